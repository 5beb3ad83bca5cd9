// Strategy extrapolate: what its head claims, good and bad.
#include "tests/support/strategies.hpp"

#include <gtest/gtest.h>

namespace grainclock::multirate {
namespace {

using core::Interface;
using tests::Swing;
using tests::TwoSprings;

/// The first coarse step of `step` [s] after a renewal, n fine ones for the light ball, half as many for the soft spring.
Swing theory(Swing s, double step, int n) {
  const double h = step / n, heavy_place = s[2], heavy_velocity = s[3];
  const int every = n > 1 ? 2 : 1;  // fine steps between evaluations of the soft spring
  double soft = TwoSprings::soft_force(s), before = soft, sum = 0.5 * soft, stiff = TwoSprings::stiff_force(s);
  const double heavy_a = -soft / TwoSprings::kHeavy;
  double felt = soft;  // of the soft spring, by the light ball at the last fine tick
  for (int k = 1; k <= n; ++k) {
    const double t = k * h;
    s[0] += h * s[1] + 0.5 * h * h * (stiff + felt);
    s[2] = heavy_place + t * heavy_velocity + 0.5 * t * t * heavy_a;
    const double stiff_now = TwoSprings::stiff_force(s);
    s[1] += 0.5 * h * (stiff + stiff_now);
    stiff = stiff_now;
    if (k % every != 0) {
      felt = soft + 0.5 * (soft - before);
      s[1] += 0.5 * h * (soft + felt);
      continue;
    }
    const double now = TwoSprings::soft_force(s);
    const double paid = every == 2 ? 0.5 * h * (soft + felt) : 0.0;
    s[1] += 0.5 * every * h * (soft + now) - paid;
    before = soft;
    soft = felt = now;
    sum += k < n ? now : 0.5 * now;
  }
  s[3] -= every * h * sum / TwoSprings::kHeavy;
  return s;
}

TEST(Extrapolate, GrowsOnTwoSpringsAsTheorySays) {
  double worst = 0.0;
  tests::sweep_growth(Interface::extrapolate, theory, {0.5, 8.0, 0.02}, [&](const tests::Growth& growth) {
    // Swings of 1e-7 m are rounded to 1e-16 m, and bend the springs by 1e-6 of themselves; where two eigenvalues
    // meet, growth goes with the root of that.
    EXPECT_NEAR(growth.measured, growth.expected, growth.expected > 1e-2 ? 1e-5 : 2e-3);
    worst = std::max(worst, growth.expected);
    if (growth.fine_steps > 1) {
      EXPECT_GT(growth.expected, 0.0) << "stable";
    }
  });
  EXPECT_GT(worst, 0.1);  // a hundred times accumulate's
}

TEST(Extrapolate, NeedsMoreDampingThanAccumulate) {
  for (const double ratio : {0.02, 0.1, 0.3}) {
    const double worst = tests::worst_growth(Interface::extrapolate, ratio);
    EXPECT_EQ(worst > 1e-2, ratio < 0.05) << "damping ratio " << ratio << ", growth " << worst;
    if (ratio > 0.05) {
      EXPECT_LT(worst, -1e-3);
    }
  }
}

TEST(Extrapolate, IsOfOrderTwo) {
  for (const bool is_damped : {false, true}) {
    SCOPED_TRACE(is_damped ? "with dashpots" : "without dashpots");
    tests::Cage cage = tests::cage_of(Interface::extrapolate, is_damped);
    cage.tolerance *= 5.5;  // keeps the split: walls at one level, all contacts among balls at the coarsest
    const tests::CageErrors errors = tests::cage_errors(cage, {2, 3, 3, 3});
    // Errors are C h2 + O(h3). Those of the resting ball and of the energy, a thousandth of the circling ball's, come from
    // terms of both signs that cancel in part: steps of this size do not show their order to a tenth.
    EXPECT_NEAR(tests::fitted_order(errors.steps, errors.circling()), 2.0, 0.1);
    EXPECT_NEAR(tests::fitted_order(errors.steps, errors.resting()), 2.0, 0.5);
    EXPECT_NEAR(tests::fitted_order(errors.steps, errors.energy), 2.0, 0.5);
    EXPECT_GT(errors.resting().back(), 1e-13);  // far above rounding
  }
}

TEST(Extrapolate, KeepsLinearMomentumExactlyInAFlowingSilo) {
  for (const bool events : {false, true}) {
    const auto stepper =
        make_multirate_stepper(tests::flowing_silo(), tests::silo_setup(Interface::extrapolate, 3.2e-4, events));
    tests::expect_exact_momentum(*stepper, 200);
    tests::expect_many_levels(*stepper);
    EXPECT_EQ(stepper->costs().events > 0, events);
  }
}

TEST(Extrapolate, KeepsAngularMomentumToTheErrorOfTheScheme) {
  const double defect = tests::SpinningCloud(Interface::extrapolate).defect(1.6e-3);
  EXPECT_LT(defect, 1e-6);   // a hundredth of the tolerance
  EXPECT_GT(defect, 1e-10);  // not exact: far above rounding, 1e-12 (impulse.cpp)
}

TEST(Extrapolate, OnOneLevelEqualsUniformBitwise) {
  for (const bool events : {false, true})
    tests::expect_one_level_is_uniform(tests::silo_setup(Interface::extrapolate, 1e-4, events));
}

/// rms distance [m] of the balls of two states.
double distance(const core::State& a, const core::State& b) {
  tests::Rms rms;
  for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) rms.add((a.position[i] - b.position[i]).norm());
  return rms.value();
}

TEST(Extrapolate, EvaluatesLessThanAccumulateAtTheSameError) {
  constexpr double kStep = 1.6e-4;
  constexpr int kSteps = 200;
  core::StepperSetup fine = tests::silo_setup(Interface::extrapolate, 2e-6, true);
  fine.stepping.method = core::Method::uniform;
  const auto reference = core::make_uniform_stepper(tests::flowing_silo(), fine);
  reference->advance(kSteps * 80);
  double error[3];
  std::uint64_t evaluations[3];
  for (const int k : {0, 1, 2}) {  // accumulate, extrapolate, and the latter without events
    const Interface interface = k == 0 ? Interface::accumulate : Interface::extrapolate;
    const auto stepper = make_multirate_stepper(tests::flowing_silo(), tests::silo_setup(interface, kStep, k < 2));
    stepper->advance(kSteps);
    error[k] = distance(stepper->state(), reference->state());
    evaluations[k] = stepper->costs().contact_evaluations;
  }
  // Measured: 0.8 of the evaluations at the same error; events are chance, hence a factor.
  EXPECT_LT(static_cast<double>(evaluations[1]), 0.85 * static_cast<double>(evaluations[0]));
  EXPECT_LT(error[1], 2.0 * error[0]);
  EXPECT_LT(error[1], error[2]);  // event correction helps here, too
}

TEST(Extrapolate, RestartsBitwise) {
  tests::expect_restarts_bitwise(tests::silo_setup(Interface::extrapolate, 3.2e-4, true));
}

}  // namespace
}  // namespace grainclock::multirate
