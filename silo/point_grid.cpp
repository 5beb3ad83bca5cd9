#include "silo/point_grid.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <utility>

namespace grainclock::silo {

PointGrid::PointGrid(std::vector<Vec3> points, double distance) : points_(std::move(points)), distance_(distance) {
  GC_REQUIRE(distance > 0.0, "points to be found within {} m: must be above 0 m", distance);
  if (points_.empty()) return;
  Vec3 low = points_.front(), high = low;
  for (const Vec3& x : points_) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  }
  // A few stray points far away make the cubes larger, not more.
  grid_ = core::CubeGrid(low, high, distance, 8.0 * static_cast<double>(points_.size()) + 64.0);
  sorted_.cube().resize(points_.size());
  for (std::size_t i = 0; i < points_.size(); ++i) sorted_.cube()[i] = static_cast<std::uint32_t>(grid_.index(points_[i]));
  sorted_.sort(grid_.cubes(), 1);
}

std::vector<std::uint32_t> PointGrid::nearest(const Vec3& x, std::size_t n) const {
  n = std::min(n, points_.size());
  std::vector<std::pair<double, std::uint32_t>> found;  // m2
  for (double distance = distance_; found.size() < n; distance *= 1.5) {
    found.clear();
    visit_within(x, distance, [&](std::uint32_t point, double square) { found.emplace_back(square, point); });
  }
  std::partial_sort(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(n), found.end());
  std::vector<std::uint32_t> points(n);
  std::transform(found.begin(), found.begin() + static_cast<std::ptrdiff_t>(n), points.begin(),
                 [](const auto& entry) { return entry.second; });
  return points;
}

}  // namespace grainclock::silo
