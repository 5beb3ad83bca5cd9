#include "core/fixed_balls.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

namespace grainclock::core {

namespace {

constexpr double kRoom = 1.1;          // so that somewhat faster content needs no new preparation
constexpr double kEdge = 0.75;         // of the range: smaller cubes take more memory, larger ones more candidates
constexpr double kCubesPerBall = 4.0;  // at most, content included
constexpr double kCubesAnyway = 4096.0;

}  // namespace

void FixedBalls::prepare(const Balls& balls, double reach) {
  ball_.clear();
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (std::size_t row = balls.first_fixed_row(); row < balls.rows.size(); ++row) {
    const BallRow& b = balls.rows[row];
    ball_.push_back({b.x, b.y, b.z, b.r});
    largest_radius_ = std::max(largest_radius_, b.r);
    low = low.cwiseMin(position(b));
    high = high.cwiseMax(position(b));
  }
  if (ball_.empty()) return;
  range_ = kRoom * (reach + largest_radius_);
  // Content outside this box meets nothing, so it does no harm that it is counted to the rim.
  const Vec3 margin = Vec3::Constant(range_);
  grid_ = CubeGrid(low - margin, high + margin, kEdge * range_,
                   kCubesPerBall * static_cast<double>(balls.rows.size()) + kCubesAnyway);
  const auto for_each_place = [&](auto use) {
    for (std::uint32_t f = 0; f < ball_.size(); ++f) {
      grid_.visit_cubes({ball_[f].x, ball_[f].y, ball_[f].z}, range_ * kRounding, [&](std::size_t cube) { use(f, cube); });
    }
  };
  start_.assign(grid_.cubes() + 2, 0);  // see CubeSort::sort()
  for_each_place([&](std::uint32_t, std::size_t cube) { ++start_[cube + 2]; });
  std::partial_sum(start_.begin(), start_.end(), start_.begin());
  near_.resize(start_.back());
  for_each_place([&](std::uint32_t f, std::size_t cube) { near_[start_[cube + 1]++] = f; });
}

}  // namespace grainclock::core
