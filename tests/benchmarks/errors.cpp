#include "benchmarks/errors.hpp"

#include "core/check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace grainclock::benchmarks {
namespace {

using core::Kind;
using core::State;
using core::Vec3;

// A few roundings of numbers of order one.
constexpr double kRounding = 1e-14;

/// Four content balls one metre apart, at rest, and one wall ball.
State four_balls() {
  State state;
  for (int ball = 0; ball < 4; ++ball) state.add(ball, Kind::content, Vec3(ball, 0, 1), Vec3::Zero(), 0.2);
  state.add(9, Kind::wall, Vec3(0, 0, 0), Vec3::Zero(), 0.2);
  return state;
}

/// The same after each ball has moved by `by` at this velocity.
State moved(const Vec3& by, const Vec3& velocity) {
  State state = four_balls();
  for (std::size_t row = 0; row < 4; ++row) {
    state.position[row] += by;
    state.velocity[row] = velocity;
  }
  return state;
}

State without(const State& state, std::size_t gone) {
  State left;
  for (std::size_t row = 0; row < state.size(); ++row) {
    if (row == gone) continue;
    left.add(state.id[row], state.kind[row], state.position[row], state.velocity[row], state.radius[row]);
  }
  return left;
}

State reversed(const State& state) {
  State other;
  for (std::size_t row = state.size(); row-- > 0;) {
    other.add(state.id[row], state.kind[row], state.position[row], state.velocity[row], state.radius[row]);
  }
  return other;
}

TEST(Errors, EqualStatesHaveNone) {
  const State end = moved({0.5, 0, 0}, {1, 0, 0});
  const TrajectoryErrors errors = trajectory_errors(four_balls(), end, end, {});
  EXPECT_EQ(errors.position.rms, 0.0);
  EXPECT_EQ(errors.velocity.p99, 0.0);
  EXPECT_EQ(errors.compared, 4u);
  EXPECT_EQ(errors.missing, 0u);
}

TEST(Errors, OneWrongBallGivesTheHandComputedMeasures) {
  const State reference = moved({0, 0.5, 0}, {0, 2, 0});
  State result = reference;
  result.position[2] += Vec3(0.03, 0, 0.04);  // off by 0.05 m
  result.velocity[2] += Vec3(0, 0, 0.1);
  const TrajectoryErrors errors = trajectory_errors(four_balls(), reference, result, {});
  EXPECT_NEAR(errors.displacement, 0.5, kRounding);
  EXPECT_NEAR(errors.speed, 2.0, kRounding);
  // Per ball 0, 0, 0, 0.1: rms 0.1/sqrt(4), median 0, 99 % at place 2.97 of 0..3, i.e. 0.97 of the way from 0 to 0.1.
  EXPECT_NEAR(errors.position.rms, 0.05, kRounding);
  EXPECT_EQ(errors.position.median, 0.0);
  EXPECT_NEAR(errors.position.p99, 0.097, kRounding);
  EXPECT_NEAR(errors.velocity.rms, 0.025, kRounding);  // 0.1 m/s over 2 m/s over sqrt(4)
}

TEST(Errors, ScaleIsTheReferencesDisplacementNotTheResults) {
  const TrajectoryErrors errors =
      trajectory_errors(four_balls(), moved({1, 0, 0}, {1, 0, 0}), moved({3, 0, 0}, {1, 0, 0}), {});
  EXPECT_NEAR(errors.position.rms, 2.0, kRounding);  // 2 m off over 1 m, not over 3 m
}

TEST(Errors, BallsAreMatchedByIdNotByRow) {
  const State reference = moved({0.5, 0, 0}, {1, 0, 0});
  const State permuted = reversed(reference), permuted_start = reversed(four_balls());
  EXPECT_EQ(trajectory_errors(four_balls(), reference, permuted, {}).position.rms, 0.0);
  EXPECT_NEAR(trajectory_errors(permuted_start, reference, reference, {}).displacement, 0.5, kRounding);
}

TEST(Errors, BallsBelowTheOutletInTheReferenceDoNotCount) {
  State reference = moved({0, 0.5, 0}, {1, 0, 0});
  reference.position[3].z() = -5.0;  // in free fall: its displacement would dilute everything
  State result = reference;
  result.position[3].z() = -9.0;
  result.position[0].x() += 0.1;
  const TrajectoryErrors errors = trajectory_errors(four_balls(), reference, result, 0.0);
  EXPECT_EQ(errors.compared, 3u);
  EXPECT_NEAR(errors.displacement, 0.5, kRounding);
  EXPECT_NEAR(errors.position.rms, 0.2 / std::sqrt(3.0), kRounding);
  EXPECT_EQ(trajectory_errors(four_balls(), reference, result, {}).compared, 4u);
}

TEST(Errors, BallsThatLeftAreCountedAsMissingOnlyIfTheReferenceKeepsThem) {
  const State reference = moved({0.5, 0, 0}, {1, 0, 0});
  EXPECT_EQ(trajectory_errors(four_balls(), reference, without(reference, 1), {}).missing, 1u);
  EXPECT_EQ(trajectory_errors(four_balls(), without(reference, 1), reference, {}).missing, 0u);
  EXPECT_EQ(trajectory_errors(four_balls(), without(reference, 1), reference, {}).compared, 3u);
}

TEST(Errors, WithoutAScaleTheyAreRefused) {
  EXPECT_THROW(trajectory_errors(four_balls(), four_balls(), four_balls(), {}), core::InputError);
  EXPECT_THROW(trajectory_errors(four_balls(), State{}, four_balls(), {}), core::InputError);
}

TEST(Errors, QuantileInterpolatesBetweenOrderStatistics) {
  EXPECT_EQ(quantile({3, 1, 2}, 0.5), 2.0);
  EXPECT_EQ(quantile({4, 1, 2, 3}, 0.5), 2.5);
  EXPECT_EQ(quantile({4, 1, 2, 3}, 1.0), 4.0);
  EXPECT_EQ(quantile({7}, 0.99), 7.0);
  EXPECT_THROW(quantile({}, 0.5), core::InputError);
}

TEST(Errors, RelativeL2OfVectors) {
  EXPECT_NEAR(relative_l2({3, 4.5}, {3, 4}), 0.1, kRounding);  // 0.5 over 5
  EXPECT_EQ(relative_l2({0, 0}, {0, 0}), 0.0);
  EXPECT_EQ(relative_l2({1, 0}, {0, 0}), std::numeric_limits<double>::infinity());
  EXPECT_THROW(relative_l2({1}, {1, 2}), core::InputError);
}

}  // namespace
}  // namespace grainclock::benchmarks
