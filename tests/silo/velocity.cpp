#include "silo/velocity.hpp"

#include "core/check.hpp"
#include "silo/random.hpp"

#include <gtest/gtest.h>
#include <Eigen/Geometry>

#include <cmath>
#include <limits>
#include <numbers>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;

// Some roundings of numbers of order one to ten.
constexpr double kRounding = 1e-13;

/// Balls of many radii anywhere in a cylinder of radius 5 m and height 8 m, velocities by a function of the place.
template <class Velocity>
State content(int n, Velocity&& velocity) {
  Random random(1, 7);
  State state;
  while (state.size() < static_cast<std::size_t>(n)) {
    const Vec3 at(random.between(-5.0, 5.0), random.between(-5.0, 5.0), random.between(0.0, 8.0));
    const double radius = random.between(0.1, 0.3);
    if (at.head<2>().norm() > 5.0) continue;
    state.add(static_cast<core::BallId>(state.size()), Kind::content, at, velocity(at), radius);
  }
  return state;
}

TEST(VerticalSection, SeesTheBallsOfItsSlabFromTheSide) {
  State state;
  state.add(3, Kind::content, {0.3, 2.0, 7.0}, {3.0, 4.0, -12.0}, 0.21);
  state.add(4, Kind::wall, {-0.4, -5.0, 6.0}, Vec3::Zero(), 0.22);
  state.add(5, Kind::content, {0.51, 1.0, 7.0}, Vec3::Zero(), 0.22);
  const auto balls = section_balls(state, {std::numbers::pi / 2.0, 1.0});  // towards y
  ASSERT_EQ(balls.size(), 2u);
  EXPECT_EQ(balls[0].id, 3);
  EXPECT_EQ(balls[0].kind, Kind::content);
  EXPECT_NEAR(balls[0].along, 2.0, kRounding);
  EXPECT_EQ(balls[0].z, 7.0);
  EXPECT_NEAR(balls[0].v_along, 4.0, kRounding);
  EXPECT_EQ(balls[0].v_z, -12.0);
  EXPECT_NEAR(balls[0].speed, 13.0, kRounding);  // 3-4-12
  EXPECT_EQ(balls[0].radius, 0.21);
  EXPECT_EQ(balls[1].kind, Kind::wall);
  EXPECT_NEAR(balls[1].along, -5.0, kRounding);
}

TEST(VerticalSection, HoldsItsFaces) {
  State state;
  state.add(0, Kind::content, {1.0, 0.5, 1.0}, Vec3::Zero(), 0.2);
  state.add(1, Kind::content, {1.0, -0.5, 1.0}, Vec3::Zero(), 0.2);
  state.add(2, Kind::content, {1.0, std::nextafter(0.5, 1.0), 1.0}, Vec3::Zero(), 0.2);
  EXPECT_EQ(section_balls(state, {0.0, 1.0}).size(), 2u);
}

TEST(VerticalSection, TurnsWithTheContent) {
  const State state = content(500, [](const Vec3& at) { return Vec3(at[1], at[0] * at[2], -at[0]); });
  const double angle = 1.234;
  const Eigen::AngleAxisd turn(angle, Vec3::UnitZ());
  State turned;
  for (std::size_t i = 0; i < state.size(); ++i)
    turned.add(state.id[i], state.kind[i], turn * state.position[i], turn * state.velocity[i], state.radius[i]);
  const auto before = section_balls(state, {0.0, 0.8}), after = section_balls(turned, {angle, 0.8});
  ASSERT_EQ(after.size(), before.size());
  ASSERT_GT(before.size(), 20u);
  for (std::size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(after[i].id, before[i].id);
    EXPECT_NEAR(after[i].along, before[i].along, kRounding);
    EXPECT_NEAR(after[i].v_along, before[i].v_along, 10.0 * kRounding);  // velocities up to 40 m/s
    EXPECT_NEAR(after[i].speed, before[i].speed, 10.0 * kRounding);
  }
}

