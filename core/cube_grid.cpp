#include "core/cube_grid.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace grainclock::core {

CubeGrid::CubeGrid(const Vec3& low, const Vec3& high, double edge, double most) : low_(low), edge_(edge) {
  const auto along = [&](int axis) { return std::floor((high[axis] - low[axis]) / edge_) + 1.0; };
  while (along(0) * along(1) * along(2) > most) edge_ *= 1.25;
  inverse_edge_ = 1.0 / edge_;
  for (int k = 0; k < 3; ++k) {
    size_[k] = static_cast<std::int32_t>((high[k] - low[k]) * inverse_edge_) + 1;
    last_[k] = static_cast<double>(size_[k] - 1);
  }
}

void CubeSort::sort(std::size_t cubes, int threads) {
  start_.resize(cubes + 2);
  // Each thread looks at all points and takes those of its own cubes: nothing to be summed over threads, and the same order
  // for any number of them.
  const auto for_own_points = [&](int t, auto use) {
    const std::size_t first = cubes * t / threads, own = cubes * (t + 1) / threads - first;
    for (std::size_t p = 0; p < cube_.size(); ++p) {
      if (cube_[p] - first < own) use(static_cast<std::uint32_t>(p), cube_[p]);
    }
  };
  // Counted two places up, summed, and moved on by the points put in place, an entry ends as where the next cube starts.
  start_[0] = start_[1] = 0;
#pragma omp parallel for num_threads(threads) schedule(static, 1) if (threads > 1)
  for (int t = 0; t < threads; ++t) {
    std::fill(start_.begin() + 2 + cubes * t / threads, start_.begin() + 2 + cubes * (t + 1) / threads, 0U);
    for_own_points(t, [&](std::uint32_t, std::uint32_t cube) { ++start_[cube + 2]; });
  }
  std::partial_sum(start_.begin(), start_.end(), start_.begin());
  order_.resize(start_.back());
#pragma omp parallel for num_threads(threads) schedule(static, 1) if (threads > 1)
  for (int t = 0; t < threads; ++t) {
    for_own_points(t, [&](std::uint32_t point, std::uint32_t cube) { order_[start_[cube + 1]++] = point; });
  }
}

}  // namespace grainclock::core
