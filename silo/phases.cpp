#include "silo/phases.hpp"

#include "core/balls.hpp"
#include "core/check.hpp"
#include "core/critical_step.hpp"
#include "core/neighbours.hpp"
#include "core/snapshot.hpp"
#include "multirate/cost_model.hpp"
#include "multirate/stepper.hpp"
#include "silo/filling.hpp"

#include <algorithm>
#include <cmath>

namespace grainclock::silo {

using core::Kind;
using core::Phase;
using core::Scene;
using core::State;
using core::StepperSetup;
using core::Until;

namespace {

/// Throws InputError for content that overlaps others so much that no stepper would take the first step.
void require_apart(const State& state, bool outlet_open, std::string_view source) {
  if (state.count(Kind::content) == 0) return;
  core::Balls balls(state, core::Materials{}, !outlet_open);
  core::NeighbourList list(0.0, {1e-3 * balls.mean_diameter, 0.0, 0.0}, 1);  // nothing moves: any small skin will do
  list.build(balls);
  for (const core::PairList* pairs : {&list.ball_pairs(), &list.fixed_pairs()})
    for (std::size_t p = 0; p < pairs->count; ++p) {
      const core::BallRow &a = balls.rows[pairs->i[p]], &b = balls.rows[pairs->j[p]];
      const double overlap = a.r + b.r - std::hypot(a.x - b.x, a.y - b.y, a.z - b.z);
      GC_REQUIRE(overlap <= core::kLargestOverlap * (a.r + b.r),
                 "{}: ball {} overlaps {} ball {} by {:.4g} m of {:.4g} m, the sum of their radii: move them apart, to at most {:.4g} m, "
                 "or see whether all lengths are in m",
                 source, balls.id_of(pairs->i[p]), name(balls.kind_of(pairs->j[p])), balls.id_of(pairs->j[p]), overlap, a.r + b.r,
                 core::kLargestOverlap * (a.r + b.r));
    }
}

}  // namespace

Start start_of(const Scene& scene) {
  Start start;
  if (scene.has_silo) {
    Silo silo = build_silo(read_silo(scene), scene.seed);
    start.state = std::move(silo.state);
    start.first_collar = silo.first_collar;
  } else {
    start.state = core::read_state(scene.initial_state);
  }
  const std::string source = scene.has_silo ? scene.path : scene.initial_state;
  validate(start.state, source);
  const bool is_open = !scene.phases.empty() && scene.phases.front().outlet_open;
  require_apart(start.state, is_open, source);
  GC_REQUIRE(start.state.count(Kind::content) > 0, "{}: the initial state has no content balls; nothing would move", source);
  return start;
}

State fresh(State state) {
  state.evaluated_position.clear();
  state.evaluated_velocity.clear();
  state.level.clear();
  state.dashpot_i.clear();
  state.dashpot_j.clear();
  state.dashpot_force.clear();
  return state;
}

State as_if_begun(const Scene& scene, std::size_t k, const State& start) {
  State state = fresh(start);
  if (k > 0 && !scene.phases[k].outlet_open) clear_gate(state);
  return state;
}

StepperSetup phase_setup(const Scene& scene, const Phase& phase, const State& state, int threads) {
  StepperSetup setup;
  setup.gravity = scene.gravity;
  setup.materials = phase.materials;
  setup.domain = scene.domain;
  setup.stepping = phase.stepping;
  setup.outlet_open = phase.outlet_open;
  setup.first_impact = phase.first_impact;
  setup.threads = threads;
  const double reach = setup.materials.reach(), radius = mean_ball(state, setup.materials).radius;
  GC_REQUIRE(radius == 0.0 || reach <= radius,
             "{}: phase \"{}\": a cohesion of {:g} N pulls over gaps of {:.3g} m (cohesion over k), more than the mean radius of {:.3g} m: "
             "lower cohesion, or raise k",
             scene.path, core::excerpt(phase.name), setup.materials.cohesion, reach, radius);
  double wanted = phase.stepping.step ? *phase.stepping.step : multirate::default_step(state, setup);
  if (!std::isfinite(wanted)) {  // no contacts yet, as before a filling: the stiffest contact to come tells
    constexpr double kSafety = 0.7;
    const double mass = mean_ball(state, setup.materials).mass;
    wanted = kSafety * std::min(core::critical_step_of_pair(setup.materials.ball, 2.0 / mass, phase.stepping),
                                core::critical_step_of_pair(setup.materials.wall, 1.0 / mass, phase.stepping));
  }
  const core::StepCount steps = core::step_for(phase.every, wanted);
  constexpr double kMostSteps = 9e15;  // counted in doubles too
  GC_REQUIRE(phase.duration / steps.step <= kMostSteps, "{}: phase \"{}\" takes {:.3g} steps of {:.3g} s: take a larger step", scene.path,
             core::excerpt(phase.name), phase.duration / steps.step, steps.step);
  setup.stepping.step = steps.step;
  if (setup.stepping.method == core::Method::multirate && setup.stepping.fallback) {
    const multirate::Prediction prediction = multirate::predict(state, setup);
    if (!pays(prediction)) {
      setup.stepping.method = core::Method::uniform;
      setup.stepping.step = core::step_for(phase.every, prediction.uniform_step).step;
    }
  }
  return setup;
}

MeanBall mean_ball(const State& state, const core::Materials& materials) {
  double sum = 0.0;
  for (std::size_t i = 0; i < state.size(); ++i)
    if (state.kind[i] == Kind::content) sum += state.radius[i];
  const std::size_t n = state.count(Kind::content);
  if (n == 0) return {};
  const double radius = sum / static_cast<double>(n);
  return {radius, materials.mass(radius)};
}

std::optional<std::string> phase_end(const Phase& phase, const MeanBall& mean, double gravity, double step, std::int64_t steps,
                                     double kinetic_energy, std::int64_t discharged, Watch& watch) {
  constexpr double kRestEnergy = 1e-6;  // of m g r, per ball
  constexpr double kRestTime = 0.1;     // s
  constexpr double kArchTime = 5.0;     // s
  // A content without friction keeps creeping: behind an arch it holds about 1e-3 m g r per ball, in flow 1e-2 and more.
  constexpr double kArchEnergy = 5e-3;  // of m g r, per ball
  const std::int64_t left = discharged - watch.discharged_before, count = watch.content_before - left;
  if (discharged > watch.discharged_last) watch.left_last = steps;
  watch.discharged_last = discharged;

  const double energy_scale = mean.mass * gravity * mean.radius * static_cast<double>(count);
  const auto note_since = [&](bool holds, std::int64_t& since) {
    if (!holds) since = -1;
    else if (since < 0) since = steps;
    return holds;
  };
  const bool is_calm = note_since(kinetic_energy < kRestEnergy * energy_scale, watch.rest_since);
  const bool is_slow = note_since(kinetic_energy < kArchEnergy * energy_scale, watch.slow_since);
  const auto seconds_since = [&](std::int64_t since) { return static_cast<double>(steps - since) * step; };
  // A count of steps times their length may fall a rounding short of the time that it stands for.
  constexpr double kGuard = 1.0 - 1e-9;
  const bool is_at_rest = is_calm && seconds_since(watch.rest_since) >= kGuard * kRestTime;

  const auto share = [&] { return static_cast<double>(left) / static_cast<double>(watch.content_before); };
  switch (phase.until) {
    case Until::duration: return std::nullopt;
    case Until::rest:
      if (is_at_rest || count == 0) return "at rest";
      return std::nullopt;
    case Until::empty:
      if (count == 0) return "empty";
      break;
    case Until::discharged:
      if (share() >= phase.fraction) return fmt::format("{} balls, {:.4g} of the content, have left", left, share());
      break;
  }
  if (is_slow && seconds_since(std::max(watch.left_last, watch.slow_since)) >= kGuard * kArchTime)
    return fmt::format("a permanent arch holds {} balls: for {} s nothing has left and the content has but crept; {} balls have left",
                       count, kArchTime, left);
  return std::nullopt;
}

}  // namespace grainclock::silo
