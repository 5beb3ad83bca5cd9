// Room for the event candidates of a sweep, kept from sweep to sweep.
#pragma once

#include "core/kernels.hpp"

#include <span>

namespace grainclock::core {

class CandidateList {
 public:
  /// Empties the list and makes room for the candidates of `pairs` pairs. Never shrinks, so that nothing is cleared or
  /// allocated sweep by sweep.
  Candidates room_for(std::size_t pairs) {
    count_ = 0;
    if (pair_.size() < pairs + kLanes) pair_.resize(pairs + kLanes);
    return {pair_.data()};
  }
  /// Takes what a sweep found in a span that begins at pair `begin` of the list.
  void take(const Candidates& found, std::size_t begin) {
    count_ = found.n;
    for (std::size_t k = 0; k < count_; ++k) pair_[k] += static_cast<std::uint32_t>(begin);
  }
  std::span<const std::uint32_t> pairs() const { return {pair_.data(), count_}; }

 private:
  std::vector<std::uint32_t> pair_;
  std::size_t count_ = 0;
};

}  // namespace grainclock::core
