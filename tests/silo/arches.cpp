#include "silo/arches.hpp"

#include "core/check.hpp"
#include "tests/support/force_network.hpp"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>
#include <optional>

namespace grainclock::silo {
namespace {

using core::BallId;
using core::Kind;
using tests::ForceNetwork;

constexpr double kR = 0.22;        // m
constexpr double kWeight = 546.0;  // N, of each ball
constexpr double kThrust = 800.0;  // N, horizontal, of an arch

std::vector<Bridge> bridges_of(const ForceNetwork& net, Choice choice = Choice::strongest) {
  return bridges(net.state, supports(net.state, net.contacts, choice));
}

/// Every content ball carries its weight.
void expect_balanced(const ForceNetwork& net) {
  for (std::size_t k = 0; k < net.state.size(); ++k) {
    if (net.state.kind[k] != Kind::content) continue;
    const Vec3 rest = net.force_on(net.state.id[k]) - Vec3(0.0, 0.0, kWeight);
    EXPECT_LT(rest.norm(), 1e-9) << k;  // rounding of forces of 1e3 N
  }
}

/// From ball k to the next of an arch of n, in its plane: (along the span, upward) [N], the thrust that goes through them.
Eigen::Vector2d thrust_after(int k, int n, double weight) { return {kThrust, weight * (0.5 * n - k)}; }

/// An arch of n balls in equilibrium between two wall balls: a hanging chain turned upside down. Leaning back by an
/// angle [rad] each ball also rests against a plug ball behind it. Contents are balls 0 to n - 1.
ForceNetwork make_arch(int n, double lean) {
  const Vec3 across = Vec3::UnitX(), up(0.0, std::sin(lean), std::cos(lean)), back(0.0, std::cos(lean), -std::sin(lean));
  const auto step = [&](int k) {
    const Eigen::Vector2d thrust = thrust_after(k, n, kWeight * std::cos(lean));
    return Vec3(thrust[0] * across + thrust[1] * up);
  };
  ForceNetwork net;
  Vec3 at = Vec3::Zero();
  for (int k = 1; k <= n; ++k) {
    net.add(Kind::content, at, kR);
    at += 2.0 * kR * step(k).normalized();
  }
  for (int k = 1; k < n; ++k) net.push(k - 1, k, step(k).norm());
  net.hold(Kind::wall, 0, step(0), step(0).norm());
  net.hold(Kind::wall, n - 1, -step(n), step(n).norm());
  if (lean > 0.0)
    for (int k = 0; k < n; ++k) net.hold(Kind::plug, k, -back, kWeight * std::sin(lean));
  expect_balanced(net);
  return net;
}

TEST(Arches, ArchBetweenTwoWallsIsOneString) {
  for (const double lean : {0.0, 0.3}) {
    for (const int n : {2, 3, 4, 5, 8, 13}) {
      const ForceNetwork net = make_arch(n, lean);
      for (const Choice choice : {Choice::strongest, Choice::lowest}) {
        const auto found = bridges_of(net, choice);
        ASSERT_EQ(found.size(), 1u) << n << ' ' << lean;
        const Bridge& arch = found.front();
        ASSERT_EQ(arch.members.size(), static_cast<std::size_t>(n));
        EXPECT_EQ(arch.members.back(), n - 1);
        for (int k = 1; k < n; ++k) EXPECT_EQ(arch.bonds.at(static_cast<std::size_t>(k) - 1), Bond(k - 1, k));
        EXPECT_EQ(arch.bonds.size(), static_cast<std::size_t>(n) - 1);
        EXPECT_EQ(arch.topology, Topology::string);
        EXPECT_EQ(arch.shape, Shape::arch);
        EXPECT_TRUE(arch.on_wall);
        // Three supports each, less two for every bond: n + 2, as Mehta et al. say; in a plane two each: the ends only.
        EXPECT_EQ(arch.bases.size(), static_cast<std::size_t>(lean > 0.0 ? n + 2 : 2));
      }
    }
  }
}

TEST(Arches, SpanAndHeightAreThoseOfTheHangingChain) {
  constexpr double kLean = 0.3;
  for (const int n : {2, 5, 8}) {
    double span = 0.0, height = 0.0;
    for (int k = 1; k < n; ++k) {
      const Eigen::Vector2d step = 2.0 * kR * thrust_after(k, n, kWeight * std::cos(kLean)).normalized();
      span += step[0];
      height += std::max(0.0, step[1]) * std::cos(kLean);
    }
    const Bridge arch = bridges_of(make_arch(n, kLean)).front();
    EXPECT_NEAR(arch.span, span, 1e-13);     // rounding, as all here; ends of one height: their distance is horizontal
    EXPECT_NEAR(arch.height, height, 1e-13);
    EXPECT_NEAR(arch.gyration[0], 0.0, 1e-13);  // in a plane
  }
}

/// A keystone on three balls that do not touch each other, each of them on two wall balls. Ball 0 is the keystone.
ForceNetwork make_dome(double elevation) {
  ForceNetwork net;
  net.add(Kind::content, {0.0, 0.0, 5.0}, kR);
  const double thrust = kWeight / (3.0 * std::sin(elevation));
  std::vector<Vec3> outward;
  for (int k = 0; k < 3; ++k) {
    const double azimuth = 2.0 * std::numbers::pi * k / 3.0;
    outward.emplace_back(std::cos(azimuth), std::sin(azimuth), 0.0);
    const Vec3 down_to_it = std::cos(elevation) * outward.back() - std::sin(elevation) * Vec3::UnitZ();
    net.add(Kind::content, Vec3(0.0, 0.0, 5.0) + 2.0 * kR * down_to_it, kR);
  }
  for (BallId k = 1; k <= 3; ++k) {
    net.push(0, k, thrust);
    const Vec3 out = outward[static_cast<std::size_t>(k - 1)];
    const Vec3 needed = -thrust * std::cos(elevation) * out + (kWeight + thrust * std::sin(elevation)) * Vec3::UnitZ();
    constexpr double kSideways = 0.6;
    for (const double side : {-kSideways, kSideways}) {
      const Vec3 direction = needed.normalized() + side * Vec3::UnitZ().cross(out);
      net.hold(Kind::wall, k, direction, 0.5 * needed.norm() * direction.norm());
    }
  }
  expect_balanced(net);
  return net;
}

TEST(Arches, RingWithAKeystoneIsADome) {
  for (const double elevation : {0.3, 0.6}) {  // the lower one is flat, but it lies
    const auto found = bridges_of(make_dome(elevation));
    ASSERT_EQ(found.size(), 1u);
    const Bridge& dome = found.front();
    EXPECT_EQ(dome.members, (std::vector<BallId>{0, 1, 2, 3}));
    EXPECT_EQ(dome.bases.size(), 6u);
    EXPECT_EQ(dome.bonds.size(), 3u);
    EXPECT_EQ(dome.topology, Topology::complex);
    EXPECT_EQ(dome.shape, Shape::dome);
    EXPECT_TRUE(dome.on_wall);
    const double radius = 2.0 * kR * std::cos(elevation), rise = 2.0 * kR * std::sin(elevation);
    EXPECT_NEAR(dome.height, rise, 1e-13);                         // rounding, as below
    EXPECT_NEAR(dome.span, std::sqrt(3.0) * radius, 1e-13);        // side of the triangle
    EXPECT_NEAR(dome.gyration[0], 3.0 / 16.0 * rise * rise, 1e-13);      // one of four stands higher
    EXPECT_NEAR(dome.gyration[1], 3.0 / 8.0 * radius * radius, 1e-13);   // three of four on a circle
    EXPECT_NEAR(dome.gyration[2], 3.0 / 8.0 * radius * radius, 1e-13);
  }
}

TEST(Arches, RingThatLeansOnAFunnelIsClosed) {
  constexpr int kN = 8;
  ForceNetwork net;
  const double radius = kR / std::sin(std::numbers::pi / kN);  // neighbours touch
  const auto outward = [](int k) {
    const double azimuth = 2.0 * std::numbers::pi * k / kN;
    return Vec3(std::cos(azimuth), std::sin(azimuth), 0.0);
  };
  for (int k = 0; k < kN; ++k) net.add(Kind::content, radius * outward(k), kR);
  for (int k = 0; k < kN; ++k) net.push(k, (k + 1) % kN, kThrust);
  for (int k = 0; k < kN; ++k) {
    const Vec3 needed = -2.0 * kThrust * std::sin(std::numbers::pi / kN) * outward(k) + kWeight * Vec3::UnitZ();
    net.hold(Kind::plug, k, needed, needed.norm());
  }
  expect_balanced(net);
  const auto found = bridges_of(net);
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found.front().members.size(), static_cast<std::size_t>(kN));
  EXPECT_EQ(found.front().bonds.size(), static_cast<std::size_t>(kN));
  EXPECT_EQ(found.front().topology, Topology::ring);
  EXPECT_EQ(found.front().shape, Shape::dome);
  EXPECT_FALSE(found.front().on_wall);  // it stands on a plug
  EXPECT_NEAR(found.front().span, 2.0 * radius, 1e-13);  // rounding
}

/// Ball `ball` on three new fixed balls that carry `load` [N].
void rest_on_three(ForceNetwork& net, BallId ball, double load) {
  constexpr double kSteep = 0.9;  // rad below the horizontal
  for (int k = 0; k < 3; ++k) {
    const double azimuth = 0.2 + 2.0 * std::numbers::pi * k / 3.0;
    const Vec3 up(-std::cos(kSteep) * std::cos(azimuth), -std::cos(kSteep) * std::sin(azimuth), std::sin(kSteep));
    net.hold(Kind::wall, ball, up, load / (3.0 * std::sin(kSteep)));
  }
}

TEST(Arches, BallOnThreeFixedOnesIsNoBridge) {
  ForceNetwork net;
  net.add(Kind::content, {1.0, 2.0, 3.0}, kR);
  rest_on_three(net, 0, kWeight);
  const auto support = supports(net.state, net.contacts, Choice::strongest);
  EXPECT_EQ(support[0].n, 3);
  EXPECT_EQ(support[0].by, (std::array<BallId, 3>{1, 2, 3}));
  EXPECT_NEAR(support[0].upward, kWeight, 1e-10);  // rounding
  EXPECT_EQ(support[1].n, 0);                      // fixed
  EXPECT_TRUE(bridges(net.state, support).empty());
}

TEST(Arches, HeapLaidBallByBallHasNone) {
  ForceNetwork net;  // a ball on three that stand apart, each on three fixed ones
  constexpr double kDown = 0.7;
  net.add(Kind::content, {0.0, 0.0, 1.0}, kR);
  for (int k = 0; k < 3; ++k) {
    const double azimuth = 2.0 * std::numbers::pi * k / 3.0;
    const Vec3 down_to_it(std::cos(kDown) * std::cos(azimuth), std::cos(kDown) * std::sin(azimuth), -std::sin(kDown));
    net.add(Kind::content, Vec3(0.0, 0.0, 1.0) + 2.0 * kR * down_to_it, kR);
  }
  for (BallId k = 1; k <= 3; ++k) {
    net.push(0, k, kWeight / (3.0 * std::sin(kDown)));
    rest_on_three(net, k, 4.0 / 3.0 * kWeight);
  }
  const auto support = supports(net.state, net.contacts, Choice::strongest);
  for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(support[k].n, 3) << k;
  EXPECT_TRUE(bridges(net.state, support).empty());
}

TEST(Arches, ColumnStandsOnTheBallBelow) {
  ForceNetwork net;
  for (int k = 0; k < 4; ++k) net.add(k == 0 ? Kind::plug : Kind::content, {0.0, 0.0, 2.0 * kR * k}, kR);
  for (BallId k = 1; k < 4; ++k) net.push(k, k - 1, kWeight * static_cast<double>(4 - k));
  const auto support = supports(net.state, net.contacts, Choice::strongest);
  for (std::size_t k = 1; k < 4; ++k) {
    ASSERT_EQ(support[k].n, 1) << k;
    EXPECT_EQ(support[k].by[0], static_cast<BallId>(k - 1));
  }
  EXPECT_TRUE(bridges(net.state, support).empty());
}

TEST(Arches, WhatDoesNotEncloseDoesNotHold) {
  const auto held = [](const std::vector<std::pair<Vec3, double>>& pushes) {
    ForceNetwork net;
    net.add(Kind::content, Vec3::Zero(), kR);
    for (const auto& [direction, force] : pushes) net.hold(Kind::wall, 0, direction, force);
    return supports(net.state, net.contacts, Choice::strongest)[0].n;
  };
  const Vec3 a(1.0, 0.0, 1.0), b(-1.0, 1.0, 1.0), c(-1.0, -1.0, 1.0);  // pushes upward from three sides
  EXPECT_EQ(held({{a, 1.0}, {b, 1.0}, {c, 1.0}}), 3);
  EXPECT_EQ(held({{a, 1.0}, {b, 1.0}}), 0);
  EXPECT_EQ(held({{-a, 1.0}, {-b, 1.0}, {-c, 1.0}}), 0);                              // from above
  EXPECT_EQ(held({{a, 1.0}, {b, 1.0}, {Vec3(1.0, 1.0, 1.0), 1.0}}), 0);               // all from one side
  EXPECT_EQ(held({{a, 1.0}, {b, 1.0}, {c, -1.0}}), 0);                                // one pulls
  EXPECT_EQ(held({{a, 1.0}, {Vec3(-2.0, 0.0, 1.0), 1.0}}), 2);                        // two opposite each other
  EXPECT_EQ(held({{a, 1.0}, {Vec3(2.0, 0.0, 1.0), 1.0}}), 0);                         // two in one plane on one side
  EXPECT_EQ(held({{a, 1.0}, {Vec3(-1.0, 0.0, -2.0), 0.1}}), 0);                       // two, the line between them above
  EXPECT_EQ(held({{Vec3::UnitZ(), 1.0}}), 1);
  EXPECT_EQ(held({{-Vec3::UnitZ(), 1.0}}), 0);
  EXPECT_EQ(held({{a, 0.0}, {b, 1.0}, {c, 1.0}}), 0);                                 // one does nothing
  EXPECT_EQ(held({{Vec3(1.0, 0.0, -0.5), 1.0}, {b, 1.0}, {c, 1.0}}), 3);              // one sits above the centre
  EXPECT_EQ(held({{Vec3(1.0, 0.0, -0.5), 9.0}, {b, 1.0}, {c, 1.0}}), 0);              // and all push the ball down
  EXPECT_EQ(held({{Vec3(1.0, 0.0, -2.0), 0.1}, {b, 1.0}, {c, 1.0}}), 0);              // so high that the vertical meets them above
}

TEST(Arches, ChoiceDecidesBetweenSeveralSupports) {
  ForceNetwork net;
  net.add(Kind::content, Vec3::Zero(), kR);
  for (int k = 0; k < 6; ++k) {  // in turn a steep one that bears little and a shallow one that bears much
    const double azimuth = std::numbers::pi * k / 3.0, down = k % 2 == 0 ? 1.0 : 0.4;
    const Vec3 up(-std::cos(down) * std::cos(azimuth), -std::cos(down) * std::sin(azimuth), std::sin(down));
    net.hold(Kind::wall, 0, up, k % 2 == 0 ? 1.0 : 10.0);
  }
  EXPECT_EQ(supports(net.state, net.contacts, Choice::lowest)[0].by, (std::array<BallId, 3>{1, 3, 5}));
  EXPECT_EQ(supports(net.state, net.contacts, Choice::strongest)[0].by, (std::array<BallId, 3>{2, 4, 6}));
}

// ------------------------------------------------- against brute force

/// Weights of three directions that add up to straight down, if there are such above zero.
bool can_hold(const Vec3& a, const Vec3& b, const Vec3& c) {
  Eigen::Matrix3d directions;
  directions << a, b, c;
  const Vec3 weight = directions.fullPivLu().solve(-Vec3::UnitZ());
  return weight.minCoeff() > 0.0;
}

/// The three supports of a ball with the largest upward force, over all triples of contacts in a list.
std::vector<BallId> brute_support(const ForceNetwork& net, BallId ball) {
  struct Seen {
    BallId other;
    Vec3 force;
  };
  std::vector<Seen> seen;
  for (const core::Contact& c : net.contacts) {
    const Vec3 to_j = net.state.position[static_cast<std::size_t>(c.j)] - net.state.position[static_cast<std::size_t>(c.i)];
    if (c.force.dot(to_j) > 0.0) continue;  // pulls
    if (c.i == ball) seen.push_back({c.j, c.force});
    if (c.j == ball) seen.push_back({c.i, -c.force});
  }
  std::vector<BallId> best;
  double most = 0.0;
  for (const Seen& a : seen)
    for (const Seen& b : seen)
      for (const Seen& c : seen) {
        if (a.other >= b.other || b.other >= c.other) continue;
        const double upward = (a.force + b.force + c.force)[2];
        if (upward <= most || !can_hold(-a.force, -b.force, -c.force)) continue;
        most = upward;
        best = {a.other, b.other, c.other};
      }
  return best;
}

TEST(Arches, SupportsAndBridgesAgreeWithBruteForce) {
  std::size_t n_bridges = 0, largest = 0;
  for (unsigned seed = 1; seed <= 40; ++seed) {
    const ForceNetwork net = tests::random_network(seed);
    const auto support = supports(net.state, net.contacts, Choice::strongest);
    std::vector<std::vector<BallId>> expected;
    for (std::size_t k = 0; k < net.state.size(); ++k) {
      const bool moves = net.state.kind[k] == Kind::content;
      expected.push_back(moves ? brute_support(net, net.state.id[k]) : std::vector<BallId>{});
      EXPECT_EQ(std::vector<BallId>(support[k].balls().begin(), support[k].balls().end()), expected[k]) << k;
    }
    const auto rests_on = [&](std::size_t a, std::size_t b) {
      return std::count(expected[a].begin(), expected[a].end(), static_cast<BallId>(b)) > 0;
    };
    std::vector<std::pair<std::size_t, std::size_t>> bonds;
    std::vector<Bond> expected_bonds;
    for (std::size_t a = 0; a < net.state.size(); ++a)
      for (std::size_t b = 0; b < a; ++b)
        if (rests_on(a, b) && rests_on(b, a)) {
          bonds.emplace_back(a, b);
          expected_bonds.emplace_back(b, a);
        }
    const auto found = bridges(net.state, support);
    std::vector<std::vector<BallId>> members;
    std::vector<Bond> found_bonds;
    for (const Bridge& bridge : found) {
      members.push_back(bridge.members);
      double span = 0.0, height = 0.0;
      for (const BallId a : bridge.members)
        for (const BallId b : bridge.members) {
          const Vec3 apart = net.state.position[static_cast<std::size_t>(a)] - net.state.position[static_cast<std::size_t>(b)];
          span = std::max(span, std::hypot(apart[0], apart[1]));
          height = std::max(height, apart[2]);
        }
      EXPECT_NEAR(bridge.span, span, 1e-14);  // rounding
      EXPECT_EQ(bridge.height, height);
      found_bonds.insert(found_bonds.end(), bridge.bonds.begin(), bridge.bonds.end());
      largest = std::max(largest, bridge.members.size());
    }
    EXPECT_EQ(members, tests::groups(tests::spread_names(net.state.size(), bonds), 2));
    std::sort(found_bonds.begin(), found_bonds.end());
    std::sort(expected_bonds.begin(), expected_bonds.end());
    EXPECT_EQ(found_bonds, expected_bonds);
    n_bridges += found.size();
  }
  EXPECT_GT(n_bridges, 200u);  // else it has compared next to nothing
  EXPECT_GE(largest, 4u);
}

TEST(Arches, NamesAndDirectionsDoNotMatter) {
  const ForceNetwork net = tests::random_network(5);
  const auto found = bridges_of(net);
  const auto names = tests::reversed_names(net.state);
  std::map<std::vector<BallId>, Bridge> by_members;
  for (const Bridge& bridge : bridges_of(tests::renumbered(net, names))) by_members[bridge.members] = bridge;
  const auto rotated = bridges_of(tests::turned(net, 1.234));
  ASSERT_EQ(by_members.size(), found.size());
  ASSERT_EQ(rotated.size(), found.size());
  for (std::size_t k = 0; k < found.size(); ++k) {
    const Bridge &bridge = found[k], &other = by_members[tests::renamed(bridge.members, names)];
    EXPECT_EQ(rotated[k].members, bridge.members);
    EXPECT_EQ(rotated[k].bases, bridge.bases);
    EXPECT_EQ(other.bases, tests::renamed(bridge.bases, names));
    for (const Bridge& same : {rotated[k], other}) {
      EXPECT_EQ(same.bonds.size(), bridge.bonds.size());
      EXPECT_EQ(same.topology, bridge.topology);
      EXPECT_EQ(same.shape, bridge.shape);
      EXPECT_EQ(same.on_wall, bridge.on_wall);
      EXPECT_NEAR(same.span, bridge.span, 1e-13);      // rounding of numbers of order 1
      EXPECT_NEAR(same.height, bridge.height, 1e-13);
      EXPECT_LT((same.gyration - bridge.gyration).norm(), 1e-13);
    }
  }
}

TEST(Arches, CountsBySize) {
  std::vector<Bridge> all(3);
  all[0].members = {1, 2};
  all[1].members = {3, 4, 5, 6};
  all[2].members = {7, 8};
  EXPECT_EQ(count_by_size(all), (std::vector<std::int64_t>{0, 0, 2, 0, 1}));
  EXPECT_TRUE(count_by_size({}).empty());
}

// --------------------------------------------------------------- speeds

/// A bridge of balls 0 and 1 at x = 2 and 2 + 2 r, with balls around it, whose speeds are powers of two.
struct Beside {
  ForceNetwork net;
  Bridge bridge;

