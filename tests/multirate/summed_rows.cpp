// Whose sums a row's kick must look at: against all shares, row by row, and against sums of a single thread.
#include "multirate/summed_rows.hpp"

#include "core/force_scale.hpp"
#include "core/share_work.hpp"
#include "multirate/ball_steps.hpp"
#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <utility>

namespace grainclock::multirate {
namespace {

using core::PairList;
using core::RowShare;
using core::Vec3;
using core::WeightedSum;
using tests::Random;
using tests::same_bits;

/// Calls judge(SummedRows) for the pieces of these rows; expects them to be all of the rows, in order.
template <class Judge>
std::size_t for_pieces(const TouchedRows& touched, const std::vector<std::uint32_t>& rows, Judge judge) {
  std::size_t done = 0, pieces = 0;
  while (done < rows.size()) {
    const SummedRows some = touched.first_alike({rows.data() + done, rows.size() - done});
    EXPECT_EQ(some.rows.row, rows.data() + done);
    const bool goes_on = some.rows.n > 0 && some.rows.n <= rows.size() - done;
    EXPECT_TRUE(goes_on) << some.rows.n << " of " << rows.size() - done << " rows";
    if (!goes_on) break;
    judge(some);
    done += some.rows.n;
    ++pieces;
  }
  return pieces;
}

/// Shares of several levels, each for as many threads or for one, anywhere, some of them empty.
struct SharesOfLevels {
  std::vector<std::vector<RowShare>> levels;

  SharesOfLevels(Random& random, int threads, std::uint32_t rows) {
    for (std::uint32_t level = 0; level <= random.below(4); ++level) {
      std::vector<RowShare> shares(random.below(3) == 0 ? 1 : static_cast<std::size_t>(threads));
      for (RowShare& share : shares) {
        share.begin = random.below(rows);
        share.end = share.begin + random.below(rows - share.begin);
        share.touched = share.end + random.below(rows - share.end + 1);
        if (random.below(4) == 0) share.touched = share.end = share.begin;
      }
      levels.push_back(shares);
    }
  }
  TouchedRows touched(int threads) const {
    TouchedRows out(threads);
    for (const std::vector<RowShare>& shares : levels) out.add(shares);
    return out;
  }
  /// Whether this thread adds to the row, at any level.
  bool adds(int thread, std::uint32_t row) const {
    return std::any_of(levels.begin(), levels.end(), [&](const std::vector<RowShare>& shares) {
      const auto t = static_cast<std::size_t>(thread);
      return t < shares.size() && shares[t].begin <= row && row < shares[t].touched;
    });
  }
  /// Whether the row is among all between this thread's first and last.
  bool spans(int thread, std::uint32_t row) const {
    RowRange range;
    for (const std::vector<RowShare>& shares : levels) {
      const auto t = static_cast<std::size_t>(thread);
      if (t >= shares.size()) continue;
      range.begin = std::min(range.begin, shares[t].begin);
      range.end = std::max(range.end, shares[t].touched);
    }
    return range.begin <= row && row < range.end;
  }
};

TEST(TouchedRows, PiecesHoldTheThreadsOfAllTheirRows) {
  Random random(1);
  std::size_t none = 0, one = 0, several = 0;
  for (int trial = 0; trial < 2000 && !HasFailure(); ++trial) {
    const int threads = 1 + static_cast<int>(random.below(4));
    SCOPED_TRACE(testing::Message() << "trial " << trial << ", " << threads << " threads");
    const std::uint32_t content = 2 + random.below(60);
    const SharesOfLevels shares(random, threads, content);
    std::vector<std::uint32_t> rows;
    for (std::uint32_t row = 0; row < content; ++row) {
      if (random.below(3) != 0) rows.push_back(row);
    }
    const std::size_t pieces = for_pieces(shares.touched(threads), rows, [&](const SummedRows& some) {
      const int end = some.first + some.parts;
      EXPECT_GE(some.first, 0);
      EXPECT_GE(some.parts, 0);
      EXPECT_LE(end, threads);
      for (std::size_t k = 0; k < some.rows.n; ++k) {
        const std::uint32_t row = some.rows.row[k];
        for (int t = 0; t < threads; ++t) {
          EXPECT_TRUE(!shares.adds(t, row) || (some.first <= t && t < end)) << "row " << row << ", thread " << t;
        }
        // And no arrays beyond these are looked at.
        EXPECT_TRUE(some.parts == 0 || (shares.spans(some.first, row) && shares.spans(end - 1, row))) << "row " << row;
      }
      ++(some.parts == 0 ? none : some.parts == 1 ? one : several);
    });
    EXPECT_LE(pieces, 1U + 2U * static_cast<std::size_t>(threads));  // one begins at most where a thread's rows do, or end
  }
  EXPECT_GT(std::min({none, one, several}), 500U);
}

/// Balls along a narrow band, sorted; those that touch, or nearly so, are paired at one of three levels.
struct Band {
  static constexpr std::uint32_t kContent = 600, kFixed = 100;
  static constexpr Level kLevels = 3;
  core::Materials materials;
  core::Balls balls;
  core::ForceScale scale;
  PairList pairs[kLevels][2];  // with balls, with fixed balls

