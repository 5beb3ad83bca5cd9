// How densely the content is packed, ball by ball: its solid volume over its Voronoi cell.
//
// The cell is the radical one (power diagram): it holds the points whose tangent to the ball is shorter than to any other,
// so that it contains its ball and its faces go through the contacts, whatever the radii. Wall balls own cells as well,
// which do not count: they end the content's cells at the wall. Plug balls are left out because a state keeps them while the
// outlet is open; so cells at the outlet are open below. voro++ cuts the cells (Rycroft, Chaos 19, 041111, 2009).
#pragma once

#include "core/state.hpp"

#include <cstddef>
#include <optional>
#include <vector>

namespace grainclock::silo {

/// Largest hole beside a ball of the heap, as radius of a ball that fits into it, in mean radii of the content. Holes in a
/// packing are below 1 (simple cubic 0.73), in its loosened zones a ball or two are missing; at the free surface they have
/// no end.
inline constexpr double kLargestHole = 2.0;

/// Volume of each ball's cell [m3], one per ball of the state; NaN for fixed balls and for content whose cell is open: where
/// a corner of the cell is farther from the ball's surface than `largest_hole` mean radii. That leaves out balls at the free
/// surface, at the outlet, and in flight. Throws InputError if two balls have the same centre, or unless largest_hole > 0.
std::vector<double> cell_volumes(const core::State& state, double largest_hole = kLargestHole);

/// Packing fraction of the heap: solid volume over volume of all cells that are not NaN; NaN if there is none.
/// `cells` [m3]: one per ball of the state, as cell_volumes() gives them (so for the next one).
double mean_density(const core::State& state, const std::vector<double>& cells);

/// Packing fraction around each ball: solid volume over volume of its own cell and those of the `neighbours` balls whose
/// centres are nearest, of those with a cell; NaN for balls without. 0 neighbours: of its own cell alone.
std::vector<double> local_density(const core::State& state, const std::vector<double>& cells, std::size_t neighbours);

/// Where the heap is densest.
struct DensityPeak {
  std::size_t ball;  // index in the state
  double density;    // there, as local_density() gives it
  double excess;     // over the mean, as a share of it
  double z;          // m
};
/// The largest value of a field from local_density(); nothing if it is NaN everywhere.
std::optional<DensityPeak> densest(const core::State& state, const std::vector<double>& density, double mean);

}  // namespace grainclock::silo
