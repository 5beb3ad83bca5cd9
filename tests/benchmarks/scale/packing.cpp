#include "benchmarks/scale/packing.hpp"

#include "core/check.hpp"
#include "tests/benchmarks/scale/blocks.hpp"

#include <gtest/gtest.h>

#include <numeric>

namespace grainclock::scale {
namespace {

using testing::cubic_lattice;
using testing::kRadius;
using testing::kStiffness;
using testing::scattered;

// Sums of a few hundred terms of one size.
constexpr double kRounding = 1e-12;
// What relax_to_pressure() leaves to the pressure, and relax() to the forces.
constexpr double kPressureError = 0.2, kResidual = 1e-2;

TEST(Packing, PressureOfALatticeIsItsFacesForce) {
  constexpr double kOverlap = 0.002;
  Packing packing = cubic_lattice(6, kOverlap);
  const Balance balance = relax(packing, kStiffness);
  const double spacing = 2.0 * kRadius - kOverlap;
  // One contact of force k d on each face of spacing^2, three contacts a ball.
  EXPECT_NEAR(balance.pressure * spacing * spacing / (kStiffness * kOverlap), 1.0, 1e3 * kRounding);  // overlap: 2e-3 of 0.44
  EXPECT_DOUBLE_EQ(balance.contacts_per_ball, 3.0);
}

TEST(Packing, LatticeAtRestStaysWhereItIs) {
  const Packing before = cubic_lattice(6, 0.002);
  Packing after = before;
  relax(after, kStiffness);
  for (std::size_t i = 0; i < before.position.size(); ++i) EXPECT_EQ(before.position[i], after.position[i]);
}

TEST(Packing, ScatteredBallsFindTheirBalance) {
  Packing packing = scattered(400, 0.68);
  const Balance balance = relax(packing, kStiffness);
  EXPECT_LE(balance.residual, kResidual);
  // Without friction a rigid packing has three contacts a ball (less than that: not rigid), its few loose balls apart.
  EXPECT_GT(balance.contacts_per_ball, 2.7);
  EXPECT_LT(balance.contacts_per_ball, 4.5);
}

TEST(Packing, ForcesOnRelaxedBallsAddUpToNothing) {
  Packing packing = scattered(200, 0.68);
  const Vec3 before = std::accumulate(packing.position.begin(), packing.position.end(), Vec3(Vec3::Zero()));
  relax(packing, kStiffness);
  const Vec3 after = std::accumulate(packing.position.begin(), packing.position.end(), Vec3(Vec3::Zero()));
  // Thousands of moves of 200 balls, each rounded at 1e-16 of a metre or so.
  EXPECT_LT((after - before).norm(), 1e-9);
}

TEST(Packing, ReachesThePressureThatIsWanted) {
  Packing packing = scattered(300, 0.60);
  for (const double wanted : {2e4, 2e5}) {
    const Balance balance = relax_to_pressure(packing, kStiffness, wanted);
    EXPECT_NEAR(balance.pressure / wanted, 1.0, kPressureError);
  }
}

TEST(Packing, TooFewBallsAreRefused) {
  core::State state;
  state.add(0, core::Kind::content, {0.5, 0.5, 0.5}, Vec3::Zero(), kRadius);
  EXPECT_THROW(cut(state, Vec3::Zero(), Vec3::Ones()), core::InputError);
}

TEST(Packing, CutTakesContentWithinTheBoxOnly) {
  core::State state;
  for (int i = 0; i < 100; ++i) state.add(i, core::Kind::content, {1.0 + 0.01 * i, 1.5, 1.5}, Vec3::Zero(), kRadius);
  state.add(100, core::Kind::content, {2.0, 1.5, 1.5}, Vec3::Zero(), kRadius);  // on the upper face: the next box's
  state.add(101, core::Kind::wall, {1.5, 1.5, 1.5}, Vec3::Zero(), kRadius);
  const Packing packing = cut(state, Vec3::Ones(), Vec3::Ones());
  ASSERT_EQ(packing.position.size(), 100U);
  EXPECT_EQ(packing.position[0], Vec3(0.0, 0.5, 0.5));
}

TEST(PressureLadder, IsDenserUnderMorePressure) {
  const PressureLadder ladder(scattered(200, 0.66), kStiffness, 1e4, 6.4e5);
  for (double pressure = 1e4; pressure < 6e5; pressure *= 2.0) {
    EXPECT_LT(ladder.number_density(pressure), ladder.number_density(2.0 * pressure));
    EXPECT_NEAR(ladder.number_density(pressure) * ladder.box(pressure).prod(), 200.0, 200.0 * 10.0 * kRounding);
  }
  EXPECT_EQ(ladder.box(0.0), ladder.box(1e3));  // below the lowest rung nothing changes
  EXPECT_EQ(ladder.box(1e9), ladder.box(2e9));  // nor above the highest
}

TEST(PressureLadder, PlacesGoOnFromRungToRung) {
  const PressureLadder ladder(scattered(200, 0.66), kStiffness, 1e4, 6.4e5);
  constexpr double kNudge = 1e-6;
  Vec3 travelled = Vec3::Zero();
  for (double pressure = 5e3; pressure < 1e6; pressure *= 1.02) {
    for (std::size_t i = 0; i < ladder.radius().size(); ++i) {
      const Vec3 step = ladder.share(i, pressure * (1.0 + kNudge)) - ladder.share(i, pressure);
      // No ball moves by a box between rungs, whose pressures differ by more than their half: 2 x nudge per box.
      ASSERT_LT(step.norm(), 2.0 * kNudge);
      travelled += step.cwiseAbs();
    }
  }
  EXPECT_GT(travelled.norm(), 0.0);
}

}  // namespace
}  // namespace grainclock::scale
