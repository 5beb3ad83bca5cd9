#include "silo/surface.hpp"

#include "core/check.hpp"
#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;
using core::Vec3;

void add(State& state, const Vec3& at, double r, Kind kind = Kind::content) {
  state.add(static_cast<core::BallId>(state.size()), kind, at, Vec3::Zero(), r);
}

using Heap = std::vector<std::uint8_t>;

TEST(Heap, HangsTogetherByGapsOfATenthOfADiameter) {
  State state;
  for (const double z : {0.0, 1.05, 2.149}) add(state, {0.0, 0.0, z}, 0.5);  // gaps 0.05 and 0.099
  add(state, {0.0, 0.0, 3.26}, 0.5);                                         // gap 0.111
  add(state, {0.0, 0.0, 4.26}, 0.5);
  EXPECT_EQ(heap(state), (Heap{1, 1, 1, 0, 0}));
  EXPECT_EQ(heap(state, 0.12), (Heap{1, 1, 1, 1, 1}));
  EXPECT_EQ(heap(state, 0.02), (Heap{0, 0, 0, 1, 1}));
}

TEST(Heap, WallBallsLinkNothing) {
  State state;
  add(state, {0.0, 0.0, 0.0}, 0.5);
  add(state, {0.0, 0.0, 1.0}, 0.5, Kind::wall);
  add(state, {0.0, 0.0, 2.0}, 0.5);
  add(state, {0.0, 0.0, 3.0}, 0.5);
  EXPECT_EQ(heap(state), (Heap{0, 0, 1, 1}));
}

TEST(Heap, GapsAreBetweenSurfaces) {
  State state;  // mean diameter 1, so gaps up to 0.1
  add(state, {0.0, 0.0, 0.0}, 0.75);
  add(state, {0.0, 0.0, 1.09}, 0.25);
  add(state, {1.61, 0.0, 0.0}, 0.75);  // 0.11 from the first
  add(state, {0.0, 0.0, -1.0}, 0.25);
  EXPECT_EQ(heap(state), (Heap{1, 1, 0, 1}));
}

TEST(Heap, OfEqualOnesTheOneWithTheLowestBallIsTaken) {
  State state;
  for (const double z : {10.0, 0.0, 1.0, 11.0}) add(state, {0.0, 0.0, z}, 0.5);
  EXPECT_EQ(heap(state), (Heap{1, 0, 0, 1}));
}

// All pairs, and from ball to ball until nothing is added.
TEST(Heap, AgreesWithWalkingOverAllPairs) {
  tests::Random random(4);
  State state;
  for (int i = 0; i < 150; ++i) add(state, random.in_cube(1.0), random.between(0.1, 0.2));
  double diameter = 0.0;
  for (const double r : state.radius) diameter += 2.0 * r / 150.0;
  std::vector<int> group(150, -1), members;
  for (std::size_t first = 0; first < 150; ++first) {
    if (group[first] >= 0) continue;
    const int name = static_cast<int>(members.size());
    members.push_back(0);
    std::vector<std::size_t> open{first};
    group[first] = name;
    while (!open.empty()) {
      const std::size_t i = open.back();
      open.pop_back();
      ++members.back();
      for (std::size_t j = 0; j < 150; ++j) {
        const double gap = (state.position[i] - state.position[j]).norm() - state.radius[i] - state.radius[j];
        if (group[j] < 0 && gap <= kHeapGap * diameter) open.push_back(j), group[j] = name;
      }
    }
  }
  const auto largest = std::max_element(members.begin(), members.end()) - members.begin();
  EXPECT_GT(members.size(), 5U);
  EXPECT_GT(members[largest], 10);
  const Heap found = heap(state);
  for (std::size_t i = 0; i < 150; ++i) EXPECT_EQ(found[i], group[i] == largest) << i;
}

/// Two layers of balls of diameter d [m], one above the other in each column out to `radius`, the upper ones' tops at
/// height(r).
template <class Height>
State surface(double d, double radius, Height height) {
  State state;
  const int n = static_cast<int>(radius / d) + 2;
  for (int i = -n; i < n; ++i) {
    for (int j = -n; j < n; ++j) {
      const double x = (i + 0.5) * d, y = (j + 0.5) * d;
      if (std::hypot(x, y) > radius + d) continue;
      for (const double below : {0.5, 1.5}) add(state, {x, y, height(std::hypot(x, y)) - below * d}, 0.5 * d);
    }
  }
  return state;
}

