// Order of convergence with a fixed split of levels, and stability at the interfaces between them.
#include "multirate/stepper.hpp"

#include "tests/support/cage.hpp"
#include "tests/support/order.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace grainclock::multirate {
namespace {

using core::Kind;
using core::State;
using core::Vec3;
using tests::kUnitMass;
using tests::levels_of;

constexpr double kRadius = tests::kUnitRadius;  // m

TEST(Order, IsTwoWithAFixedSplitOfLevels) {
  const tests::CageErrors errors = tests::cage_errors(tests::Cage(), {0, 2, 3, 3});
  // Errors are C h2 + O(h3); h times the fastest frequency is 0.4 at most at the coarsest level.
  for (std::size_t b = 0; b < tests::CageErrors::kBalls; ++b) {
    EXPECT_NEAR(tests::fitted_order(errors.steps, errors.position[b]), 2.0, 0.1) << "position of ball " << b;
    EXPECT_NEAR(tests::fitted_order(errors.steps, errors.velocity[b]), 2.0, 0.1) << "velocity of ball " << b;
    EXPECT_GT(errors.position[b].back(), 1e-13);  // far above rounding
  }
  EXPECT_NEAR(tests::fitted_order(errors.steps, errors.energy), 2.0, 0.1) << "energy residual";
}

/// Balls in line between two stiff walls, linear springs throughout, thrown about at random.
struct Chain {
  static constexpr int kBalls = 12;
  static constexpr double kStiffness = 1e5;  // N/m
  State start;
  core::StepperSetup setup;
  double limit;  // s, stability bound of the balls between balls

  Chain(double wall_ratio, double damping_ratio) {
    constexpr double overlap = 4e-3;  // m, never used up
    setup.gravity = Vec3::Zero();
    setup.materials.density = kUnitMass;
    setup.materials.ball = {kStiffness, 2.0 * damping_ratio * std::sqrt(0.5 * kStiffness)};
    setup.materials.wall = {wall_ratio * kStiffness, 2.0 * damping_ratio * std::sqrt(wall_ratio * kStiffness)};
    setup.materials.tension = true;
    setup.stepping.tolerance = 1e3;  // levels from stability alone
    // Two contacts of inverse mass 2: (h2 k + 4 h c) 4 = 4.
    const double c = 2.0 * setup.materials.ball.c;
    limit = (std::sqrt(c * c + kStiffness) - c) / kStiffness;
    double x = 2.0 * kRadius - overlap / wall_ratio, phase = 0.0;
    start.add(0, Kind::wall, Vec3::Zero(), Vec3::Zero(), kRadius);
    for (int k = 1; k <= kBalls; ++k) {
      phase = std::fmod(phase + 0.618, 1.0);
      start.add(k, Kind::content, Vec3(x, 0.0, 0.0), Vec3(0.05 * (phase - 0.5), 0.0, 0.0), kRadius);
      x += 2.0 * kRadius - (k == kBalls ? overlap / wall_ratio : overlap);
    }
    start.add(kBalls + 1, Kind::wall, Vec3(x, 0.0, 0.0), Vec3::Zero(), kRadius);
  }

  std::unique_ptr<core::Stepper> stepper(double step) {
    setup.stepping.step = step;
    return make_multirate_stepper(start, setup);
  }
};

/// Energy above that of the chain at rest, as multiples of what it began with, after every `steps` coarse steps.
std::vector<double> energy_history(core::Stepper& stepper, int pieces, int steps) {
  const core::Energies before = stepper.energies();
  std::vector<double> out;
  for (int k = 0; k < pieces; ++k) {
    stepper.advance(steps);
    out.push_back((stepper.energies().total() - before.total()) / before.kinetic + 1.0);
  }
  return out;
}

TEST(Interfaces, UndampedChainsGrowWeakly) {
  // Growth per time, at a half and at a quarter of the bulk's limit. Explored: proportional to h3 at every ratio.
  Chain chain(100.0, 0.0);
  double growth[2];
  for (int k = 0; k < 2; ++k) {
    const double step = (k == 0 ? 0.5 : 0.25) * chain.limit;
    const auto stepper = chain.stepper(step);
    const std::vector<double> energy = energy_history(*stepper, 2, k == 0 ? 800 : 5000);
    EXPECT_EQ(levels_of(*stepper)[1], 7);
    EXPECT_LT(levels_of(*stepper)[0], 7);
    EXPECT_GT(energy[1], energy[0]);
    growth[k] = std::log(energy[1] / energy[0]) / (step * (k == 0 ? 800 : 5000));
  }
  EXPECT_GT(growth[0] * 100.0 * 2.0 * std::numbers::pi / std::sqrt(Chain::kStiffness), 1.0);  // visible within 100 periods
  EXPECT_GT(growth[0] / growth[1], 4.0);                                                      // faster than h2
  EXPECT_LT(growth[0] / growth[1], 32.0);                                                     // slower than h5
}

TEST(Interfaces, UndampedChainsOnOneLevelDoNotGrow) {
  Chain chain(100.0, 0.0);
  chain.setup.stepping.levels = 1;
  const auto stepper = chain.stepper(0.5 * chain.limit / 8.0);
  // The energy of this scheme oscillates by a fraction (h w / 2)^2 of its size, 0.4 at the stiffest mode.
  for (const double energy : energy_history(*stepper, 20, 2000)) EXPECT_NEAR(energy, 1.0, 0.4);
}

TEST(Interfaces, ADampingRatioOfTwoHundredthsStopsTheGrowth) {
  for (const double wall_ratio : {25.0, 100.0, 400.0})
    for (const double fraction : {0.95, 0.7, 0.5, 0.25}) {
      SCOPED_TRACE(testing::Message() << "wall " << wall_ratio << " times stiffer, " << fraction << " of the limit");
      Chain chain(wall_ratio, 0.02);
      const auto stepper = chain.stepper(fraction * chain.limit);
      const std::vector<double> energy = energy_history(*stepper, 30, 100);
      const std::vector<int> levels = levels_of(*stepper);
      EXPECT_TRUE(*std::min_element(levels.begin(), levels.end()) < 7 || (wall_ratio < 30.0 && fraction < 0.3));
      EXPECT_LT(*std::max_element(energy.begin(), energy.end()), 1.0);
      EXPECT_LT(energy.back(), 0.02);
      for (std::size_t k = 5; k < energy.size(); ++k) EXPECT_LT(energy[k], energy[k - 5]);
    }
}

}  // namespace
}  // namespace grainclock::multirate
