// Strategy impulse: what its head claims, good and bad.
#include "tests/support/strategies.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace grainclock::multirate {
namespace {

using core::Interface;
using tests::Swing;
using tests::TwoSprings;

/// A coarse step of `step` [s], n fine ones for the stiff spring.
Swing theory(Swing s, double step, int n) {
  const double h = step / n;
  const auto soft = [&] {
    const double half = 0.5 * step * TwoSprings::soft_force(s);
    s[1] += half;
    s[3] -= half / TwoSprings::kHeavy;
  };
  const auto stiff = [&] { s[1] += 0.5 * h * TwoSprings::stiff_force(s); };
  soft();
  for (int k = 0; k < n; ++k) {
    stiff();
    s[0] += h * s[1];
    s[2] += h * s[3];
    stiff();
  }
  soft();
  return s;
}

TEST(Impulse, ResonatesOnTwoSpringsWhereTheorySays) {
  int stable = 0, bands = 0;
  bool was_in_band = false;
  tests::sweep_growth(Interface::impulse, theory, {0.5, 7.6, 0.02}, [&](const tests::Growth& growth) {
    // Swings of 1e-7 m are rounded to 1e-16 m, and bend the springs by 1e-6 of themselves; at the edge of a band, where two
    // eigenvalues meet, growth goes with the root of that.
    EXPECT_NEAR(growth.measured, growth.expected, growth.expected > 1e-2 ? 1e-5 : 2e-3);
    const bool is_in_band = growth.expected > 1e-2;
    bands += is_in_band && !was_in_band;
    was_in_band = is_in_band;
    stable += !is_in_band;
    if (!is_in_band) return;
    // Half a period of the stiff spring as its fine steps have it, or a multiple, less what the soft spring and the heavy
    // ball's own swing add to the phase: 0.2 half periods each at these steps.
    const int n = growth.fine_steps;
    const double halves = 2.0 * n * std::asin(0.5 * growth.phase / n) / std::numbers::pi;
    EXPECT_LT(std::ceil(halves) - halves, 0.4);
  });
  // Half the period (one fine step, and two), the whole (two, and four), three halves. With one step that is the bound of
  // both springs together.
  EXPECT_EQ(bands, 5);
  EXPECT_GT(stable, 250);  // of 355
}

TEST(Impulse, DampingClosesTheBandsLate) {
  // A damping ratio of 0.1 is not enough where accumulate needs 0.02; 0.3 is.
  for (const double ratio : {0.02, 0.1, 0.3}) {
    const double worst = tests::worst_growth(Interface::impulse, ratio);
    EXPECT_EQ(worst > 1e-2, ratio < 0.2) << "damping ratio " << ratio << ", growth " << worst;
  }
}

/// Mean kinetic energy [J] of a ball that rests on a stiff wall, and of a heavier one on top, after they had time to rest.
double kinetic_at_rest(Interface interface) {
  constexpr double k_wall = 1e6, k_ball = 1e5, heavy = 8.0, g = 10.0, ratio = 0.05;
  core::StepperSetup setup;
  setup.gravity = core::Vec3(-g, 0.0, 0.0);
  setup.materials.density = tests::kUnitMass;
  setup.materials.wall = {k_wall, 2.0 * ratio * std::sqrt(k_wall)};
  setup.materials.ball = {k_ball, 2.0 * ratio * std::sqrt(k_ball * heavy / (1.0 + heavy))};
  setup.stepping.interface = interface;
  setup.stepping.events = false;
  setup.stepping.tolerance = 1e3;
  setup.stepping.step = 3.0 / std::sqrt(k_wall);
  const double light_x = 2.0 * tests::kUnitRadius - (1.0 + heavy) * g / k_wall;
  const double heavy_x = light_x + 3.0 * tests::kUnitRadius - heavy * g / k_ball;
  core::State state;
  state.add(0, core::Kind::content, core::Vec3(light_x, 0.0, 0.0), core::Vec3::Zero(), tests::kUnitRadius);
  state.add(1, core::Kind::content, core::Vec3(heavy_x, 0.0, 0.0), core::Vec3::Zero(), 2.0 * tests::kUnitRadius);
  state.add(2, core::Kind::wall, core::Vec3::Zero(), core::Vec3::Zero(), tests::kUnitRadius);
  const auto stepper = make_multirate_stepper(state, setup);
  EXPECT_EQ(tests::levels_of(*stepper), (std::vector<int>{6, 7}));
  stepper->advance(2000);
  constexpr int kSamples = 100;
  double sum = 0.0;
  for (int k = 0; k < kSamples; ++k) {
    stepper->advance(1);
    sum += stepper->energies().kinetic;
  }
  return sum / kSamples;
}

TEST(Impulse, HeatsBallsThatRestAtAStiffWall) {
  // The load comes in kicks and throws the light ball off the wall: up to a kick, 80 N over 3 ms, a quarter of a
  // metre a second. On its path of accumulate nothing moves, to the rounding of forces.
  EXPECT_GT(kinetic_at_rest(Interface::impulse), 1e-3);
  EXPECT_LT(kinetic_at_rest(Interface::accumulate), 1e-15);
}

TEST(Impulse, KeepsLinearMomentumExactlyInAFlowingSilo) {
  const auto stepper = make_multirate_stepper(tests::flowing_silo(), tests::silo_setup(Interface::impulse, 3.2e-4, false));
  tests::expect_exact_momentum(*stepper, 200);
  tests::expect_many_levels(*stepper);
}

TEST(Impulse, KeepsAngularMomentumExactly) {
  // Forces are rounded to a whole unit along each axis, some 1e-12 of the larger ones: not quite central.
  EXPECT_LT(tests::SpinningCloud(Interface::impulse).defect(1.6e-3), 1e-11);
}

TEST(Impulse, IsOfOrderTwoWithoutDashpotsAndOneWithThem) {
  for (const bool is_damped : {false, true}) {
    SCOPED_TRACE(is_damped ? "with dashpots" : "without dashpots");
    tests::Cage cage = tests::cage_of(Interface::impulse, is_damped);
    cage.tolerance *= 5.5;  // keeps the split: walls at one level, all contacts among balls at the coarsest
    const tests::CageErrors errors = tests::cage_errors(cage, {2, 3, 3, 3});
    // Errors are C h^p + O(h^(p+1)). With dashpots both terms of the circling ball's are of a size at the largest step.
    const double order = is_damped ? 1.0 : 2.0;
    EXPECT_NEAR(tests::fitted_order(errors.steps, errors.resting()), order, 0.1);
    EXPECT_NEAR(tests::fitted_order(errors.steps, errors.circling()), order, is_damped ? 0.5 : 0.1);
    if (!is_damped) {
      EXPECT_NEAR(tests::fitted_order(errors.steps, errors.energy), 2.0, 0.1);
    }
    EXPECT_GT(errors.resting().back(), 1e-13);  // far above rounding
  }
}

TEST(Impulse, OnOneLevelIsTheLaggedScheme) {
  // Without gravity, of which a wall's dashpot would see half a step more.
  core::StepperSetup setup = tests::silo_setup(core::Method::multirate, 1e-4, false), uniform = setup;
  setup.gravity = uniform.gravity = core::Vec3::Zero();
  setup.stepping.events = uniform.stepping.events = false;
  setup.stepping.levels = 1;
  setup.stepping.interface = Interface::impulse;
  uniform.stepping.method = core::Method::uniform;
  uniform.stepping.integrator = core::Integrator::lagged;
  const auto a = make_multirate_stepper(tests::resting_silo(), setup);
  const auto b = core::make_uniform_stepper(tests::resting_silo(), uniform);
  a->advance(200);
  b->advance(200);
  const core::State x = a->state(), y = b->state();
  // Rounding of positions, 1e-16 m, grows on stiff contacts by some 10 in 200 steps.
  for (std::size_t i = 0; i < x.size(); ++i) ASSERT_LE((x.position[i] - y.position[i]).norm(), 1e-13) << "ball " << x.id[i];
}

TEST(Impulse, RestartsBitwise) { tests::expect_restarts_bitwise(tests::silo_setup(Interface::impulse, 3.2e-4, false)); }

}  // namespace
}  // namespace grainclock::multirate