  Beside() {
    bridge.members = {0, 1};
    place({0.0, 0.0, 0.0}, 1.0);
    place({2.0, 0.0, 0.0}, 3.0);
    place({0.3, 0.0, 2.5}, 4.0);    // above the first
    place({2.0, 1.5, 3.5}, 8.0);    // above the second
    place({2.0, 0.0, -2.0}, 16.0);  // below the second
    place({0.0, 2.1, 2.5}, 32.0);   // its shadow passes
    place({3.8, 0.0, 0.9}, 64.0);   // neither higher nor lower by its radius
    place({0.0, 0.0, -7.0}, 128.0); // out of reach
    net.add(Kind::wall, Vec3(2.0, 0.0, 2.5 * kR), kR);
  }
  /// At (2 m, 0, 0) and so many radii beside it.
  void place(const Vec3& radii, double speed) {
    net.add(Kind::content, Vec3(2.0, 0.0, 0.0) + kR * radii, kR, Vec3(0.6, 0.0, -0.8) * speed);
  }
};

TEST(Arches, SpeedsOnBothSidesAreThoseInItsShadow) {
  const Beside scene;
  const Sides sides = speeds_beside(scene.net.state, {scene.bridge}, 5.0 * kR).front();
  EXPECT_EQ(sides.above, 2);
  EXPECT_EQ(sides.below, 1);
  EXPECT_DOUBLE_EQ(sides.speed_above, 6.0);  // rounding of 0.6 and 0.8
  EXPECT_DOUBLE_EQ(sides.speed_below, 16.0);
  EXPECT_DOUBLE_EQ(sides.speed_within, 2.0);
  EXPECT_EQ(speeds_beside(scene.net.state, {scene.bridge}, 8.0 * kR).front().below, 2);
}

TEST(Arches, ReachCountsFromTheNearestMember) {
  ForceNetwork net;  // two members far apart in height; a ball above the lower one, below the upper one's height
  net.add(Kind::content, Vec3::Zero(), kR);
  net.add(Kind::content, {3.0 * kR, 0.0, 4.0 * kR}, kR);
  net.add(Kind::content, {0.0, 0.0, 3.5 * kR}, kR);
  Bridge bridge;
  bridge.members = {0, 1};
  EXPECT_EQ(speeds_beside(net.state, {bridge}, 3.0 * kR).front().above, 0);
  EXPECT_EQ(speeds_beside(net.state, {bridge}, 4.0 * kR).front().above, 1);
}

TEST(Arches, TurnedBridgeLooksElsewhere) {
  Beside scene;
  scene.net.add(Kind::content, {-2.0, 0.0, 3.0 * kR}, kR, Vec3(0.0, 0.0, 5.0));
  scene.net.add(Kind::content, {-2.0, 0.0, 0.0}, kR, Vec3(0.0, 0.0, 7.0));  // in the bridge's place
  const Sides sides = speeds_beside(scene.net.state, {scene.bridge}, 5.0 * kR, std::numbers::pi).front();
  EXPECT_EQ(sides.above, 1);
  EXPECT_EQ(sides.below, 0);
  EXPECT_DOUBLE_EQ(sides.speed_above, 5.0);
  EXPECT_EQ(sides.speed_below, 0.0);
}

TEST(Arches, SupportsOfAnotherStateAreRejected) {
  const ForceNetwork net = make_arch(3, 0.0);
  EXPECT_THROW(bridges(net.state, {}), core::InputError);
  EXPECT_THROW(supports(net.state, {{0, 99, Kind::wall, 0.0, 0.0, Vec3::Zero()}}, Choice::lowest), core::InputError);
}

}  // namespace
}  // namespace grainclock::silo
