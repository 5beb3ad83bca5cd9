// Scenes without closed forms: integrators that share nothing but the equations agree to their tolerances.
#include "benchmarks/reference.hpp"

#include "tests/support/reference_runs.hpp"

#include <gtest/gtest.h>

namespace grainclock::benchmarks {
namespace {

using core::Kind;
using core::State;
using core::StepperSetup;
using tests::judged;

StepperSetup falling() {
  StepperSetup setup = tests::weightless(core::Materials{}, 1e-3);
  setup.gravity = {0.0, 0.0, -9.81};
  return setup;
}

/// Three balls that fall onto three fixed ones and onto each other, off every axis.
State three_balls() {
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 0.45}, {0.1, 0.0, -1.0}, 0.22);
  state.add(1, Kind::content, {0.1, 0.05, 0.9}, {0.0, 0.0, -1.5}, 0.2);
  state.add(2, Kind::content, {-0.1, 0.1, 1.35}, {0.0, -0.1, -2.0}, 0.21);
  state.add(3, Kind::wall, {0.0, 0.0, 0.0}, core::Vec3::Zero(), 0.22);
  state.add(4, Kind::wall, {0.44, 0.0, 0.1}, core::Vec3::Zero(), 0.22);
  state.add(5, Kind::wall, {-0.3, 0.3, 0.1}, core::Vec3::Zero(), 0.22);
  return state;
}

void expect_same(const BranchChanges& a, const BranchChanges& b) {
  EXPECT_EQ(a.touched, b.touched);
  EXPECT_EQ(a.lost, b.lost);
  EXPECT_EQ(a.clamped, b.clamped);
  EXPECT_EQ(a.unclamped, b.unclamped);
}

/// Largest difference of positions [m] from `exact`, asked for `rtol`.
double error(Scheme scheme, double rtol, bool roots, const State& start, double seconds, const ReferenceRun& exact) {
  const ReferenceRun run = integrate({scheme, rtol, 0.0, roots}, start, falling(), seconds);
  if (roots) expect_same(run.changes, exact.changes);
  return tests::distance(run.end, exact.end).x;
}

TEST(ReferenceAgreement, ThreeBalls) {
  const State start = three_balls();
  const double seconds = 0.1;
  const ReferenceRun exact = judged(Scheme::erkstep, 1e-13, start, falling(), seconds);
  EXPECT_EQ(exact.changes.touched, 9U);
  EXPECT_EQ(exact.changes.lost, 8U);
  EXPECT_EQ(exact.changes.clamped, 8U);
  for (const Scheme scheme : tests::kAdaptive) {
    SCOPED_TRACE(tests::name_of(scheme));
    // They move 0.2 m. Each of eight collisions multiplies what is wrong before it: 100 rtol of the way in all.
    EXPECT_LT(error(scheme, 1e-10, true, start, seconds, exact), 2e-9);
    EXPECT_LT(error(scheme, 1e-12, true, start, seconds, exact), 2e-11);
  }
}

TEST(ReferenceAgreement, AFewDozenBalls) {
  const State start = tests::tray(5, 3, 1);
  const double seconds = 0.02;
  const ReferenceRun exact = judged(Scheme::erkstep, 1e-13, start, falling(), seconds);
  ASSERT_EQ(start.count(Kind::content), 27U);
  EXPECT_EQ(exact.changes.touched, 28U);
  EXPECT_EQ(exact.changes.lost, 40U);
  EXPECT_EQ(exact.changes.clamped, 40U);
  EXPECT_EQ(exact.changes.unclamped, 1U);
  for (const Scheme scheme : tests::kAdaptive) {
    SCOPED_TRACE(tests::name_of(scheme));
    // Measured 4e-12 to 3e-10 m at 1e-10, of 10 mm that they move.
    EXPECT_LT(error(scheme, 1e-10, true, start, seconds, exact), 1e-9);
  }
  EXPECT_LT(error(Scheme::cvode_adams, 1e-12, true, start, seconds, exact), 1e-11);
  // Without roots a step across a branch change errs up to the tolerance on one side, over and over: measured 300 times
  // more for ERKStep, 2.5 times for Adams.
  EXPECT_GT(error(Scheme::erkstep, 1e-10, false, start, seconds, exact),
            20.0 * error(Scheme::erkstep, 1e-10, true, start, seconds, exact));
}

}  // namespace
}  // namespace grainclock::benchmarks
