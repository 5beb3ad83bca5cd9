#include "core/row_shares.hpp"

#include <algorithm>

namespace grainclock::core {

namespace {

/// Pairs that begin before `row`.
std::size_t pairs_before(const PairList& pairs, std::uint32_t row) {
  const auto count = static_cast<std::ptrdiff_t>(pairs.count);
  return static_cast<std::size_t>(std::lower_bound(pairs.i.begin(), pairs.i.begin() + count, row) - pairs.i.begin());
}

/// The first whole vector of which no pair begins before `row`.
std::size_t first_vector(const PairList& pairs, std::uint32_t row) {
  return (pairs_before(pairs, row) + kLanes - 1) / kLanes * kLanes;
}

/// The first of `rows` before which at least `wanted` pairs begin.
std::uint32_t row_after(const PairList& ball, const PairList& fixed, std::size_t wanted, std::uint32_t rows) {
  std::uint32_t first = 0, last = rows;
  while (first < last) {
    const std::uint32_t middle = first + (last - first) / 2;
    const bool is_enough = pairs_before(ball, middle) + pairs_before(fixed, middle) >= wanted;
    (is_enough ? last : first) = is_enough ? middle : middle + 1;
  }
  return first;
}

}  // namespace

std::uint32_t vector_reach(const PairList& pairs, bool both) {
  std::uint32_t reach = 0;
  for (std::size_t first = 0; first < pairs.count; first += kLanes) {
    std::uint32_t last = 0;
    for (std::size_t p = first; p < std::min(first + kLanes, pairs.count); ++p) last = std::max(last, both ? pairs.j[p] : pairs.i[p]);
    reach = std::max(reach, last - pairs.i[first]);
  }
  return reach;
}

void cut_shares(const PairList& ball, const PairList& fixed, std::uint32_t rows, std::span<RowShare> shares) {
  const std::size_t pairs = ball.count + fixed.count, parts = shares.size();
  std::uint32_t touched = 0;  // by the shares so far
  for (std::size_t t = 0; t < parts; ++t) {
    RowShare& share = shares[t];
    const RowShare before = t == 0 ? RowShare{} : shares[t - 1];
    const bool is_last = t + 1 == parts;
    share.begin = before.end;
    share.end = is_last ? rows : std::max(share.begin, row_after(ball, fixed, pairs * (t + 1) / parts, rows));
    share.ball = {before.ball.end, is_last ? ball.i.size() : first_vector(ball, share.end)};
    share.fixed = {before.fixed.end, is_last ? fixed.i.size() : first_vector(fixed, share.end)};
    share.own = std::clamp(touched, share.begin, share.end);
    share.touched = share.end;
    if (is_last) continue;  // to the end
    for (std::size_t p = share.ball.begin; p < std::min(share.ball.end, ball.count); ++p) {
      share.touched = std::max(share.touched, ball.j[p] + 1);
    }
    if (share.fixed.end > share.fixed.begin && share.fixed.begin < fixed.count) {
      share.touched = std::max(share.touched, fixed.i[std::min(share.fixed.end, fixed.count) - 1] + 1);
    }
    touched = std::max(touched, share.touched);
  }
}

}  // namespace grainclock::core
