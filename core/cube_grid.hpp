// Equal cubes over a box, and the sort of points into them (the paper, section 3).
#pragma once

#include "core/state.hpp"

#include <algorithm>
#include <vector>

namespace grainclock::core {

/// Cubes over a box. What lies outside belongs to the cubes of the rim, so points that are near each other are in
/// neighbouring cubes wherever they are.
class CubeGrid {
 public:
  CubeGrid() = default;
  /// Cubes of at least `edge` [m]; larger ones where the box would take more than `most`.
  CubeGrid(const Vec3& low, const Vec3& high, double edge, double most);

  std::size_t cubes() const { return static_cast<std::size_t>(size_[0]) * size_[1] * size_[2]; }
  const std::int32_t* size() const { return size_; }

  /// Cube coordinate along an axis; a NaN goes to cube 0.
  std::int32_t coordinate(double x, int axis) const {
    const double scaled = (x - low_[axis]) * inverse_edge_;
    return scaled > 0.0 ? static_cast<std::int32_t>(std::min(scaled, last_[axis])) : 0;
  }
  std::size_t index(std::int32_t x, std::int32_t y, std::int32_t z) const {
    return (static_cast<std::size_t>(z) * size_[1] + y) * size_[0] + x;
  }
  std::size_t index(const Vec3& x) const { return index(coordinate(x[0], 0), coordinate(x[1], 1), coordinate(x[2], 2)); }

  /// Calls visit(first, last) for each line of cubes along x, from first to last, that together hold all that is within
  /// `margin` [m] of x in every coordinate.
  template <class Visit>
  void visit_lines(const Vec3& x, double margin, Visit visit) const {
    const std::int32_t x0 = coordinate(x[0] - margin, 0), x1 = coordinate(x[0] + margin, 0);
    const std::int32_t y0 = coordinate(x[1] - margin, 1), y1 = coordinate(x[1] + margin, 1);
    const std::int32_t z0 = coordinate(x[2] - margin, 2), z1 = coordinate(x[2] + margin, 2);
    for (std::int32_t z = z0; z <= z1; ++z) {
      for (std::int32_t y = y0; y <= y1; ++y) visit(index(x0, y, z), index(x1, y, z));
    }
  }
  /// Calls visit(cube) for each cube that has a point within `distance` [m] of x.
  template <class Visit>
  void visit_cubes(const Vec3& x, double distance, Visit visit) const {
    std::int32_t first[3], last[3];
    for (int k = 0; k < 3; ++k) {
      first[k] = coordinate(x[k] - distance, k);
      last[k] = coordinate(x[k] + distance, k);
    }
    const auto square_of_gap = [&](int axis, std::int32_t cube) {
      const double begin = low_[axis] + cube * edge_ - x[axis], gap = std::max({begin, -begin - edge_, 0.0});
      return gap * gap;
    };
    for (std::int32_t c = first[2]; c <= last[2]; ++c) {
      for (std::int32_t b = first[1]; b <= last[1]; ++b) {
        const double gap2 = square_of_gap(2, c) + square_of_gap(1, b);
        for (std::int32_t a = first[0]; a <= last[0]; ++a) {
          if (gap2 + square_of_gap(0, a) <= distance * distance) visit(index(a, b, c));
        }
      }
    }
  }

 private:
  Vec3 low_ = Vec3::Zero();
  double edge_ = 1.0, inverse_edge_ = 1.0;  // m, 1/m
  double last_[3] = {0.0, 0.0, 0.0};        // size - 1
  std::int32_t size_[3] = {1, 1, 1};
};

/// Points in order of their cubes, within a cube as they were. Keeps its memory.
class CubeSort {
 public:
  /// The cube of each point, to be filled in before sort().
  std::vector<std::uint32_t>& cube() { return cube_; }
  void sort(std::size_t cubes, int threads);

  /// The points of cube c are order()[start()[c] .. start()[c + 1]).
  const std::vector<std::uint32_t>& order() const { return order_; }
  const std::uint32_t* start() const { return start_.data(); }

 private:
  std::vector<std::uint32_t> cube_, order_, start_;
};

}  // namespace grainclock::core
