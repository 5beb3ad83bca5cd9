#include "silo/contact_graph.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace grainclock::silo {

std::size_t place_of(const core::State& state, core::BallId ball) {
  const auto at = std::lower_bound(state.id.begin(), state.id.end(), ball);
  GC_REQUIRE(at != state.id.end() && *at == ball, "ball {} of a contact is not in the state: pass the state that the contacts "
             "belong to", ball);
  return static_cast<std::size_t>(at - state.id.begin());
}

ContactGraph::ContactGraph(const core::State& state, const std::vector<core::Contact>& contacts) : begin_(state.size() + 1, 0) {
  std::vector<std::pair<std::size_t, std::size_t>> places;
  for (const core::Contact& contact : contacts) {
    places.emplace_back(place_of(state, contact.i), place_of(state, contact.j));
    ++begin_[places.back().first + 1];
    ++begin_[places.back().second + 1];
  }
  std::partial_sum(begin_.begin(), begin_.end(), begin_.begin());
  touches_.resize(begin_.back());
  std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const auto [i, j] = places[k];
    const Vec3 apart = state.position[j] - state.position[i];
    const double distance = apart.norm();
    GC_REQUIRE(distance > 0.0, "balls {} and {} have one centre: a contact needs a direction", contacts[k].i, contacts[k].j);
    const Vec3 towards = apart / distance;
    const double push = -contacts[k].force.dot(towards);
    touches_[next[i]++] = {j, towards, push};
    touches_[next[j]++] = {i, -towards, push};
  }
  for (std::size_t ball = 0; ball < state.size(); ++ball) {
    const std::span<Touch> its = std::span(touches_).subspan(begin_[ball], begin_[ball + 1] - begin_[ball]);
    std::sort(its.begin(), its.end(), [](const Touch& a, const Touch& b) { return a.other < b.other; });
  }
}

std::span<const Touch> ContactGraph::of(std::size_t ball) const {
  return std::span(touches_).subspan(begin_[ball], begin_[ball + 1] - begin_[ball]);
}

std::vector<std::vector<std::size_t>> connected_sets(std::size_t n, const Links& links) {
  std::vector<std::size_t> parent(n);
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&parent](std::size_t k) {
    while (parent[k] != k) k = parent[k] = parent[parent[k]];
    return k;
  };
  for (const auto& [a, b] : links) {
    const std::size_t ra = root(a), rb = root(b);
    parent[std::max(ra, rb)] = std::min(ra, rb);  // so that a root is the smallest of its set
  }
  std::vector<std::vector<std::size_t>> by_root(n), sets;
  for (std::size_t k = 0; k < n; ++k) by_root[root(k)].push_back(k);
  for (auto& set : by_root)
    if (set.size() >= 2) sets.push_back(std::move(set));
  return sets;
}

double widest(const std::vector<Vec3>& points) {
  double square = 0.0;
  for (std::size_t a = 0; a < points.size(); ++a)
    for (std::size_t b = a + 1; b < points.size(); ++b) square = std::max(square, (points[a] - points[b]).squaredNorm());
  return std::sqrt(square);
}

}  // namespace grainclock::silo
