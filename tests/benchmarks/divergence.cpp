#include "benchmarks/divergence.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace grainclock::benchmarks {
namespace {

using core::Kind;
using core::State;
using core::Vec3;

// A few roundings through log and exp.
constexpr double kRounding = 1e-12;

State two_balls_and_a_wall() {
  State state;
  state.add(1, Kind::content, Vec3(0, 0, 1.0), Vec3::Zero(), 0.2);
  state.add(2, Kind::content, Vec3(0, 0, 2.0), Vec3::Zero(), 0.2);
  state.add(3, Kind::wall, Vec3(0, 0, 0.0), Vec3::Zero(), 0.2);
  return state;
}

TEST(Separation, IsTheDistanceOfBallsWithTheSameId) {
  const State one = two_balls_and_a_wall();
  State two = one;
  two.position[0] += Vec3(3e-9, 0, 0);
  two.position[1] += Vec3(0, 4e-9, 0);
  two.position[2] += Vec3(1, 1, 1);  // walls do not count
  const Separation apart = separation(one, two, std::nullopt);
  // sqrt((9 + 16) / 2) and 4, to the rounding of positions of 2 m.
  EXPECT_NEAR(apart.rms, std::sqrt(12.5) * 1e-9, 1e-15);
  EXPECT_NEAR(apart.max, 4e-9, 1e-15);
}

TEST(Separation, LeavesOutBallsBelowTheOutletAndThoseThatLeft) {
  const State one = two_balls_and_a_wall();
  State two = one;
  two.position[0] += Vec3(3e-9, 0, 0);
  two.position[1] += Vec3(0, 4e-9, 0);
  EXPECT_NEAR(separation(one, two, 1.5).rms, 4e-9, 1e-15);  // rounding of positions
  State left;
  left.add(2, Kind::content, two.position[1], Vec3::Zero(), 0.2);
  EXPECT_NEAR(separation(one, left, std::nullopt).rms, 4e-9, 1e-15);  // the same
  EXPECT_EQ(separation(one, two, 5.0).rms, 0.0);
}

TEST(Perturbed, MovesContentOnlyTheSameWayForTheSameSeed) {
  const State state = two_balls_and_a_wall();
  const State one = perturbed(state, 1e-6, 1), again = perturbed(state, 1e-6, 1), other = perturbed(state, 1e-6, 2);
  EXPECT_EQ(one.position[0], again.position[0]);
  EXPECT_NE(one.position[0], other.position[0]);
  EXPECT_NE(one.position[0], state.position[0]);
  EXPECT_EQ(one.position[2], state.position[2]);
  EXPECT_LE((one.position[1] - state.position[1]).cwiseAbs().maxCoeff(), 1e-6 + 1e-15);  // rounding of positions
}

TEST(Perturbed, HasTheAskedRmsDisplacement) {
  State state;
  for (core::BallId id = 0; id < 10000; ++id) state.add(id, Kind::content, Vec3::Zero(), Vec3::Zero(), 0.2);
  // Relative scatter of the rms of n vectors with uniform components is sqrt(4/15 / n): 0.5 %; four of these.
  EXPECT_NEAR(separation(state, perturbed(state, 1e-6, 1), std::nullopt).rms, 1e-6, 0.02e-6);
}

/// Samples every 0.01 s of what grows at `rate` from 1e-12 m after lying still for `flat` seconds, saturating at `top`.
struct Curve {
  std::vector<double> time, separation;
  Curve(double rate, double flat, double top, double until) {
    for (int k = 0; 0.01 * k <= until; ++k) {
      const double t = 0.01 * k;
      time.push_back(t);
      const double grown = 1e-12 * std::exp(rate * std::max(0.0, t - flat));
      separation.push_back(grown * top / (grown + top));
    }
  }
};

TEST(Growth, OfAnExponentialIsItsRate) {
  const Curve curve(40.0, 0.0, 1e9, 0.5);
  const Growth growth = fitted_growth(curve.time, curve.separation, 1.0);
  ASSERT_TRUE(growth.rate.has_value());
  EXPECT_NEAR(*growth.rate / 40.0, 1.0, 1e3 * kRounding);  // top is 1e9 above the curve's end at most
  EXPECT_EQ(growth.floor, curve.separation.front());
}

TEST(Growth, LeavesOutFloorAndSaturation) {
  const Curve curve(40.0, 0.2, 0.1, 1.2);
  const Growth growth = fitted_growth(curve.time, curve.separation, 1e-4);
  ASSERT_TRUE(growth.rate.has_value());
  EXPECT_NEAR(*growth.rate / 40.0, 1.0, 2e-3);  // at the ceiling the curve lags by 1e-4 / 0.1
  EXPECT_GT(growth.begin, 0.2);
  EXPECT_LT(growth.end, 0.2 + std::log(1e8) / 40.0);
}

TEST(Growth, WithoutTheCeilingSaturationWouldSpoilTheRate) {
  const Curve curve(40.0, 0.2, 1e-4, 1.2);
  EXPECT_LT(*fitted_growth(curve.time, curve.separation, 1.0).rate, 0.9 * 40.0);
}

TEST(Growth, IgnoresADipAndNoiseOfTheFloor) {
  Curve curve(40.0, 0.3, 1e9, 0.8);
  for (std::size_t k = 0; k < 30; ++k)
    curve.separation[k] *= k % 2 ? 1.0 : 0.5;  // lowest 0.5e-12, noise below three times that
  const Growth growth = fitted_growth(curve.time, curve.separation, 1.0);
  EXPECT_EQ(growth.floor, 0.5e-12);
  EXPECT_NEAR(*growth.rate / 40.0, 1.0, 1e3 * kRounding);  // as above
}

TEST(Growth, IsUnknownWhereNothingGrows) {
  const std::vector<double> time{0, 1, 2, 3, 4, 5};
  EXPECT_FALSE(fitted_growth(time, {1e-12, 1e-12, 1e-12, 1e-12, 1e-12, 1e-12}, 1.0).rate);
  EXPECT_FALSE(fitted_growth(time, {1e-9, 1e-10, 1e-11, 1e-12, 1e-13, 1e-14}, 1.0).rate);
  EXPECT_FALSE(fitted_growth(time, {1e-12, 2e-12, 3e-12, 4e-12, 5e-12, 6e-12}, 1.0).rate);  // below ten times the floor
  EXPECT_FALSE(fitted_growth(time, {0, 0, 0, 0, 0, 0}, 1.0).rate);
  EXPECT_FALSE(fitted_growth(time, {2, 3, 4, 5, 6, 7}, 1.0).rate);  // beyond the ceiling from the first
  EXPECT_FALSE(fitted_growth({}, {}, 1.0).rate);
}

TEST(TrustedUntil, GrowsTheReferencesErrorToATenthOfTheSmallest) {
  // At 0.1 s the reference is off by 1e-7, at 0.1 s + ln(100)/50 by 1e-5: a tenth of 1e-4.
  EXPECT_NEAR(*trusted_until(50.0, 0.1, 1e-7, 1e-4), 0.1 + std::log(100.0) / 50.0, kRounding);
}

TEST(TrustedUntil, IsBeforeTheHorizonWhereTheReferenceIsTooCoarse) {
  EXPECT_NEAR(*trusted_until(50.0, 0.1, 1e-4, 1e-4), 0.1 - std::log(10.0) / 50.0, kRounding);
  EXPECT_EQ(*trusted_until(50.0, 0.001, 1e-2, 1e-4), 0.0);
}

TEST(TrustedUntil, IsUnknownWithoutGrowthOrErrors) {
  EXPECT_FALSE(trusted_until(0.0, 0.1, 1e-7, 1e-4));
  EXPECT_FALSE(trusted_until(std::nan(""), 0.1, 1e-7, 1e-4));
  EXPECT_FALSE(trusted_until(50.0, 0.1, 0.0, 1e-4));
}

}  // namespace
}  // namespace grainclock::benchmarks
