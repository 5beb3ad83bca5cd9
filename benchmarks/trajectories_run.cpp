#include "benchmarks/trajectories_run.hpp"

#include "benchmarks/divergence.hpp"
#include "core/check.hpp"
#include "multirate/stepper.hpp"

#include <chrono>

namespace grainclock::benchmarks {
namespace {

using core::State;
using core::Stepping;

constexpr std::uint64_t kPerturbationSeed = 1;

/// Evaluations saved by an ideal scheme with this run's levels: all contacts at the finest step over each at its own.
std::optional<double> ideal_gain(const core::LevelStatistics& levels) {
  double all = 0.0, weighted = 0.0, finest = 0.0;
  for (std::size_t level = 0; level < levels.contacts.size(); ++level) {
    if (levels.contacts[level] <= 0.0) continue;
    if (finest == 0.0) finest = levels.step[level];
    all += levels.contacts[level];
    weighted += levels.contacts[level] * finest / levels.step[level];
  }
  if (weighted == 0.0) return std::nullopt;
  return all / weighted;
}

/// Horizontal force on the wall by layer [N].
std::vector<double> wall_force(const StartState& start, const std::vector<core::Contact>& contacts) {
  if (!start.layers) return {};
  return silo::wall_force_by_layer(start.state, contacts, *start.layers);
}

/// The content alone, without what a restart would need: all that errors are taken over.
State content_of(const State& state) {
  State content;
  content.time = state.time;
  content.length_scale = state.length_scale;
  for (std::size_t row = 0; row < state.size(); ++row) {
    if (state.kind[row] != core::Kind::content) continue;
    content.add(state.id[row], state.kind[row], state.position[row], state.velocity[row], state.radius[row]);
  }
  return content;
}

/// The stepper's construction (lists, first forces) is outside the clock.
Outcome step(const core::Scene& scene, const StartState& start, const Stepping& stepping, double horizon, int threads) {
  const core::StepperSetup made = first_phase_setup(scene, start.state, stepping, horizon, threads);
  Outcome outcome;
  outcome.step = *made.stepping.step;
  const auto stepper = multirate::make_stepper(start.state, made);
  const std::int64_t n = core::step_for(horizon, stepper->step()).n;
  const core::Energies before = stepper->energies();
  try {
    const auto begin = std::chrono::steady_clock::now();
    stepper->advance(n);
    outcome.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  } catch (const core::NumericsError& error) {
    outcome.status = fmt::format("failed: {}", error.what());
    return outcome;
  }
  outcome.end = content_of(stepper->state());
  outcome.wall_force = wall_force(start, stepper->contacts());
  outcome.steps = static_cast<std::uint64_t>(n);
  outcome.costs = stepper->costs();
  outcome.momentum_residual = core::momentum_residual(before, stepper->energies(), stepper->ledger());
  outcome.energy_residual = core::energy_residual(before, stepper->energies(), stepper->ledger());
  outcome.levels = stepper->level_statistics();
  outcome.ideal_gain = ideal_gain(outcome.levels);
  outcome.method_used = method_used(stepping, outcome.levels);
  return outcome;
}

Outcome integrate(const core::Scene& scene, const StartState& start, const Point& point, double horizon, int threads) {
  Stepping stepping;
  stepping.method = core::Method::uniform;
  stepping.step = horizon;
  const core::StepperSetup made = first_phase_setup(scene, start.state, stepping, horizon, threads);
  Outcome outcome;
  outcome.method_used = method_name(point);
  try {
    const ReferenceRun run = benchmarks::integrate(*point.sundials, start.state, made, horizon);
    outcome.end = content_of(run.end);
    outcome.wall_s = run.wall_s;
    outcome.costs.contact_evaluations = run.contact_evaluations;
    outcome.costs.ball_updates = run.steps * start.state.count(core::Kind::content);
    outcome.steps = run.steps;
    outcome.restarts = run.restarts;
    outcome.changes = run.changes;
    const auto stepper = core::make_uniform_stepper(run.end, made);  // for the contacts at the end
    outcome.wall_force = wall_force(start, stepper->contacts());
    outcome.levels.listed = stepper->level_statistics().listed;
  } catch (const core::NumericsError& error) {
    outcome.status = fmt::format("failed: {}", error.what());
  }
  return outcome;
}

}  // namespace

Outcome run_point(const core::Scene& scene, const StartState& start, const Point& point, double horizon, int threads) {
  return point.sundials ? integrate(scene, start, point, horizon, threads)
                        : step(scene, start, point.stepping, horizon, threads);
}

DivergenceSeries run_divergence(const core::Scene& scene, const StartState& start, const Divergence& divergence,
                                int threads) {
  Stepping stepping;
  stepping.method = core::Method::uniform;
  stepping.step = divergence.step;
  const double every = divergence.horizon / divergence.samples;
  const auto stepper_of = [&](const State& state) {
    return multirate::make_stepper(state, first_phase_setup(scene, state, stepping, every, threads));
  };
  const State other = perturbed(start.state, divergence.perturbation, kPerturbationSeed);
  const auto one = stepper_of(start.state), two = stepper_of(other);
  const std::int64_t n = core::step_for(every, one->step()).n;

  DivergenceSeries series;
  series.mean_diameter = mean_diameter(start.state);
  const auto add = [&](int sample, const State& a, const State& b) {
    const Separation apart = separation(a, b, scene.domain.outlet_z);
    series.time.push_back(every * sample);
    series.rms.push_back(apart.rms);
    series.max.push_back(apart.max);
  };
  add(0, start.state, other);
  for (int sample = 1; sample <= divergence.samples; ++sample) {
    one->advance(n);
    two->advance(n);
    add(sample, one->state(), two->state());
  }
  return series;
}

}  // namespace grainclock::benchmarks
