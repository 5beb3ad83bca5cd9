// Integer time: ticks and levels. Pure functions, no state.
//
// Level 0 is the finest; a ball of level l steps by 2^l ticks, and its steps
// begin and end at multiples of 2^l. Seconds are computed from ticks, never summed.
#pragma once

#include <bit>
#include <compare>
#include <cstdint>

namespace grainclock::multirate {

/// Whole ticks since the coarse step began.
struct Tick {
  std::int64_t count = 0;
  constexpr auto operator<=>(const Tick&) const = default;
};

/// Exponent of a step: 2^level ticks.
using Level = std::uint8_t;
constexpr Level kMostLevels = 12;

/// Length of a step of this level, in ticks.
constexpr std::int64_t ticks_of(Level level) { return std::int64_t{1} << level; }

/// Whether a step of this level ends at this tick.
constexpr bool is_active_at(Level level, Tick tick) { return tick.count % ticks_of(level) == 0; }

/// The coarsest level whose step ends at this tick (> 0); at most `coarsest`.
constexpr Level coarsest_active(Tick tick, Level coarsest) {
  const auto level = static_cast<Level>(std::countr_zero(static_cast<std::uint64_t>(tick.count)));
  return level < coarsest ? level : coarsest;
}

/// Ticks from `tick` to the end of the step of this level that it lies in; 0 at the end.
constexpr std::int64_t ticks_to_end(Level level, Tick tick) {
  const std::int64_t past = tick.count % ticks_of(level);
  return past == 0 ? 0 : ticks_of(level) - past;
}

}  // namespace grainclock::multirate
