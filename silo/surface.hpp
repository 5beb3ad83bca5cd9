// The free surface of the content: which balls lie in the heap, how high it stands over the radius, and whether it is a
// dish.
#pragma once

#include "core/state.hpp"

#include <cstdint>
#include <optional>
#include <vector>

namespace grainclock::silo {

/// Largest gap within a heap, in mean diameters of the content: flowing balls stay linked, falling ones do not.
inline constexpr double kHeapGap = 0.1;

/// 1 for each ball of the heap: the largest set of content balls that hang together by gaps of at most `gap` mean diameters
/// (of equally large ones that with the ball of lowest id). So balls that rain from above or fall below the outlet are none.
/// One per ball of the state. Throws InputError unless gap >= 0.
std::vector<std::uint8_t> heap(const core::State& state, double gap = kHeapGap);

/// n rings of equal width around the silo's axis, from it out to `radius`; a ring holds its inner edge, the last one also
/// `radius`.
struct Rings {
  double radius;  // m
  int n;
};

/// Height of the surface, one entry per ring.
struct SurfaceProfile {
  std::vector<double> radius;  // m, root mean square over the columns; NaN without columns
  std::vector<double> height;  // m, mean over the columns; NaN without columns
  std::vector<int> columns;
};

/// The heap is cut into square columns of one mean diameter, with edges through the axis. A column with the centre of a ball
/// of the heap has the height of the highest such ball's top, and belongs to the ring that its own centre lies in. Throws
/// InputError unless rings.radius > 0 and rings.n >= 1.
SurfaceProfile surface_profile(const core::State& state, const Rings& rings);

/// The paraboloid z = a + b r^2 that fits a profile best.
struct Dish {
  double a;  // m, height at the axis
  double b;  // 1/m; above 0: concave, as the paper has it during discharge; below 0: a mound
  double rise(double radius) const { return b * radius * radius; }  // m, from the axis to a radius [m]
};
/// Least squares over the columns; nothing unless two rings of different radius have any.
std::optional<Dish> fit_dish(const SurfaceProfile& profile);

}  // namespace grainclock::silo
