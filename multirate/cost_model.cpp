#include "multirate/cost_model.hpp"

#include "core/check.hpp"
#include "multirate/stepper.hpp"
#include "multirate/time_line.hpp"

#include <algorithm>
#include <cmath>

namespace grainclock::multirate {
namespace {

/// Coarsest steps that a prediction looks ahead, several renewals: levels as first classified lack the hysteresis of later
/// ones, and lists need a while to find their skins. A count, not a time: the same state always gives the same prediction.
constexpr std::int64_t kTrialSteps = 24;
constexpr std::int64_t kMostUniformSteps = 1000;  // of as long a look ahead, where that would take many

/// Whether all balls at the finest of `levels` levels would keep the tolerance.
bool is_accurate(const core::State& state, core::StepperSetup setup, double coarsest_step, int levels) {
  setup.stepping.step = coarsest_step;
  setup.stepping.levels = levels;
  return !make_multirate_stepper(state, setup)->level_statistics().ran_out;
}

core::StepperSetup uniform_setup(core::StepperSetup setup, double step) {
  setup.stepping.method = core::Method::uniform;
  setup.stepping.step = step;
  return setup;
}

/// What a stepper counts over the next steps, or what it begins with if the numerics fail within them.
template <class Count>
auto try_out(core::Stepper& stepper, std::int64_t steps, Count count) {
  const auto first = count();
  try {
    stepper.advance(steps);
    return count();
  } catch (const core::NumericsError&) {
    return first;
  }
}

/// Levels over the steps that a prediction looks ahead. One stepper at a time: of millions of balls each takes gigabytes.
core::LevelStatistics levels_ahead(const core::State& state, const core::StepperSetup& setup) {
  const auto selective = make_multirate_stepper(state, setup);
  return try_out(*selective, kTrialSteps, [&] { return selective->level_statistics(); });
}

/// The finest level that is in use.
std::size_t finest_of(const core::LevelStatistics& levels) {
  std::size_t finest = 0;
  while (finest + 1 < levels.step.size() && levels.balls[finest] == 0.0 && levels.contacts[finest] == 0.0) ++finest;
  return finest;
}

double sum(const std::vector<double>& values) {
  double total = 0.0;
  for (const double value : values) total += value;
  return total;
}

/// Sum over the levels of what is done at each of its steps, per coarsest step.
double per_coarsest_step(const std::vector<double>& counts) {
  double total = 0.0;
  for (std::size_t l = 0; l < counts.size(); ++l) {
    total += std::ldexp(counts[l], static_cast<int>(counts.size() - 1 - l));
  }
  return total;
}

double cost(const Prices& prices, double pairs, double balls, double calls) {
  return prices.pair * pairs + prices.ball * balls + prices.call * calls;
}

/// Time of one coarsest step.
double selective_cost(const core::LevelStatistics& levels) {
  const std::size_t finest = finest_of(levels);
  const std::vector<double> each(levels.step.size() - finest, 1.0);
  return cost(kSelectivePrices, per_coarsest_step(levels.contacts), per_coarsest_step(levels.balls), per_coarsest_step(each)) +
         levels.renewals * cost(kRenewalPrices, levels.listed, sum(levels.balls), 1.0);
}

}  // namespace

double evaluations(const core::LevelStatistics& levels) {
  const double contacts = sum(levels.contacts);
  return per_coarsest_step(levels.contacts) + levels.renewals * (levels.listed - contacts + kChangedShare * contacts);
}

Prediction price(const core::LevelStatistics& levels, const UniformSteps& uniform) {
  Prediction out;
  const std::size_t finest = finest_of(levels);
  for (std::size_t l = finest; l < levels.step.size(); ++l) {
    out.step.push_back(levels.step[l]);
    out.balls.push_back(std::llround(levels.balls[l]));
    out.contacts.push_back(std::llround(levels.contacts[l]));
  }
  out.uniform_step = uniform.step;
  const double coarsest = levels.step.back(), uniform_steps = coarsest / uniform.step;
  const double selective = per_coarsest_step(levels.contacts);
  if (selective > 0.0) {
    out.ideal_gain = sum(levels.contacts) * (coarsest / levels.step[finest]) / selective;
    out.gain = uniform.listed * uniform_steps / evaluations(levels);
  }
  out.wall_gain = cost(kUniformPrices, uniform.listed, sum(levels.balls), 1.0) * uniform_steps / selective_cost(levels);
  return out;
}

Prediction predict(const core::State& state, const core::StepperSetup& setup) {
  const core::LevelStatistics levels = levels_ahead(state, setup);
  const double step = equally_accurate_step(state, setup);
  const auto uniform = core::make_uniform_stepper(state, uniform_setup(setup, step));
  const auto listed = [&] {
    const double done = static_cast<double>(uniform->steps_done() - setup.steps_done);
    const double evaluated = static_cast<double>(uniform->costs().contact_evaluations - setup.costs.contact_evaluations);
    return done > 0.0 ? evaluated / done : uniform->level_statistics().listed;
  };
  const std::int64_t as_long = std::lround(kTrialSteps * levels.step.back() / step);
  return price(levels, {step, try_out(*uniform, std::min(as_long, kMostUniformSteps), listed)});
}

double equally_accurate_step(const core::State& state, const core::StepperSetup& setup) {
  const double coarsest = *setup.stepping.step;
  // The number of levels that the tolerance needs, first; then where within the last octave.
  int too_few = 0, enough = kMostLevels;
  while (enough - too_few > 1) {
    const int levels = (too_few + enough) / 2;
    (is_accurate(state, setup, coarsest, levels) ? enough : too_few) = levels;
  }
  double longest = std::ldexp(coarsest, 1 - enough);
  if (enough > 1) {
    for (const double factor : {std::sqrt(2.0), std::sqrt(std::sqrt(2.0))}) {
      if (is_accurate(state, setup, factor * std::ldexp(longest, enough - 2), enough - 1)) longest *= factor;
    }
  }
  return std::min(longest, default_step(state, uniform_setup(setup, coarsest)));
}

}  // namespace grainclock::multirate
