#include "silo/flux.hpp"

#include "core/check.hpp"
#include "silo/random.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;
using core::Vec3;

constexpr double kDensity = 1250.0;  // kg/m3
constexpr double kPi = std::numbers::pi;
// Some hundred roundings of numbers of order one.
constexpr double kRounding = 1e-13;

/// Rings of n balls each around the axis, between azimuths that are multiples of 2 pi / n, cut in halves by z = 10 m.
/// Velocities are a function of the place.
template <class Velocity>
State rings(int n, Velocity&& velocity) {
  State state;
  for (int ring = 1; ring <= 3; ++ring)
    for (int k = 0; k < n; ++k) {
      const double azimuth = (k + 0.5) * 2.0 * kPi / n;
      const Vec3 at(ring * std::cos(azimuth), ring * std::sin(azimuth), 10.0);
      state.add(static_cast<core::BallId>(state.size()), Kind::content, at, velocity(at), 0.2);
    }
  return state;
}

constexpr double kCut = kPi * 0.04;  // m2, of a ball of radius 0.2 m

TEST(Flux, UniformFlowHasModeZeroOnlyAndItsCentroidOnTheAxis) {
  const State state = rings(20, [](const Vec3&) { return Vec3(0.1, -0.3, -0.5); });
  const Flux flux = flux_through(state, kDensity, 10.0, 6);
  EXPECT_NEAR(flux.modes[0].real() / (60 * kDensity * kCut * 0.5), 1.0, kRounding);
  EXPECT_EQ(flux.modes[0].imag(), 0.0);
  EXPECT_NEAR(flux.asymmetry(0), 1.0, kRounding);
  for (int m = 1; m <= 6; ++m) EXPECT_NEAR(flux.asymmetry(m), 0.0, kRounding) << m;
  EXPECT_NEAR(flux.centroid.norm(), 0.0, kRounding);
}

TEST(Flux, HalfTheSectionInMotionShowsOddModes) {
  const int n = 360;
  const State state = rings(n, [](const Vec3& at) { return Vec3(0.0, 0.0, at[1] > 0.0 ? -0.7 : 0.0); });
  const Flux flux = flux_through(state, kDensity, 10.0, 5);
  for (const int m : {1, 3, 5}) {
    // The sum of exp(i m azimuth) over half a ring of n/2 balls has the size 1 / sin(pi m / n): a geometric series.
    EXPECT_NEAR(flux.asymmetry(m), 2.0 / n / std::sin(kPi * m / n), kRounding) << m;
    // And 2 / (pi m) for a continuum; the sine's next term is (pi m / n)^2 / 6.
    EXPECT_NEAR(flux.asymmetry(m) * kPi * m / 2.0, 1.0, 1.1 * std::pow(kPi * m / n, 2) / 6.0) << m;
  }
  EXPECT_NEAR(flux.asymmetry(2), 0.0, kRounding);
  EXPECT_NEAR(flux.asymmetry(4), 0.0, kRounding);
  EXPECT_NEAR(flux.direction(1), kPi / 2.0, kRounding);  // towards y
  EXPECT_NEAR(flux.centroid.x(), 0.0, kRounding);
  // Rings of 1, 2 and 3 m of equal flux; the half ring's mean of sin(azimuth) is mode 1.
  EXPECT_NEAR(flux.centroid.y(), 2.0 * flux.asymmetry(1), kRounding);
}

TEST(Flux, OvalFlowPointsAlongItsLongAxis) {
  const double along = 0.6;
  const State state = rings(
      40, [&](const Vec3& at) { return Vec3(0.0, 0.0, -1.0 - 0.8 * std::cos(2.0 * (std::atan2(at[1], at[0]) - along))); });
  const Flux flux = flux_through(state, kDensity, 10.0, 3);
  EXPECT_NEAR(flux.asymmetry(2), 0.4, kRounding);  // half the cosine's amplitude
  EXPECT_NEAR(flux.direction(2), along, kRounding);
  EXPECT_NEAR(flux.asymmetry(1), 0.0, kRounding);
}

TEST(Flux, RigidRotationCarriesNothingDown) {
  const State state = rings(20, [](const Vec3& at) { return Vec3(-at[1], at[0], 0.0); });
  const Flux flux = flux_through(state, kDensity, 10.0, 2);
  EXPECT_EQ(flux.modes[0], 0.0);
  EXPECT_EQ(flux.turnover, 0.0);
  EXPECT_TRUE(std::isnan(flux.asymmetry(1)));
  EXPECT_TRUE(std::isnan(flux.centroid.x()));
}

