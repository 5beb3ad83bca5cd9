// Accelerations as a function of positions and velocities: the steppers' own force routine for other integrators.
#pragma once

#include "core/force_scale.hpp"
#include "core/neighbours.hpp"

#include <span>

namespace grainclock::core {

/// What of the accelerations is wanted. Two splittings into parts, each adding up to the whole:
/// springs and dashpots, ball_pairs and fixed_pairs. Gravity belongs to springs and to ball_pairs.
enum class Part {
  all,
  springs,      // the law as it is without dashpots
  dashpots,     // what the dashpots change of that: where a contact is clamped they take back the spring's push
  ball_pairs,   // contacts of content with content
  fixed_pairs,  // contacts of content with fixed balls
};

/// Content balls in order of id; fixed balls stay where they are. Keeps its own pair list and renews it when needed.
///
/// Sums are exact in the integer force unit (force_scale.hpp), about 2^-57 of the scene's force limit. What limits
/// the accuracy is the rounding of positions instead: an overlap of balls at |x| is known to about 1e-16 |x|,
/// hence an acceleration to 1e-16 |x| k / m. For 56 kg against a wall of 1e9 N/m at 5 m that is 1e-8 m/s2.
class ForceField {
 public:
  ForceField(const State& state, const Materials& materials, const Vec3& gravity, bool outlet_open, int threads);

  /// Number of content balls.
  std::size_t size() const { return balls_.content_count(); }
  /// Accelerations [m/s2] for positions [m] and velocities [m/s]; each 3 size(), ball by ball.
  /// Throws NumericsError where a force or overlap is beyond the limit or not finite.
  void acceleration(std::span<const double> x, std::span<const double> v, std::span<double> a, Part part = Part::all);
  std::uint64_t contact_evaluations() const { return contact_evaluations_; }

 private:
  /// Puts the balls where they are; whether the list still holds every pair that may touch.
  bool load(std::span<const double> x, std::span<const double> v);
  void find_places();
  /// Adds the forces of one kind of pair to the sums.
  void sweep(bool fixed, bool damped);
  /// Adds the forces of a part to the sums.
  void sum_up(Part part);

  Materials materials_, undamped_;
  Vec3 gravity_;
  Balls balls_;
  NeighbourList list_;
  ForceScale scale_;
  std::vector<BallId> ids_;           // sorted
  std::vector<std::uint32_t> place_;  // of each row in order of id
  std::vector<IntVec> sums_;          // all zero between calls; the far row has one too
  std::uint64_t contact_evaluations_ = 0;
  bool has_list_ = false, overloaded_ = false;
};

}  // namespace grainclock::core
