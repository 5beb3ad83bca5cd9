// What every strategy at the interfaces between levels is asked: two springs, the cage, the spinning cloud and the flowing
// silo under its name. What it answers, and how well, stands in its own test file.
#pragma once

#include "tests/support/cage.hpp"
#include "tests/support/order.hpp"
#include "tests/support/silo_runs.hpp"
#include "tests/support/spinning_cloud.hpp"
#include "tests/support/two_springs.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace grainclock::tests {

/// Phases of the stiff spring per coarse step [rad]: from `first` on, below `end`.
struct Phases {
  double first, end, by;
};

/// Growth per coarse step on two springs.
struct Growth {
  double phase;               // of the stiff spring per coarse step [rad]
  int fine_steps;             // of the light ball in a coarse one
  double expected, measured;  // by theory, and the strategy's own
};

/// The swing after a coarse step of `step` [s] with so many fine ones in it, as theory has it.
using Theory = Swing (*)(Swing swing, double step, int fine_steps);

/// Calls `judge` with the growth at each of the phases.
template <class Judge>
void sweep_growth(core::Interface interface, Theory theory, const Phases& phases, Judge judge) {
  TwoSprings springs(interface);
  for (double phase = phases.first; phase < phases.end; phase += phases.by) {
    SCOPED_TRACE(testing::Message() << "phase per coarse step " << phase);
    const double step = TwoSprings::step_of(phase);
    const std::vector<int> levels = levels_of(*springs.stepper(Swing::Zero(), step));
    ASSERT_EQ(levels[1], 7);
    const int n = 1 << (7 - levels[0]);
    const double expected = growth_of([&](const Swing& s) { return theory(s, step, n); });
    judge(Growth{phase, n, expected, measured_growth(springs, step)});
    if (testing::Test::HasFatalFailure()) return;
  }
}

/// Largest growth per coarse step on two springs with dashpots. Coarse steps are about half a period of the stiff one: phases
/// of 2.2 to 5.6.
inline double worst_growth(core::Interface interface, double damping_ratio) {
  TwoSprings springs(interface);
  springs.damp(damping_ratio);
  double worst = -1.0;
  for (double phase = 2.2; phase < 5.6; phase += 0.05)
    worst = std::max(worst, measured_growth(springs, TwoSprings::step_of(phase)));
  return worst;
}

/// A cage for a strategy, without events.
inline Cage cage_of(core::Interface interface, bool is_damped) {
  Cage cage;
  cage.setup.stepping.interface = interface;
  cage.setup.stepping.events = false;
  if (!is_damped) cage.setup.materials.wall.c = cage.setup.materials.ball.c = 0.0;
  return cage;
}

/// Stepping of the open silo by a strategy; `step` [s] is the coarsest one.
inline core::StepperSetup silo_setup(core::Interface interface, double step, bool events) {
  core::StepperSetup setup = silo_setup(core::Method::multirate, step, true);
  setup.stepping.interface = interface;
  setup.stepping.events = events;
  return setup;
}

/// Expects five levels or more with contacts to evaluate.
inline void expect_many_levels(const core::Stepper& stepper) {
  const core::LevelStatistics levels = stepper.level_statistics();
  EXPECT_GT(std::count_if(levels.contacts.begin(), levels.contacts.end(), [](double n) { return n > 1.0; }), 4);
}

}  // namespace grainclock::tests
