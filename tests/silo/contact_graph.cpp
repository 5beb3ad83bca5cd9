#include "silo/contact_graph.hpp"

#include "core/check.hpp"
#include "tests/support/force_network.hpp"

#include <gtest/gtest.h>

namespace grainclock::silo {
namespace {

using core::Kind;
using tests::ForceNetwork;

TEST(ContactGraph, EachContactIsSeenFromBothBalls) {
  ForceNetwork net;
  net.add(Kind::content, {0.0, 0.0, 0.0}, 0.2);
  net.add(Kind::content, {0.0, 0.0, 0.4}, 0.2);
  net.add(Kind::wall, {0.4, 0.0, 0.0}, 0.2);
  net.push(0, 2, -3.0);
  net.push(0, 1, 7.0);
  const ContactGraph graph(net.state, net.contacts);
  ASSERT_EQ(graph.size(), 3u);
  ASSERT_EQ(graph.of(0).size(), 2u);
  EXPECT_EQ(graph.of(0)[0].other, 1u);  // by id, not as given
  EXPECT_EQ(graph.of(0)[0].towards, Vec3::UnitZ());
  EXPECT_EQ(graph.of(0)[0].push, 7.0);
  EXPECT_EQ(graph.of(0)[1].push, -3.0);
  ASSERT_EQ(graph.of(1).size(), 1u);
  EXPECT_EQ(graph.of(1)[0].towards, -Vec3::UnitZ());
  EXPECT_EQ(graph.of(1)[0].push, 7.0);
  EXPECT_EQ(graph.of(2)[0].other, 0u);
}

TEST(ContactGraph, ContactsOfOtherStatesAreRejected) {
  ForceNetwork net;
  net.add(Kind::content, Vec3::Zero(), 0.2);
  net.add(Kind::content, Vec3::Zero(), 0.2);
  EXPECT_THROW(ContactGraph(net.state, {{0, 9, Kind::content, 0.0, 0.0, Vec3::Zero()}}), core::InputError);
  EXPECT_THROW(ContactGraph(net.state, {{0, 1, Kind::content, 0.0, 0.0, Vec3::Zero()}}), core::InputError);  // one centre
}

TEST(ContactGraph, ConnectedSetsAgreeWithSpreadingNames) {
  std::mt19937_64 engine(1);
  std::uniform_int_distribution<std::size_t> ball(0, 199);
  for (const int n_links : {0, 1, 40, 90, 150, 400}) {
    std::vector<std::pair<std::size_t, std::size_t>> links;
    for (int k = 0; k < n_links; ++k) links.emplace_back(ball(engine), ball(engine));
    std::vector<std::vector<core::BallId>> found;
    for (const auto& set : connected_sets(200, links)) found.emplace_back(set.begin(), set.end());
    EXPECT_EQ(found, tests::groups(tests::spread_names(200, links), 2)) << n_links;
  }
}

TEST(ContactGraph, WidestIsTheLargestDistance) {
  EXPECT_EQ(widest({}), 0.0);
  EXPECT_EQ(widest({Vec3::Ones()}), 0.0);
  EXPECT_EQ(widest({{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, {-2.0, 4.0, 0.0}}), 5.0);  // 3-4-5
}

}  // namespace
}  // namespace grainclock::silo