TEST(MeanMotion, IsTheWayOverTheTimeOfTheBallsThatStay) {
  State before, after;
  before.time = 2.0;
  after.time = 2.5;
  before.add(1, Kind::content, {1.0, 0.0, 3.0}, {9.0, 9.0, 9.0}, 0.2);
  before.add(2, Kind::content, {0.0, 0.0, 0.1}, {0.0, 0.0, -5.0}, 0.2);  // leaves
  before.add(4, Kind::content, {2.0, 0.0, 3.0}, {7.0, 0.0, 0.0}, 0.2);   // jitters
  before.add(8, Kind::wall, {5.0, 0.0, 3.0}, Vec3::Zero(), 0.21);
  after.add(1, Kind::content, {1.5, 0.0, 2.0}, Vec3::Zero(), 0.2);
  after.add(3, Kind::content, {1.0, 1.0, 9.0}, Vec3::Zero(), 0.2);  // comes
  after.add(4, Kind::content, {2.0, 0.0, 3.0}, {-7.0, 0.0, 0.0}, 0.2);
  after.add(8, Kind::wall, {5.0, 0.0, 3.0}, Vec3::Zero(), 0.21);
  const State mean = mean_motion(before, after);
  EXPECT_EQ(mean.time, 2.25);
  EXPECT_EQ(mean.id, (std::vector<core::BallId>{1, 4, 8}));
  EXPECT_EQ(mean.position[0], Vec3(1.25, 0.0, 2.5));
  EXPECT_EQ(mean.velocity[0], Vec3(1.0, 0.0, -2.0));
  EXPECT_EQ(mean.velocity[1], Vec3(0.0, 0.0, 0.0));
  EXPECT_EQ(mean.kind[2], Kind::wall);
  EXPECT_EQ(mean.radius[2], 0.21);
  EXPECT_THROW(mean_motion(after, before), core::InputError);
  after.kind[0] = Kind::wall;
  EXPECT_THROW(mean_motion(before, after), core::InputError);
}

TEST(VelocityFields, UniformFlowIsUniformUpToItsBoundary) {
  const Vec3 v(0.3, -0.2, -1.5);
  const State state = content(400, [&](const Vec3&) { return v; });
  const auto field = horizontal_velocity(state, {4.0, 2.0}, {-8.0, 8.0, 17}, {-8.0, 8.0, 17}, 1.0);
  int known = 0;
  for (const Vec3& at : field.velocity) {
    if (std::isnan(at[0])) continue;
    ++known;
    EXPECT_LT((at - v).norm(), kRounding);
  }
  EXPECT_GT(known, 60);
  EXPECT_TRUE(std::isnan(field.at(0, 0)[2])) << "nobody is there";
  const State falling = content(3000, [](const Vec3&) { return Vec3(0.0, 0.0, -1.5); });
  const auto meridional = meridional_velocity(falling, {0.0, 5.0, 6}, {0.0, 8.0, 9}, 1.0);
  for (const Vec3& at : meridional.velocity) EXPECT_LT((at - Vec3(0.0, 0.0, -1.5)).norm(), kRounding);
}

TEST(VelocityFields, ShearOfASquareLatticeIsReproducedAtItsPoints) {
  State state;
  for (int i = -6; i <= 6; ++i)
    for (int j = -6; j <= 6; ++j)
      state.add(13 * (i + 6) + j + 6, Kind::content, {0.5 * i, 0.5 * j, 3.0}, {2.0 * 0.5 * j, -0.7 * 0.5 * i, 0.1 * i}, 0.2);
  const auto field = horizontal_velocity(state, {3.0, 0.1}, {-1.5, 1.5, 7}, {-1.5, 1.5, 7}, 1.4);
  for (int i = 0; i < 7; ++i)
    for (int j = 0; j < 7; ++j) {
      const double x = field.first.at(i), y = field.second.at(j);
      EXPECT_LT((field.at(i, j) - Vec3(2.0 * y, -0.7 * x, 0.2 * x)).norm(), kRounding)
          << i << " " << j;  // symmetry: neighbours cancel
    }
}

TEST(VelocityFields, TwoBallsOfUnequalMassByHand) {
  State state;
  state.add(0, Kind::content, {1.0, 0.0, 5.0}, {0.0, 0.0, -1.0}, 0.1);
  state.add(1, Kind::content, {2.0, 0.0, 5.0}, {0.0, 0.0, -3.0}, 0.2);
  state.add(2, Kind::wall, {2.0, 0.0, 5.0}, Vec3::Zero(), 0.2);
  state.add(3, Kind::content, {2.0, 0.0, 5.26}, {0.0, 0.0, 9.0}, 0.2);  // above the slab
  const auto field = horizontal_velocity(state, {5.0, 0.5}, {1.0, 2.0, 3}, {0.0, 1.0, 2}, 2.0);
  // Distances over reach 0.25 and 0.25: the masses 1 and 8 count. At the first ball 0 and 0.5: kernel 1 and 2.5 / 8.
  EXPECT_NEAR(field.at(1, 0)[2], -(1.0 + 8.0 * 3.0) / 9.0, kRounding);
  EXPECT_NEAR(field.at(0, 0)[2], -(1.0 + 2.5 * 3.0) / 3.5, kRounding);
}

