#include "core/dashpot_stepper.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <cmath>

namespace grainclock::core {

DashpotStepper::DashpotStepper(const State& state, const StepperSetup& setup)
    : BallStepper(state, setup, 1, 0.0), pairs_(law(false, step_).law, law(true, step_).law) {
  const Stepping& s = setup.stepping;
  GC_REQUIRE(s.integrator == Integrator::predicted,
             "stepping.dashpot = \"{}\" does not go with integrator = \"{}\"; use \"predicted\"", name(s.dashpot), name(s.integrator));
  GC_REQUIRE(!s.events, "stepping.events = true goes with dashpot = \"explicit\", not \"{}\"; set events = false", name(s.dashpot));
  GC_REQUIRE(setup.materials.cohesion == 0.0, "contact.cohesion = {} N goes with stepping.dashpot = \"explicit\", not \"{}\"",
             setup.materials.cohesion, name(s.dashpot));
  build_list();
  if (!state.evaluated_position.empty()) load_synchronised(state);
  std::vector<DashpotForce> memory;
  for (std::size_t k = 0; k < state.dashpot_force.size(); ++k)
    memory.push_back({state.dashpot_i[k], state.dashpot_j[k], state.dashpot_force[k]});
  pairs_.recall(memory);
  if (state.evaluated_position.empty()) {
    // No force before: the law with the delay of a first touch, which is a small force where the dashpot is stiff.
    find_touches();
    add_up_dashpots();
    for (Touch& touch : touches_) touch.dashpot = std::max(touch.least, touch.c * touch.rate / delay(touch));
    pairs_.remember();
  }
  keep_evaluated();
  costs_ = setup.costs;  // making a stepper costs nothing that a run would count
}

void DashpotStepper::follow_order(std::span<const std::uint32_t> order) {
  sums_.resize(order.size());
  losses_.resize(order.size());
  pairs_.list(balls_, list_);
}

void DashpotStepper::advance(std::int64_t n) {
  for (std::int64_t k = 0; k < n; ++k) {
    take_step();
    pairs_.remember();
    ++steps_done_;
    costs_.ball_updates += balls_.content_count();
    book_gravity(step_);
    std::vector<std::uint32_t> stopped = setup_.first_impact ? first_hits() : std::vector<std::uint32_t>{};
    stop_first_impacts(stopped);
    keep_list_safe();  // from here on the touches are gone
    const std::vector<std::uint8_t> leaving = find_leaving();
    if (!leaving.empty()) remove_balls(leaving);
    if (!stopped.empty() || !leaving.empty()) restart();
  }
  keep_evaluated();
}

void DashpotStepper::find_touches() {
  touches_ = pairs_.find(balls_);
  list_.count_sweep();
  costs_.contact_evaluations += pairs_.listed();
}

void DashpotStepper::add_up_dashpots() {
  std::fill(losses_.begin(), losses_.end(), 0.0);
  for (const Touch& touch : touches_) {
    losses_[touch.i] += touch.c * balls_.inverse_mass[touch.i];
    if (touch.both) losses_[touch.j] += touch.c * balls_.inverse_mass[touch.j];
  }
}

IntVec DashpotStepper::in_units(const Touch& touch, double force) const {
  IntVec out;
  for (int k = 0; k < 3; ++k) out.v[k] = std::llround(force * touch.normal[k] / scale_.unit);
  return out;
}

void DashpotStepper::add_up_forces() {
  std::fill(sums_.begin(), sums_.end(), IntVec{});
  for (const Touch& touch : touches_) {
    const double radii = balls_.rows[touch.i].r + balls_.rows[touch.j].r;
    // Written so that what is not a number fails.
    if (!(std::abs(touch.force()) <= scale_.limit && touch.overlap <= kLargestOverlap * radii)) throw_overloaded();
    const IntVec force = in_units(touch, touch.force());
    for (int k = 0; k < 3; ++k) {
      sums_[touch.i].v[k] += force.v[k];
      if (touch.both) sums_[touch.j].v[k] -= force.v[k];
    }
  }
}

/// Content rows that feel a contact for the first time (paper, section 5.3).
std::vector<std::uint32_t> DashpotStepper::first_hits() const {
  std::vector<std::uint32_t> hit;
  const auto add = [&](std::uint32_t row) {
    if (impacted_[row] == 0) hit.push_back(row);
  };
  for (const Touch& touch : touches_) {
    if (touch.force() == 0.0) continue;
    add(touch.i);
    if (touch.both) add(touch.j);
  }
  std::sort(hit.begin(), hit.end());
  hit.erase(std::unique(hit.begin(), hit.end()), hit.end());
  return hit;
}

State DashpotStepper::state() const {
  State out = BallStepper::state();
  for (const DashpotForce& last : pairs_.memory()) {
    out.dashpot_i.push_back(last.i);
    out.dashpot_j.push_back(last.j);
    out.dashpot_force.push_back(last.force);
  }
  return out;
}

double DashpotStepper::force_of(BallId i, BallId j, const ContactLaw& its, double overlap, double /*rate*/) const {
  if (overlap <= 0.0) return 0.0;
  const double force = its.k * overlap + pairs_.last_force(i, j);
  return its.tension ? force : std::max(0.0, force);
}

LevelStatistics DashpotStepper::level_statistics() const {
  const auto pairs = static_cast<double>(pairs_.listed());
  return {{step_}, {static_cast<double>(balls_.content_count())}, {pairs}, pairs};
}

std::unique_ptr<Stepper> make_dashpot_stepper(const State& state, const StepperSetup& setup) {
  switch (setup.stepping.dashpot) {
    case Dashpot::relaxed: return make_relaxed_stepper(state, setup);
    case Dashpot::pairwise: return make_pairwise_stepper(state, setup);
    case Dashpot::solve: return make_solve_stepper(state, setup);
    case Dashpot::explicit_: break;
  }
  return make_uniform_stepper(state, setup);
}

}  // namespace grainclock::core
