#include "silo/surface.hpp"

#include "core/check.hpp"
#include "silo/content.hpp"
#include "silo/point_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numeric>
#include <utility>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;

/// Disjoint sets of 0 .. n - 1; the smallest member names its set.
class Sets {
 public:
  explicit Sets(std::size_t n) : parent_(n) { std::iota(parent_.begin(), parent_.end(), std::size_t{0}); }

  std::size_t name(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::size_t i, std::size_t j) {
    const std::size_t a = name(i), b = name(j);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::size_t> parent_;
};

/// The balls that hang together, as indices into `content`, by the lowest one.
Sets linked(const State& state, const Content& content, double gap) {
  Sets sets(content.ball.size());
  const PointGrid grid(content.centre, 2.0 * content.largest_radius + gap);
  for (std::size_t a = 0; a < content.ball.size(); ++a) {
    const double r = state.radius[content.ball[a]];
    grid.visit_within(content.centre[a], r + content.largest_radius + gap, [&](std::uint32_t b, double square) {
      const double reach = r + state.radius[content.ball[b]] + gap;
      if (b < a && square <= reach * reach) sets.join(a, b);
    });
  }
  return sets;
}

int ring_at(const Rings& rings, double radius) {
  return std::min(rings.n - 1, static_cast<int>(radius / rings.radius * rings.n));
}

}  // namespace

std::vector<std::uint8_t> heap(const State& state, double gap) {
  GC_REQUIRE(gap >= 0.0, "gap of {} mean diameters within a heap: must be at least 0", gap);
  std::vector<std::uint8_t> in_heap(state.size(), 0);
  const Content content = content_of(state);
  if (content.ball.empty()) return in_heap;
  Sets sets = linked(state, content, gap * content.mean_diameter);
  std::vector<std::size_t> members(content.ball.size(), 0);
  for (std::size_t a = 0; a < members.size(); ++a) ++members[sets.name(a)];
  const auto largest = static_cast<std::size_t>(std::max_element(members.begin(), members.end()) - members.begin());
  for (std::size_t a = 0; a < members.size(); ++a) in_heap[content.ball[a]] = sets.name(a) == largest;
  return in_heap;
}

SurfaceProfile surface_profile(const State& state, const Rings& rings) {
  GC_REQUIRE(rings.radius > 0.0 && rings.n >= 1, "{} rings out to {} m: need at least one, and a radius above 0 m",
             rings.n, rings.radius);
  const std::vector<std::uint8_t> in_heap = heap(state);
  const double width = content_of(state).mean_diameter;
  std::map<std::pair<int, int>, double> tops;  // m, by column
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (!in_heap[i]) continue;
    const Vec3& x = state.position[i];
    const std::pair column{static_cast<int>(std::floor(x[0] / width)), static_cast<int>(std::floor(x[1] / width))};
    double& top = tops.try_emplace(column, -std::numeric_limits<double>::infinity()).first->second;
    top = std::max(top, x[2] + state.radius[i]);
  }
  const auto n = static_cast<std::size_t>(rings.n);
  SurfaceProfile profile{std::vector(n, 0.0), std::vector(n, 0.0), std::vector(n, 0)};
  for (const auto& [column, top] : tops) {
    const double radius = width * std::hypot(column.first + 0.5, column.second + 0.5);
    if (radius > rings.radius) continue;
    const auto ring = static_cast<std::size_t>(ring_at(rings, radius));
    profile.radius[ring] += radius * radius;
    profile.height[ring] += top;
    ++profile.columns[ring];
  }
  for (std::size_t ring = 0; ring < n; ++ring) {
    profile.radius[ring] = std::sqrt(profile.radius[ring] / profile.columns[ring]);
    profile.height[ring] /= profile.columns[ring];
  }
  return profile;
}

std::optional<Dish> fit_dish(const SurfaceProfile& profile) {
  double columns = 0.0, mean_square = 0.0, mean_height = 0.0;
  const auto for_rings = [&](auto use) {
    for (std::size_t ring = 0; ring < profile.columns.size(); ++ring) {
      const double radius = profile.radius[ring];
      if (profile.columns[ring] > 0) use(profile.columns[ring], radius * radius, profile.height[ring]);
    }
  };
  for_rings([&](double weight, double square, double height) {
    columns += weight;
    mean_square += weight * square;
    mean_height += weight * height;
  });
  mean_square /= columns;
  mean_height /= columns;
  double variance = 0.0, covariance = 0.0;
  for_rings([&](double weight, double square, double height) {
    variance += weight * (square - mean_square) * (square - mean_square);
    covariance += weight * (square - mean_square) * (height - mean_height);
  });
  if (!(variance > 0.0)) return std::nullopt;
  const double b = covariance / variance;
  return Dish{mean_height - b * mean_square, b};
}

}  // namespace grainclock::silo
