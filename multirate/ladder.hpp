// The ladder of steps: step(level) = 2^level ticks, the top step is the coarsest one.
#pragma once

#include "multirate/time_line.hpp"

#include <bit>
#include <cmath>
#include <cstdint>

namespace grainclock::multirate {

class Ladder {
 public:
  /// `coarsest_step` [s] is step(levels - 1). Dividing by a power of two is exact.
  Ladder(double coarsest_step, int levels)
      : tick_(std::ldexp(coarsest_step, 1 - levels)), coarsest_(static_cast<Level>(levels - 1)) {}

  double tick() const { return tick_; }                                            // s
  double step(Level level) const { return tick_ * static_cast<double>(ticks_of(level)); }  // s, exact
  Level coarsest() const { return coarsest_; }
  int levels() const { return coarsest_ + 1; }

  /// The coarsest level with step(level) <= dt; 0 if even the finest is larger. Half-open: dt just below
  /// step(l) belongs to l - 1. A NaN or anything not positive gives 0.
  Level level_of(double dt) const {
    if (!(dt >= tick_)) return 0;
    const int exponent = static_cast<int>(std::bit_cast<std::uint64_t>(dt / tick_) >> 52) - 1023;  // of a double from 1 on
    return exponent < coarsest_ ? static_cast<Level>(exponent) : coarsest_;
  }

 private:
  double tick_;
  Level coarsest_;
};

}  // namespace grainclock::multirate
