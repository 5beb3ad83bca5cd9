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

/// A hundred and one balls that have all moved by (0, 0.5, 0) m at 2 m/s.
struct Crowd {
  State start, reference;
  Crowd() {
    for (int ball = 0; ball < 101; ++ball) {
      start.add(ball, Kind::content, Vec3(ball, 0, 1), Vec3::Zero(), 0.2);
      reference.add(ball, Kind::content, Vec3(ball, 0.5, 1), Vec3(0, 0, 2), 0.2);
    }
  }
};

TEST(Errors, OneOutlierOfAHundredAndOneIsSeenByTheRmsAndJustNotByTheQuantile) {
  const Crowd crowd;
  State result = crowd.reference;
  result.position[40].z() += 0.5;  // one displacement
  const TrajectoryErrors errors = trajectory_errors(crowd.start, crowd.reference, result, {});
  EXPECT_NEAR(errors.position.rms, 1.0 / std::sqrt(101.0), kRounding);
  EXPECT_EQ(errors.position.median, 0.0);
  EXPECT_EQ(errors.position.p99, 0.0);  // place 99 of 0..100: the last one but one
  result.position[41].z() += 0.25;
  EXPECT_NEAR(trajectory_errors(crowd.start, crowd.reference, result, {}).position.p99, 0.5, kRounding);
}

TEST(Errors, AMajorityThatIsOffMovesTheMedian) {
  const Crowd crowd;
  State result = crowd.reference;
  for (std::size_t row = 0; row < 51; ++row) result.position[row].x() -= 0.05;
  const TrajectoryErrors errors = trajectory_errors(crowd.start, crowd.reference, result, {});
  EXPECT_NEAR(errors.position.median, 0.1, kRounding);
  EXPECT_NEAR(errors.position.rms, 0.1 * std::sqrt(51.0 / 101.0), kRounding);
}

TEST(Errors, AFallingBallChangesNothingHoweverWrong) {
  const State start = four_balls();
  State reference = moved({0, 0.5, 0}, {1, 0, 0});
  reference.position[3].z() = -500.0;
  reference.velocity[3].z() = -100.0;
  State result = reference;
  result.position[0].x() += 0.1;
  const TrajectoryErrors before = trajectory_errors(start, reference, result, 0.0);
  result.position[3] = Vec3(7.0, 8.0, std::numeric_limits<double>::quiet_NaN());
  result.velocity[3] = Vec3(1e9, 0, 0);
  const TrajectoryErrors after = trajectory_errors(start, reference, result, 0.0);
  EXPECT_EQ(before.position.rms, after.position.rms);
  EXPECT_EQ(before.position.p99, after.position.p99);
  EXPECT_EQ(before.velocity.rms, after.velocity.rms);
  EXPECT_EQ(before.displacement, after.displacement);
  EXPECT_EQ(trajectory_errors(start, reference, without(result, 3), 0.0).missing, 0u);
}

TEST(Errors, OnlyTheReferenceTellsWhichBallsAreBelowThePlane) {
  const State reference = moved({0, 0.5, 0}, {1, 0, 0});
  State result = reference;
  result.position[2].z() = -99.0;  // fell through where it should not have
  const TrajectoryErrors errors = trajectory_errors(four_balls(), reference, result, 0.0);
  EXPECT_EQ(errors.compared, 4u);
  EXPECT_NEAR(errors.position.rms, 200.0 / 2.0, 1e-12);  // 100 m over 0.5 m over sqrt(4); rounding of a hundred
}

TEST(Errors, AMissingBallDoesNotMoveTheScale) {
  State reference = moved({0, 0.5, 0}, {1, 0, 0});
  reference.position[1].y() = 30.0;  // the one that carries the scale
  reference.velocity[1].x() = 50.0;
  State result = reference;
  result.position[0].x() += 0.1;
  const TrajectoryErrors whole = trajectory_errors(four_balls(), reference, result, {});
  const TrajectoryErrors lost = trajectory_errors(four_balls(), reference, without(result, 1), {});
  EXPECT_EQ(lost.missing, 1u);
  EXPECT_EQ(lost.compared, 3u);
  EXPECT_EQ(lost.displacement, whole.displacement);
  EXPECT_EQ(lost.speed, whole.speed);
}

TEST(Errors, ABallThatIsNotFiniteIsInfinitelyWrong) {
  const Crowd crowd;
  for (const double value : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    State result = crowd.reference;
    result.position[7].y() = value;
    const ErrorSummary position = trajectory_errors(crowd.start, crowd.reference, result, {}).position;
    EXPECT_EQ(position.rms, std::numeric_limits<double>::infinity());
    EXPECT_EQ(position.median, 0.0);
    EXPECT_EQ(position.p99, 0.0);
    for (const std::size_t row : {8u, 9u}) result.position[row].y() = value;
    EXPECT_EQ(trajectory_errors(crowd.start, crowd.reference, result, {}).position.p99,
              std::numeric_limits<double>::infinity());
  }
}

TEST(Errors, AReferenceThatIsNotFiniteIsRefused) {
  const Crowd crowd;
  State reference = crowd.reference;
  reference.velocity[5].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(trajectory_errors(crowd.start, reference, crowd.reference, {}), core::InputError);
}

TEST(Errors, DistancesNeedNoStartAndNoOrder) {
  const Crowd crowd;
  State other = reversed(crowd.reference);  // row 0 is ball 100
  other.position[0].z() += 3.0;
  const Distances apart = distances(other, crowd.reference);
  EXPECT_EQ(apart.common, 101u);
  EXPECT_NEAR(apart.rms, 3.0 / std::sqrt(101.0), kRounding);
  EXPECT_EQ(apart.median, 0.0);
  EXPECT_EQ(apart.largest, 3.0);
  EXPECT_EQ(distances(without(other, 0), crowd.reference).largest, 0.0);
  EXPECT_EQ(distances(State{}, crowd.reference).common, 0u);
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
  const double infinity = std::numeric_limits<double>::infinity();
  EXPECT_EQ(quantile({1, infinity, 2}, 0.5), 2.0);
  EXPECT_EQ(quantile({1, infinity, infinity}, 0.75), infinity);
  EXPECT_TRUE(std::isnan(quantile({1, std::numeric_limits<double>::quiet_NaN(), 2}, 0.5)));
  EXPECT_THROW(quantile({}, 0.5), core::InputError);
}

TEST(Errors, RelativeL2OfVectors) {
  EXPECT_NEAR(relative_l2({3, 4.5}, {3, 4}), 0.1, kRounding);  // 0.5 over 5
  EXPECT_EQ(relative_l2({0, 0}, {0, 0}), 0.0);
  EXPECT_EQ(relative_l2({1, 0}, {0, 0}), std::numeric_limits<double>::infinity());
  EXPECT_THROW(relative_l2({1}, {1, 2}), core::InputError);
}

TEST(Errors, OneLayersWallForceThatIsATenthOff) {
  const std::vector<double> reference{300, 400, 1200, 0};  // norm 1300
  std::vector<double> force = reference;
  force[1] *= 1.1;
  EXPECT_NEAR(relative_l2(force, reference), 40.0 / 1300.0, kRounding);
  force[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(relative_l2(force, reference), std::numeric_limits<double>::infinity());
  EXPECT_THROW(relative_l2(reference, force), core::InputError);
}

}  // namespace
}  // namespace grainclock::benchmarks
