// Sums that are the same in any order of the balls.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace grainclock::core {

/// The sum of value_of(0) to value_of(n - 1), each rounded to 2^-38 of the largest magnitude: whole numbers of a unit that
/// depends on the largest only. Holds for up to 2^24 values.
template <class ValueOf>
double order_free_sum(std::uint32_t n, ValueOf value_of) {
  double largest = 0.0;
  for (std::uint32_t k = 0; k < n; ++k) largest = std::max(largest, std::abs(value_of(k)));
  const double unit = std::max(largest, std::numeric_limits<double>::min()) * 0x1p-38;
  std::int64_t sum = 0;
  for (std::uint32_t k = 0; k < n; ++k) {
    const double value = value_of(k) / unit;
    sum += static_cast<std::int64_t>(value + std::copysign(0.5, value));
  }
  return unit * static_cast<double>(sum);
}

}  // namespace grainclock::core
