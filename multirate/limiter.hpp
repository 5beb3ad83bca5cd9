// Bounds the difference of level across a contact.
#pragma once

#include "multirate/pairs_by_ball.hpp"
#include "multirate/time_line.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <vector>

namespace grainclock::multirate {

/// Makes balls finer until the levels of every pair differ by at most `largest_difference`.
/// Demotes only, so the fixed point is unique, whatever the order of the pairs. `is_active(p)` says whether pair p counts.
/// Returns the number of balls that have become finer.
template <class IsActive>
std::size_t limit_levels(std::span<Level> level, const PairsByBall& pairs, int largest_difference, IsActive is_active) {
  const int coarsest = level.empty() ? 0 : *std::max_element(level.begin(), level.end());
  // Few balls are so fine that others may have to follow. The finest come first: what they ask of others holds.
  std::array<std::vector<std::uint32_t>, kMostLevels> fine;
  const auto note = [&](std::uint32_t ball) {
    if (level[ball] + largest_difference < coarsest) fine[level[ball]].push_back(ball);
  };
  for (std::uint32_t ball = 0; ball < level.size(); ++ball) note(ball);
  std::size_t demotions = 0;
  for (const std::vector<std::uint32_t>& balls : fine) {
    for (const std::uint32_t ball : balls) {
      const auto allowed = static_cast<Level>(level[ball] + largest_difference);
      pairs.for_each(ball, [&](std::uint32_t p, std::uint32_t partner) {
        if (level[partner] <= allowed || !is_active(p)) return;
        level[partner] = allowed;
        ++demotions;
        note(partner);
      });
    }
  }
  return demotions;
}

}  // namespace grainclock::multirate
