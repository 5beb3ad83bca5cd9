// All listed pairs of one kind as last recorded and classified.
#pragma once

#include "multirate/needs.hpp"

namespace grainclock::multirate {

struct PairBook {
  std::vector<float> overlap, rate;  // see core::PairRecords
  std::vector<core::PairDirection> direction;
  std::vector<Level> level;   // at which the pair is evaluated, or kSkipped
  std::vector<Level> before;  // the same before the present renewal

  /// Room for a new list of `pairs` pairs, whole vectors, that have had no level yet.
  void begin(std::size_t pairs) {
    overlap.resize(pairs);
    rate.resize(pairs);
    direction.resize(pairs);
    level.assign(pairs, kSkipped);
    before.assign(pairs, kSkipped);
  }
  /// Pairs that touch though they were skipped: missed contacts.
  std::uint64_t skipped_contacts() const {
    std::uint64_t count = 0;
    for (std::size_t p = 0; p < level.size(); ++p) count += (level[p] == kSkipped) & (overlap[p] > 0.0F) ? 1 : 0;
    return count;
  }
  core::PairRecords records(std::size_t first) {
    return {overlap.data() + first, rate.data() + first, direction.data() + first};
  }
};

}  // namespace grainclock::multirate
