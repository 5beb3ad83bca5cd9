#include "benchmarks/scale/settle.hpp"

#include "tests/benchmarks/scale/blocks.hpp"

#include <gtest/gtest.h>

namespace grainclock::scale {
namespace {

using core::Vec3;
using testing::kRadius;

const core::Materials kMaterials;

double overlap(const core::State& state, std::size_t i, std::size_t j) {
  return state.radius[i] + state.radius[j] - (state.position[i] - state.position[j]).norm();
}

core::State pair(double distance) {
  core::State state;
  state.add(3, core::Kind::content, {0.0, 0.0, 0.0}, {0.3, 0.0, 0.0}, kRadius);
  state.add(5, core::Kind::content, {distance, 0.0, 0.0}, Vec3::Zero(), kRadius);
  return state;
}

TEST(PushApart, EndsWithBallsThatTouch) {
  core::State state = pair(0.1);
  push_apart(state, kMaterials, 0.0, 300, 1);
  // Heavy ball: they part at some speed and stop at once when the force ends, as momentum fades within some ten rounds.
  EXPECT_LE(overlap(state, 0, 1), 1e-6);
  EXPECT_GT(overlap(state, 0, 1), -0.5);
  EXPECT_EQ(state.velocity[0], Vec3(0.3, 0.0, 0.0));
}

TEST(PushApart, KeepsTheCentreOfMass) {
  core::State state = pair(0.3);
  const Vec3 before = state.position[0] + state.position[1];
  push_apart(state, kMaterials, 0.0, 300, 1);
  // Moves are kept as floats: 300 of them of at most 2 cm, rounded at 6e-8 of their size.
  EXPECT_LT((state.position[0] + state.position[1] - before).norm(), 2.0 * 300.0 * 0.02 * 6e-8);
}

TEST(PushApart, BallOnTheFloorComesToCarryItsWeight) {
  constexpr double kGravity = 9.81;
  core::State state;
  state.add(0, core::Kind::content, {0.0, 0.0, 0.439}, Vec3::Zero(), kRadius);
  state.add(1, core::Kind::wall, {0.0, 0.0, 0.0}, Vec3::Zero(), kRadius);
  push_apart(state, kMaterials, kGravity, 400, 1);
  const double wanted = kMaterials.mass(kRadius) * kGravity / kMaterials.ball.k;  // as soft as another ball
  // A heavy ball's swing fades by the root of the momentum a round: 0.92^200 of 1 mm is 6e-11 m. Overlaps of balls 0.44 m
  // apart round at 1e-16 m. Together below 1e-5 of 5e-5 m.
  EXPECT_NEAR(overlap(state, 0, 1) / wanted, 1.0, 1e-5);
}

TEST(LoadOf, CountsContactsAndEnergyOfATouchingPair) {
  const core::State state = pair(2.0 * kRadius - 0.001);
  const Load load = load_of(state, kMaterials, 0.0, 1);
  EXPECT_DOUBLE_EQ(load.contacts_per_ball, 0.5);
  EXPECT_NEAR(load.mean_overlap, 0.001, 1e-15);  // rounding of 0.44 m
  EXPECT_NEAR(load.kinetic_per_ball, 0.25 * kMaterials.mass(kRadius) * 0.09, 1e-12);
}

TEST(Settle, BringsAFallenColumnToRest) {
  constexpr double kGravity = 9.81;
  core::State state;
  for (int i = 0; i < 5; ++i) state.add(i, core::Kind::content, {0.0, 0.0, 0.4399 * (i + 1)}, Vec3::Zero(), kRadius);
  state.add(5, core::Kind::wall, {0.0, 0.0, 0.0}, Vec3::Zero(), kRadius);
  const core::State rest = settle(state, kMaterials, kGravity, 1);
  // The lowest contact's wall carries five balls: 2.7 kN on 1e9 N/m. It swings with the column above it, whose periods are longer
  // than what is stepped: within a factor of two.
  const double wanted = 5.0 * kMaterials.mass(kRadius) * kGravity / kMaterials.wall.k;
  EXPECT_GT(overlap(rest, 0, 5), 0.5 * wanted);
  EXPECT_LT(overlap(rest, 0, 5), 2.0 * wanted);
  EXPECT_EQ(rest.time, 0.0);
  EXPECT_TRUE(rest.evaluated_position.empty());
}

}  // namespace
}  // namespace grainclock::scale
