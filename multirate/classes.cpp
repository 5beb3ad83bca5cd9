#include "multirate/classes.hpp"

#include <bit>
#include <cstdint>
#include <limits>

namespace grainclock::multirate {

double shared_reach4(const std::vector<double>& strides4, std::size_t balls, double error_factor, double tolerance) {
  // Counted in classes of a sixteenth of an octave, the leading bits of the numbers: no sort, and no order.
  constexpr int kBits = 16;
  std::vector<std::uint32_t> count(std::size_t{1} << (kBits - 1));  // positive numbers
  for (const double stride4 : strides4) ++count[std::bit_cast<std::uint64_t>(stride4) >> (64 - kBits)];
  const double allowed = affordable4(balls, error_factor, tolerance);
  double below = 0.0, above = static_cast<double>(strides4.size());
  for (std::uint64_t k = 0; above > 0.0; ++k) {
    if (count[k] == 0) continue;
    const double largest = std::bit_cast<double>((k + 1) << (64 - kBits));
    if (below + above * largest > allowed) return (allowed - below) / above;
    const double here = static_cast<double>(count[k]);
    below += here * largest;
    above -= here;
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace grainclock::multirate
