// Scenes that a search for sign changes at the ends of steps would get wrong, and scenes without an end to their events.
#include "benchmarks/reference.hpp"

#include "core/check.hpp"
#include "tests/support/closed_forms.hpp"
#include "tests/support/order.hpp"
#include "tests/support/reference_runs.hpp"
#include "tests/support/runge_kutta.hpp"
#include "tests/support/scratch.hpp"

#include <gtest/gtest.h>
#include <algorithm>

namespace grainclock::benchmarks {
namespace {

using core::Kind;
using core::Materials;
using core::State;
using core::StepperSetup;
using tests::expect_changes;
using tests::judged;
using tests::time_of;

class ReferenceEvents : public testing::TestWithParam<Scheme> {};
INSTANTIATE_TEST_SUITE_P(Schemes, ReferenceEvents, testing::ValuesIn(tests::kAdaptive), tests::test_name);

/// Two balls that pass each other along x at 10 m/s, `overlap` [m] deep where they are closest.
State passing_by(double overlap) {
  State state;
  state.add(0, Kind::content, {-1.0, 0.44 - overlap, 0.0}, {5.0, 0.0, 0.0}, 0.22);
  state.add(1, Kind::content, {1.0, 0.0, 0.0}, {-5.0, 0.0, 0.0}, 0.22);
  return state;
}

TEST_P(ReferenceEvents, AGrazeWithinOneStepIsFound) {
  Materials materials;
  materials.ball = materials.wall = {1e4, 0.0};  // so soft that steps may last 0.07 s
  const StepperSetup setup = tests::weightless(materials, 1e-3);
  const double overlap = 1e-4, seconds = 0.4, relative = 10.0;
  // Half the chord of the sum of the radii: 0.94 ms of contact before and after the closest approach.
  const double half = std::sqrt(2.0 * 0.44 * overlap) / relative;

  const ReferenceRun run = judged(GetParam(), 1e-10, passing_by(overlap), setup, seconds);

  expect_changes(run, {.touched = 1, .lost = 1});
  // The push, at most k d over the contact, bends the paths by 1e-6 of the chord.
  EXPECT_NEAR(time_of(run, ChangeKind::touched), 0.2 - half, 1e-3 * half);
  EXPECT_NEAR(time_of(run, ChangeKind::lost), 0.2 + half, 1e-3 * half);
  // An integration with steps of a thousandth of the contact, and none far from it.
  State near = passing_by(overlap);
  const double before = 0.2 - 2.0 * half;
  for (std::size_t i = 0; i < 2; ++i) near.position[i] += before * near.velocity[i];
  const State expected = tests::runge_kutta(near, materials, core::Vec3::Zero(), 4.0 * half, 8000);
  // k d / m over the contact: 2e-5 m/s, the path taken as a parabola. The integrations agree to 100 rtol of 0.1 m/s, the
  // speed that absolute tolerances are made from.
  EXPECT_NEAR(std::abs(run.end.velocity[0].y()), materials.ball.k / materials.mass(0.22) * overlap * 4.0 / 3.0 * half, 1e-8);
  EXPECT_NEAR((run.end.velocity[0] - expected.velocity[0]).norm(), 0.0, 1e-9);

  // The same steps without roots go from apart to apart and see no force at all.
  const ReferenceRun blind = integrate({GetParam(), 1e-10, 0.0, false}, passing_by(overlap), setup, seconds);
  EXPECT_EQ(blind.end.velocity[0], passing_by(overlap).velocity[0]);
  // Nor is there a contact where the balls miss each other by as much.
  expect_changes(judged(GetParam(), 1e-10, passing_by(-overlap), setup, seconds), {});
}

TEST_P(ReferenceEvents, BouncesToRestWithoutFlicker) {
  // Dropped from 5 mm, with an elastic spring and a damper that loses half the speed: bounces until the weight holds the
  // contact.
  Materials materials;
  materials.wall = {1e6, 0.0};
  materials.wall.c = core::dashpot_for_restitution(1e6, materials.mass(0.22), 0.5, false);
  StepperSetup setup = tests::weightless(materials, 1e-3);
  setup.gravity = {0.0, 0.0, -9.81};
  const double drop = 0.005;
  const double rest = materials.mass(0.22) * 9.81 / materials.wall.k;

  const ReferenceRun run = judged(GetParam(), 1e-9, tests::ball_on_floor(drop, 0.0), setup, 0.5);

  EXPECT_GE(run.changes.touched, 2U);
  EXPECT_EQ(run.changes.lost, run.changes.touched - 1);
  EXPECT_GE(run.changes.clamped, run.changes.lost);
  EXPECT_EQ(run.changes.unclamped, run.changes.clamped - run.changes.lost);
  // Since the last touch, at 0.08 s, its motion has decayed with c / 2 m.
  const double fade = std::exp(-0.42 * materials.wall.c / (2.0 * materials.mass(0.22)));
  EXPECT_NEAR(tests::approach(run.end).overlap, rest, fade * drop);
  const ReferenceRun longer = judged(GetParam(), 1e-9, tests::ball_on_floor(drop, 0.0), setup, 1.0);
  EXPECT_EQ(longer.log.size(), run.log.size());
}

TEST_P(ReferenceEvents, CohesionThatCarriesALoadIsAnError) {
  // Drawn down out of contact below a fixed ball, the ball turns where the pull exceeds its weight. There the law lets it
  // go, it falls, is caught again: infinitely many changes.
  Materials materials;
  materials.wall = {1e6, 0.0};
  materials.cohesion = 5e3;
  StepperSetup setup = tests::weightless(materials, 1e-3);
  setup.gravity = {0.0, 0.0, -9.81};
  const std::string text = tests::message_of<core::NumericsError>(
      [&] { judged(GetParam(), 1e-9, tests::ball_under_ceiling(0.001, -0.1), setup, 0.1); });
  EXPECT_NE(text.find("balls 0 and 1 change their branch more than"), std::string::npos) << text;
  EXPECT_NE(text.find("smaller rtol, no roots, or no cohesion"), std::string::npos) << text;
}

TEST(Reference, ChangesAtTheSameTimeAreCountedOnceEach) {
  // Four balls hit four walls at once, and each other nowhere.
  const Materials materials;
  State state;
  for (int ball = 0; ball < 4; ++ball) state.add(ball, Kind::content, {2.0 * ball, 0.0, 0.45}, {0.0, 0.0, -1.0}, 0.22);
  for (int ball = 0; ball < 4; ++ball) state.add(4 + ball, Kind::wall, {2.0 * ball, 0.0, 0.0}, core::Vec3::Zero(), 0.22);
  for (const Scheme scheme : tests::kAdaptive) {
    SCOPED_TRACE(tests::name_of(scheme));
    expect_changes(judged(scheme, 1e-10, state, tests::weightless(materials, 1e-3), 0.02),
                   {.touched = 4, .lost = 4, .clamped = 4});
  }
}

TEST(Reference, BeginsInTheMiddleOfThings) {
  // Touching from the start, clamped from the start, just touching: the branch is the law's, and only later changes count.
  const Materials materials;
  const StepperSetup setup = tests::weightless(materials, 1e-3);
  const auto changes = [&](double gap, double up) {
    return judged(Scheme::cvode_adams, 1e-10, tests::ball_on_floor(gap, up), setup, 0.01);
  };
  expect_changes(changes(-0.001, 0.0), {.lost = 1, .clamped = 1});
  expect_changes(changes(-0.001, 10.0), {.lost = 1});
  expect_changes(changes(0.0, -1.0), {.touched = 1, .lost = 1, .clamped = 1});
  expect_changes(changes(0.0, 1.0), {});
}

TEST(Reference, WatchesPairsThatMeetLater) {
  // A ball flies past forty fixed ones and touches each: far more than the set that is watched at first.
  Materials materials;
  materials.wall = {1e5, 0.0};
  State state;
  state.add(0, Kind::content, {-1.0, 0.0, 0.4395}, {20.0, 0.0, 0.0}, 0.22);
  constexpr int kWalls = 40;
  for (int wall = 0; wall < kWalls; ++wall)
    state.add(1 + wall, Kind::wall, {1.0 * wall, 0.0, wall % 2 == 0 ? 0.0 : 0.879}, core::Vec3::Zero(), 0.22);
  const ReferenceRun run = judged(Scheme::cvode_adams, 1e-9, state, tests::weightless(materials, 1e-3), 2.2);
  expect_changes(run, {.touched = kWalls, .lost = kWalls});
}

TEST(Reference, WatchesPairsAlsoWhereEveryStepEndsInAChange) {
  // A ball flies at 20 m/s towards a wall 2 m away, unwatched at first, while every 0.5 ms two other balls touch or part.
  Materials materials;
  materials.ball = materials.wall = {1e5, 0.0};  // steps may last 23 ms
  constexpr int kOthers = 120;
  State state;
  state.add(0, Kind::content, {-2.44, 0.0, 0.0}, {20.0, 0.0, 0.0}, 0.22);
  for (int k = 0; k < kOthers; ++k)
    state.add(1 + k, Kind::content, {3.0 * k, 100.0, 0.44 + 1e-3 * (k + 0.5)}, {0.0, 0.0, -1.0}, 0.22);
  state.add(1 + kOthers, Kind::wall, {0.0, 0.0, 0.0}, core::Vec3::Zero(), 0.22);
  for (int k = 0; k < kOthers; ++k) state.add(2 + kOthers + k, Kind::wall, {3.0 * k, 100.0, 0.0}, core::Vec3::Zero(), 0.22);
  const ReferenceRun run = judged(Scheme::erkstep, 1e-3, state, tests::weightless(materials, 1e-3), 0.102);
  ASSERT_LT(run.steps, run.restarts + 20) << "steps that end in no change";
  const auto first = std::find_if(run.log.begin(), run.log.end(), [](const BranchChange& one) { return one.i == 0; });
  ASSERT_NE(first, run.log.end());
  EXPECT_NEAR(first->time, 0.1, 3e-9);  // found to a hundredth of the absolute tolerance: 4.4e-8 m at 20 m/s
}

TEST(Reference, TheSlowStepOfMristepIsOfOrderThree) {
  // Two balls above each other, held together by a squeeze between floor and ceiling: contacts with these are fast.
  Materials materials;
  materials.ball = {1e6, 1e3};
  materials.wall = {1e8, 1e4};
  State state;
  const double a = 0.438, b = 0.436;
  state.add(0, Kind::content, {0.0, 0.0, a}, {0.0, 0.0, 0.1}, 0.22);
  state.add(1, Kind::content, {0.0, 0.0, a + b}, {0.0, 0.0, -0.05}, 0.22);
  state.add(2, Kind::wall, {0.0, 0.0, 0.0}, core::Vec3::Zero(), 0.22);
  state.add(3, Kind::wall, {0.0, 0.0, 2.0 * a + b}, core::Vec3::Zero(), 0.22);
  const StepperSetup setup = tests::weightless(materials, 1e-3);
  const double seconds = 0.004;
  const State exact = judged(Scheme::cvode_adams, 1e-12, state, setup, seconds).end;
  std::vector<double> steps, errors;
  for (const double step : {4e-4, 2e-4, 1e-4, 5e-5}) {
    const ReferenceRun run = judged(Scheme::mristep, 1e-12, state, setup, seconds, step);
    steps.push_back(step);
    errors.push_back(tests::distance(run.end, exact).x);
  }
  // Measured 3.00, and 2.97 to 3.03 from step to step. A force in both parts, or in none, is an error that no step reduces.
  EXPECT_NEAR(tests::fitted_order(steps, errors), 3.0, 0.1);
  EXPECT_LT(errors.back(), 1e-8);
}

TEST(Reference, FailsWhereABallGoesTooDeep) {
  // So soft a wall and so fast a ball that the overlap passes what the force routine allows: no scheme may try for ever.
  Materials materials;
  materials.wall = {1e4, 0.0};
  for (const Scheme scheme : tests::kSchemes) {
    for (const bool roots : {true, false}) {
      const std::string text = tests::message_of<core::NumericsError>([&] {
        integrate({scheme, 1e-6, 1e-5, roots}, tests::ball_on_floor(0.01, -50.0), tests::weightless(materials, 1e-3), 0.1);
      });
      EXPECT_NE(text.find("overlap is"), std::string::npos) << tests::name_of(scheme) << ": " << text;
      EXPECT_NE(text.find("limit"), std::string::npos) << text;
    }
  }
}

TEST(Reference, RefusesWhatMakesNoSense) {
  const Materials materials;
  const State state = tests::two_balls(materials, 0.2, 0.2, 0.01, 1.0);
  const StepperSetup setup = tests::weightless(materials, 1e-3);
  const auto complaint = [&](const ReferenceSettings& settings, double seconds) {
    return tests::message_of<core::InputError>([&] { integrate(settings, state, setup, seconds); });
  };
  EXPECT_NE(complaint({Scheme::mristep, 1e-8, 0.0, false}, 0.1).find("slow_step = 0 s"), std::string::npos);
  EXPECT_NE(complaint({Scheme::erkstep, 0.0, 0.0, false}, 0.1).find("rtol = 0"), std::string::npos);
  EXPECT_NE(complaint({Scheme::erkstep, 1e-8, 0.0, false}, 0.0).find("horizon is 0 s"), std::string::npos);
}

}  // namespace
}  // namespace grainclock::benchmarks
