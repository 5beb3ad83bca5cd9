// The pairs that a ball takes part in, for looks at few balls only.
#pragma once

#include "core/neighbours.hpp"

#include <vector>

namespace grainclock::multirate {

class PairsByBall {
 public:
  /// Notes which pairs of a list, in ascending order of i, are whose; j may be a fixed ball, a row not below `balls`. The list
  /// must stay as it is.
  void begin(const core::PairList& pairs, std::size_t balls) {
    pairs_ = &pairs;
    first_.assign(balls + 1, static_cast<std::uint32_t>(pairs.count));
    first_back_.assign(balls + 2, 0);
    std::size_t row = 0;
    for (std::uint32_t p = 0; p < pairs.count; ++p) {
      for (; row <= pairs.i[p]; ++row) first_[row] = p;
      if (pairs.j[p] < balls) ++first_back_[pairs.j[p] + 2];
    }
    for (std::size_t k = 2; k < first_back_.size(); ++k) first_back_[k] += first_back_[k - 1];
    back_.resize(first_back_.back());
    for (std::uint32_t p = 0; p < pairs.count; ++p) {
      if (pairs.j[p] < balls) back_[first_back_[pairs.j[p] + 1]++] = p;
    }
  }
  /// Calls visit(pair, partner) for all pairs of a ball.
  template <class Visit>
  void for_each(std::uint32_t ball, Visit visit) const {
    for (std::uint32_t p = first_[ball]; p < first_[ball + 1]; ++p) visit(p, pairs_->j[p]);
    for (std::uint32_t k = first_back_[ball]; k < first_back_[ball + 1]; ++k) visit(back_[k], pairs_->i[back_[k]]);
  }

 private:
  const core::PairList* pairs_ = nullptr;
  std::vector<std::uint32_t> first_;       // by ball, its first pair as i, and the end
  std::vector<std::uint32_t> first_back_;  // by ball, where its pairs as j begin in
  std::vector<std::uint32_t> back_;        // pairs
};

}  // namespace grainclock::multirate
