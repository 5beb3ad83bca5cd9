#include "silo/chains.hpp"

#include "core/check.hpp"
#include "silo/contact_graph.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <numeric>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;

double mean_of(const std::vector<double>& values) {
  return values.empty() ? 0.0 : std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

Load load_of(double radius, std::span<const Touch> touches) {
  const double volume = 4.0 / 3.0 * std::numbers::pi * radius * radius * radius;
  Eigen::Matrix3d stress = Eigen::Matrix3d::Zero();
  for (const Touch& touch : touches) stress += radius * touch.push / volume * touch.towards * touch.towards.transpose();
  if (stress.isZero(0.0)) return {};
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solved(stress);
  return {solved.eigenvalues()[2], solved.eigenvectors().col(2)};
}

std::vector<Load> loads(const State& state, const ContactGraph& graph) {
  std::vector<Load> out(state.size());
  for (std::size_t ball = 0; ball < state.size(); ++ball)
    if (state.kind[ball] == Kind::content) out[ball] = load_of(state.radius[ball], graph.of(ball));
  return out;
}

Links chain_links(const State& state, const ContactGraph& graph) {
  const std::vector<Load> load = loads(state, graph);
  double mean = 0.0;
  for (const Load& its : load) mean += its.stress;
  mean /= static_cast<double>(std::max(state.count(Kind::content), std::size_t{1}));

  constexpr double kAligned = std::numbers::sqrt2 / 2.0;  // cosine of 45 degrees
  const auto bears_along = [&](std::size_t ball, const Vec3& line) {
    return load[ball].stress > mean && std::abs(load[ball].direction.dot(line)) >= kAligned;
  };
  Links links;
  for (std::size_t ball = 0; ball < state.size(); ++ball)
    for (const Touch& touch : graph.of(ball))
      if (ball < touch.other && touch.push > 0.0 && bears_along(ball, touch.towards) && bears_along(touch.other, touch.towards))
        links.emplace_back(ball, touch.other);
  return links;
}

}  // namespace

std::vector<double> pushing_forces(const State& state, const std::vector<core::Contact>& contacts) {
  std::vector<double> out;
  for (const core::Contact& contact : contacts) {
    const Vec3 from_other = state.position[place_of(state, contact.i)] - state.position[place_of(state, contact.j)];
    if (contact.force.dot(from_other) > 0.0) out.push_back(contact.force.norm());
  }
  return out;
}

ForceDistribution force_distribution(const std::vector<double>& forces, const std::vector<double>& edges) {
  GC_REQUIRE(edges.size() >= 2 && std::adjacent_find(edges.begin(), edges.end(), std::greater_equal<>{}) == edges.end(),
             "{} edges of bins of force: need two at least, each above the one before", edges.size());
  ForceDistribution out{mean_of(forces), std::vector<double>(edges.size() - 1, 0.0), 0.0};
  if (!(out.mean > 0.0)) return out;
  const double share = 1.0 / static_cast<double>(forces.size());
  for (const double force : forces) {
    const double x = force / out.mean;
    if (x < edges.front() || x > edges.back()) {
      out.outside += share;
      continue;
    }
    const auto above = std::upper_bound(edges.begin(), edges.end() - 1, x);
    const auto bin = static_cast<std::size_t>(above - edges.begin()) - 1;
    out.density[bin] += share / (edges[bin + 1] - edges[bin]);
  }
  return out;
}

double unloaded_share(const State& state, const std::vector<core::Contact>& contacts, double fraction) {
  const double limit = fraction * mean_of(pushing_forces(state, contacts));
  const ContactGraph graph(state, contacts);
  std::size_t unloaded = 0;
  for (std::size_t ball = 0; ball < state.size(); ++ball) {
    if (state.kind[ball] != Kind::content) continue;
    double largest = 0.0;
    for (const Touch& touch : graph.of(ball)) largest = std::max(largest, touch.push);
    if (largest < limit || largest == 0.0) ++unloaded;
  }
  return static_cast<double>(unloaded) / static_cast<double>(std::max(state.count(Kind::content), std::size_t{1}));
}

std::vector<Load> largest_compression(const State& state, const std::vector<core::Contact>& contacts) {
  return loads(state, ContactGraph(state, contacts));
}

std::vector<Chain> compression_chains(const State& state, const std::vector<core::Contact>& contacts) {
  const auto links = chain_links(state, ContactGraph(state, contacts));
  std::vector<int> links_of(state.size(), 0);
  for (const auto& [a, b] : links) ++links_of[a], ++links_of[b];
  std::vector<Chain> chains;
  for (const auto& places : connected_sets(state.size(), links)) {
    if (places.size() < 3) continue;
    Chain chain;
    std::vector<Vec3> points;
    for (const std::size_t place : places) {
      chain.members.push_back(state.id[place]);
      chain.links += links_of[place];
      chain.branches = chain.branches || links_of[place] > 2;
      points.push_back(state.position[place]);
    }
    chain.links /= 2;
    chain.length = widest(points);
    chains.push_back(std::move(chain));
  }
  return chains;
}

double share_in_chains(const State& state, const std::vector<Chain>& chains) {
  std::size_t balls = 0;
  for (const Chain& chain : chains) balls += chain.members.size();
  return static_cast<double>(balls) / static_cast<double>(std::max(state.count(Kind::content), std::size_t{1}));
}

}  // namespace grainclock::silo