TEST(VelocityFields, MeridionalPartsAreRadialTangentialAndVertical) {
  // A ring of balls which all move outward by 0.5, along the ring by 2 and down by 1 m/s.
  State state;
  for (int k = 0; k < 12; ++k) {
    const double a = 0.3 + k * std::numbers::pi / 6.0;
    const Vec3 out(std::cos(a), std::sin(a), 0.0), around(-std::sin(a), std::cos(a), 0.0);
    state.add(k, Kind::content, 3.0 * out + 6.0 * Vec3::UnitZ(), 0.5 * out + 2.0 * around - Vec3::UnitZ(), 0.22);
  }
  const auto field = meridional_velocity(state, {2.5, 3.5, 3}, {5.5, 6.5, 3}, 0.9);
  for (const Vec3& at : field.velocity) EXPECT_LT((at - Vec3(0.5, 2.0, -1.0)).norm(), kRounding);
}

TEST(VelocityFields, BallsNearEnoughAreAllCountedAndNoOthers) {
  const State state = content(600, [](const Vec3& at) { return Vec3(-at[0], 2.0 * at[0], at[2] * at[1]); });
  const GridAxis r{0.2, 4.7, 8}, z{-1.0, 9.0, 13};
  const double reach = 0.77;
  const auto field = meridional_velocity(state, r, z, reach);
  for (int i = 0; i < r.n; ++i)
    for (int j = 0; j < z.n; ++j) {
      Vec3 momentum = Vec3::Zero();
      double mass = 0.0;
      for (std::size_t b = 0; b < state.size(); ++b) {
        const Vec3 &x = state.position[b], &v = state.velocity[b];
        const double radius = x.head<2>().norm(), q = std::hypot(radius - r.at(i), x[2] - z.at(j)) / reach;
        if (q >= 1.0) continue;
        const double weight = std::pow(state.radius[b], 3) * (1.0 + 3.0 * q) * std::pow(1.0 - q, 3);
        mass += weight;
        momentum += weight * Vec3((x[0] * v[0] + x[1] * v[1]) / radius, (x[0] * v[1] - x[1] * v[0]) / radius, v[2]);
      }
      if (mass == 0.0)
        EXPECT_TRUE(std::isnan(field.at(i, j)[0]));
      else
        EXPECT_LT((field.at(i, j) - momentum / mass).norm(), 10.0 * kRounding);  // velocities up to 40 m/s
    }
}

TEST(VelocityFields, RigidRotationHasATangentialPartOnly) {
  const State state = content(600, [](const Vec3& at) { return Vec3(-0.4 * at[1], 0.4 * at[0], 0.0); });
  const double reach = 0.6;
  const auto field = meridional_velocity(state, {0.5, 4.5, 9}, {1.0, 7.0, 4}, reach);
  for (int i = 0; i < 9; ++i)
    for (int j = 0; j < 4; ++j) {
      EXPECT_NEAR(field.at(i, j)[0], 0.0, kRounding);
      EXPECT_NEAR(field.at(i, j)[1], 0.4 * field.first.at(i), 0.4 * reach);  // a mean over balls within reach
      EXPECT_EQ(field.at(i, j)[2], 0.0);
    }
}

TEST(VelocityFields, ImpossibleOnesAreRejected) {
  const GridAxis fine{0.0, 1.0, 3};
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(section_balls({}, {0.0, 0.0}), core::InputError);
  EXPECT_THROW(meridional_velocity({}, {0.0, 1.0, 1}, fine, 1.0), core::InputError);
  EXPECT_THROW(meridional_velocity({}, fine, {1.0, 1.0, 3}, 1.0), core::InputError);
  EXPECT_THROW(meridional_velocity({}, {-1.0, 1.0, 3}, fine, 1.0), core::InputError);
  EXPECT_THROW(meridional_velocity({}, fine, fine, 0.0), core::InputError);
  EXPECT_THROW(horizontal_velocity({}, {0.0, nan}, fine, fine, 1.0), core::InputError);
  EXPECT_THROW(horizontal_velocity({}, {0.0, 1.0}, fine, fine, nan), core::InputError);
}

}  // namespace
}  // namespace grainclock::silo