TEST(Surface, BowlAndMoundAreFoundExactly) {
  for (const double b : {0.02, -0.015, 0.0}) {
    const State state = surface(0.44, 4.6, [b](double r) { return 20.0 + b * r * r; });
    const SurfaceProfile profile = surface_profile(state, {4.6, 9});
    for (std::size_t ring = 0; ring < 9; ++ring) {
      ASSERT_GT(profile.columns[ring], 0);
      // Rounding: heights of 20 m. The mean of a + b r^2 is that of the mean of r^2.
      EXPECT_NEAR(profile.height[ring], 20.0 + b * profile.radius[ring] * profile.radius[ring], 1e-13);
      EXPECT_GE(profile.radius[ring], 4.6 / 9 * static_cast<double>(ring));
      EXPECT_LE(profile.radius[ring], 4.6 / 9 * static_cast<double>(ring + 1));
    }
    const auto dish = fit_dish(profile);
    ASSERT_TRUE(dish);
    EXPECT_NEAR(dish->a, 20.0, 1e-12);  // rounding
    EXPECT_NEAR(dish->b, b, 1e-13);
    EXPECT_NEAR(dish->rise(4.0), 16.0 * b, 1e-11);
  }
}

// A cone z = s r over a disc: with u = r^2 / R^2, uniform from 0 to 1, the best line through sqrt(u) is 4/15 + 4/5 u.
TEST(Surface, ConeGivesItsBestParaboloid) {
  const double s = 0.3, radius = 5.0;
  const State state = surface(0.1, radius, [s](double r) { return 10.0 + s * r; });
  const auto dish = fit_dish(surface_profile(state, {radius, 25}));
  ASSERT_TRUE(dish);
  // Columns are d / R = 2 % wide, rings 4 %: the rim is a staircase, heights are means over rings. A fifth of a column is
  // allowed.
  EXPECT_NEAR(dish->a - 10.0, 4.0 / 15.0 * s * radius, 0.004 * s * radius);
  EXPECT_NEAR(dish->b, 0.8 * s / radius, 0.004 * s / radius);
}

TEST(Surface, BallsInFlightDoNotMakeIt) {
  const auto height = [](double r) { return 20.0 + 0.02 * r * r; };
  State state = surface(0.44, 4.6, height);
  const SurfaceProfile still = surface_profile(state, {4.6, 9});
  tests::Random random(1);
  for (int i = 0; i < 40; ++i) add(state, {random.between(-4.0, 4.0), random.between(-4.0, 4.0), 21.5 + i}, 0.22);
  add(state, {0.1, 0.1, 30.0}, 0.22, Kind::wall);
  for (int i = 0; i < 40; ++i) add(state, {0.0, 0.0, -0.45 * i}, 0.22);  // a chain below the outlet
  const SurfaceProfile rained = surface_profile(state, {4.6, 9});
  EXPECT_EQ(rained.height, still.height);
  EXPECT_EQ(rained.columns, still.columns);
}

TEST(Surface, AColumnBelongsToTheRingOfItsCentre) {
  const State state = surface(1.0, 3.0, [](double) { return 0.0; });
  const SurfaceProfile profile = surface_profile(state, {2.0, 2});
  // Centres at (1/2, 1/2): 0.71; (3/2, 1/2): 1.58; (3/2, 3/2): 2.12, beyond.
  EXPECT_EQ(profile.columns, (std::vector<int>{4, 8}));
  EXPECT_DOUBLE_EQ(profile.radius[0], std::sqrt(0.5));
  EXPECT_DOUBLE_EQ(profile.radius[1], std::sqrt(2.5));
}

TEST(Surface, RingsWithoutColumnsAreNotFitted) {
  State state;
  EXPECT_FALSE(fit_dish(surface_profile(state, {4.0, 8})));
  add(state, {0.1, 0.1, 3.0}, 0.5);
  const SurfaceProfile profile = surface_profile(state, {4.0, 8});
  EXPECT_EQ(profile.columns, (std::vector<int>{0, 1, 0, 0, 0, 0, 0, 0}));
  EXPECT_EQ(profile.height[1], 3.5);
  EXPECT_TRUE(std::isnan(profile.height[0]) && std::isnan(profile.radius[0]));
  EXPECT_FALSE(fit_dish(profile));
}

TEST(Surface, WrongInputIsRejected) {
  EXPECT_THROW(surface_profile({}, {0.0, 3}), core::InputError);
  EXPECT_THROW(surface_profile({}, {1.0, 0}), core::InputError);
  EXPECT_THROW(heap({}, -0.1), core::InputError);
}

}  // namespace
}  // namespace grainclock::silo
