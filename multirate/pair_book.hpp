// All listed pairs of one kind as last recorded and classified.
#pragma once

#include "multirate/needs.hpp"

namespace grainclock::multirate {

struct PairBook {
  std::vector<double> overlap, rate, speed;  // see core::PairRecords
  std::vector<core::Normal> normal;
  std::vector<Level> level;   // at which the pair is evaluated, or kSkipped
  std::vector<Level> before;  // the same before the present renewal

  /// Room for a new list of `pairs` pairs, whole vectors, that have had no level yet.
  void begin(std::size_t pairs) {
    for (auto* v : {&overlap, &rate, &speed}) v->resize(pairs);
    normal.resize(pairs);
    level.assign(pairs, kSkipped);
    before.assign(pairs, kSkipped);
  }
  core::PairRecords records(std::size_t first) {
    return {overlap.data() + first, rate.data() + first, speed.data() + first, normal.data() + first};
  }
};

}  // namespace grainclock::multirate
