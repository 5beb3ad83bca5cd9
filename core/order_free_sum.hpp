// Sums that are the same in any order of the balls.
#pragma once

#include "core/state.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>

namespace grainclock::core {

/// What rounds values to whole numbers: 2^-38 of the largest magnitude. So up to 2^24 values have an exact sum.
/// Its inverse is finite, also where all are zero.
inline double order_free_unit(double largest) { return std::max(largest * 0x1p-38, std::numeric_limits<double>::min()); }

/// The sum of value_of(0) to value_of(n - 1), none below zero, each rounded to the unit of the largest. NaN if one of them is
/// not finite.
template <class ValueOf>
double order_free_sum(std::uint32_t n, ValueOf value_of) {
  double largest = 0.0;
  bool is_finite = true;
  for (std::uint32_t k = 0; k < n; ++k) {
    const double value = value_of(k);
    largest = std::max(largest, value);
    is_finite = is_finite && std::isfinite(value);
  }
  if (!is_finite) return std::numeric_limits<double>::quiet_NaN();
  const double unit = order_free_unit(largest);
  std::int64_t sum = 0;
  // At most 2^38 units: adding a half is exact but just below a half.
  for (std::uint32_t k = 0; k < n; ++k)
    sum += static_cast<std::int64_t>(value_of(k) / unit + 0.5);  // NOLINT(bugprone-incorrect-roundings)
  return unit * static_cast<double>(sum);
}

/// The same of vectors with components of any sign, which share the unit of the largest component.
template <class VectorOf>
Vec3 order_free_vector_sum(std::uint32_t n, VectorOf vector_of) {
  double largest = 0.0;
  bool is_finite = true;
  for (std::uint32_t k = 0; k < n; ++k) {
    const Vec3 value = vector_of(k);
    largest = std::max(largest, value.cwiseAbs().maxCoeff());
    is_finite = is_finite && value.allFinite();
  }
  if (!is_finite) return Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
  const double per_unit = 1.0 / order_free_unit(largest);
  std::array<std::int64_t, 3> sum{};
  for (std::uint32_t k = 0; k < n; ++k) {
    const Vec3 units = vector_of(k) * per_unit;
    for (int axis = 0; axis < 3; ++axis) sum[static_cast<std::size_t>(axis)] += std::llrint(units[axis]);
  }
  return order_free_unit(largest) * Vec3(static_cast<double>(sum[0]), static_cast<double>(sum[1]), static_cast<double>(sum[2]));
}

}  // namespace grainclock::core
