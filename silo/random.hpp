// Uniform numbers that are the same on every machine.
//
// The bits of std::mt19937_64 and std::seed_seq are laid down by the standard,
// what std::uniform_real_distribution makes of them is not.
#pragma once

#include <cstdint>
#include <random>

namespace grainclock::silo {

class Random {
 public:
  /// Streams of one seed are independent of each other.
  Random(std::uint64_t seed, std::uint32_t stream) {
    std::seed_seq sequence{static_cast<std::uint32_t>(seed), static_cast<std::uint32_t>(seed >> 32), stream};
    bits_.seed(sequence);
  }

  /// Uniform in [low, high].
  double between(double low, double high) {
    const double unit = static_cast<double>(bits_() >> 11) * 0x1p-53;  // [0, 1), every double of the grid as likely
    return low + (high - low) * unit;
  }

 private:
  std::mt19937_64 bits_;
};

}  // namespace grainclock::silo
