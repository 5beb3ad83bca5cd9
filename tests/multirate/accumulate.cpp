// Strategy accumulate: what its head claims beyond momentum.cpp and order.cpp.
#include "tests/support/strategies.hpp"

#include <gtest/gtest.h>

namespace grainclock::multirate {
namespace {

using core::Interface;
using tests::Swing;
using tests::TwoSprings;

/// A coarse step of `step` [s], n fine ones for the light ball.
Swing theory(Swing s, double step, int n) {
  const double h = step / n, heavy_place = s[2], heavy_velocity = s[3];
  double soft = TwoSprings::soft_force(s), sum = 0.5 * soft;
  double light_a = TwoSprings::stiff_force(s) + soft;
  const double heavy_a = -soft / TwoSprings::kHeavy;
  for (int k = 1; k <= n; ++k) {
    const double t = k * h;
    s[0] += h * s[1] + 0.5 * h * h * light_a;
    s[2] = heavy_place + t * heavy_velocity + 0.5 * t * t * heavy_a;
    soft = TwoSprings::soft_force(s);
    const double a = TwoSprings::stiff_force(s) + soft;
    s[1] += 0.5 * h * (light_a + a);
    light_a = a;
    sum += k < n ? soft : 0.5 * soft;
  }
  s[3] -= h * sum / TwoSprings::kHeavy;
  return s;
}

TEST(Accumulate, GrowsOnTwoSpringsAsTheorySaysAndHasNoResonance) {
  double worst = 0.0;
  // Through half the period of the stiff spring, and multiples.
  tests::sweep_growth(Interface::accumulate, theory, {0.5, 8.0, 0.05}, [&](const tests::Growth& growth) {
    ASSERT_EQ(growth.fine_steps > 1, growth.phase > 1.92);  // the bound for both springs together: 1.91
    // Swings of 1e-7 m are rounded to 1e-16 m, and bend the springs by 1e-6 of themselves.
    EXPECT_NEAR(growth.measured, growth.expected, 1e-6);
    worst = std::max(worst, growth.measured);
  });
  EXPECT_GT(worst, 1e-3);  // weakly unstable
  EXPECT_LT(worst, 0.01);  // nowhere a band
}

TEST(Accumulate, ADampingRatioOfTwoHundredthsStopsTheGrowthOnTwoSprings) {
  TwoSprings springs(Interface::accumulate);
  springs.damp(0.02);
  for (double phase = 0.5; phase < 5.6; phase += 0.1) {
    EXPECT_LT(tests::measured_growth(springs, TwoSprings::step_of(phase)), -1e-4) << "phase per coarse step " << phase;
  }
}

TEST(Accumulate, KeepsAngularMomentumToTheErrorOfTheScheme) {
  tests::SpinningCloud cloud(Interface::accumulate);
  double defect[2];
  for (const int k : {0, 1}) {
    cloud.setup.stepping.tolerance = k == 0 ? 1e-3 : 1e-4;
    defect[k] = cloud.defect(1.6e-3);
  }
  EXPECT_LT(defect[0], 1e-5);   // a hundredth of the tolerance
  EXPECT_GT(defect[1], 1e-10);  // not exact: far above rounding, 1e-12 (impulse.cpp)
  EXPECT_LT(defect[1], 0.5 * defect[0]);
}

}  // namespace
}  // namespace grainclock::multirate
