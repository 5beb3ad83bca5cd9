#include "silo/point_grid.hpp"

#include "core/check.hpp"
#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace grainclock::silo {
namespace {

/// A crowd, some of it in the same place, and two strays far away.
std::vector<Vec3> crowd() {
  tests::Random random(2);
  std::vector<Vec3> points;
  for (int i = 0; i < 300; ++i) points.push_back(random.in_cube(1.0));
  for (int i = 0; i < 5; ++i) points.push_back(points[7]);
  points.emplace_back(0.0, 0.0, -4000.0);
  points.emplace_back(900.0, 0.0, 0.0);
  return points;
}

TEST(PointGrid, PointsWithinADistanceAreThoseOfBruteForce) {
  const std::vector<Vec3> points = crowd();
  const PointGrid grid(points, 0.3);
  for (const double distance : {0.0, 0.1, 0.3, 0.7, 5000.0}) {
    for (const Vec3& x : {points[7], Vec3(0.2, -0.9, 1.4), points.back()}) {
      std::vector<std::uint32_t> found, all;
      grid.visit_within(x, distance, [&](std::uint32_t point, double square) {
        found.push_back(point);
        EXPECT_EQ(square, (points[point] - x).squaredNorm());
      });
      for (std::uint32_t i = 0; i < points.size(); ++i)
        if ((points[i] - x).squaredNorm() <= distance * distance) all.push_back(i);
      std::sort(found.begin(), found.end());
      EXPECT_EQ(found, all) << distance;
    }
  }
}

TEST(PointGrid, NearestPointsAreThoseOfBruteForce) {
  const std::vector<Vec3> points = crowd();
  for (const double distance : {0.01, 0.3, 10.0}) {
    const PointGrid grid(points, distance);
    for (const Vec3& x : {points[7], points[100], Vec3(3.0, 3.0, 3.0), points.back()}) {
      for (const std::size_t n : {0UL, 1UL, 3UL, 12UL, 306UL, 1000UL}) {
        std::vector<std::uint32_t> all(points.size());
        for (std::uint32_t i = 0; i < all.size(); ++i) all[i] = i;
        std::stable_sort(all.begin(), all.end(), [&](std::uint32_t a, std::uint32_t b) {
          return (points[a] - x).squaredNorm() < (points[b] - x).squaredNorm();
        });
        all.resize(std::min(n, all.size()));
        EXPECT_EQ(grid.nearest(x, n), all) << n;
      }
    }
  }
}

TEST(PointGrid, NoPointsAreNearAnything) {
  const PointGrid grid({}, 1.0);
  grid.visit_within(Vec3::Zero(), 1e9, [](std::uint32_t, double) { FAIL(); });
  EXPECT_TRUE(grid.nearest(Vec3::Zero(), 3).empty());
}

TEST(PointGrid, ADistanceOfNothingIsRejected) { EXPECT_THROW(PointGrid({}, 0.0), core::InputError); }

}  // namespace
}  // namespace grainclock::silo
