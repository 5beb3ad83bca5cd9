// Points sorted into cubes, to be asked what lies near a place.
#pragma once

#include "core/cube_grid.hpp"

#include <cstdint>
#include <vector>

namespace grainclock::silo {

using core::Vec3;

/// A copy of some points; they are known by their index in the vector given.
class PointGrid {
 public:
  /// `distance` [m], above 0: about how far one will look.
  PointGrid(std::vector<Vec3> points, double distance);

  std::size_t size() const { return points_.size(); }
  const Vec3& at(std::size_t point) const { return points_[point]; }

  /// Calls visit(index, squared distance [m2]) for every point within `distance` [m] of x, in a fixed order.
  template <class Visit>
  void visit_within(const Vec3& x, double distance, Visit visit) const {
    if (points_.empty()) return;
    grid_.visit_lines(x, distance, [&](std::size_t first, std::size_t last) {
      for (std::uint32_t k = sorted_.start()[first]; k < sorted_.start()[last + 1]; ++k) {
        const std::uint32_t point = sorted_.order()[k];
        const double square = (points_[point] - x).squaredNorm();
        if (square <= distance * distance) visit(point, square);
      }
    });
  }

  /// The n points nearest to x, all if there are fewer; nearest first, equally near ones by index.
  std::vector<std::uint32_t> nearest(const Vec3& x, std::size_t n) const;

 private:
  std::vector<Vec3> points_;
  double distance_;
  core::CubeGrid grid_;
  core::CubeSort sorted_;
};

}  // namespace grainclock::silo
