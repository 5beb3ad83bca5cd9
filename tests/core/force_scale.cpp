#include "core/force_scale.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

namespace grainclock::core {
namespace {

bool is_power_of_two(double x) {
  int exponent = 0;
  return std::frexp(x, &exponent) == 0.5;
}

struct Scene {
  Materials materials;
  double length;
  int weight_bits;
  std::size_t balls;
};

/// From small to large: the paper's scenes, its printed dampers, glass beads, a million balls, twelve levels.
std::vector<Scene> scenes() {
  Materials printed, beads;
  printed.ball.c = 1e8;
  printed.wall.c = 1e7;
  beads.ball = beads.wall = {1e3, 0.01};
  return {{Materials{}, 0.44, 1, 22741}, {Materials{}, 0.44, 12, 22741}, {printed, 0.44, 1, 500},
          {printed, 0.44, 12, 1000000},  {beads, 0.002, 1, 100000},      {Materials{}, 0.44, 8, 1}};
}

TEST(ForceScale, UnitsArePowersOfTwoAboveTheLimitWanted) {
  for (const Scene& scene : scenes()) {
    const ForceScale scale = force_scale(scene.materials, 9.81, scene.length, scene.weight_bits, scene.balls);
    for (const double x : {scale.limit, scale.unit, scale.total}) EXPECT_TRUE(is_power_of_two(x)) << x;
    const double fall = std::sqrt(2.0 * 9.81 * 100.0 * scene.length);
    for (const PairLaw& law : {scene.materials.ball, scene.materials.wall}) {
      EXPECT_GE(scale.limit, law.k * scene.length / 8.0 + law.c * fall);
    }
    EXPECT_LT(scale.unit, 1e-12 * scale.limit) << "rounding of a sum must not show";
  }
}

TEST(ForceScale, LimitMayBeGiven) {
  EXPECT_EQ(force_scale(Materials{}, 9.81, 0.44, 1, 500, 1000.0).limit, 1024.0);
  EXPECT_EQ(force_scale(Materials{}, 9.81, 0.44, 1, 500, 1024.0).limit, 1024.0);
}

TEST(ForceScale, SumsAtTheLimitDoNotOverflow) {
  constexpr double kMost = 0x1p63;
  for (const Scene& scene : scenes()) {
    const ForceScale scale = force_scale(scene.materials, 9.81, scene.length, scene.weight_bits, scene.balls);
    // A ball with 16 contacts all at the limit and all along one axis, times the largest weight.
    EXPECT_LT(16.0 * std::exp2(scene.weight_bits) * scale.limit / scale.unit, kMost);
    // All balls so at once, and at 64 m/s for the powers.
    EXPECT_LT(16.0 * static_cast<double>(scene.balls) * scale.limit * 64.0 / scale.total, kMost);
  }
}

TEST(ForceScale, SixteenForcesAtTheLimitAreSummedExactly) {
  // The arithmetic itself, through the sweep: a ball in the middle pressed from one side by sixteen others.
  Materials materials;
  const int weight_bits = 8;
  const ForceScale scale = force_scale(materials, 9.81, 0.44, weight_bits, 17);
  const double overlap = 0.05;
  materials.ball = {std::nextafter(scale.limit, 0.0) / overlap * (1.0 - 1e-12), 0.0};  // just within the limit
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.22);
  for (int k = 1; k <= 16; ++k) state.add(k, Kind::content, {-0.44 + overlap, 0.0, 0.0}, Vec3::Zero(), 0.22);
  const Balls balls(state, materials, true);
  std::vector<std::uint32_t> i(16, 0), j(16);
  for (std::uint32_t k = 0; k < 16; ++k) j[k] = k + 1;
  const SweepLaw law = sweep_law(materials, false, scale, 0.0);
  std::vector<WeightedSum> sums(18);
  SweepTotals totals;
  kernels().sweep_weighted(balls.rows.data(), {i.data(), j.data(), 16}, law, weight_bits, sums.data(), totals, nullptr);
  EXPECT_FALSE(totals.overloaded);
  EXPECT_NEAR(static_cast<double>(sums[0].force.v[0]) * scale.unit, 16.0 * scale.limit, 1e-9 * scale.limit);
  EXPECT_NEAR(static_cast<double>(sums[0].impulse.v[0]) * scale.unit, std::ldexp(16.0 * scale.limit, weight_bits),
              1e-9 * std::ldexp(scale.limit, weight_bits));
  std::int64_t reaction = 0;
  for (int k = 1; k <= 16; ++k) reaction += sums[k].impulse.v[0];
  EXPECT_EQ(reaction, -sums[0].impulse.v[0]);
}

TEST(ForceScale, QuantisationNeverBreaksMomentum) {
  // Two balls in touch, forces from below a unit to the limit: action and reaction are the same integers.
  tests::Random random(1);
  const Materials materials;
  const ForceScale scale = force_scale(materials, 9.81, 0.44, 1, 2);
  const SweepLaw law = sweep_law(materials, false, scale, 0.0);
  for (int trial = 0; trial < 500; ++trial) {
    State state;
    const double overlap = std::pow(10.0, random.between(-17.0, -1.5));
    state.add(0, Kind::content, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.22);
    state.add(1, Kind::content, (0.44 - overlap) * random.direction(), random.direction(), 0.22);
    const Balls balls(state, materials, true);
    std::vector<std::uint32_t> i(8, 0), j(8, balls.far_row());
    j[0] = 1;
    std::vector<IntVec> sums(3);
    SweepTotals totals;
    kernels().sweep(balls.rows.data(), {i.data(), j.data(), 8}, law, sums.data(), totals, nullptr);
    for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(sums[0].v[axis], -sums[1].v[axis]);
  }
}

TEST(SweepLaw, CarriesTheMaterialsOfItsKind) {
  Materials materials;
  materials.cohesion = 1e4;
  materials.tension = true;
  const ForceScale scale = force_scale(materials, 9.81, 0.44, 1, 10);
  const SweepLaw ball = sweep_law(materials, false, scale, 1e-5), wall = sweep_law(materials, true, scale, 1e-5);
  EXPECT_EQ(ball.law.k, materials.ball.k);
  EXPECT_EQ(ball.law.c, materials.ball.c);
  EXPECT_EQ(ball.law.reach, 1e4 / materials.ball.k);
  EXPECT_TRUE(ball.law.tension);
  EXPECT_TRUE(ball.both);
  EXPECT_EQ(wall.law.k, materials.wall.k);
  EXPECT_EQ(wall.law.c, materials.wall.c);
  EXPECT_EQ(wall.law.reach, 1e4 / materials.wall.k);
  EXPECT_FALSE(wall.both);
  EXPECT_EQ(wall.step, 1e-5);
  EXPECT_EQ(ball.per_unit * scale.unit, 1.0);
  EXPECT_EQ(ball.per_total * scale.total, 1.0);
  EXPECT_EQ(ball.force_limit, scale.limit);
}

}  // namespace
}  // namespace grainclock::core
