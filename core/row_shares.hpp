// Cuts sorted pair lists into shares of work whose balls can go on before the other shares are done.
#pragma once

#include "core/neighbours.hpp"

#include <span>

namespace grainclock::core {

/// A run of pairs, whole vectors.
struct PairRange {
  std::size_t begin = 0, end = 0;
};

/// One thread's share: the content rows [begin, end) and the pairs that begin there, give or take less than a
/// vector. Pairs of earlier shares may add to the rows [begin, own), never to [own, end); pairs of this
/// share may add to rows [end, touched), which are the next shares' [begin, own).
struct RowShare {
  std::uint32_t begin = 0, own = 0, end = 0, touched = 0;
  PairRange ball, fixed;
};

/// How far the rows of any one vector of pairs lie apart at most, from its first pair's first row on.
std::uint32_t vector_reach(const PairList& pairs, bool both);

/// Cuts lists in ascending order of their first rows into shares of about the same number of pairs, of both lists together.
void cut_shares(const PairList& ball, const PairList& fixed, std::uint32_t rows, std::span<RowShare> shares);

}  // namespace grainclock::core
