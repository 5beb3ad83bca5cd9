#include "multirate/cost_model.hpp"

#include "core/check.hpp"
#include "multirate/stepper.hpp"
#include "multirate/time_line.hpp"

#include <algorithm>
#include <cmath>

namespace grainclock::multirate {
namespace {

// A trial's length: many enough renewals that the few early ones and new lists among them come out as often as they do, many
// enough steps where all renewals are alike. Counts, not times: the same state always gives the same prediction.
constexpr std::int64_t kTrialRenewals = 6, kTrialSteps = 24;
constexpr double kMostUniformSteps = 10000.0;  // of as long a look ahead, where that would take many

core::StepperSetup uniform_setup(core::StepperSetup setup, double step) {
  setup.stepping.method = core::Method::uniform;
  setup.stepping.step = step;
  return setup;
}

/// Counts over the next steps, or over those before the numerics fail.
Trial try_out(core::Stepper& stepper, std::int64_t steps) {
  const std::int64_t begin = stepper.steps_done();
  const std::uint64_t had = stepper.costs().contact_evaluations;
  try {
    stepper.advance(steps);
  } catch (const core::NumericsError&) {
  }
  const std::int64_t done = stepper.steps_done() - begin;
  const auto evaluated = static_cast<double>(stepper.costs().contact_evaluations - had);
  return {done, evaluated / static_cast<double>(std::max<std::int64_t>(done, 1))};
}

/// See equally_accurate_step(), from the step that all balls together could take.
double equally_accurate_step(const core::State& state, const core::StepperSetup& setup, double common_step) {
  return std::min({common_step, *setup.stepping.step, default_step(state, uniform_setup(setup, *setup.stepping.step))});
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

Prediction price(const core::LevelStatistics& levels, const Trial& selective, const UniformSteps& uniform) {
  Prediction out;
  const std::size_t finest = finest_of(levels);
  for (std::size_t l = finest; l < levels.step.size(); ++l) {
    out.step.push_back(levels.step[l]);
    out.balls.push_back(std::llround(levels.balls[l]));
    out.contacts.push_back(std::llround(levels.contacts[l]));
  }
  out.tried = selective.steps;
  out.uniform_step = uniform.step;
  const double coarsest = levels.step.back(), uniform_steps = coarsest / uniform.step;
  const double at_levels = per_coarsest_step(levels.contacts), uniformly = uniform.trial.evaluated;
  if (at_levels > 0.0) out.ideal_gain = sum(levels.contacts) * (coarsest / levels.step[finest]) / at_levels;
  if (selective.evaluated > 0.0) out.gain = uniformly * uniform_steps / selective.evaluated;
  out.wall_gain = cost(kUniformPrices, uniformly, sum(levels.balls), 1.0) * uniform_steps / selective_cost(levels);
  return out;
}

Prediction predict(const core::State& state, const core::StepperSetup& setup) {
  double step = 0.0, seconds = 0.0;
  core::LevelStatistics levels;
  Trial trial{};
  {  // one stepper at a time: of millions of balls each takes gigabytes
    const auto selective = make_multirate_stepper(state, setup);
    const core::LevelStatistics first = selective->level_statistics();
    step = equally_accurate_step(state, setup, first.common_step);
    trial = try_out(*selective, std::max(kTrialSteps, kTrialRenewals * first.renew_every));
    levels = selective->level_statistics();
    seconds = static_cast<double>(trial.steps) * selective->step();
  }
  const auto uniform = core::make_uniform_stepper(state, uniform_setup(setup, step));
  return price(levels, trial, {step, try_out(*uniform, std::llround(std::min(seconds / step, kMostUniformSteps)))});
}

double equally_accurate_step(const core::State& state, const core::StepperSetup& setup) {
  return equally_accurate_step(state, setup, make_multirate_stepper(state, setup)->level_statistics().common_step);
}

}  // namespace grainclock::multirate
