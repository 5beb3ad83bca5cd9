// Where the fixed balls are, prepared once: which of them content at a place can meet.
#pragma once

#include "core/balls.hpp"
#include "core/cube_grid.hpp"

namespace grainclock::core {

class FixedBalls {
 public:
  /// Lists the fixed balls of `balls` for content whose reach (see find()) is mostly below `reach` [m].
  void prepare(const Balls& balls, double reach);
  /// Whether content of this reach finds all that it can meet at one place.
  bool serves(double reach) const { return (reach + largest_radius_) * kRounding <= range_; }

  /// Calls use(number, is_within) for fixed balls, and for all whose surface is within `reach` [m] of x, in ascending order.
  /// If `reach` is not served, in any order and maybe more than once.
  template <class Use>
  void find(const Vec3& x, double reach, Use use) const;

 private:
  static constexpr double kRounding = 1.0 + 1e-6;  // far above that of cube coordinates

  template <class Use>
  void find_at(std::size_t cube, const Vec3& x, double reach, Use use) const;

  struct Ball {
    double x, y, z, r;  // m
  };
  std::vector<Ball> ball_;
  CubeGrid grid_;
  /// Numbers near_[start_[c]] .. near_[start_[c + 1]] are within range of cube c, ascending.
  std::vector<std::uint32_t> start_, near_;
  double range_ = 0.0, largest_radius_ = 0.0;  // m
};

template <class Use>
void FixedBalls::find_at(std::size_t cube, const Vec3& x, double reach, Use use) const {
  const double at[3] = {x.x(), x.y(), x.z()};
  const std::uint32_t* const end = near_.data() + start_[cube + 1];
  for (const std::uint32_t* number = near_.data() + start_[cube]; number < end; ++number) {
    const Ball& b = ball_[*number];
    const double dx = at[0] - b.x, dy = at[1] - b.y, dz = at[2] - b.z, range = reach + b.r;
    use(*number, dx * dx + dy * dy + dz * dz <= range * range);
  }
}

template <class Use>
void FixedBalls::find(const Vec3& x, double reach, Use use) const {
  if (ball_.empty()) return;
  if (serves(reach)) return find_at(grid_.index(x), x, reach, use);
  grid_.visit_lines(x, (reach + largest_radius_) * kRounding, [&](std::size_t first, std::size_t last) {
    for (std::size_t cube = first; cube <= last; ++cube) find_at(cube, x, reach, use);
  });
}

}  // namespace grainclock::core
