// Velocity classes at their limits, and the stability test against Eigen's eigenvalues.
#include "multirate/classes.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <limits>

namespace grainclock::multirate {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The urgency [1/s] of a pair of circular frequency omega [1/s].
double urgency(double overlap, double rate, double acceleration, double omega, double speed) {
  return std::pow(motion_of(overlap, rate, acceleration, omega * omega, speed * speed).urgency4, 0.25);
}
bool is_impact(double overlap, double rate, double acceleration, double omega) {
  return motion_of(overlap, rate, acceleration, omega * omega, 1.0).is_impact;
}

TEST(Classes, UrgencyIsTheSameAllThroughAnOscillation) {
  tests::Random random(1);
  for (int k = 0; k < 200; ++k) {
    const double omega = std::exp(random.between(3.0, 9.0)), v = std::exp(random.between(-8.0, 3.0)),
                 speed = random.between(0.1, 2.0);
    const double phase = random.between(0.0, 6.0), rest = 2.0 * v / omega;  // m, deep enough to stay closed
    const double u =
        urgency(rest + v / omega * std::sin(phase), v * std::cos(phase), omega * v * std::sin(phase), omega, speed);
    EXPECT_NEAR(u / (omega * std::sqrt(v / speed)), 1.0, 1e-14);  // a few roundings
  }
}

TEST(Classes, AnImpactIsOneFromFirstTouchToLoss) {
  // An undamped collision between free balls: overlap v/omega sin, all of its acceleration its own.
  const double omega = 600.0, v = 0.7;
  for (double phase = 0.01; phase < 3.14; phase += 0.01) {
    EXPECT_TRUE(is_impact(v / omega * std::sin(phase), v * std::cos(phase), -omega * v * std::sin(phase), omega)) << phase;
  }
  EXPECT_TRUE(is_impact(-1e-3, v, 0.0, omega));  // about to touch
  EXPECT_TRUE(is_impact(0.0, v, 0.0, omega));
}

TEST(Classes, ASmallSwingAboutADeepOverlapIsSmooth) {
  const double omega = 600.0, deep = 1e-3;
  const double opening = kOpening * omega * deep;  // m/s
  EXPECT_FALSE(is_impact(deep, std::nextafter(opening, 0.0) * (1.0 - 1e-12), 0.0, omega));
  EXPECT_TRUE(is_impact(deep, opening * (1.0 + 1e-12), 0.0, omega));  // 1e-12: far above the roundings of the squares
  EXPECT_FALSE(is_impact(deep, 0.0, 0.99 * omega * opening, omega));
  EXPECT_TRUE(is_impact(deep, 0.0, -1.01 * omega * opening, omega));
}

TEST(Classes, WhatDoesNotMoveAsksForNothing) {
  EXPECT_EQ(urgency(1e-4, 0.0, 0.0, 600.0, 1.0), 0.0);
  EXPECT_EQ(urgency(-1e-4, 0.0, 9.81, 600.0, 1.0), 0.0);  // open: no spring that could swing
}

TEST(Classes, UrgencyGrowsWithSpeedAndStiffnessAndFallsWithTheScenesSpeed) {
  const double u = urgency(1e-4, 0.5, 0.0, 600.0, 1.0);
  EXPECT_NEAR(urgency(1e-4, 2.0, 0.0, 600.0, 1.0) / u, 2.0, 1e-14);    // the root of the speed
  EXPECT_NEAR(urgency(1e-4, 0.5, 0.0, 6000.0, 1.0) / u, 10.0, 1e-13);  // a fixed share of the collision's duration
  EXPECT_NEAR(urgency(1e-4, 0.5, 0.0, 600.0, 4.0) / u, 0.5, 1e-14);
}

/// What shared_reach4() promises: the rms error at this reach.
double expected_error(const std::vector<double>& strides4, std::size_t balls, double factor, double reach4) {
  double sum = 0.0;
  for (const double stride4 : strides4) sum += factor * factor * std::min(reach4, stride4);
  return std::sqrt(sum / static_cast<double>(balls));
}

TEST(Classes, TheSharedReachSpendsTheTolerance) {
  tests::Random random(2);
  int bounded = 0;
  for (int k = 0; k < 200; ++k) {
    std::vector<double> strides4(1 + random.below(200));
    for (double& stride4 : strides4) stride4 = std::exp(random.between(-24.0, 4.0));
    const std::size_t balls = strides4.size() + random.below(1000);
    const double tolerance = std::exp(random.between(-12.0, -2.0));
    const double reach4 = shared_reach4(strides4, balls, 0.3, tolerance);
    const double error = expected_error(strides4, balls, 0.3, reach4);
    EXPECT_LE(error, tolerance * (1.0 + 1e-12));  // rounding of sums of up to 200 terms
    if (std::isfinite(reach4)) {
      ++bounded;
      // Squares are taken at the upper ends of classes a sixteenth of an octave wide: up to 1/16 more, by class.
      EXPECT_GE(error, tolerance * std::sqrt(16.0 / 17.0) * (1.0 - 1e-12));
      EXPECT_LE(reach4, *std::max_element(strides4.begin(), strides4.end()) * 17.0 / 16.0);
    }
    std::reverse(strides4.begin(), strides4.end());
    EXPECT_EQ(shared_reach4(strides4, balls, 0.3, tolerance), reach4);  // to the bit, in any order
  }
  EXPECT_GT(bounded, 50);
}

TEST(Classes, WithoutUrgentBallsThereIsNoBound) {
  EXPECT_EQ(shared_reach4({}, 10, 0.3, 1e-4), kInfinity);
  EXPECT_EQ(shared_reach4({1e-12, 1e-10}, 10, 0.3, 1e-4), kInfinity);
}

TEST(Classes, WhereAllBallsCollideTheErrorIsTheSquareOfTheReach) {
  const std::vector<double> strides4(50, 1.0);
  EXPECT_NEAR(shared_reach4(strides4, 50, 0.25, 1e-4) / std::pow(4e-4, 2), 1.0, 1e-14);  // 0.25 r^2 = 1e-4; rounding
  // One in a hundred: the rms over all balls allows ten times the error.
  EXPECT_NEAR(shared_reach4(strides4, 5000, 0.25, 1e-4) / std::pow(4e-3, 2), 1.0, 1e-14);
}

/// Contacts of one ball, in both forms.
struct Cage {
  ContactMatrix integers;
  Eigen::Matrix3d ball = Eigen::Matrix3d::Zero(), fixed = Eigen::Matrix3d::Zero();  // 1/kg
  double inertia;  // 1/kg, that the integers are relative to: of the lightest ball anywhere
  double cut_off;  // relative error of the matrix that integers may make

