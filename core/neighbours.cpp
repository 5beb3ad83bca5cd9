#include "core/neighbours.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace grainclock::core {

namespace {

/// Cubes over a box, and counting sort of points into them.
class CubeGrid {
 public:
  CubeGrid(const Vec3& low, const Vec3& high, double edge, std::size_t points) : low_(low) {
    // Scattered balls (free fall, blow-up) must not cost memory: at most a few cubes per ball.
    const double most = 16.0 * static_cast<double>(points) + 4096.0;
    for (;;) {
      double cubes = 1.0;
      for (int k = 0; k < 3; ++k) cubes *= std::floor((high[k] - low[k]) / edge) + 1.0;
      if (cubes <= most) break;
      edge *= 1.5;
    }
    inverse_edge_ = 1.0 / edge;
    for (int k = 0; k < 3; ++k) size_[k] = static_cast<std::int32_t>((high[k] - low[k]) * inverse_edge_) + 1;
  }

  std::size_t cube_count() const { return static_cast<std::size_t>(size_[0]) * size_[1] * size_[2]; }
  std::int32_t size(int axis) const { return size_[axis]; }

  /// Cube coordinate along an axis, clamped into the grid.
  std::int32_t coordinate(double x, int axis) const {
    const double scaled = (x - low_[axis]) * inverse_edge_;
    // A NaN goes to cube 0; the sweep finds it.
    return scaled > 0.0 ? static_cast<std::int32_t>(std::min(scaled, static_cast<double>(size_[axis] - 1))) : 0;
  }
  std::size_t index(std::int32_t x, std::int32_t y, std::int32_t z) const {
    return (static_cast<std::size_t>(z) * size_[1] + y) * size_[0] + x;
  }
  std::size_t index(double x, double y, double z) const {
    return index(coordinate(x, 0), coordinate(y, 1), coordinate(z, 2));
  }

 private:
  Vec3 low_;
  double inverse_edge_ = 1.0;
  std::int32_t size_[3] = {1, 1, 1};
};

/// Members of cubes: `member[start[c] .. start[c + 1])`.
struct CubeMembers {
  std::vector<std::uint32_t> start, member;

