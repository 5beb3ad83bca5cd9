#include "core/materials.hpp"

#include "core/check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace grainclock::core {
namespace {

constexpr double kStiffness = 1e7;  // N/m
constexpr double kMass = 27.9;      // kg, effective mass of two mean balls

PairLaw law_of_ratio(double ratio) { return {kStiffness, ratio * 2.0 * std::sqrt(kStiffness * kMass)}; }

struct Collision {
  double restitution;
  double force_time;    // s, until the force is first zero
  double overlap_time;  // s, until the overlap is zero
};

// The law itself, F = k d + c d' (clamped at zero without tension), by the
// classical Runge-Kutta scheme until the overlap is zero; it knows no closed form.
Collision integrate(const PairLaw& law, bool tension) {
  const double w = std::sqrt(law.k / kMass);
  const double ratio = law.c / (2.0 * std::sqrt(law.k * kMass));
  const double h = 1e-5 / (w * std::max(1.0, ratio));
  const auto acceleration = [&](double d, double v) {
    const double force = law.k * d + law.c * v;
    return -(tension ? force : std::max(0.0, force)) / kMass;
  };
  double d = 0.0, v = 1.0, t = 0.0, force_time = 0.0;
  for (;;) {
    const double a1 = acceleration(d, v);
    const double v2 = v + 0.5 * h * a1, a2 = acceleration(d + 0.5 * h * v, v2);
    const double v3 = v + 0.5 * h * a2, a3 = acceleration(d + 0.5 * h * v2, v3);
    const double v4 = v + h * a3, a4 = acceleration(d + h * v3, v4);
    const double next = d + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4);
    v += h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4);
    if (next <= 0.0) return {-v, force_time > 0.0 ? force_time : t, t + h * d / (d - next)};
    d = next;
    t += h;
    if (force_time == 0.0 && law.k * d + law.c * v <= 0.0) force_time = t;
  }
}

class RestitutionOf : public testing::TestWithParam<double> {};

TEST_P(RestitutionOf, ForceZeroEndingAgreesWithIntegratedLaw) {
  const PairLaw law = law_of_ratio(GetParam());
  const Collision expected = integrate(law, false);
  // The kink at the clamp costs the integration h^2 = 1e-10 in speed, the end of the force is known to h = 1e-5.
  EXPECT_NEAR(restitution(law, kMass, false), expected.restitution, 1e-9);
  const double scale = std::sqrt(kMass / law.k);
  EXPECT_NEAR(collision_time(law, kMass, false) / scale, expected.force_time / scale, 2e-5);
}

TEST_P(RestitutionOf, DashpotInvertsRestitutionAtForceZero) {
  const PairLaw law = law_of_ratio(GetParam());
  const double e = restitution(law, kMass, false);
  // Rounding of e, amplified by d(ln z)/d(ln e) <= 1 / (2 z) for small z.
  EXPECT_NEAR(dashpot_for_restitution(law.k, kMass, e, false) / law.c, 1.0, 1e-14 / std::min(1.0, GetParam()));
}

INSTANTIATE_TEST_SUITE_P(DampingRatios, RestitutionOf, testing::Values(0.02, 0.3, 0.6, 0.999999, 1.0, 1.000001, 1.5, 5.0));

class UnderdampedOf : public testing::TestWithParam<double> {};

TEST_P(UnderdampedOf, OverlapZeroEndingAgreesWithIntegratedLaw) {
  const PairLaw law = law_of_ratio(GetParam());
  const Collision expected = integrate(law, true);
  // The last step is not cut at the root: speed is off by h times the acceleration, at most 1e-5.
  EXPECT_NEAR(restitution(law, kMass, true), expected.restitution, 2e-5);
  // The root is interpolated linearly: h^2 = 1e-10, plus 1e6 roundings of the time.
  const double scale = std::sqrt(kMass / law.k);
  EXPECT_NEAR(collision_time(law, kMass, true) / scale, expected.overlap_time / scale, 1e-8);
}

TEST_P(UnderdampedOf, DashpotInvertsRestitutionAtOverlapZero) {
  const PairLaw law = law_of_ratio(GetParam());
  const double e = restitution(law, kMass, true);
  EXPECT_NEAR(dashpot_for_restitution(law.k, kMass, e, true) / law.c, 1.0, 1e-14 / GetParam());  // rounding, as above
}

