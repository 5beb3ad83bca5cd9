// Which threads' force sums a row must look at. Threads sweep shares of the pairs, each into an array of its own; sorted in
// space, shares meet in few rows, and all others have their sums in one array, in the cache of the thread that goes on with them.
#pragma once

#include "core/row_shares.hpp"

#include <algorithm>
#include <vector>

namespace grainclock::multirate {

/// Content rows [begin, end).
struct RowRange {
  std::uint32_t begin = UINT32_MAX, end = 0;

  bool has(std::uint32_t row) const { return begin <= row && row < end; }
};

/// Rows whose sums of this tick are in the arrays [first, first + parts); those in others are zero.
struct SummedRows {
  core::RowSpan rows;
  int first, parts;
};

/// By thread: the rows that the sweeps of several levels, cut into these shares, have added to.
class TouchedRows {
 public:
  explicit TouchedRows(int threads) : by_thread_(static_cast<std::size_t>(threads)) {}

  void add(const std::vector<core::RowShare>& shares) {
    for (std::size_t t = 0; t < shares.size(); ++t) {
      by_thread_[t].begin = std::min(by_thread_[t].begin, shares[t].begin);
      by_thread_[t].end = std::max(by_thread_[t].end, shares[t].touched);
    }
  }

  /// The first of these ascending rows, one at least, with all that follow as long as the same threads have added to them.
  SummedRows first_alike(const core::RowSpan& rows) const {
    const std::uint32_t first_row = rows.row[0];
    std::uint32_t end = UINT32_MAX;
    int first = 0, last = -1;
    for (int t = 0; t < static_cast<int>(by_thread_.size()); ++t) {
      const RowRange& range = by_thread_[static_cast<std::size_t>(t)];
      if (range.has(first_row)) {
        if (last < 0) first = t;
        last = t;
      }
      for (const std::uint32_t edge : {range.begin, range.end}) {
        if (edge > first_row) end = std::min(end, edge);
      }
    }
    const auto n = static_cast<std::size_t>(std::lower_bound(rows.row, rows.row + rows.n, end) - rows.row);
    return {{rows.row, n}, first, last - first + 1};
  }

 private:
  std::vector<RowRange> by_thread_;
};

}  // namespace grainclock::multirate
