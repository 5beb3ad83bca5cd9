#include "benchmarks/trajectories_run.hpp"

#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "multirate/stepper.hpp"
#include "silo/phases.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <memory>

namespace grainclock::benchmarks {
namespace {

using core::State;
using core::Stepping;

/// Wall forces are compared by layers this many mean diameters thick.
constexpr double kLayerDiameters = 2.0;
constexpr std::uint64_t kPerturbationSeed = 1;

double mean_diameter(const State& state) {
  double sum = 0.0;
  for (std::size_t row = 0; row < state.size(); ++row) {
    if (state.kind[row] == core::Kind::content) sum += 2.0 * state.radius[row];
  }
  return sum / static_cast<double>(std::max<std::size_t>(1, state.count(core::Kind::content)));
}

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

/// Layers about kLayerDiameters thick over the height of the wall; nothing without a wall.
std::optional<silo::Layers> wall_layers(const State& state) {
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  for (std::size_t row = 0; row < state.size(); ++row) {
    if (state.kind[row] != core::Kind::wall) continue;
    lowest = std::min(lowest, state.position[row].z());
    highest = std::max(highest, state.position[row].z());
  }
  if (!(lowest < highest)) return std::nullopt;
  const double layers = (highest - lowest) / (kLayerDiameters * mean_diameter(state));
  return silo::Layers{lowest, highest, std::max(1, static_cast<int>(std::lround(layers)))};
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

/// The setup of the scene's first phase at this stepping; the step is a whole fraction of `every` [s].
core::StepperSetup setup_of(const core::Scene& scene, const State& state, const Stepping& stepping, double every,
                            int threads) {
  core::Phase phase = scene.phases.front();
  phase.stepping = stepping;
  phase.every = every;
  return silo::phase_setup(scene, phase, state, threads);
}

}  // namespace

StartState read_start(const std::string& path) {
  StartState start;
  start.name = std::filesystem::path(path).stem().string();
  start.state = silo::fresh(core::read_state(path));
  start.layers = wall_layers(start.state);
  return start;
}

core::StepperSetup Runner::setup(const State& state, const Stepping& stepping) const {
  return setup_of(scene_, state, stepping, horizon_, threads_);
}

void Runner::require_offered(const StartState& start, const Point& point) const {
  if (point.sundials) return;
  GC_REQUIRE(start.state.count(core::Kind::content) > 0, "{}: the start state has no content balls; nothing would move",
             start.name);
  const State content = content_of(start.state);
  const auto highest = std::max_element(content.position.begin(), content.position.end(),
                                        [](const core::Vec3& a, const core::Vec3& b) { return a.z() < b.z(); });
  const auto row = static_cast<std::size_t>(highest - content.position.begin());
  State one;  // ball: what a stepper says about its keys does not depend on the rest
  one.add(content.id[row], core::Kind::content, content.position[row], content.velocity[row], content.radius[row]);
  (void)multirate::make_stepper(one, setup(one, point.stepping));
}

Outcome Runner::run(const StartState& start, const Point& point) const {
  return point.sundials ? integrate(start, *point.sundials) : step(start, point.stepping);
}

/// The stepper's construction (lists, first forces) is outside the clock.
Outcome Runner::step(const StartState& start, const Stepping& stepping) const {
  const core::StepperSetup made = setup(start.state, stepping);
  Outcome outcome;
  outcome.step = *made.stepping.step;
  const auto stepper = multirate::make_stepper(start.state, made);
  const std::int64_t n = core::step_for(horizon_, stepper->step()).n;
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
  const bool selective = stepping.method == core::Method::multirate && outcome.levels.step.size() > 1;
  outcome.method_used = core::name(selective ? core::Method::multirate : core::Method::uniform);
  return outcome;
}

Outcome Runner::integrate(const StartState& start, const ReferenceSettings& settings) const {
  Stepping stepping;
  stepping.method = core::Method::uniform;
  stepping.step = horizon_;
  const core::StepperSetup made = setup(start.state, stepping);
  Outcome outcome;
  outcome.method_used = method_name(Point{.name = {}, .sundials = settings, .stepping = {}});
  try {
    const ReferenceRun run = benchmarks::integrate(settings, start.state, made, horizon_);
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

DivergenceSeries run_divergence(const core::Scene& scene, const StartState& start, const Divergence& divergence,
                                int threads) {
  Stepping stepping;
  stepping.method = core::Method::uniform;
  stepping.step = divergence.step;
  const double every = divergence.horizon / divergence.samples;
  const auto stepper_of = [&](const State& state) {
    return multirate::make_stepper(state, setup_of(scene, state, stepping, every, threads));
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