  Cage(tests::Random& random, int contacts, bool flat) {
    constexpr double kHeaviest = 30.0;  // kg; the lightest has 1 kg
    const double own = 1.0 / random.between(1.0, kHeaviest);
    inertia = 1.0;
    // Every contact loses up to one unit per entry, 3 units of the norm, and gives at least `own` to the trace, which is at
    // most 3 eigenvalues.
    cut_off = 9.0 * kMatrixUnit * inertia / own;
    for (int k = 0; k < contacts; ++k) {
      const bool is_fixed = random.below(3) == 0;
      core::Vec3 n = random.direction();
      if (flat) n = core::Vec3(n.x(), n.y(), 0.0).normalized();
      const double inverse_masses = own + (is_fixed ? 0.0 : 1.0 / random.between(1.0, kHeaviest));
      (is_fixed ? fixed : ball) += inverse_masses * n * n.transpose();
      (is_fixed ? integers.fixed : integers.ball) +=
          NormalMatrix::of(n.x(), n.y(), n.z(), inverse_masses / inertia / kMatrixUnit);
    }
  }

  double largest_eigenvalue(double h, const core::ContactLaw& a, const core::ContactLaw& b) const {
    const Eigen::Matrix3d m = (h * h * a.k + 4.0 * h * a.c) * ball + (h * h * b.k + 4.0 * h * b.c) * fixed;
    return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m, Eigen::EigenvaluesOnly).eigenvalues()[2];
  }
};

TEST(Stability, AgreesWithEigenvaluesOnBothSidesOfTheLimit) {
  tests::Random random(3);
  for (int trial = 0; trial < 1000; ++trial) {
    const Cage cage(random, 1 + static_cast<int>(random.below(12)), trial % 4 == 0);
    const bool damped = random.below(4) != 0;
    const core::ContactLaw ball{std::pow(10.0, random.between(4.0, 8.0)),
                                damped ? std::pow(10.0, random.between(2.0, 5.0)) : 0.0, 0.0, false};
    const core::ContactLaw fixed{ball.k * std::pow(10.0, random.between(0.0, 3.0)), ball.c * random.between(0.0, 20.0), 0.0,
                                 false};
    double safe = 1e-12, unsafe = 1e3;
    while (unsafe > safe * (1.0 + 1e-14)) {
      const double middle = std::sqrt(safe * unsafe);
      (cage.largest_eigenvalue(middle, ball, fixed) < 4.0 ? safe : unsafe) = middle;
    }
    // The eigenvalue grows at least like h, so that a step off the limit by the cut-off is on a known side.
    EXPECT_TRUE(is_stable(cage.integers, StepWeights(safe * (1.0 - cage.cut_off), ball, fixed, cage.inertia))) << "trial " << trial;
    EXPECT_FALSE(is_stable(cage.integers, StepWeights(safe * (1.0 + cage.cut_off), ball, fixed, cage.inertia))) << "trial " << trial;
    // Far beyond, an even number of negative eigenvalues must not pass for none.
    for (const double factor : {1.1, 1.5, 2.0, 3.0, 5.0, 10.0, 100.0})
      EXPECT_FALSE(is_stable(cage.integers, StepWeights(factor * safe, ball, fixed, cage.inertia))) << "trial " << trial;
    for (const double factor : {0.9, 0.5, 0.1, 1e-3})
      EXPECT_TRUE(is_stable(cage.integers, StepWeights(factor * safe, ball, fixed, cage.inertia))) << "trial " << trial;
  }
}

TEST(Stability, ManyContactsFitIntoTheIntegers) {
  tests::Random random(4);
  const Cage cage(random, 120, false);
  const Eigen::Matrix3d both = cage.ball + cage.fixed;
  for (int k = 0; k < 3; ++k) {
    const double sum = (cage.integers.ball.entry[k] + cage.integers.fixed.entry[k]) * kMatrixUnit * cage.inertia;
    EXPECT_NEAR(sum, both(k, k), 120.0 * kMatrixUnit * cage.inertia);  // one unit per contact is cut off
  }
}

TEST(Stability, ABallWithoutContactsIsAlwaysStable) {
  EXPECT_TRUE(is_stable(ContactMatrix{}, StepWeights(1e3, {1e7, 2e4, 0.0, false}, {1e9, 2e5, 0.0, false}, 1.0)));
}

}  // namespace
}  // namespace grainclock::multirate