INSTANTIATE_TEST_SUITE_P(DampingRatios, UnderdampedOf, testing::Values(0.02, 0.3, 0.6, 0.9));

TEST(Materials, RestitutionAtCriticalDampingIsExpMinusTwo) {
  EXPECT_NEAR(restitution(law_of_ratio(1.0), kMass, false), std::exp(-2.0), 1e-15);  // rounding
}

TEST(Materials, RestitutionIsContinuousThroughCriticalDamping) {
  const double below = restitution(law_of_ratio(1.0 - 1e-9), kMass, false);
  const double above = restitution(law_of_ratio(1.0 + 1e-9), kMass, false);
  // d(ln e)/dz = -4/3 at z = 1; rounding of the ratio itself is 1e-16.
  EXPECT_NEAR((below - above) / std::exp(-2.0), 4.0 / 3.0 * 2e-9, 1e-14);
}

TEST(Materials, StrongDampingKeepsRestitutionAboveZeroWithoutTension) {
  // Known limit e = 1/(4 z^2), next term of relative order ln(z)/z^2.
  EXPECT_NEAR(restitution(law_of_ratio(3000.0), kMass, false) * 4.0 * 9e6, 1.0, 1e-5);
  EXPECT_EQ(restitution(law_of_ratio(3000.0), kMass, true), 0.0);
  EXPECT_EQ(collision_time(law_of_ratio(1.0), kMass, true), std::numeric_limits<double>::infinity());
}

TEST(Materials, NoDashpotLosesNothing) {
  for (const bool tension : {false, true}) {
    EXPECT_EQ(restitution({kStiffness, 0.0}, kMass, tension), 1.0);
    EXPECT_EQ(dashpot_for_restitution(kStiffness, kMass, 1.0, tension), 0.0);
    // Half a period; rounding.
    EXPECT_NEAR(collision_time({kStiffness, 0.0}, kMass, tension) / (std::numbers::pi * std::sqrt(kMass / kStiffness)), 1.0,
                1e-15);
  }
}

TEST(Materials, EveryRestitutionAboveZeroIsReachable) {
  for (const bool tension : {false, true})
    for (const double e : {1.0 - 1e-12, 0.9, 0.3, 1e-3, 1e-12})
      // ln e is known to its rounding.
      EXPECT_NEAR(restitution({kStiffness, dashpot_for_restitution(kStiffness, kMass, e, tension)}, kMass, tension) / e, 1.0,
                  1e-12);
}

TEST(Materials, ImpossibleRestitutionIsRejectedWithItsValue) {
  for (const bool tension : {false, true})
    for (const double e : {0.0, -0.1, 1.0000001, std::numeric_limits<double>::quiet_NaN()})
      EXPECT_THROW(dashpot_for_restitution(kStiffness, kMass, e, tension), InputError) << e;
  EXPECT_THROW(dashpot_for_restitution(0.0, kMass, 0.5, false), InputError);
  EXPECT_THROW(dashpot_for_restitution(kStiffness, -1.0, 0.5, false), InputError);
  try {
    dashpot_for_restitution(kStiffness, kMass, 1.5, false);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("1.5"), std::string::npos);
  }
}

TEST(Materials, MassOfMeanBallIsThePapers) {
  // 1250 kg/m3 and radius 0.22 m; design figure of four digits.
  EXPECT_NEAR(Materials{}.mass(0.22), 55.75, 0.005);
}

TEST(Materials, DefaultDampingRatiosAreTheStandardScenes) {
  const Materials materials;
  const double m = materials.mass(0.22);
  EXPECT_NEAR(damping_ratio(materials.ball, m / 2.0), 0.6, 0.005);   // stated with one digit
  EXPECT_NEAR(damping_ratio(materials.wall, m), 0.4, 0.03);
}

TEST(Materials, ReachIsCohesionOverTheSofterSpring) {
  Materials materials;
  EXPECT_EQ(materials.reach(), 0.0);
  materials.cohesion = 1e4;
  EXPECT_DOUBLE_EQ(materials.reach(), 1e-3);
}

TEST(Materials, PlugBallsAreWallForContacts) {
  const Materials materials;
  EXPECT_EQ(&materials.pair(Kind::content), &materials.ball);
  EXPECT_EQ(&materials.pair(Kind::wall), &materials.wall);
  EXPECT_EQ(&materials.pair(Kind::plug), &materials.wall);
}

}  // namespace
}  // namespace grainclock::core