  template <class CubeOf>
  CubeMembers(std::size_t cubes, std::size_t points, CubeOf cube_of) : start(cubes + 1, 0), member(points) {
    std::vector<std::uint32_t> cube(points);
    for (std::size_t p = 0; p < points; ++p) ++start[(cube[p] = static_cast<std::uint32_t>(cube_of(p))) + 1];
    std::partial_sum(start.begin(), start.end(), start.begin());
    std::vector<std::uint32_t> next(start.begin(), start.end() - 1);
    for (std::size_t p = 0; p < points; ++p) member[next[cube[p]]++] = static_cast<std::uint32_t>(p);
  }
};

/// A ball's reference and how far around it a partner matters: radius, skin and (once too often, harmless) reach [m].
struct Sphere {
  double x, y, z, reach;
};

/// Balls with an uncommonly wide skin: they are paired with each other by brute force.
constexpr std::size_t kMostWide = 200;

/// The smallest value that at most `few` of `values` exceed; 0 if there are no more than those.
double all_but_few(std::vector<double>& values, std::size_t few) {
  if (values.size() <= few) return 0.0;
  const auto nth = values.end() - static_cast<std::ptrdiff_t>(few) - 1;
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

}  // namespace

void PairList::clear() {
  i.clear();
  j.clear();
  count = 0;
}

void PairList::finish(std::uint32_t far) {
  count = i.size();
  while (i.size() % kLanes != 0) add(0, far);
}

SkinRule SkinRule::for_diameter(double mean_diameter) {
  SkinRule rule;
  const double scale = mean_diameter / 0.44;
  rule.floor *= scale;
  rule.lifetime *= std::sqrt(scale);  // speeds go with sqrt(g d)
  return rule;
}

std::vector<std::uint32_t> NeighbourList::build(Balls& balls, const std::vector<std::uint8_t>& leaving) {
  ++builds_;
  // A moving ball's reference lies half a lifetime ahead of it; its skin covers the way there and on.
  const auto shifted = [this](const BallRow& row) {
    const double t = 0.5 * rule_.lifetime;
    return Vec3(row.x + row.vx * t, row.y + row.vy * t, row.z + row.vz * t);
  };
  const auto skin_of = [this](const BallRow& row) {
    const double speed = std::sqrt(row.vx * row.vx + row.vy * row.vy + row.vz * row.vz);
    return rule_.floor + (0.5 * rule_.lifetime + rule_.ahead) * speed;
  };

  std::vector<std::uint32_t> kept;
  kept.reserve(balls.content_count());
  for (std::uint32_t i = 0; i < balls.content_count(); ++i) {
    if (leaving.empty() || leaving[i] == 0) kept.push_back(i);
  }
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  const auto widen = [&](const Vec3& x) {
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
  };
  for (const std::uint32_t i : kept) {
    const Vec3 x = shifted(balls.rows[i]);
    if (x.allFinite()) widen(x);
  }
  if ((low.array() > high.array()).any()) low = high = Vec3::Zero();  // no ball, or none that is finite
  // A cube allows for a skin that all balls but the fastest few have; those look into more cubes.
  std::vector<double> skins;
  skins.reserve(kept.size());
  for (const std::uint32_t i : kept) skins.push_back(skin_of(balls.rows[i]));
  const double common_skin = std::max(rule_.floor, all_but_few(skins, kMostWide));
  const double edge = 2.0 * balls.largest_radius + reach_ + 2.0 * common_skin;
  const CubeGrid grid(low, high, edge, kept.size());

  const CubeMembers sorted(grid.cube_count(), kept.size(), [&](std::size_t p) {
    const Vec3 x = shifted(balls.rows[kept[p]]);
    return grid.index(x.x(), x.y(), x.z());
  });
  {
    std::vector<std::uint32_t> order(kept.size());
    for (std::size_t p = 0; p < kept.size(); ++p) order[p] = kept[sorted.member[p]];
    kept.swap(order);
  }
  balls.reorder(kept);
  const std::vector<std::uint32_t>& cube_start = sorted.start;  // of the sorted rows

  const std::uint32_t n = balls.content_count();
  skins_.resize(n);
  std::vector<Sphere> sphere(n);
  std::vector<std::uint8_t> is_wide(n, 0);
  std::vector<std::uint32_t> wide;  // rows with more than the common skin
  for (std::uint32_t i = 0; i < n; ++i) {
    const Vec3 x = shifted(balls.rows[i]);
    const double skin = skin_of(balls.rows[i]);
    skins_[i] = {x.x(), x.y(), x.z(), skin * skin};
    sphere[i] = {x.x(), x.y(), x.z(), balls.rows[i].r + skin + reach_};
    if (skin <= common_skin) continue;
    is_wide[i] = 1;
    wide.push_back(i);
  }
  // Fixed balls outside the grid by more than a cube edge are clamped into its rim: harmless, only tested in vain.
  const std::uint32_t fixed = balls.fixed_count();
  const CubeMembers fixed_members(grid.cube_count(), fixed, [&](std::size_t f) {
    const BallRow& row = balls.rows[balls.first_fixed_row() + f];
    return grid.index(row.x, row.y, row.z);
  });

  const auto is_within = [](const Sphere& a, const Sphere& b) {
    const double dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z, range = a.reach + b.reach;
    return dx * dx + dy * dy + dz * dz <= range * range;
  };

  struct Part {
    PairList balls, fixed;
  };
  std::vector<Part> parts(static_cast<std::size_t>(threads_));
#pragma omp parallel for num_threads(threads_) schedule(static, 1)
  for (int part = 0; part < threads_; ++part) {
    Part& out = parts[static_cast<std::size_t>(part)];
    const std::uint32_t begin = static_cast<std::uint32_t>(std::uint64_t{n} * part / threads_);
    const std::uint32_t end = static_cast<std::uint32_t>(std::uint64_t{n} * (part + 1) / threads_);
    for (std::uint32_t i = begin; i < end; ++i) {
      const Sphere& at = sphere[i];
      // Along x the cubes of a row are one run of members.
      const auto cubes = [&](double margin, auto visit) {
        const std::int32_t x0 = grid.coordinate(at.x - margin, 0), x1 = grid.coordinate(at.x + margin, 0);
        const std::int32_t y0 = grid.coordinate(at.y - margin, 1), y1 = grid.coordinate(at.y + margin, 1);
        const std::int32_t z0 = grid.coordinate(at.z - margin, 2), z1 = grid.coordinate(at.z + margin, 2);
        for (std::int32_t z = z0; z <= z1; ++z) {
          for (std::int32_t y = y0; y <= y1; ++y) visit(grid.index(x0, y, z), grid.index(x1, y, z) + 1);
        }
      };
      const double range = at.reach + balls.largest_radius + common_skin;
      cubes(range, [&](std::size_t first, std::size_t last) {
        // Rows are sorted by cube: a run of cubes is a run of rows. Each pair once: from the wide ball, else from the lower row.
        const std::uint32_t from = is_wide[i] ? cube_start[first] : std::max(cube_start[first], i + 1);
        for (std::uint32_t j = from; j < cube_start[last]; ++j) {
          if (is_within(at, sphere[j]) && !is_wide[j]) out.balls.add(std::min(i, j), std::max(i, j));
        }
        for (std::uint32_t m = fixed_members.start[first]; m < fixed_members.start[last]; ++m) {
          const std::uint32_t row = balls.first_fixed_row() + fixed_members.member[m];
          const BallRow& other = balls.rows[row];
          if (is_within(at, {other.x, other.y, other.z, other.r})) out.fixed.add(i, row);
        }
      });
      if (is_wide[i]) {
        for (const std::uint32_t j : wide) {
          if (j > i && is_within(at, sphere[j])) out.balls.add(i, j);
        }
      }
    }
  }
  ball_pairs_.clear();
  fixed_pairs_.clear();
  for (const Part& part : parts) {
    ball_pairs_.i.insert(ball_pairs_.i.end(), part.balls.i.begin(), part.balls.i.end());
    ball_pairs_.j.insert(ball_pairs_.j.end(), part.balls.j.begin(), part.balls.j.end());
    fixed_pairs_.i.insert(fixed_pairs_.i.end(), part.fixed.i.begin(), part.fixed.i.end());
    fixed_pairs_.j.insert(fixed_pairs_.j.end(), part.fixed.j.begin(), part.fixed.j.end());
  }
  ball_pairs_.finish(balls.far_row());
  fixed_pairs_.finish(balls.far_row());
  return kept;
}

std::vector<std::pair<std::uint32_t, std::uint32_t>> brute_force_pairs(const Balls& balls, double reach) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
  for (std::uint32_t i = 0; i < balls.content_count(); ++i) {
    for (std::uint32_t j = i + 1; j < balls.rows.size(); ++j) {
      if (j == balls.far_row()) continue;
      const double distance = (position(balls.rows[i]) - position(balls.rows[j])).norm();
      if (distance - balls.rows[i].r - balls.rows[j].r <= reach) pairs.emplace_back(i, j);
    }
  }
  return pairs;
}

}  // namespace grainclock::core
