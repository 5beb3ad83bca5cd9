#include "core/dashpot_touches.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace grainclock::core {

void DashpotTouches::list(const Balls& balls, const NeighbourList& list) {
  std::swap(pairs_, before_);
  pairs_.clear();
  const PairList& among = list.ball_pairs();
  for (std::size_t p = 0; p < among.count; ++p) {
    std::uint32_t i = among.i[p], j = among.j[p];
    if (balls.id[i] > balls.id[j]) std::swap(i, j);
    pairs_.push_back({balls.id[i], balls.id[j], i, j, true, 0.0});
  }
  const PairList& fixed = list.fixed_pairs();
  for (std::size_t p = 0; p < fixed.count; ++p) {
    const std::uint32_t i = fixed.i[p], j = fixed.j[p];
    pairs_.push_back({balls.id_of(i), balls.id_of(j), i, j, false, 0.0});
  }
  std::sort(pairs_.begin(), pairs_.end());
  auto old = before_.begin();
  for (Pair& pair : pairs_) {
    while (old != before_.end() && *old < pair) ++old;
    if (old != before_.end() && !(pair < *old)) pair.dashpot = old->dashpot;
  }
}

std::span<Touch> DashpotTouches::find(const Balls& balls) {
  constexpr double kUnbounded = -std::numeric_limits<double>::infinity();
  touches_.clear();
  for (const Pair& pair : pairs_) {
    const ContactLaw& law = pair.both ? ball_law_ : wall_law_;
    const BallRow &a = balls.rows[pair.i], &b = balls.rows[pair.j];
    const Vec3 d = position(a) - position(b);
    const double radii = a.r + b.r, square = d.squaredNorm();
    if (square >= radii * radii) continue;
    const double distance = std::sqrt(square), overlap = radii - distance, spring = law.k * overlap;
    const Vec3 normal = d / distance;
    touches_.push_back({normal, overlap, rate_along(normal, a, b), spring, law.c, law.tension ? kUnbounded : -spring, pair.dashpot,
                        pair.i, pair.j, static_cast<std::uint32_t>(&pair - pairs_.data()), pair.both});
  }
  return touches_;
}

void DashpotTouches::remember() {
  for (Pair& pair : pairs_) pair.dashpot = 0.0;
  for (const Touch& touch : touches_) pairs_[touch.listed].dashpot = touch.dashpot;
}

std::vector<DashpotForce> DashpotTouches::memory() const {
  std::vector<DashpotForce> memory;
  for (const Pair& pair : pairs_) {
    if (pair.dashpot != 0.0) memory.push_back({pair.id_i, pair.id_j, pair.dashpot});
  }
  return memory;
}

void DashpotTouches::recall(std::span<const DashpotForce> memory) {
  for (const DashpotForce& last : memory) {
    if (const Pair* pair = find_pair(last.i, last.j)) pairs_[static_cast<std::size_t>(pair - pairs_.data())].dashpot = last.force;
  }
}

double DashpotTouches::last_force(BallId i, BallId j) const {
  const Pair* pair = find_pair(i, j);
  return pair != nullptr ? pair->dashpot : 0.0;
}

const DashpotTouches::Pair* DashpotTouches::find_pair(BallId i, BallId j) const {
  const Pair wanted{i, j, 0, 0, false, 0.0};
  const auto found = std::lower_bound(pairs_.begin(), pairs_.end(), wanted);
  return found != pairs_.end() && !(wanted < *found) ? &*found : nullptr;
}

}  // namespace grainclock::core