TEST(Flux, ABallCarriesItsMassThroughThePlane) {
  const double r = 0.22, v = 3.0;
  const int n = 40;  // even
  double passed = 0.0;
  for (int k = 0; k <= n; ++k) {
    State state;
    const double t = -r / v + 2.0 * r / v * k / n;
    state.add(0, Kind::content, {0.4, 0.1, 5.0 - v * t}, {1.0, 0.0, -v}, r);
    const double simpson = k == 0 || k == n ? 1.0 : k % 2 == 1 ? 4.0 : 2.0;
    passed += simpson / 3.0 * 2.0 * r / v / n * flux_through(state, kDensity, 5.0, 0).modes[0].real();
  }
  // Simpson's rule is exact for the parabola that a ball's section is over time.
  EXPECT_NEAR(passed / (kDensity * 4.0 / 3.0 * kPi * r * r * r), 1.0, 1e-12);
}

TEST(Flux, WhatMovesUpCountsInTheTurnoverButNotInTheCentroid) {
  State state;
  state.add(0, Kind::content, {2.0, 0.0, 10.0}, {0.0, 0.0, -3.0}, 0.2);
  state.add(1, Kind::content, {0.0, 0.0, 10.0}, {0.0, 0.0, -1.0}, 0.2);
  state.add(2, Kind::content, {0.0, 2.0, 10.0}, {0.0, 0.0, 1.0}, 0.2);
  state.add(3, Kind::content, {0.0, 3.0, 10.25}, {0.0, 0.0, -9.0}, 0.25);  // touches the plane only
  state.add(4, Kind::wall, {3.0, 0.0, 10.0}, Vec3::Zero(), 0.2);
  const double unit = kDensity * kCut;
  const Flux flux = flux_through(state, kDensity, 10.0, 1);
  EXPECT_NEAR(flux.modes[0].real(), 3.0 * unit, 1e-12 * unit);  // rounding
  EXPECT_NEAR(flux.turnover, 5.0 * unit, 1e-12 * unit);
  EXPECT_NEAR(flux.centroid.x(), 1.5, kRounding);
  EXPECT_EQ(flux.centroid.y(), 0.0);
  EXPECT_NEAR(flux.modes[1].real(), 3.0 * unit, 1e-12 * unit) << "a ball on the axis has no azimuth";
  EXPECT_NEAR(flux.modes[1].imag(), -1.0 * unit, 1e-12 * unit);
  EXPECT_THROW(flux_through(state, 0.0, 10.0, 1), core::InputError);
  EXPECT_THROW(flux_through(state, kDensity, 10.0, -1), core::InputError);
  EXPECT_THROW(flux.direction(0), core::InputError);
}

TEST(Flux, RandomAzimuthsShowOneOverTheRootOfTheirNumber) {
  constexpr int kBalls = 100, kTrials = 2000;
  Random random(3, 0);
  double squares = 0.0;
  for (int trial = 0; trial < kTrials; ++trial) {
    State state;
    for (int k = 0; k < kBalls; ++k) {
      const double azimuth = random.between(0.0, 2.0 * kPi);
      state.add(k, Kind::content, {std::cos(azimuth), std::sin(azimuth), 0.0}, {0.0, 0.0, -1.0}, 0.2);
    }
    squares += std::pow(flux_through(state, kDensity, 0.0, 1).asymmetry(1), 2);
  }
  // The square is distributed exponentially with mean 1/n: four standard errors of its mean.
  EXPECT_NEAR(squares / kTrials * kBalls, 1.0, 4.0 / std::sqrt(kTrials));
}

TEST(Motion, SharesAreThoseOfTheMassAboveTheOutlet) {
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 1.0}, {0.0, 0.0, -0.5}, 0.1);   // mass 1
  state.add(1, Kind::content, {0.0, 0.0, 2.0}, {0.3, 0.0, -0.4}, 0.2);   // mass 8, speed 0.5
  state.add(2, Kind::content, {0.0, 0.0, 3.0}, {0.0, 0.0, 0.01}, 0.1);   // mass 1
  state.add(3, Kind::content, {0.0, 0.0, 3.0}, {0.1, 0.0, 0.0}, 0.1);    // mass 1
  state.add(4, Kind::content, {0.0, 0.0, -0.2}, {0.0, 0.0, -7.0}, 0.2);  // has left
  state.add(5, Kind::wall, {0.0, 0.0, 3.0}, Vec3::Zero(), 0.2);
  EXPECT_NEAR(mean_flux_speed(state), (0.5 + 8.0 * 0.4 - 0.01) / 11.0, kRounding);
  const Motion found = motion(state, 0.2, 0.1);
  EXPECT_NEAR(found.intensive, 9.0 / 11.0, kRounding);
  EXPECT_NEAR(found.at_rest, 1.0 / 11.0, kRounding);  // 0.1 m/s is not below 0.1 m/s
  EXPECT_NEAR(motion(state, 0.1, 0.0).intensive, 9.0 / 11.0, kRounding);
  EXPECT_EQ(motion({}, 0.1, 0.0).intensive, 0.0);
  EXPECT_EQ(mean_flux_speed({}), 0.0);
  EXPECT_THROW(motion(state, 0.1, 0.2), core::InputError);
  EXPECT_THROW(motion(state, 0.1, -0.1), core::InputError);
}

}  // namespace
}  // namespace grainclock::silo
