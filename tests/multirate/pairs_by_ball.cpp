// Pairs by ball against a look at all pairs.
#include "multirate/pairs_by_ball.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <set>

namespace grainclock::multirate {
namespace {

using Seen = std::multiset<std::pair<std::uint32_t, std::uint32_t>>;  // pair and partner

TEST(PairsByBall, AreAllOfABallAndNoOthers) {
  tests::Random random(5);
  PairsByBall by_ball;  // kept from list to list
  for (int trial = 0; trial < 100; ++trial) {
    const std::uint32_t balls = random.below(30), far = balls, fixed = trial % 2 == 0 ? 0 : 10;
    core::PairList pairs;
    for (std::uint32_t i = 0; i < balls; ++i) {
      if (random.below(4) == 0) continue;
      for (std::uint32_t j = i + 1; j < far; ++j)
        if (random.below(5) == 0) pairs.add(i, j);
      for (std::uint32_t j = far + 1; j <= far + fixed; ++j)
        if (random.below(5) == 0) pairs.add(i, j);
    }
    pairs.finish(far);
    by_ball.begin(pairs, balls);
    for (std::uint32_t ball = 0; ball < balls; ++ball) {
      Seen wanted, seen;
      for (std::uint32_t p = 0; p < pairs.count; ++p) {
        if (pairs.i[p] == ball) wanted.emplace(p, pairs.j[p]);
        if (pairs.j[p] == ball) wanted.emplace(p, pairs.i[p]);
      }
      by_ball.for_each(ball, [&](std::uint32_t pair, std::uint32_t partner) { seen.emplace(pair, partner); });
      EXPECT_EQ(seen, wanted) << "trial " << trial << ", ball " << ball;
    }
  }
}

}  // namespace
}  // namespace grainclock::multirate
