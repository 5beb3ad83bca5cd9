// Pair lists against brute force.
#include "core/neighbours.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <numbers>
#include <set>
#include <string>

namespace grainclock::core {
namespace {

using tests::Random;
using Pairs = std::vector<std::pair<std::uint32_t, std::uint32_t>>;

const SkinRule kDefault;
constexpr double kRounding = 1e-13;  // m, of distances of some metres

Balls balls_of(const State& state) { return {state, Materials{}, true}; }

Pairs pairs_of(const PairList& list) {
  Pairs pairs;
  for (std::size_t p = 0; p < list.count; ++p) pairs.emplace_back(list.i[p], list.j[p]);
  return pairs;
}

/// Both lists, sorted.
Pairs listed(const NeighbourList& list) {
  Pairs pairs = pairs_of(list.ball_pairs());
  const Pairs fixed = pairs_of(list.fixed_pairs());
  pairs.insert(pairs.end(), fixed.begin(), fixed.end());
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

/// Every pair that can come within reach while balls keep to their skins, by testing all.
Pairs possible(const Balls& balls, const NeighbourList& list, double reach) {
  Pairs pairs;
  for (std::uint32_t i = 0; i < balls.content_count(); ++i) {
    const SkinReference& a = list.skins()[i];
    for (std::uint32_t j = i + 1; j < balls.rows.size(); ++j) {
      if (j == balls.far_row()) continue;
      const bool content = j < balls.content_count();
      const Vec3 b = content ? Vec3(list.skins()[j].x, list.skins()[j].y, list.skins()[j].z) : position(balls.rows[j]);
      const double skins = std::sqrt(a.skin2) + (content ? std::sqrt(list.skins()[j].skin2) : 0.0);
      const double gap = (Vec3(a.x, a.y, a.z) - b).norm() - balls.rows[i].r - balls.rows[j].r - skins;
      if (gap <= reach) pairs.emplace_back(i, j);
    }
  }
  return pairs;
}

/// Each pair once, in ascending order, and filled up as the sweep wants it.
void expect_in_order(const Balls& balls, const NeighbourList& list) {
  for (const PairList* part : {&list.ball_pairs(), &list.fixed_pairs()}) {
    const Pairs pairs = pairs_of(*part);
    EXPECT_EQ(std::adjacent_find(pairs.begin(), pairs.end(), std::greater_equal<>()), pairs.end());
  }
  for (std::size_t p = 0; p < list.ball_pairs().count; ++p) {
    ASSERT_LT(list.ball_pairs().i[p], list.ball_pairs().j[p]);
    ASSERT_LT(list.ball_pairs().j[p], balls.content_count());
  }
  for (std::size_t p = 0; p < list.fixed_pairs().count; ++p) {
    ASSERT_LT(list.fixed_pairs().i[p], balls.content_count());
    ASSERT_GE(list.fixed_pairs().j[p], balls.first_fixed_row());
    ASSERT_LT(list.fixed_pairs().j[p], balls.rows.size());
  }
  for (const PairList* part : {&list.ball_pairs(), &list.fixed_pairs()}) {
    EXPECT_EQ(part->i.size() % kLanes, 0u);
    EXPECT_LT(part->i.size() - part->count, kLanes);
    for (std::size_t p = part->count; p < part->i.size(); ++p) {
      EXPECT_EQ(part->i[p], 0u);
      EXPECT_EQ(part->j[p], balls.far_row());
    }
  }
}

/// Builds a list of `state` and compares it with brute force, where the balls are and wherever their skins let them go.
void expect_complete(const State& state, double reach, SkinRule rule, std::uint32_t seed, const std::string& what) {
  SCOPED_TRACE(what);
  Balls balls = balls_of(state);
  NeighbourList list(reach, rule, 2);
  list.build(balls);
  expect_in_order(balls, list);
  const Pairs pairs = listed(list);
  // Not a pair too few, but for rounding where a gap is just the reach; and none that is of no use: the reach counts
  // at most once per ball.
  const Pairs wanted = possible(balls, list, reach - kRounding), useful = possible(balls, list, 2.0 * reach + kRounding);
  EXPECT_TRUE(std::includes(pairs.begin(), pairs.end(), wanted.begin(), wanted.end()));
  EXPECT_TRUE(std::includes(useful.begin(), useful.end(), pairs.begin(), pairs.end()));

  Random random(seed);
  for (int trial = 0; trial < 4; ++trial) {
    Balls moved = balls;
    for (std::uint32_t i = 0; i < moved.content_count(); ++i) {
      const SkinReference& skin = list.skins()[i];
      // To the very edge of the skin, but for rounding.
      const Vec3 x = Vec3(skin.x, skin.y, skin.z) + (1.0 - 1e-9) * std::sqrt(skin.skin2) * random.direction();
      BallRow& row = moved.rows[i];
      row.x = x.x();
      row.y = x.y();
      row.z = x.z();
    }
    const Pairs touching = brute_force_pairs(moved, reach);
    EXPECT_TRUE(std::includes(pairs.begin(), pairs.end(), touching.begin(), touching.end()))
        << "after a move within the skins";
  }
  const Pairs now = brute_force_pairs(balls, reach);
  EXPECT_TRUE(std::includes(pairs.begin(), pairs.end(), now.begin(), now.end()));
}

/// Content in a cube with fixed balls among it; `speed` the fastest ball's.
State random_set(int content, int fixed, double half, double r_min, double r_max, double speed, std::uint32_t seed) {
  Random random(seed);
  State state;
  for (int i = 0; i < content + fixed; ++i) {
    const bool moves = i < content;
    // Speeds over three decades, so that skins differ.
    const Vec3 v =
        moves ? Vec3(speed * std::pow(10.0, random.between(-3.0, 0.0)) * random.direction()) : Vec3(0.0, 0.0, 0.0);
    state.add(i, moves ? Kind::content : (i % 2 == 0 ? Kind::wall : Kind::plug), random.in_cube(half), v,
              random.between(r_min, r_max));
  }
  return state;
}

/// Face-centred cubic: every ball touches twelve.
State fcc(int cells, double r) {
  State state;
  const double a = 2.0 * std::numbers::sqrt2 * r;
  BallId id = 0;
  for (int x = 0; x < cells; ++x)
    for (int y = 0; y < cells; ++y)
      for (int z = 0; z < cells; ++z)
        for (const Vec3& at : {Vec3(0.0, 0.0, 0.0), Vec3(0.5, 0.5, 0.0), Vec3(0.5, 0.0, 0.5), Vec3(0.0, 0.5, 0.5)})
          state.add(id++, z == 0 ? Kind::wall : Kind::content, a * (Vec3(x, y, z) + at), Vec3::Zero(), r);
  return state;
}

TEST(NeighbourList, EqualsBruteForceOnRandomSets) {
  for (std::uint32_t seed = 1; seed <= 4; ++seed) {
    expect_complete(random_set(400, 200, 2.0, 0.2, 0.25, 1.0, seed), 0.0, kDefault, seed, "loose");
    expect_complete(random_set(400, 200, 2.0, 0.2, 0.25, 1.0, seed), 2e-3, kDefault, seed, "with reach");
    expect_complete(random_set(300, 100, 2.0, 0.2, 0.25, 1.0, seed), 0.0, {0.1, 0.0}, seed, "one wide skin for all");
    expect_complete(random_set(300, 100, 2.0, 0.2, 0.25, 1.0, seed), 0.0, {1e-6, 0.012}, seed, "next to no skin");
  }
}

TEST(NeighbourList, EqualsBruteForceOnADenseSet) {
  // Touching by rounding: two thirds of the gaps are zero but for 1e-16.
  expect_complete(fcc(5, 0.22), 0.0, kDefault, 1, "fcc");
  expect_complete(fcc(5, 0.22), 1e-3, {1e-4, 0.0}, 2, "fcc with reach");
  Balls balls = balls_of(fcc(6, 0.2201));
  NeighbourList list(0.0, kDefault, 1);
  list.build(balls);
  std::vector<int> neighbours(balls.content_count(), 0);
  for (std::size_t p = 0; p < list.ball_pairs().count; ++p) {
    ++neighbours[list.ball_pairs().i[p]];
    ++neighbours[list.ball_pairs().j[p]];
  }
  EXPECT_EQ(*std::max_element(neighbours.begin(), neighbours.end()), 12);
}

TEST(NeighbourList, EqualsBruteForceOnFastSets) {
  for (std::uint32_t seed = 1; seed <= 3; ++seed) {
    expect_complete(random_set(400, 200, 3.0, 0.2, 0.25, 100.0, seed), 0.0, kDefault, seed, "up to 100 m/s");
    expect_complete(random_set(900, 100, 4.0, 0.2, 0.25, 100.0, seed), 0.0, kDefault, seed, "more fast balls than the few");
    State few = random_set(600, 200, 3.0, 0.2, 0.25, 0.1, seed);
    for (std::size_t i = 0; i < 7; ++i) few.velocity[50 * i] = 100.0 * Vec3::UnitX();
    expect_complete(few, 0.0, kDefault, seed, "a few fast ones among slow ones");
    State far = random_set(1500, 300, 4.0, 0.2, 0.25, 0.1, seed);
    for (std::size_t i = 0; i < 7; ++i) far.velocity[200 * i + i] = 200.0 * Vec3::UnitZ();
    expect_complete(far, 0.0, kDefault, seed, "a few with skins of several cubes");
    State same = random_set(300, 100, 2.0, 0.2, 0.25, 1.0, seed);
    for (std::size_t i = 0; i < 300; ++i) same.velocity[i] = {0.0, 0.0, -30.0};
    expect_complete(same, 0.0, kDefault, seed, "all falling");
  }
}

TEST(NeighbourList, EqualsBruteForceOnPathologicalSets) {
  expect_complete(random_set(150, 50, 1e-3, 0.2, 0.25, 1.0, 1), 0.0, kDefault, 1, "all about one point");
  State apart = random_set(200, 50, 1.5, 0.2, 0.25, 1.0, 2);
  apart.position[17] = {1e7, -2e7, 3e6};
  expect_complete(apart, 0.0, kDefault, 2, "one far away");
  apart.position[18] = {1e7, -2e7, 3e6 + 0.41};
  apart.position[230] = {-1e9, 0.0, 0.0};
  expect_complete(apart, 0.0, kDefault, 3, "two far away, and a fixed one elsewhere");
  State same = random_set(100, 20, 1.0, 0.2, 0.25, 1.0, 3);
  for (std::size_t i = 0; i < 100; i += 2) same.position[i + 1] = same.position[i];
  same.position[110] = same.position[0];
  expect_complete(same, 0.0, kDefault, 4, "coincident centres");
  State one;
  one.add(5, Kind::content, {1.0, 2.0, 3.0}, Vec3::Zero(), 0.2);
  expect_complete(one, 0.0, kDefault, 5, "one ball");
  one.add(6, Kind::wall, {1.0, 2.0, 2.6}, Vec3::Zero(), 0.2);
  expect_complete(one, 0.0, kDefault, 6, "one ball on one fixed ball");
  expect_complete(random_set(500, 100, 1.5, 0.05, 0.4, 1.0, 4), 0.0, kDefault, 7, "radii 1 : 8");
  State line;
  for (int i = 0; i < 300; ++i)
    line.add(i, i % 5 == 0 ? Kind::wall : Kind::content, {0.43 * i, 0.0, 0.0}, Vec3::Zero(), 0.22);
  expect_complete(line, 0.0, kDefault, 8, "in a line");
}

TEST(NeighbourList, SortsAndRemovesContentAndTellsTheOrder) {
  const State state = random_set(200, 50, 2.0, 0.2, 0.25, 1.0, 5);
  Balls balls = balls_of(state);
  NeighbourList list(0.0, kDefault, 1);
  const std::vector<std::uint32_t> sorted = list.build(balls);
  const std::set<BallId> gone = {balls.id[0], balls.id[7], balls.id[100], balls.id[199]};
  std::vector<std::uint8_t> leaving;
  for (const BallId id : balls.id) leaving.push_back(gone.contains(id) ? 1 : 0);
  std::vector<std::uint32_t> order;
  for (const std::uint32_t row : list.remove(balls, leaving)) order.push_back(sorted[row]);
  ASSERT_EQ(order.size(), 196u);
  ASSERT_EQ(balls.content_count(), 196u);
  EXPECT_EQ(balls.fixed_count(), 50u);
  for (std::uint32_t row = 0; row < 196; ++row) {
    EXPECT_FALSE(gone.contains(balls.id[row]));
    EXPECT_EQ(balls.id[row], state.id[order[row]]);
    EXPECT_EQ(position(balls.rows[row]), state.position[order[row]]);
    EXPECT_EQ(balls.rows[row].r, state.radius[order[row]]);
    EXPECT_EQ(balls.inverse_mass[row], 1.0 / Materials{}.mass(state.radius[order[row]]));
  }
  EXPECT_EQ(std::set<std::uint32_t>(order.begin(), order.end()).size(), 196u);
  expect_in_order(balls, list);
  EXPECT_EQ(listed(list), possible(balls, list, 0.0));  // no gap of this set is within rounding of zero
  EXPECT_EQ(list.builds(), 1u);
}

TEST(NeighbourList, StaysCompleteWhileBallsMoveAndLeave) {
  // One list over many builds, with ever fewer and faster balls: what it keeps from build to build must not show.
  const State state = random_set(400, 100, 2.0, 0.2, 0.25, 1.0, 8);
  Balls balls = balls_of(state);
  NeighbourList list(0.0, kDefault, 2);
  Random random(8);
  for (int build = 0; build < 12; ++build) {
    std::vector<std::uint8_t> leaving(balls.content_count(), 0);
    for (std::uint8_t& leaves : leaving) leaves = random.between(0.0, 1.0) < 0.1 ? 1 : 0;
    for (std::uint32_t i = 0; i < balls.content_count(); ++i) {
      const Vec3 v = 1.5 * velocity(balls.rows[i]) + 0.1 * random.direction();
      BallRow& row = balls.rows[i];
      row = {row.x + 0.05 * v.x(), row.y + 0.05 * v.y(), row.z + 0.05 * v.z(), row.r, v.x(), v.y(), v.z(), 0.0};
    }
    list.build(balls);
    if (build % 3 != 0) list.remove(balls, leaving);
    expect_in_order(balls, list);
    const Pairs pairs = listed(list);
    const Pairs wanted = possible(balls, list, -kRounding), useful = possible(balls, list, kRounding);
    EXPECT_TRUE(std::includes(pairs.begin(), pairs.end(), wanted.begin(), wanted.end())) << build;
    EXPECT_TRUE(std::includes(useful.begin(), useful.end(), pairs.begin(), pairs.end())) << build;
  }
  EXPECT_LT(balls.content_count(), 250u);
}

TEST(NeighbourList, MayEmpty) {
  Balls balls = balls_of(random_set(3, 5, 1.0, 0.2, 0.25, 1.0, 6));
  NeighbourList list(0.0, kDefault, 2);
  list.build(balls);
  list.remove(balls, {1, 1, 1});
  EXPECT_EQ(balls.content_count(), 0u);
  EXPECT_EQ(list.ball_pairs().count + list.fixed_pairs().count, 0u);
  list.build(balls);
  EXPECT_EQ(list.ball_pairs().count + list.fixed_pairs().count, 0u);
}

/// All that a build gives.
struct Built {
  std::vector<std::uint32_t> order, i, j, fixed_i, fixed_j;
  bool operator==(const Built&) const = default;
};

Built built(const State& state, int threads, const Kernels& kernels) {
  Balls balls = balls_of(state);
  NeighbourList list(1e-3, kDefault, threads, kernels);
  const std::vector<std::uint32_t> order = list.build(balls);
  return {order, list.ball_pairs().i, list.ball_pairs().j, list.fixed_pairs().i, list.fixed_pairs().j};
}

TEST(NeighbourList, DoesNotDependOnThreadsOrInstructionSet) {
  for (const double speed : {0.1, 30.0}) {
    State state = random_set(1500, 300, 3.0, 0.2, 0.25, speed, 7);
    for (std::size_t i = 0; i < 5; ++i) state.velocity[100 * i] = {100.0, 0.0, 0.0};  // wide ones among the others
    const Built first = built(state, 1, *runnable_kernels().front());
    ASSERT_GT(first.i.size(), 1500u);
    for (const Kernels* kernels : runnable_kernels()) {
      for (const int threads : {1, 2, 3, 8}) EXPECT_EQ(built(state, threads, *kernels), first) << threads << kernels->name;
    }
  }
}

TEST(NeighbourList, SkinOfAMovingBallLastsItsLifetime) {
  // A ball that flies on must stay within its skin for `lifetime`: the reference lies ahead of it.
  State state;
  for (int i = 0; i < 20; ++i) state.add(i, Kind::content, {2.0 * i, 0.0, 0.0}, {0.0, 0.0, -0.5 * i * i}, 0.22);
  Balls balls = balls_of(state);
  NeighbourList list(0.0, kDefault, 1);
  list.build(balls);
  for (std::uint32_t row = 0; row < 20; ++row) {
    for (const double t : {0.0, 0.5 * kDefault.lifetime, kDefault.lifetime}) {
      const Vec3 x = position(balls.rows[row]) + t * velocity(balls.rows[row]);
      const SkinReference& skin = list.skins()[row];
      EXPECT_LE((x - Vec3(skin.x, skin.y, skin.z)).squaredNorm(), skin.skin2);
    }
  }
}

/// Skin [m] of a ball at rest after `builds` builds, each after so many sweeps.
double floor_after(int builds, int sweeps) {
  Balls balls = balls_of(fcc(3, 0.22));
  NeighbourList list(0.0, kDefault, 1);
  list.build(balls);
  for (int build = 0; build < builds; ++build) {
    for (int sweep = 0; sweep < sweeps; ++sweep) list.count_sweep();
    list.build(balls);
  }
  return std::sqrt(list.skins()[0].skin2);
}

TEST(NeighbourList, SkinsAdaptToWhatBuildsCost) {
  constexpr double kRoot = 1e-15;                         // rounding of the square and its root
  EXPECT_NEAR(floor_after(5, 0), kDefault.floor, kRoot);  // nobody counts
  const double often = floor_after(50, 20), seldom = floor_after(50, 1000);
  EXPECT_GT(often, kDefault.floor);
  EXPECT_LT(seldom, kDefault.floor);
  // Settled: sweeps times floor is the same for both, to the last bits of a root taken over and over.
  EXPECT_NEAR(20 * often, 1000 * seldom, 1e-12);
  // However seldom or often, a skin stays between rounding and a radius.
  EXPECT_GT(floor_after(50, 1000000), 1e-5);
  EXPECT_LT(floor_after(50, 1), 0.22 / 4.0);
}

/// Seconds of the fastest of a few builds, per ball, of a lattice of cells^3 by four balls with a few very fast ones.
double build_seconds(int cells) {
  State state = fcc(cells, 0.22);
  for (std::size_t i = 0; i < state.size(); i += 150) {
    if (state.kind[i] == Kind::content) state.velocity[i] = {0.0, 0.0, -20.0};
  }
  Balls balls = balls_of(state);
  NeighbourList list(0.0, kDefault, 1);
  double best = 1e9;
  for (int k = 0; k < 5; ++k) {
    const auto begin = std::chrono::steady_clock::now();
    list.build(balls);
    best = std::min(best, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  return best / balls.content_count();
}

TEST(SlowNeighbourList, TimeGoesWithTheNumberOfBalls) {
  // 16 times as many balls, 210 thousand. What leaves the caches costs up to twice as much per ball; anything that grows
  // with the square, such as a search among all fast balls, costs up to 16 times.
  EXPECT_LT(build_seconds(38), 5.0 * build_seconds(15));
}

TEST(BruteForcePairs, CountALattice) {
  // 3 x 3 x 3 touching balls, simple cubic: 54 bonds.
  State state;
  for (int i = 0; i < 27; ++i) state.add(i, Kind::content, 0.25 * Vec3(i % 3, i / 3 % 3, i / 9), Vec3::Zero(), 0.125);
  EXPECT_EQ(brute_force_pairs(balls_of(state), 0.0).size(), 54u);
  EXPECT_EQ(brute_force_pairs(balls_of(state), 0.25 * (std::numbers::sqrt2 - 1.0) - 1e-9).size(), 54u);
  EXPECT_EQ(brute_force_pairs(balls_of(state), 0.25 * (std::numbers::sqrt2 - 1.0) + 1e-9).size(),
            54u + 72u);  // and face diagonals
}

}  // namespace
}  // namespace grainclock::core
