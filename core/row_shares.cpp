#include "core/row_shares.hpp"

#include <algorithm>

namespace grainclock::core {

namespace {

/// The first whole vector of which no pair begins before `row`.
std::size_t first_vector(const PairList& pairs, std::uint32_t row) {
  const auto count = static_cast<std::ptrdiff_t>(pairs.count);
  const auto at = std::lower_bound(pairs.i.begin(), pairs.i.begin() + count, row) - pairs.i.begin();
  return (static_cast<std::size_t>(at) + kLanes - 1) / kLanes * kLanes;
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
  const std::size_t groups = ball.i.size() / kLanes, parts = shares.size();
  std::uint32_t touched = 0;  // by the shares so far
  for (std::size_t t = 0; t < parts; ++t) {
    RowShare& share = shares[t];
    const bool first = t == 0, last = t + 1 == parts;
    share.ball = {groups * t / parts * kLanes, groups * (t + 1) / parts * kLanes};
    share.begin = first ? 0 : shares[t - 1].end;
    // The row that the next share's first pair begins with is the next share's, whatever of its pairs are here.
    share.end = last ? rows : (share.ball.end < ball.count ? ball.i[share.ball.end] : rows);
    share.fixed = {first ? 0 : shares[t - 1].fixed.end, last ? fixed.i.size() : first_vector(fixed, share.end)};
    share.own = std::clamp(touched, share.begin, share.end);
    share.touched = share.end;
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
