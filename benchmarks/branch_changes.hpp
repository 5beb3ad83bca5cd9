// The branches of the contact law, each a smooth formula of its own, and when a pair leaves one for another.
//
// A pair leaves its branch where an exit function, linear in overlap and rate, falls below zero. The branch is kept in
// memory: a pair at a root, on whichever side rounding has put it, belongs to the branch it was last found to enter.
#pragma once

#include "benchmarks/reference.hpp"
#include "core/contact_law.hpp"
#include "core/events.hpp"

#include <span>

namespace grainclock::benchmarks {

/// d: overlap, r: its rate, N/k: reach of cohesion.
enum class Branch : std::uint8_t {
  apart,    // d <= 0, or d < -N/k with cohesion: no force
  nearing,  // within the reach, r >= 0: no force
  parting,  // within the reach, r < 0: k d
  pressed,  // d > 0: k d + c r
  clamped,  // d > 0 and k d + c r < 0, without tension: no force
};

/// The branch that the law is on.
Branch branch_of(const core::ContactLaw& law, const core::Approach& at);

/// The branch's formula, on either side of its limits [N].
double branch_force(const core::ContactLaw& law, Branch branch, const core::Approach& at);
/// The same law without its dashpot, on the side of `branch` (the part `springs` of core::ForceField) [N].
double branch_spring(const core::ContactLaw& law, Branch branch, const core::Approach& at);

/// The branch ends where overlap_weight d + rate_weight r + offset falls below zero: a length, or a rate.
struct Exit {
  double overlap_weight;  // 1
  double rate_weight;     // s, or 1
  double offset;          // m
  Branch to;
  ChangeKind kind;

  double value(const core::Approach& at) const { return overlap_weight * at.overlap + rate_weight * at.rate + offset; }
};

/// At most two ways out of a branch.
struct Exits {
  Exit exit[2];
  std::size_t n = 0;
  std::span<const Exit> all() const { return {exit, n}; }
};
Exits exits_of(const core::ContactLaw& law, Branch branch);

/// What rounding, or an integration's tolerance, makes of overlaps [m] and rates [m/s]; an exit counts only beyond that.
struct Rounding {
  double overlap, rate;
  double of(const Exit& exit) const;
};

/// How a branch may have ended within a step of which both ends are known.
enum class Passage {
  none,
  through,  // beyond the exit at one of the step's ends
  grazing,  // within the branch at both ends, but perhaps not in between
};
/// Follows the cubic Hermite path of the overlap between the two ends of a step of `h` [s]. A graze is reported where the
/// path's lowest point is within a margin for the path's own error.
Passage passage(const Exit& exit, const core::Approach& start, const core::Approach& end, double h,
                const Rounding& rounding);

}  // namespace grainclock::benchmarks
