#include "benchmarks/scale/scaled_silo.hpp"

#include "core/check.hpp"
#include "tests/benchmarks/scale/blocks.hpp"

#include <gtest/gtest.h>

#include <numbers>

namespace grainclock::scale {
namespace {

constexpr double kGravity = 9.81;
constexpr std::int64_t kBalls = 12000;

const core::Materials kMaterials;
const silo::SiloShape kShape;  // Table 1

/// Balls as dense as in a silo, in a small box: made once.
const Packing& block() {
  static const Packing packing = [] {
    Packing made = testing::scattered(300, 0.64);
    relax_to_pressure(made, kMaterials.ball.k, 5e4);
    return made;
  }();
  return packing;
}

core::State filled(double factor, std::int64_t balls) { return tile(block(), kShape, factor, balls, kMaterials, kGravity, 1); }

TEST(ScaledSilo, HoldsWhatWasAskedForInOrderOfHeight) {
  const core::State state = filled(1.0, kBalls);
  core::validate(state, "tiled silo");
  ASSERT_EQ(state.count(core::Kind::content), static_cast<std::size_t>(kBalls));
  for (std::int64_t i = 1; i < kBalls; ++i) ASSERT_LE(state.position[i - 1].z(), state.position[i].z());
  const silo::Walls walls = silo::build_walls(kShape, 1);
  EXPECT_EQ(state.count(core::Kind::wall), walls.wall.size());
  EXPECT_EQ(state.count(core::Kind::plug), walls.plug.size());
}

TEST(ScaledSilo, IsFilledEvenlyAndOnlyInside) {
  const core::State state = filled(1.0, kBalls);
  const silo::Meridian surface = silo::meridian(kShape);
  std::int64_t counted = 0;
  constexpr double kInner = 3.5, kLow = 6.0, kHigh = 12.0;  // m, well inside the cylinder and under the surface
  for (std::int64_t i = 0; i < kBalls; ++i) {
    const Vec3& x = state.position[i];
    EXPECT_GT(silo::depth_inside(kShape.section, surface, x), 0.0);
    EXPECT_GT(x.z(), 0.0);
    if (std::hypot(x.x(), x.y()) < kInner && x.z() > kLow && x.z() < kHigh) ++counted;
  }
  const double density = static_cast<double>(block().radius.size()) / block().box.prod();
  const double expected = density * std::numbers::pi * kInner * kInner * (kHigh - kLow);
  // 3,300 balls: their number in a cut scatters by less than its square root (2 %); pressure changes the density by 1 %.
  EXPECT_NEAR(static_cast<double>(counted) / expected, 1.0, 0.03);
}

TEST(ScaledSilo, BallsInTheBulkOverlapAsTheirLoadAsks) {
  const core::State state = filled(1.0, kBalls);
  // Between 6 and 8 m, in the middle.
  std::vector<std::size_t> inner;
  for (std::size_t i = 0; i < static_cast<std::size_t>(kBalls); ++i) {
    const Vec3& x = state.position[i];
    if (std::hypot(x.x(), x.y()) < 3.0 && x.z() > 6.0 && x.z() < 8.0) inner.push_back(i);
  }
  double sum = 0.0, deepest = 0.0;
  std::size_t contacts = 0;
  for (const std::size_t i : inner)
    for (const std::size_t j : inner) {
      const double overlap = state.radius[i] + state.radius[j] - (state.position[i] - state.position[j]).norm();
      if (j >= i || overlap <= 0.0) continue;
      sum += overlap;
      deepest = std::max(deepest, overlap);
      ++contacts;
    }
  // p = n_c F d / 3 with n_c contacts per volume, 14.4 x 3.2: about 7 m under the top 54 kPa, F = 8 kN, overlap 0.8 mm.
  // Rungs of pressure stand a factor of 4 apart: within a factor of 2.
  EXPECT_GT(sum / static_cast<double>(contacts), 0.4e-3);
  EXPECT_LT(sum / static_cast<double>(contacts), 1.6e-3);
  // Forces in a packing scatter, but hardly one is beyond six times the mean; a bad seam would overlap by centimetres.
  EXPECT_LT(deepest, 10e-3);
}

TEST(ScaledSilo, LargerSiloHasALargerShape) {
  constexpr std::int64_t kMany = 60000;
  const core::State state = filled(2.0, kMany);
  double highest = 0.0, widest = 0.0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] != core::Kind::wall) continue;
    highest = std::max(highest, state.position[i].z());
    widest = std::max(widest, std::hypot(state.position[i].x(), state.position[i].y()));
  }
  // Centres of the wall's balls lie on the nominal surface: 50 m high, 10 m in radius. Rounding.
  EXPECT_NEAR(highest, 50.0, 1e-9);
  EXPECT_NEAR(widest, 10.0, 1e-9);
}

TEST(ScaledSilo, TooManyBallsAreRefused) { EXPECT_THROW(filled(1.0, 40000), core::InputError); }

TEST(ScaledSilo, OnlyTheRoundSiloIsScaled) {
  silo::SiloShape square;
  square.section = silo::Section::square;
  EXPECT_THROW(interior(filled(1.0, kBalls), square), core::InputError);
}

}  // namespace
}  // namespace grainclock::scale
