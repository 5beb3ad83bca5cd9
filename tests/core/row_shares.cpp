// What makes it safe to move balls before all pairs are swept.
#include "core/row_shares.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace grainclock::core {
namespace {

using tests::Random;

constexpr std::uint32_t kRows = 400;

/// Sorted pairs of rows not far apart, or of any distance, some rows with none.
PairList pairs_among(std::uint32_t rows, std::size_t count, std::uint32_t reach, std::uint32_t seed) {
  Random random(seed);
  std::vector<std::pair<std::uint32_t, std::uint32_t>> drawn;
  while (drawn.size() < count) {
    const std::uint32_t i = random.below(rows - 1), j = i + 1 + random.below(std::min(reach, rows - 1 - i));
    if (i % 17 != 3) drawn.emplace_back(i, j);
  }
  std::sort(drawn.begin(), drawn.end());
  PairList list;
  for (const auto& [i, j] : drawn) list.add(i, j);
  list.finish(rows);
  return list;
}

void expect_safe(const PairList& ball, const PairList& fixed, int threads) {
  std::vector<RowShare> shares(static_cast<std::size_t>(threads));
  cut_shares(ball, fixed, kRows, shares);
  std::uint32_t row = 0;
  std::size_t ball_at = 0, fixed_at = 0;
  for (const RowShare& share : shares) {
    // Shares follow one another, and cover all rows and pairs in whole vectors.
    EXPECT_EQ(share.begin, row);
    EXPECT_EQ(share.ball.begin, ball_at);
    EXPECT_EQ(share.fixed.begin, fixed_at);
    EXPECT_LE(share.begin, share.own);
    EXPECT_LE(share.own, share.end);
    EXPECT_EQ(share.ball.end % kLanes, 0u);
    EXPECT_EQ(share.fixed.end % kLanes, 0u);
    row = share.end;
    ball_at = share.ball.end;
    fixed_at = share.fixed.end;
  }
  EXPECT_EQ(row, kRows);
  EXPECT_EQ(ball_at, ball.i.size());
  EXPECT_EQ(fixed_at, fixed.i.size());
  // A row of [own, end) is touched by its own share only, and no share touches a row before its own.
  for (std::size_t of = 0; of < shares.size(); ++of) {
    const auto touches = [&](std::uint32_t touched) {
      EXPECT_GE(touched, shares[of].begin);
      EXPECT_LT(touched, shares[of].touched);
      for (std::size_t t = 0; t < shares.size(); ++t) {
        const bool is_anothers = t != of && touched >= shares[t].own && touched < shares[t].end;
        EXPECT_FALSE(is_anothers) << "row " << touched << ", share " << of;
      }
    };
    for (std::size_t p = shares[of].ball.begin; p < std::min(shares[of].ball.end, ball.count); ++p) {
      touches(ball.i[p]);
      touches(ball.j[p]);
    }
    for (std::size_t p = shares[of].fixed.begin; p < std::min(shares[of].fixed.end, fixed.count); ++p) touches(fixed.i[p]);
  }
}

TEST(RowShares, NoShareTouchesRowsThatAnotherMovesEarly) {
  for (const std::uint32_t reach : {1u, 20u, kRows}) {
    for (const int threads : {1, 2, 3, 7}) {
      for (std::uint32_t seed = 1; seed <= 5; ++seed) {
        SCOPED_TRACE(testing::Message() << "reach " << reach << ", " << threads << " threads, seed " << seed);
        expect_safe(pairs_among(kRows, 1400, reach, seed), pairs_among(kRows, 90, reach, 100 + seed), threads);
      }
    }
  }
}

TEST(VectorReach, IsTheLargestSpanOfRowsInOneVector) {
  for (const bool both : {true, false}) {
    const PairList pairs = pairs_among(kRows, 701, 40, 9);  // not a multiple of a vector
    std::uint32_t reach = 0;
    for (std::size_t p = 0; p < pairs.count; ++p) {
      const std::uint32_t last = both ? pairs.j[p] : pairs.i[p];
      reach = std::max(reach, last - pairs.i[p / kLanes * kLanes]);
    }
    EXPECT_EQ(vector_reach(pairs, both), reach);
    EXPECT_GT(reach, 0u);
  }
  EXPECT_EQ(vector_reach(PairList{}, true), 0u);
}

TEST(RowShares, EmptyAndShortListsGiveEverybodySomethingOrNothing) {
  PairList none;
  none.finish(kRows);
  for (const int threads : {1, 2, 5}) {
    expect_safe(none, none, threads);
    expect_safe(none, pairs_among(kRows, 90, 20, 1), threads);
    expect_safe(pairs_among(kRows, 3, 20, 1), none, threads);
  }
}

TEST(RowShares, AreAboutEqual) {
  const PairList ball = pairs_among(kRows, 4000, 20, 1), fixed = pairs_among(60, 800, 20, 2);
  std::vector<RowShare> shares(4);
  cut_shares(ball, fixed, kRows, shares);
  for (const RowShare& share : shares) {
    const std::size_t pairs = share.ball.end - share.ball.begin + share.fixed.end - share.fixed.begin;
    // A share ends with a row, of 30 pairs at most, and each list's part is rounded up to a vector.
    EXPECT_NEAR(static_cast<double>(pairs), 1200.0, 30.0 + 2.0 * kLanes);
  }
}

}  // namespace
}  // namespace grainclock::core