  Band() {
    Random random(3);
    std::vector<Vec3> content(kContent);
    for (Vec3& x : content) x = Vec3(random.between(0.0, 40.0), random.between(0.0, 1.0), random.between(0.0, 1.0));
    std::sort(content.begin(), content.end(), [](const Vec3& a, const Vec3& b) { return a.x() < b.x(); });
    core::State state;
    for (const Vec3& x : content) add(state, core::Kind::content, x, random.in_cube(2.0), random);
    for (std::uint32_t b = 0; b < kFixed; ++b) add(state, core::Kind::wall, {0.4 * b, 0.5, 0.0}, Vec3::Zero(), random);
    balls = core::Balls(state, materials, true);
    scale = core::force_scale(materials, 9.81, 0.44, 8, kContent);
    for (const auto& [i, j] : core::brute_force_pairs(balls, 0.01)) {
      const core::BallRow &a = balls.rows[i], &b = balls.rows[j];
      if (a.r + b.r - (position(a) - position(b)).norm() > 0.04) continue;  // beyond what a law allows
      // Few of the last level, which one thread sweeps.
      pairs[random.below(8) == 0 ? 2 : random.below(2)][j > balls.far_row()].add(i, j);
    }
    for (auto& lists : pairs) {
      for (PairList& list : lists) list.finish(balls.far_row());
    }
  }

  /// Sweeps of the levels from `finest` to `active`, by as many threads. Returns to what rows they add.
  TouchedRows sweep(BallSteps& steps, Level finest, Level active, int threads) const {
    steps.stride = kContent + 1;
    steps.sums.assign(static_cast<std::size_t>(threads) * steps.stride, WeightedSum{});
    TouchedRows touched(threads);
    for (Level level = finest; level <= active; ++level) {
      std::vector<RowShare> shares(level == 2 ? 1 : static_cast<std::size_t>(threads));
      core::cut_shares(pairs[level][0], pairs[level][1], kContent, shares);
      touched.add(shares);
      core::share_work(static_cast<int>(shares.size()), [&](int t) {
        const RowShare& share = shares[static_cast<std::size_t>(t)];
        for (const bool fixed : {false, true}) {
          const auto [begin, end] = fixed ? share.fixed : share.ball;
          const PairList& list = pairs[level][fixed];
          core::SweepTotals totals;
          core::kernels().sweep_weighted(balls.rows.data(), {list.i.data() + begin, list.j.data() + begin, end - begin},
                                         core::sweep_law(materials, fixed, scale, 1e-4), level, steps.sums_of(t), totals,
                                         nullptr);
          EXPECT_FALSE(totals.overloaded);
        }
      });
    }
    return touched;
  }

 private:
  static void add(core::State& state, core::Kind kind, const Vec3& x, const Vec3& v, Random& random) {
    state.add(static_cast<core::BallId>(state.size()), kind, x, v, random.between(0.2, 0.24));
  }
};

bool is_zero(const std::vector<WeightedSum>& sums) { return same_bits(sums, std::vector<WeightedSum>(sums.size())); }

TEST(TouchedRows, TakenSumsAreThoseOfOneThreadAndLeaveNone) {
  const Band band;
  std::vector<std::uint32_t> rows(Band::kContent);
  std::iota(rows.begin(), rows.end(), 0U);
  for (const int threads : {1, 2, 3, 4}) {
    for (const auto& [finest, active] : {std::pair<Level, Level>{0, 0}, {0, 1}, {1, 1}, {0, 2}, {1, 2}, {2, 2}}) {
      SCOPED_TRACE(testing::Message() << threads << " threads, levels " << int{finest} << " to " << int{active});
      BallSteps alone, shared;
      band.sweep(alone, finest, active, 1);
      const TouchedRows touched = band.sweep(shared, finest, active, threads);
      const std::vector<WeightedSum> last(shared.sums.end() - static_cast<std::ptrdiff_t>(shared.stride), shared.sums.end());
      EXPECT_EQ(is_zero(last), threads > 1 && finest == 2);
      std::vector<WeightedSum> sums(Band::kContent + 1);
      std::size_t in_one = 0;
      for_pieces(touched, rows, [&](const SummedRows& some) {
        for (std::size_t k = 0; k < some.rows.n; ++k) sums[some.rows.row[k]] = shared.take_sums(some.rows.row[k], some);
        if (some.parts == 1) in_one += some.rows.n;
      });
      EXPECT_TRUE(same_bits(sums, alone.sums));
      EXPECT_TRUE(is_zero(shared.sums));
      EXPECT_FALSE(is_zero(sums));
      // Sums of some rows are in one array, of others in several.
      EXPECT_GT(in_one, 100U);
      EXPECT_EQ(in_one == rows.size(), threads == 1 || finest == 2);
    }
  }
}

}  // namespace
}  // namespace grainclock::multirate
