// Bounds the difference of level across a contact.
#pragma once

#include "core/kernels.hpp"
#include "core/share_work.hpp"
#include "multirate/time_line.hpp"

#include <span>
#include <vector>

namespace grainclock::multirate {

/// Room for the pairs that a look finds beyond the limit, one list per thread.
using PairsBeyond = std::vector<std::vector<std::uint32_t>>;

/// Makes balls finer until the levels of every pair differ by at most `largest_difference`.
/// Demotes only, so the fixed point is unique, whatever the order of the pairs and the number of threads, which is
/// that of the lists of `found`. `is_active(p)` says whether pair p counts. Returns the number of demotions.
template <class IsActive>
std::size_t limit_levels(std::span<Level> level, const core::PairSpan& pairs, std::size_t count, int largest_difference,
                         IsActive is_active, PairsBeyond& found) {
  const int threads = static_cast<int>(found.size());
  std::size_t demotions = 0;
  for (bool changed = true; changed;) {
    // Looking takes long, demoting does not.
    core::share_range(count, threads, [&](int t, std::size_t begin, std::size_t end) {
      std::vector<std::uint32_t>& mine = found[static_cast<std::size_t>(t)];
      mine.clear();
      for (std::size_t p = begin; p < end; ++p) {
        const int difference = level[pairs.i[p]] - level[pairs.j[p]];
        if ((difference > largest_difference || -difference > largest_difference) && is_active(p)) {
          mine.push_back(static_cast<std::uint32_t>(p));
        }
      }
    });
    changed = false;
    for (const std::vector<std::uint32_t>& some : found) {
      for (const std::uint32_t p : some) {
        Level& a = level[pairs.i[p]];
        Level& b = level[pairs.j[p]];
        Level& coarser = a > b ? a : b;
        const int allowed = (a > b ? b : a) + largest_difference;
        if (coarser <= allowed) continue;
        coarser = static_cast<Level>(allowed);
        ++demotions;
        changed = true;
      }
    }
  }
  return demotions;
}

}  // namespace grainclock::multirate
