#include "silo/filling.hpp"

#include "core/check.hpp"
#include "silo/random.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <string>
#include <tuple>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;

SiloShape full_silo() {
  SiloShape shape;
  shape.collar = 14.0;
  return shape;
}

SiloShape small_silo() {
  SiloShape shape;
  shape.half_width = 1.3;
  shape.half_outlet = 0.7;
  shape.hopper_height = 0.8;
  shape.height = 3.0;
  shape.balls = 60;
  shape.collar = 2.0;
  return shape;
}

// The smallest gap between a content ball and any other ball [m], over cells of one diameter.
double smallest_gap(const State& state) {
  const double cell = 2.0 * *std::max_element(state.radius.begin(), state.radius.end());
  std::map<std::tuple<long, long, long>, std::vector<std::size_t>> cells;
  const auto key = [cell](const Vec3& x) {
    return std::tuple{std::lround(x[0] / cell), std::lround(x[1] / cell), std::lround(x[2] / cell)};
  };
  for (std::size_t i = 0; i < state.size(); ++i) cells[key(state.position[i])].push_back(i);
  double smallest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] != Kind::content) continue;
    const auto [a, b, c] = key(state.position[i]);
    for (long x = a - 1; x <= a + 1; ++x)
      for (long y = b - 1; y <= b + 1; ++y)
        for (long z = c - 1; z <= c + 1; ++z) {
          const auto found = cells.find({x, y, z});
          if (found == cells.end()) continue;
          for (const std::size_t j : found->second)
            if (j != i)
              smallest = std::min(smallest,
                                  (state.position[i] - state.position[j]).norm() - state.radius[i] - state.radius[j]);
        }
  }
  return smallest;
}

TEST(Filling, FullSiloHoldsEveryBallClearOfAllOthers) {
  const Silo silo = build_silo(full_silo(), 1);
  EXPECT_EQ(silo.state.count(Kind::content), 22741u);
  EXPECT_GT(smallest_gap(silo.state), 0.0);
  core::validate(silo.state, "fill");
}

TEST(Filling, EveryShapeHoldsItsBallsClearOfAllOthers) {
  for (const Section section : {Section::round, Section::square})
    for (const Surface surface : {Surface::centres, Surface::inner})
      for (const double hopper_height : {0.0, 0.8}) {
        SiloShape shape = small_silo();
        shape.section = section;
        shape.surface = surface;
        shape.hopper_height = hopper_height;
        const Silo silo = build_silo(shape, 7);
        EXPECT_GT(smallest_gap(silo.state), 0.0);
        EXPECT_EQ(silo.state.count(Kind::content), 60u);
      }
}

TEST(Filling, ContentLiesInsideAboveThePlugAndBelowTheCollarsEdge) {
  const SiloShape shape = full_silo();
  const Silo silo = build_silo(shape, 1);
  const Meridian surface = meridian(shape);
  for (std::size_t i = 0; i < silo.state.size(); ++i) {
    if (silo.state.kind[i] != Kind::content) continue;
    ASSERT_GT(depth_inside(shape.section, surface, silo.state.position[i]), 2.0 * shape.r_max);
    ASSERT_GT(silo.state.position[i][2], 2.0 * shape.r_max);
    ASSERT_LT(silo.state.position[i][2], shape.rim() + shape.collar);
  }
}

TEST(Filling, IdsAreContentThenWallThenPlugThenCollar) {
  const SiloShape shape = full_silo();
  const Silo silo = build_silo(shape, 1);
  const Walls walls = build_walls(shape, 1);
  const auto content = static_cast<std::size_t>(shape.balls);
  const std::size_t plug = content + walls.wall.size(), collar = plug + walls.plug.size();
  ASSERT_EQ(silo.state.size(), collar + walls.collar.size());
  EXPECT_EQ(silo.first_collar, static_cast<core::BallId>(collar));
  for (std::size_t i = 0; i < silo.state.size(); ++i) {
    ASSERT_EQ(silo.state.id[i], static_cast<core::BallId>(i));
    ASSERT_EQ(silo.state.kind[i], i < content ? Kind::content : i < plug || i >= collar ? Kind::wall : Kind::plug);
  }
  EXPECT_EQ(silo.state.position[content], walls.wall[0].at);
  EXPECT_EQ(silo.state.radius[collar], walls.collar[0].radius);
  EXPECT_EQ(silo.report.balls, std::ssize(walls.wall));
}

TEST(Filling, LowestBallsComeFirst) {
  const SiloShape shape = full_silo();
  const Silo silo = build_silo(shape, 1);
  double highest = 0.0;
  for (std::size_t i = 0; i < static_cast<std::size_t>(shape.balls); ++i) {
    // Within a layer heights differ by twice the jitter, 2 % of r_max.
    ASSERT_GT(silo.state.position[i][2], highest - 0.04 * shape.r_max);
    highest = std::max(highest, silo.state.position[i][2]);
  }
}

