// Bounds the difference of level across a contact.
#pragma once

#include "core/kernels.hpp"
#include "multirate/time_line.hpp"

#include <span>

namespace grainclock::multirate {

/// Makes balls finer until the levels of every pair differ by at most `largest_difference`.
/// Demotes only, so the fixed point is unique, whatever the order of the pairs. `is_active(p)` says
/// whether pair p counts. Returns the number of demotions.
template <class IsActive>
std::size_t limit_levels(std::span<Level> level, const core::PairSpan& pairs, std::size_t count, int largest_difference,
                         IsActive is_active) {
  std::size_t demotions = 0;
  for (bool changed = true; changed;) {
    changed = false;
    for (std::size_t p = 0; p < count; ++p) {
      Level& a = level[pairs.i[p]];
      Level& b = level[pairs.j[p]];
      Level& coarser = a > b ? a : b;
      const int allowed = (a > b ? b : a) + largest_difference;
      if (coarser > allowed && is_active(p)) {  // the rarer condition first
        coarser = static_cast<Level>(allowed);
        ++demotions;
        changed = true;
      }
    }
  }
  return demotions;
}

}  // namespace grainclock::multirate
