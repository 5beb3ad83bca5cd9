// The touching pairs of a content system, for dashpots that are not stepped explicitly.
//
// Pairs are in order of ids, whatever the list and its sort in space: what goes through them one after
// another gives the same bits with any skin and any number of threads. Each pair remembers its dashpot's last force.
#pragma once

#include "core/neighbours.hpp"

#include <span>
#include <tuple>

namespace grainclock::core {

/// One touching pair.
struct Touch {
  Vec3 normal;            // from j to i
  double overlap, rate;   // m, m/s
  double spring;          // N, along the normal, positive pushing apart
  double c;               // N s/m
  double least;           // N, the clamp: the dashpot's force is not below it
  double dashpot;         // N, the dashpot's force; when found, the last one
  std::uint32_t i, j;     // rows; i is content
  std::uint32_t listed;   // its place among all listed pairs
  bool both;              // j is content

  double force() const { return spring + dashpot; }
};

/// d(overlap)/dt [m/s] of two balls with this normal from b to a.
inline double rate_along(const Vec3& normal, const BallRow& a, const BallRow& b) { return -normal.dot(velocity(a) - velocity(b)); }

/// A remembered dashpot force, for restarts.
struct DashpotForce {
  BallId i, j;
  double force;  // N
};

class DashpotTouches {
 public:
  DashpotTouches(const ContactLaw& ball, const ContactLaw& wall) : ball_law_(ball), wall_law_(wall) {}

  /// Takes the pairs of a new list. Forces stay with their pairs.
  void list(const Balls& balls, const NeighbourList& list);
  /// Finds what touches, with the rates of the rows' velocities. Lasts until the next call.
  std::span<Touch> find(const Balls& balls);
  /// The dashpot forces of the touches are the last ones now; pairs that do not touch have none.
  void remember();

  /// All forces but zeros, in order of ids.
  std::vector<DashpotForce> memory() const;
  void recall(std::span<const DashpotForce> memory);
  /// The last force of a pair [N], 0 if it is not listed.
  double last_force(BallId i, BallId j) const;
  std::size_t listed() const { return pairs_.size(); }

 private:
  struct Pair {
    BallId id_i, id_j;
    std::uint32_t i, j;  // rows
    bool both;
    double dashpot;      // N, last force
    bool operator<(const Pair& other) const { return std::tie(id_i, id_j) < std::tie(other.id_i, other.id_j); }
  };
  const Pair* find_pair(BallId i, BallId j) const;

  ContactLaw ball_law_, wall_law_;
  std::vector<Pair> pairs_, before_;  // sorted
  std::vector<Touch> touches_;
};

}  // namespace grainclock::core
