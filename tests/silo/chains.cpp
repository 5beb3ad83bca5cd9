#include "silo/chains.hpp"

#include "core/check.hpp"
#include "tests/support/force_network.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <numbers>

namespace grainclock::silo {
namespace {

using core::BallId;
using core::Kind;
using tests::ForceNetwork;

constexpr double kR = 0.22;        // m
constexpr double kLoad = 1000.0;   // N

/// Adds n balls in a row around a centre and the loads along it, from a wall ball at each end. `shared` >= 0: this ball is
/// the one in the middle. Returns the row.
std::vector<BallId> add_row(ForceNetwork& net, int n, const Vec3& centre, const Vec3& along, double load, BallId shared = -1) {
  std::vector<BallId> row;
  for (int k = 0; k < n; ++k)
    row.push_back(2 * k + 1 == n && shared >= 0 ? shared : net.add(Kind::content, centre + kR * (2 * k - n + 1) * along, kR));
  for (std::size_t k = 0; k + 1 < row.size(); ++k) net.push(row[k], row[k + 1], load);
  net.hold(Kind::wall, row.front(), along, load);
  net.hold(Kind::wall, row.back(), -along, load);
  return row;
}

void add_idle(ForceNetwork& net, int n) {
  for (int k = 0; k < n; ++k) net.add(Kind::content, {10.0 + k, 0.0, 0.0}, kR);
}

TEST(Chains, RowUnderAxialLoadIsOneChain) {
  ForceNetwork net;
  const Vec3 along = Vec3(1.0, 2.0, 2.0) / 3.0;
  const auto row = add_row(net, 5, {0.0, 0.0, 1.0}, along, kLoad);
  add_idle(net, 5);
  const auto chains = compression_chains(net.state, net.contacts);
  ASSERT_EQ(chains.size(), 1u);
  EXPECT_EQ(chains[0].members, row);
  EXPECT_EQ(chains[0].links, 4);
  EXPECT_FALSE(chains[0].branches);
  EXPECT_NEAR(chains[0].length, 8.0 * kR, 1e-13);  // rounding
  EXPECT_EQ(share_in_chains(net.state, chains), 0.5);

  const auto load = largest_compression(net.state, net.contacts);
  const double stress = 2.0 * kR * kLoad / (4.0 / 3.0 * std::numbers::pi * kR * kR * kR);
  for (const BallId ball : row) {
    const Load& its = load[static_cast<std::size_t>(ball)];
    EXPECT_NEAR(its.stress / stress, 1.0, 1e-14);                         // rounding
    EXPECT_NEAR(std::abs(its.direction.dot(along)), 1.0, 1e-14);          // likewise
  }
  EXPECT_EQ(load.back().stress, 0.0);
  EXPECT_EQ(load.back().direction, Vec3::Zero());
}

TEST(Chains, TwoBallsAreNoChainAndAllAlikeHaveNone) {
  ForceNetwork pair;
  add_row(pair, 2, Vec3::Zero(), Vec3::UnitX(), kLoad);
  add_idle(pair, 5);
  EXPECT_TRUE(compression_chains(pair.state, pair.contacts).empty());

  ForceNetwork alike;  // nothing is above the mean
  add_row(alike, 4, Vec3::Zero(), Vec3::UnitX(), 1024.0);
  EXPECT_TRUE(compression_chains(alike.state, alike.contacts).empty());
}

TEST(Chains, StrongerOfTwoCrossingRowsCutsTheOther) {
  ForceNetwork net;
  const auto strong = add_row(net, 7, Vec3::Zero(), Vec3::UnitX(), 2.0 * kLoad);
  const auto weak = add_row(net, 7, Vec3::Zero(), Vec3::UnitZ(), kLoad, strong[3]);
  add_idle(net, 20);
  const auto chains = compression_chains(net.state, net.contacts);
  ASSERT_EQ(chains.size(), 3u);
  EXPECT_EQ(chains[0].members, strong);
  EXPECT_FALSE(chains[0].branches);
  EXPECT_EQ(chains[1].members, (std::vector<BallId>{weak[0], weak[1], weak[2]}));
  EXPECT_EQ(chains[2].members, (std::vector<BallId>{weak[4], weak[5], weak[6]}));
  EXPECT_EQ(share_in_chains(net.state, chains), 13.0 / 33.0);
}

TEST(Chains, RowThatForksBranches) {
  ForceNetwork net;  // the load of a row of three goes on through two rows at 30 degrees on either side
  std::vector<BallId> row;
  for (int k = 0; k < 3; ++k) row.push_back(net.add(Kind::content, {2.0 * kR * k, 0.0, 0.0}, kR));
  net.hold(Kind::wall, row[0], Vec3::UnitX(), kLoad);
  for (std::size_t k = 0; k < 2; ++k) net.push(row[k], row[k + 1], kLoad);
  for (const double side : {-0.5, 0.5}) {
    const Vec3 on(std::sqrt(0.75), side, 0.0);
    BallId before = row[2];
    for (int k = 1; k <= 2; ++k) {
      const BallId next = net.add(Kind::content, Vec3(4.0 * kR, 0.0, 0.0) + 2.0 * kR * k * on, kR);
      net.push(before, next, kLoad / std::sqrt(3.0));
      before = next;
    }
    net.hold(Kind::wall, before, -on, kLoad / std::sqrt(3.0));
  }
  EXPECT_LT(net.force_on(row[2]).norm(), 1e-10);  // rounding: the fork is balanced
  add_idle(net, 14);
  const auto chains = compression_chains(net.state, net.contacts);
  ASSERT_EQ(chains.size(), 1u);
  EXPECT_EQ(chains[0].members.size(), 7u);
  EXPECT_EQ(chains[0].links, 6);
  EXPECT_TRUE(chains[0].branches);
}

TEST(Chains, KinkOfMoreThan45DegreesEndsAChain) {
  for (const double kink : {40.0, 50.0}) {  // degrees between the last ball's load and the line to it
    ForceNetwork net;
    const auto row = add_row(net, 3, Vec3::Zero(), Vec3::UnitX(), kLoad);
    const double angle = kink * std::numbers::pi / 180.0;
    const BallId last = net.add(Kind::content, Vec3(4.0 * kR, 0.0, 0.0), kR);  // touches the row in its own direction
    net.push(row[2], last, 1e-3 * kLoad);
    const Vec3 load(std::cos(angle), std::sin(angle), 0.0);
    net.hold(Kind::wall, last, load, kLoad);
    net.hold(Kind::wall, last, -load, kLoad);
    add_idle(net, 10);
    const auto chains = compression_chains(net.state, net.contacts);
    ASSERT_EQ(chains.size(), 1u);
    EXPECT_EQ(chains[0].members.size(), kink < 45.0 ? 4u : 3u);
  }
}

/// Largest eigenvector of a symmetric matrix by powers of a shifted one; its value.
std::pair<double, Vec3> by_powers(const Eigen::Matrix3d& m) {
  const double shift = m.norm();
  Vec3 v(0.3, 0.5, 0.8);
  for (int k = 0; k < 20000; ++k) v = ((m + shift * Eigen::Matrix3d::Identity()) * v).normalized();
  return {v.dot(m * v), v};
}

TEST(Chains, AgreeWithBruteForce) {
  std::size_t n_chains = 0;
  for (const unsigned seed : {1u, 2u, 3u}) {
    const ForceNetwork net = tests::random_network(seed);
    std::vector<Eigen::Matrix3d> stress(net.state.size(), Eigen::Matrix3d::Zero());
    const auto place = [](BallId ball) { return static_cast<std::size_t>(ball); };
    const auto line = [&](const core::Contact& c) {
      return Vec3((net.state.position[place(c.j)] - net.state.position[place(c.i)]).normalized());
    };
    for (const core::Contact& c : net.contacts)
      for (const BallId ball : {c.i, c.j}) {
        const double r = net.state.radius[place(ball)];
        stress[place(ball)] -= line(c) * c.force.transpose() / (4.0 / 3.0 * std::numbers::pi * r * r);
      }
    std::vector<std::pair<double, Vec3>> principal;
    double mean = 0.0;
    const double n_content = static_cast<double>(net.state.count(Kind::content));
    for (std::size_t k = 0; k < net.state.size(); ++k) {
      const bool moves = net.state.kind[k] == Kind::content;
      principal.push_back(moves ? by_powers(stress[k]) : std::pair{0.0, Vec3(Vec3::Zero())});
      mean += principal[k].first / n_content;
    }
    std::vector<std::pair<std::size_t, std::size_t>> links;
    for (const core::Contact& c : net.contacts) {
      if (c.other != Kind::content || c.force.dot(line(c)) > 0.0) continue;
      const auto &a = principal[place(c.i)], &b = principal[place(c.j)];
      if (std::min(a.first, b.first) <= mean) continue;
      const double least = std::min(std::abs(a.second.dot(line(c))), std::abs(b.second.dot(line(c))));
      if (std::acos(least) <= std::numbers::pi / 4.0) links.emplace_back(place(c.i), place(c.j));
    }
    std::vector<std::vector<BallId>> found;
    for (const Chain& chain : compression_chains(net.state, net.contacts)) found.push_back(chain.members);
    EXPECT_EQ(found, tests::groups(tests::spread_names(net.state.size(), links), 3));
    n_chains += found.size();
  }
  EXPECT_GT(n_chains, 5u);  // else it has compared next to nothing
}

TEST(Chains, NamesAndDirectionsDoNotMatter) {
  const ForceNetwork net = tests::random_network(6);
  const auto names = tests::reversed_names(net.state);
  const auto found = compression_chains(net.state, net.contacts);
  ASSERT_FALSE(found.empty());
  const ForceNetwork rotated_net = tests::turned(net, 2.2), named_net = tests::renumbered(net, names);
  const auto rotated = compression_chains(rotated_net.state, rotated_net.contacts);
  std::map<std::vector<BallId>, Chain> named;
  for (const Chain& chain : compression_chains(named_net.state, named_net.contacts)) named[chain.members] = chain;
  ASSERT_EQ(rotated.size(), found.size());
  ASSERT_EQ(named.size(), found.size());
  for (std::size_t k = 0; k < found.size(); ++k) {
    EXPECT_EQ(rotated[k].members, found[k].members);
    const Chain& other = named[tests::renamed(found[k].members, names)];
    EXPECT_EQ(other.links, found[k].links);
    EXPECT_NEAR(other.length, found[k].length, 1e-13);  // rounding
    EXPECT_NEAR(rotated[k].length, found[k].length, 1e-13);
  }
  EXPECT_EQ(unloaded_share(rotated_net.state, rotated_net.contacts, 0.5), unloaded_share(net.state, net.contacts, 0.5));
}

// --------------------------------------------------------------- forces

TEST(Chains, DistributionIsADensityOverTheMean) {
  const std::vector<double> forces{1.0, 2.0, 3.0, 6.0};  // N, over their mean: 1/3, 2/3, 1, 2
  const auto all = force_distribution(forces, {0.0, 0.5, 1.0, 2.0});
  EXPECT_EQ(all.mean, 3.0);
  EXPECT_EQ(all.density, (std::vector<double>{0.5, 0.5, 0.5}));  // 1 opens a bin, 2 closes the last
  EXPECT_EQ(all.outside, 0.0);
  const auto some = force_distribution(forces, {0.5, 1.0});
  EXPECT_EQ(some.density, std::vector<double>{1.0});
  EXPECT_EQ(some.outside, 0.5);
  const auto none = force_distribution({}, {0.0, 1.0});
  EXPECT_EQ(none.mean, 0.0);
  EXPECT_EQ(none.density, std::vector<double>{0.0});
}

TEST(Chains, ImpossibleBinsAreRejected) {
  EXPECT_THROW(force_distribution({1.0}, {}), core::InputError);
  EXPECT_THROW(force_distribution({1.0}, {1.0}), core::InputError);
  EXPECT_THROW(force_distribution({1.0}, {0.0, 1.0, 1.0}), core::InputError);
  EXPECT_THROW(force_distribution({1.0}, {1.0, 0.0}), core::InputError);
}

TEST(Chains, UnloadedAreThoseWhoseLargestForceIsSmall) {
  ForceNetwork net;
  add_row(net, 3, Vec3::Zero(), Vec3::UnitX(), 100.0);  // four contacts of 100 N
  add_row(net, 2, Vec3::UnitY(), Vec3::UnitX(), 20.0);  // three of 20 N: the mean is 460 N / 7 = 65.7 N
  add_idle(net, 3);
  net.push(0, 1, -500.0);  // a pull is no load and not in the mean
  EXPECT_EQ(pushing_forces(net.state, net.contacts), (std::vector<double>{100.0, 100.0, 100.0, 100.0, 20.0, 20.0, 20.0}));
  EXPECT_EQ(unloaded_share(net.state, net.contacts, 0.0), 3.0 / 8.0);
  EXPECT_EQ(unloaded_share(net.state, net.contacts, 0.30), 3.0 / 8.0);
  EXPECT_EQ(unloaded_share(net.state, net.contacts, 0.31), 5.0 / 8.0);  // 20.4 N
  EXPECT_EQ(unloaded_share(net.state, net.contacts, 1.6), 1.0);
  EXPECT_EQ(unloaded_share({}, {}, 0.5), 0.0);
}

TEST(Chains, ContactOfAnUnknownBallIsRejected) {
  ForceNetwork net;
  net.add(Kind::content, Vec3::Zero(), kR);
  const std::vector<core::Contact> contacts{{0, 9, Kind::wall, 0.0, 0.0, Vec3::Zero()}};
  EXPECT_THROW(pushing_forces(net.state, contacts), core::InputError);
  EXPECT_THROW(compression_chains(net.state, contacts), core::InputError);
}

}  // namespace
}  // namespace grainclock::silo