TEST(Filling, RadiiAreUniformInTheirRange) {
  const Silo silo = build_silo(full_silo(), 1);
  const auto n = 22741;
  const double mean = std::accumulate(silo.state.radius.begin(), silo.state.radius.begin() + n, 0.0) / n;
  double square = 0.0;
  for (int i = 0; i < n; ++i) square += std::pow(silo.state.radius[static_cast<std::size_t>(i)] - mean, 2);
  // Statistics: 4 sigma of the mean (0.01 / sqrt(12 n)) and of the deviation (relative sqrt(0.2 / n)).
  EXPECT_NEAR(mean, 0.22, 4.0 * 0.01 / std::sqrt(12.0 * n));
  EXPECT_NEAR(std::sqrt(square / n) / (0.01 / std::sqrt(12.0)), 1.0, 4.0 * std::sqrt(0.2 / n));
}

TEST(Filling, LayersAreTurnedSoThatNoLatticeRunsThroughThem) {
  // The bond-angle order of a ball and its neighbours in the layer, summed over layers: aligned square layers give 1,
  // layers turned at random 1/sqrt(layers), here about 90; 0.4 is 4 sigma.
  const Silo silo = build_silo(full_silo(), 1);
  double c = 0.0, s = 0.0;
  int bonds = 0;
  for (std::size_t i = 0; i + 1 < 22741; ++i)
    for (std::size_t j = i + 1; j < std::min<std::size_t>(22741, i + 400); ++j) {
      const Vec3 d = silo.state.position[j] - silo.state.position[i];
      if (d.norm() > 0.49 || std::abs(d[2]) > 0.02) continue;
      const double angle = std::atan2(d[1], d[0]);
      c += std::cos(4.0 * angle);
      s += std::sin(4.0 * angle);
      ++bonds;
    }
  ASSERT_GT(bonds, 30000);
  EXPECT_LT(std::hypot(c, s) / bonds, 0.4);
}

TEST(Filling, SameSeedGivesTheSameStateOtherSeedsAnother) {
  const Silo a = build_silo(small_silo(), 3), b = build_silo(small_silo(), 3), c = build_silo(small_silo(), 4);
  EXPECT_EQ(a.state.position, b.state.position);
  EXPECT_EQ(a.state.velocity, b.state.velocity);
  EXPECT_EQ(a.state.radius, b.state.radius);
  EXPECT_NE(a.state.position, c.state.position);
  EXPECT_NE(a.state.radius, c.state.radius);
}

TEST(Filling, TooManyBallsSayHowManyFitAndTheRemedyWorks) {
  SiloShape shape;
  shape.where = "scene.toml:3: [silo]";
  std::string text;
  try {
    build_silo(shape, 1);
  } catch (const core::InputError& error) {
    text = error.what();
  }
  EXPECT_EQ(text.rfind("scene.toml:3: [silo] balls = 22741", 0), 0u) << text;
  const auto at = text.find("give collar = ");
  ASSERT_NE(at, std::string::npos) << text;
  shape.collar = std::stod(text.substr(at + 14));
  EXPECT_EQ(build_silo(shape, 1).state.count(Kind::content), 22741u);
}

TEST(Filling, SiloNarrowerThanItsBallsIsNamed) {
  SiloShape shape = small_silo();
  shape.half_width = 0.44;
  shape.half_outlet = 0.43;
  EXPECT_THROW(build_silo(shape, 1), core::InputError);
}

TEST(Filling, CollarGoesAndNothingElse) {
  Silo silo = build_silo(small_silo(), 1);
  silo.state.level.assign(silo.state.size(), 2);
  const State before = silo.state;
  remove_collar(silo.state, silo.first_collar);
  const auto left = static_cast<std::size_t>(silo.first_collar);
  ASSERT_LT(left, before.size());
  ASSERT_EQ(silo.state.size(), left);
  core::validate(silo.state, "without collar");
  EXPECT_EQ(silo.state.level.size(), left);
  for (std::size_t i = 0; i < left; ++i) {
    ASSERT_EQ(silo.state.id[i], before.id[i]);
    ASSERT_EQ(silo.state.position[i], before.position[i]);
    ASSERT_TRUE(silo.state.kind[i] != Kind::wall || silo.state.position[i][2] < 3.8 + 1e-9);
  }
}

TEST(Filling, GateClearsOnlyWhatIsInItsWay) {
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 0.1}, Vec3::Zero(), 0.2);
  state.add(1, Kind::content, {0.0, 0.0, 0.41}, Vec3::Zero(), 0.2);
  state.add(2, Kind::content, {0.0, 0.3, -0.2}, Vec3::Zero(), 0.2);
  state.add(3, Kind::wall, {0.1, 0.0, 0.0}, Vec3::Zero(), 0.2);
  state.add(4, Kind::plug, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.2);
  EXPECT_EQ(clear_gate(state), (std::vector<core::BallId>{0, 2}));
  EXPECT_EQ(state.id, (std::vector<core::BallId>{1, 3, 4}));
  EXPECT_TRUE(clear_gate(state).empty());
}

TEST(Random, MappingIsPinned) {
  // Laid down by the C++ standard (seed_seq, mt19937_64) and the mapping of the top 53 bits; must never change.
  std::seed_seq sequence{1u, 0u, 2u};
  std::mt19937_64 bits(sequence);
  Random random(1, 2);
  for (int i = 0; i < 5; ++i) EXPECT_EQ(random.between(0.0, 1.0), std::ldexp(static_cast<double>(bits() >> 11), -53));
  EXPECT_NE(Random(1, 2).between(0.0, 1.0), Random(1, 3).between(0.0, 1.0));
}

}  // namespace
}  // namespace grainclock::silo
