// Integer units in which forces are summed: exact sums, independent of order.
#pragma once

#include "core/kernels.hpp"
#include "core/materials.hpp"

namespace grainclock::core {

/// Powers of two chosen from the scene, so that sums of forces within the limit never overflow.
struct ForceScale {
  double limit = 0.0;   // N, a contact force beyond it means that the numerics have failed
  double unit = 0.0;    // N, of force sums
  double total = 0.0;   // N or W, of sums over all contacts
};

/// `length` [m] is the scene's mean ball diameter, `weight_bits` the bits of the largest weight that
/// multiplies a force sum, `balls` the number of content balls, `limit` [N] overrides the default:
/// the spring at an overlap of length/8 and the dashpot at the speed of a fall through 100 lengths.
ForceScale force_scale(const Materials& materials, double gravity, double length, int weight_bits, std::size_t balls,
                       double limit = 0.0);

/// The law of content against content (fixed = false) or against fixed balls, ready to sweep.
SweepLaw sweep_law(const Materials& materials, bool fixed, const ForceScale& scale, double step);

}  // namespace grainclock::core
