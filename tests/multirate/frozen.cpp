// Strategy frozen, the bad example: every ball alone is sound, momentum is not.
#include "tests/support/strategies.hpp"

#include <gtest/gtest.h>

namespace grainclock::multirate {
namespace {

using core::Interface;
using tests::Swing;
using tests::TwoSprings;

/// The flowing silo, and later on.
const std::vector<core::State>& starts() {
  static const std::vector<core::State> states = [] {
    std::vector<core::State> made{tests::flowing_silo()};
    for (int k = 1; k < 4; ++k) {
      const auto stepper = core::make_uniform_stepper(made.back(), tests::silo_setup(core::Method::uniform, 1e-4, true));
      stepper->advance(500);
      made.push_back(tests::fresh(stepper->state()));
    }
    return made;
  }();
  return states;
}

/// Momentum residual of 0.08 s of a flowing silo, rms over starts; finest step 1e-5 s.
double defect(Interface interface, int levels) {
  core::StepperSetup setup = tests::silo_setup(interface, std::ldexp(1e-5, levels - 1), false);
  setup.stepping.levels = levels;
  setup.stepping.limiter = levels;
  setup.stepping.tolerance = 1e-5;  // a good part of the contacts at level 0
  double square = 0.0;
  for (const core::State& start : starts()) {
    const auto stepper = make_multirate_stepper(start, setup);
    const core::Energies before = stepper->energies();
    stepper->advance(std::llround(0.08 / *setup.stepping.step));
    const double residual = core::momentum_residual(before, stepper->energies(), stepper->ledger());
    square += residual * residual;
  }
  return std::sqrt(square / static_cast<double>(starts().size()));
}

TEST(Frozen, LosesMomentumMoreAtLargerRatiosOfSteps) {
  const double ratio_1 = defect(Interface::frozen, 1), ratio_2 = defect(Interface::frozen, 2),
               ratio_4 = defect(Interface::frozen, 3), ratio_16 = defect(Interface::frozen, 5);
  EXPECT_LE(ratio_1, 1e-12);  // one level: rounding
  // Measured 6.8e-6, 1.9e-5 and 1.9e-5. What events leave is chance, and from 4 on few balls take the coarsest steps.
  EXPECT_GT(ratio_2, 1e-7);
  EXPECT_GT(ratio_4, 1.5 * ratio_2);
  EXPECT_GT(ratio_16, 1.5 * ratio_2);
  EXPECT_LT(ratio_16, 1e-2);
  EXPECT_LE(defect(Interface::accumulate, 5), 1e-12);  // the scene is not to blame
}

TEST(Frozen, LosesAngularMomentum) {
  const double frozen = tests::SpinningCloud(Interface::frozen).defect(1.6e-3);
  const double accumulate = tests::SpinningCloud(Interface::accumulate).defect(1.6e-3);
  EXPECT_GT(frozen, 30.0 * accumulate);  // measured: some hundreds
}

TEST(Frozen, IsOfOrderTwoWhileContactsStayClosed) {
  for (const bool is_damped : {false, true}) {
    const tests::CageErrors errors = tests::cage_errors(tests::cage_of(Interface::frozen, is_damped), {0, 2, 3, 3});
    // Errors are C h2 + O(h3).
    EXPECT_NEAR(tests::fitted_order(errors.steps, errors.circling()), 2.0, 0.1);
    EXPECT_NEAR(tests::fitted_order(errors.steps, errors.resting()), 2.0, 0.1);
    EXPECT_NEAR(tests::fitted_order(errors.steps, errors.energy), 2.0, 0.1);
    EXPECT_GT(errors.resting().back(), 1e-13);  // far above rounding
  }
}

/// A coarse step of `step` [s], n fine ones for the light ball.
Swing theory(Swing s, double step, int n) {
  const double h = step / n, heavy_place = s[2], heavy_velocity = s[3];
  const double before = TwoSprings::soft_force(s), heavy_a = -before / TwoSprings::kHeavy;
  double light_a = TwoSprings::stiff_force(s) + before;
  for (int k = 1; k <= n; ++k) {
    const double t = k * h;
    s[0] += h * s[1] + 0.5 * h * h * light_a;
    s[2] = heavy_place + t * heavy_velocity + 0.5 * t * t * heavy_a;
    const double a = TwoSprings::stiff_force(s) + TwoSprings::soft_force(s);
    s[1] += 0.5 * h * (light_a + a);
    light_a = a;
  }
  s[3] -= 0.5 * step * (before + TwoSprings::soft_force(s)) / TwoSprings::kHeavy;
  return s;
}

TEST(Frozen, GrowsOnTwoSpringsAsTheorySays) {
  double worst = 0.0;
  tests::sweep_growth(Interface::frozen, theory, {0.5, 8.0, 0.1}, [&](const tests::Growth& growth) {
    // Swings of 1e-7 m are rounded to 1e-16 m, and bend the springs by 1e-6 of themselves.
    EXPECT_NEAR(growth.measured, growth.expected, 1e-6);
    worst = std::max(worst, growth.measured);
  });
  EXPECT_GT(worst, 1e-3);
}

TEST(Frozen, OnOneLevelEqualsUniformBitwise) {
  tests::expect_one_level_is_uniform(tests::silo_setup(Interface::frozen, 1e-4, false));
}

}  // namespace
}  // namespace grainclock::multirate
