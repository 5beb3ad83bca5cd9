// Accelerations as a function of positions and velocities: the steppers' own force routine for other integrators.
#pragma once

#include "core/force_scale.hpp"
#include "core/neighbours.hpp"

#include <span>

namespace grainclock::core {

/// Content balls in order of id; fixed balls stay where they are. Keeps its own pair list and renews it when needed.
class ForceField {
 public:
  ForceField(const State& state, const Materials& materials, const Vec3& gravity, bool outlet_open, int threads);

  /// Number of content balls.
  std::size_t size() const { return balls_.content_count(); }
  /// Accelerations [m/s2] for positions [m] and velocities [m/s]; each 3 size(), ball by ball.
  /// Throws NumericsError where a force or overlap is beyond the limit or not finite.
  void acceleration(std::span<const double> x, std::span<const double> v, std::span<double> a);
  std::uint64_t contact_evaluations() const { return contact_evaluations_; }

 private:
  Materials materials_;
  Vec3 gravity_;
  Balls balls_;
  NeighbourList list_;
  ForceScale scale_;
  std::vector<BallId> ids_;           // sorted
  std::vector<std::uint32_t> place_;  // of each row in order of id
  std::vector<IntVec> sums_;
  std::uint64_t contact_evaluations_ = 0;
  bool has_list_ = false;
};

}  // namespace grainclock::core
