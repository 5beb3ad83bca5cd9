// The limiter against shortest paths through the graph of pairs.
#include "multirate/limiter.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

namespace grainclock::multirate {
namespace {

struct Graph {
  std::vector<Level> level;
  std::vector<std::uint32_t> i, j;
  std::vector<std::uint8_t> active;

  /// The limited levels.
  std::vector<Level> limited(int difference, std::size_t* demotions = nullptr) const {
    std::vector<Level> out = level;
    std::vector<std::size_t> order(i.size());  // lists are in order of i
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [this](std::size_t p, std::size_t q) { return i[p] < i[q]; });
    core::PairList pairs;
    for (const std::size_t p : order) pairs.add(i[p], j[p]);
    pairs.finish(0);
    PairsByBall by_ball;
    by_ball.begin(pairs, level.size());
    const auto is_active = [&](std::uint32_t p) { return active[order[p]] != 0; };
    const std::size_t n = limit_levels(std::span<Level>(out), by_ball, difference, is_active);
    if (demotions != nullptr) *demotions = n;
    return out;
  }
};

Graph random_graph(tests::Random& random) {
  Graph graph;
  const std::uint32_t balls = 2 + random.below(60);
  for (std::uint32_t b = 0; b < balls; ++b) {
    // Mostly coarse, so that a few fine balls have far to reach.
    graph.level.push_back(static_cast<Level>(random.below(4) == 0 ? random.below(12) : 11));
  }
  const std::uint32_t pairs = random.below(3 * balls);
  for (std::uint32_t p = 0; p < pairs; ++p) {
    const std::uint32_t a = random.below(balls), b = random.below(balls);
    if (a == b) continue;
    graph.i.push_back(a);
    graph.j.push_back(b);
    graph.active.push_back(random.below(8) != 0);
  }
  return graph;
}

/// The largest levels within the limit and not above the given ones: a ball's own, or another's plus the limit times
/// the number of active pairs between them.
std::vector<Level> by_shortest_paths(const Graph& graph, int difference) {
  const std::size_t n = graph.level.size();
  constexpr int kFar = 1 << 20;
  std::vector<std::vector<int>> hops(n, std::vector<int>(n, kFar));
  for (std::size_t b = 0; b < n; ++b) hops[b][b] = 0;
  for (std::size_t p = 0; p < graph.i.size(); ++p)
    if (graph.active[p]) hops[graph.i[p]][graph.j[p]] = hops[graph.j[p]][graph.i[p]] = 1;
  for (std::size_t via = 0; via < n; ++via)
    for (std::size_t a = 0; a < n; ++a)
      for (std::size_t b = 0; b < n; ++b) hops[a][b] = std::min(hops[a][b], hops[a][via] + hops[via][b]);
  std::vector<Level> out;
  for (std::size_t a = 0; a < n; ++a) {
    int level = graph.level[a];
    for (std::size_t b = 0; b < n; ++b) level = std::min(level, graph.level[b] + difference * hops[a][b]);
    out.push_back(static_cast<Level>(level));
  }
  return out;
}

TEST(Limiter, FindsTheFixedPointOfShortestPaths) {
  tests::Random random(1);
  std::size_t changed = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const Graph graph = random_graph(random);
    const int difference = 1 + static_cast<int>(random.below(3));
    std::size_t demotions = 0;
    EXPECT_EQ(graph.limited(difference, &demotions), by_shortest_paths(graph, difference)) << "trial " << trial;
    EXPECT_EQ(demotions == 0, graph.limited(difference) == graph.level);
    changed += demotions > 0;
  }
  EXPECT_GT(changed, 200U);  // or the trials would show nothing
}

TEST(Limiter, DemotesOnlyAndBoundsTheDifference) {
  tests::Random random(2);
  for (int trial = 0; trial < 300; ++trial) {
    const Graph graph = random_graph(random);
    const int difference = 1 + static_cast<int>(random.below(3));
    const std::vector<Level> level = graph.limited(difference);
    for (std::size_t b = 0; b < level.size(); ++b) EXPECT_LE(level[b], graph.level[b]);
    for (std::size_t p = 0; p < graph.i.size(); ++p) {
      EXPECT_TRUE(!graph.active[p] || std::abs(level[graph.i[p]] - level[graph.j[p]]) <= difference) << "pair " << p;
    }
  }
}

TEST(Limiter, TheOrderOfPairsDoesNotMatter) {
  tests::Random random(3);
  for (int trial = 0; trial < 100; ++trial) {
    Graph graph = random_graph(random);
    const std::vector<Level> level = graph.limited(2);
    for (int shuffle = 0; shuffle < 5; ++shuffle) {
      for (std::uint32_t p = 1; p < graph.i.size(); ++p) {
        const std::uint32_t q = random.below(p + 1);
        std::swap(graph.i[p], graph.i[q]);
        std::swap(graph.j[p], graph.j[q]);
        std::swap(graph.active[p], graph.active[q]);
        if (random.below(2) == 0) std::swap(graph.i[p], graph.j[p]);
      }
      EXPECT_EQ(graph.limited(2), level);
    }
  }
}

TEST(Limiter, ALimitedSetStaysAsItIs) {
  tests::Random random(4);
  for (int trial = 0; trial < 50; ++trial) {
    Graph graph = random_graph(random);
    graph.level = graph.limited(1);
    std::size_t demotions = 1;
    graph.limited(1, &demotions);
    EXPECT_EQ(demotions, 0U);
  }
}

}  // namespace
}  // namespace grainclock::multirate
