#include "silo/density.hpp"

#include "core/check.hpp"
#include "silo/content.hpp"
#include "silo/point_grid.hpp"

#include <voro++/cell.hh>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

double ball_volume(double r) { return 4.0 / 3.0 * std::numbers::pi * r * r * r; }

/// The balls that own cells: content and wall, as indices in the state.
std::vector<std::size_t> generators_of(const State& state) {
  std::vector<std::size_t> generators;
  for (std::size_t i = 0; i < state.size(); ++i)
    if (state.kind[i] != Kind::plug) generators.push_back(i);
  return generators;
}

double largest_radius(const State& state, const std::vector<std::size_t>& balls) {
  double largest = 0.0;
  for (const std::size_t ball : balls) largest = std::max(largest, state.radius[ball]);
  return largest;
}

std::vector<Vec3> centres(const State& state, const std::vector<std::size_t>& balls) {
  std::vector<Vec3> points;
  points.reserve(balls.size());
  for (const std::size_t ball : balls) points.push_back(state.position[ball]);
  return points;
}

/// How far a ball's centre may be whose radical plane still comes as near as `reach` to the centre of a ball of radius r
/// [m]. `largest`: radius of the largest ball [m].
double farthest_partner(double reach, double r, double largest) {
  return reach + std::sqrt(reach * reach + largest * largest - r * r);
}

class CellCutter {
 public:
  CellCutter(const State& state, double largest_hole)
      : state_(state),
        generators_(generators_of(state)),
        largest_(largest_radius(state, generators_)),
        hole_(0.5 * largest_hole * content_of(state).mean_diameter),
        grid_(centres(state, generators_), largest_ + hole_) {}

  /// Volume of the cell of content ball i [m3]; NaN if it is open.
  double volume(std::size_t i) {
    const double r = state_.radius[i], reach = r + hole_;
    // A closed cell lies within reach of the centre, so within this cube, and the cube leaves no face on it.
    cell_.init(-reach, reach, -reach, reach, -reach, reach);
    find_partners(i, farthest_partner(reach, r, largest_));
    for (std::size_t k = 0; k < partners_.size(); ++k) {
      const auto [square, partner] = partners_[k];
      // Enough planes: those of all that are farther pass by the cell. To look at its corners costs as much as a cut.
      if (k % kLook == 0 && farthest_partner(farthest_corner(), r, largest_) < std::sqrt(square)) break;
      const std::size_t j = generators_[partner];
      const Vec3 towards = state_.position[j] - state_.position[i];
      GC_REQUIRE(square > 0.0, "balls {} and {} have the same centre ({}, {}, {}) m: one cell cannot be told from the other; "
                 "remove one", state_.id[i], state_.id[j], state_.position[i][0], state_.position[i][1], state_.position[i][2]);
      // The plane of equal tangents is where x . towards is half of this.
      const double twice = square + r * r - state_.radius[j] * state_.radius[j];
      if (!cell_.plane(towards[0], towards[1], towards[2], twice)) return kNone;
    }
    return farthest_corner() < reach ? cell_.volume() : kNone;
  }

 private:
  static constexpr std::size_t kLook = 8;

  /// Nearest first: cells become small early, and planes that miss them cost little.
  void find_partners(std::size_t i, double distance) {
    partners_.clear();
    grid_.visit_within(state_.position[i], distance, [&](std::uint32_t point, double square) {
      if (generators_[point] != i) partners_.emplace_back(square, point);
    });
    std::sort(partners_.begin(), partners_.end());
  }

  /// From the ball's centre [m]; voro++ keeps its corners at twice the distance.
  double farthest_corner() { return 0.5 * std::sqrt(cell_.max_radius_squared()); }

  const State& state_;
  std::vector<std::size_t> generators_;
  double largest_, hole_;  // m, radii
  PointGrid grid_;
  voro::voronoicell cell_;
  std::vector<std::pair<double, std::uint32_t>> partners_;  // m2, index of a generator
};

void require_one_per_ball(const State& state, const std::vector<double>& values, const char* what) {
  GC_REQUIRE(values.size() == state.size(), "{} {} for {} balls: pass those of the same state", values.size(), what,
             state.size());
}

}  // namespace

std::vector<double> cell_volumes(const State& state, double largest_hole) {
  GC_REQUIRE(largest_hole > 0.0, "largest hole of {} mean radii: must be above 0", largest_hole);
  std::vector<double> volumes(state.size(), kNone);
  if (state.count(Kind::content) == 0) return volumes;
  CellCutter cutter(state, largest_hole);
  for (std::size_t i = 0; i < state.size(); ++i)
    if (state.kind[i] == Kind::content) volumes[i] = cutter.volume(i);
  return volumes;
}

double mean_density(const State& state, const std::vector<double>& cells) {
  require_one_per_ball(state, cells, "cells");
  double solid = 0.0, volume = 0.0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (std::isnan(cells[i])) continue;
    solid += ball_volume(state.radius[i]);
    volume += cells[i];
  }
  return solid / volume;
}

std::vector<double> local_density(const State& state, const std::vector<double>& cells, std::size_t neighbours) {
  require_one_per_ball(state, cells, "cells");
  std::vector<std::size_t> with_cell;
  for (std::size_t i = 0; i < state.size(); ++i)
    if (!std::isnan(cells[i])) with_cell.push_back(i);
  std::vector<double> density(state.size(), kNone);
  if (with_cell.empty()) return density;
  double volume_of_all = 0.0;
  for (const std::size_t i : with_cell) volume_of_all += cells[i];
  const std::size_t together = neighbours + 1;  // the ball itself is the nearest
  const double share = static_cast<double>(together) / static_cast<double>(with_cell.size());
  const PointGrid grid(centres(state, with_cell), std::cbrt(share * volume_of_all));
  for (const std::size_t i : with_cell) {
    double solid = 0.0, volume = 0.0;
    for (const std::uint32_t k : grid.nearest(state.position[i], together)) {
      solid += ball_volume(state.radius[with_cell[k]]);
      volume += cells[with_cell[k]];
    }
    density[i] = solid / volume;
  }
  return density;
}

std::optional<DensityPeak> densest(const State& state, const std::vector<double>& density, double mean) {
  require_one_per_ball(state, density, "densities");
  std::optional<DensityPeak> peak;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (std::isnan(density[i]) || (peak && density[i] <= peak->density)) continue;
    peak = DensityPeak{i, density[i], density[i] / mean - 1.0, state.position[i][2]};
  }
  return peak;
}

}  // namespace grainclock::silo
