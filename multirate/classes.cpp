#include "multirate/classes.hpp"

#include <algorithm>
#include <bit>
#include <cstdint>
#include <limits>

namespace grainclock::multirate {

double shared_reach4(const std::vector<double>& strides4, std::size_t balls, double error_factor, double tolerance) {
  if (strides4.empty()) return std::numeric_limits<double>::infinity();
  // Counted in classes of a sixteenth of an octave, the leading bits of the numbers: no sort, and no order.
  constexpr int kBits = 16;
  const auto class_of = [](double stride4) { return std::bit_cast<std::uint64_t>(stride4) >> (64 - kBits); };
  double smallest = strides4[0], greatest = strides4[0];
  for (const double stride4 : strides4) {
    smallest = std::min(smallest, stride4);
    greatest = std::max(greatest, stride4);
  }
  const std::uint64_t first = class_of(smallest);
  std::vector<std::uint32_t> count(class_of(greatest) - first + 1);
  for (const double stride4 : strides4) ++count[class_of(stride4) - first];
  const double allowed = affordable4(balls, error_factor, tolerance);
  double below = 0.0, above = static_cast<double>(strides4.size());
  for (std::uint64_t k = 0; k < count.size(); ++k) {
    if (count[k] == 0) continue;
    const double largest = std::bit_cast<double>((first + k + 1) << (64 - kBits));
    if (below + above * largest > allowed) return (allowed - below) / above;
    const double here = static_cast<double>(count[k]);
    below += here * largest;
    above -= here;
  }
  return std::numeric_limits<double>::infinity();
}

}  // namespace grainclock::multirate
