// Velocity classes at their limits, and the stability test against Eigen's eigenvalues.
#include "multirate/classes.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include <limits>

namespace grainclock::multirate {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kTolerance = 0x1p-13, kDiameter = 0.5;  // powers of two: the class limits are exact
constexpr double kLength = kApproachPerTolerance * kTolerance * kDiameter;
const Ladder kLadder(0x1p-12, 8);

Classes classes(double stiffness_ratio = 1.0) { return {kLadder, kTolerance, kDiameter, stiffness_ratio}; }
Level need(const Classes& some, double approach, bool fixed) { return some.need(some.weighted(approach, fixed)); }

/// The fastest approach [m/s] that needs no step finer than that of `level`, by bisection down to neighbouring numbers.
double fastest_of(const Classes& some, Level level) {
  double slow = 0.0, fast = 1e6;
  while (std::nextafter(slow, fast) < fast) {
    const double middle = 0.5 * (slow + fast);
    (some.need(middle) >= level ? slow : fast) = middle;
  }
  return slow;
}

TEST(Classes, LimitsAreHalfOpenAndGeometric) {
  const Classes some = classes();
  for (Level level = 1; level <= kLadder.coarsest(); ++level) {
    const double limit = fastest_of(some, level);
    // Two roundings: of the quotient and of the limit itself.
    EXPECT_NEAR(limit * kLadder.step(level) / kLength, 1.0, 2.0 * std::numeric_limits<double>::epsilon());
    EXPECT_EQ(some.need(limit), level);
    EXPECT_EQ(some.need(std::nextafter(limit, kInfinity)), level - 1);
  }
}

TEST(Classes, FasterPairsNeverGetCoarser) {
  tests::Random random(1);
  for (const double ratio : {0.1, 1.0, 100.0}) {
    const Classes some = classes(ratio);
    for (int k = 0; k < 2000; ++k) {
      const double v = std::exp(random.between(-12.0, 6.0)), faster = v * random.between(1.0, 3.0);
      for (const bool fixed : {false, true}) {
        EXPECT_LE(need(some, faster, fixed), need(some, v, fixed));
        EXPECT_EQ(need(some, -v, fixed), need(some, v, fixed));  // opening counts as closing does
      }
    }
  }
}

TEST(Classes, EveryLevelIsReached) {
  std::vector<int> count(static_cast<std::size_t>(kLadder.levels()));
  for (double v = 1e-5; v < 1e3; v *= 1.1) ++count[classes().need(v)];
  for (const int n : count) EXPECT_GT(n, 0);
}

TEST(Classes, WhatDoesNotApproachMayTakeTheCoarsestStep) {
  EXPECT_EQ(need(classes(100.0), 0.0, false), kLadder.coarsest());
  EXPECT_EQ(need(classes(100.0), 0.0, true), kLadder.coarsest());
  EXPECT_EQ(classes().need(std::numeric_limits<double>::denorm_min()), kLadder.coarsest());
}

TEST(Classes, FixedPartnersWeighByTheRootOfTheirStiffness) {
  tests::Random random(2);
  const Classes stiff = classes(256.0), soft = classes(0.25);  // roots are exact
  for (int k = 0; k < 2000; ++k) {
    const double v = std::exp(random.between(-12.0, 6.0));
    EXPECT_EQ(stiff.weighted(v, false), v);
    EXPECT_EQ(stiff.weighted(-v, true), 16.0 * v);
    EXPECT_EQ(soft.weighted(v, true), v);  // softer ones count no less
  }
}

TEST(Classes, ATenthOfTheToleranceNeedsATenthOfTheSpeed) {
  const Classes loose(kLadder, 1e-3, kDiameter, 1.0), tight(kLadder, 1e-4, kDiameter, 1.0);
  for (double v = 1e-5; v < 1e3; v *= 1.37) EXPECT_EQ(tight.need(v), loose.need(10.0 * v)) << v;
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
    EXPECT_TRUE(is_stable(cage.integers, safe * (1.0 - cage.cut_off), ball, fixed, cage.inertia)) << "trial " << trial;
    EXPECT_FALSE(is_stable(cage.integers, safe * (1.0 + cage.cut_off), ball, fixed, cage.inertia)) << "trial " << trial;
    // Far beyond, an even number of negative eigenvalues must not pass for none.
    for (const double factor : {1.1, 1.5, 2.0, 3.0, 5.0, 10.0, 100.0})
      EXPECT_FALSE(is_stable(cage.integers, factor * safe, ball, fixed, cage.inertia)) << "trial " << trial;
    for (const double factor : {0.9, 0.5, 0.1, 1e-3})
      EXPECT_TRUE(is_stable(cage.integers, factor * safe, ball, fixed, cage.inertia)) << "trial " << trial;
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
  EXPECT_TRUE(is_stable(ContactMatrix{}, 1e3, {1e7, 2e4, 0.0, false}, {1e9, 2e5, 0.0, false}, 1.0));
}

}  // namespace
}  // namespace grainclock::multirate
