// Arches and domes in the content: bridges, the sets of mutually stabilised balls of the literature.
//
// A ball rests on the contacts that hold it against gravity, in general three; two balls of which each is among
// the supports of the other have stabilised each other; balls connected by such bonds are a bridge, the balls
// that support it from outside are its bases. L. A. Pugnaloni, G. C. Barker, A. Mehta, Adv. Complex Syst. 4 (2001) 289;
// A. Mehta, G. C. Barker, J. M. Luck, J. Stat. Mech. (2004) P10014 (linear and complex bridges, domes); in a plane two
// supports: R. Arevalo, D. Maza, L. A. Pugnaloni, Phys. Rev. E 74 (2006) 021303; which of several triples to take where the
// history is not known: M. C. Jenkins et al., Soft Matter 7 (2011) 684.
//
// The rule here, for a moment of a moving content without friction:
// - only contacts that push count (the normal force drives the balls apart);
// - some of them hold the ball if pushes along them, all above zero, can add up to a force straight up, and none can
//   be spared for it. That is: the vertical through the ball's centre meets the triangle of the contact points inside
//   and below the centre. Three contacts do that, or two opposite ones in one vertical plane, or one straight below;
// - what they push now must have a sum that points up;
// - among several sets of supports Choice takes one. A ball without a set is not supported.
// A support may sit above the ball's centre. It must: what pushes one ball of a pair up pushes the other down, so if each
// contact had to push up on its own, no two balls could support each other.
#pragma once

#include "core/state.hpp"
#include "core/stepper.hpp"

#include <array>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace grainclock::silo {

using core::Vec3;

/// Which set of supports a ball is taken to rest on; of equals the first in the order of ids.
enum class Choice {
  strongest,  // largest upward sum of the forces
  lowest,     // lowest mean height of the supporting balls' centres (LCOM of Jenkins et al.)
};

/// What a ball rests on.
struct Support {
  std::array<core::BallId, 3> by{};  // the first n hold, increasing
  int n = 0;                         // 0: the ball is not supported
  double upward = 0.0;               // N, upward part of the force that they exert

  std::span<const core::BallId> balls() const { return {by.data(), static_cast<std::size_t>(n)}; }
  bool includes(core::BallId ball) const;
};

/// Support of each ball of the state, in its order; wall and plug balls need none and have none.
/// Throws InputError if a contact names a ball that the state does not hold.
std::vector<Support> supports(const core::State& state, const std::vector<core::Contact>& contacts, Choice choice);

enum class Topology {
  string,   // an open row: each member has at most two mutual bonds (linear bridge)
  ring,     // a closed row: each member has two
  complex,  // some member has more
};

enum class Shape {
  arch,  // flat in a steep plane: the members lie within half a mean radius (rms) of it, and its normal within 45 degrees of
         // the horizontal; a row of two is an arch
  dome,  // extends in two horizontal directions, or in all three
};

using Bond = std::pair<core::BallId, core::BallId>;  // two balls that support each other, the smaller id first

struct Bridge {
  std::vector<core::BallId> members;  // increasing, two at least
  std::vector<core::BallId> bases;    // increasing
  std::vector<Bond> bonds;            // increasing
  Topology topology = Topology::string;
  Shape shape = Shape::arch;
  bool on_wall = false;               // a base is a wall ball
  double span = 0.0;                  // m, largest horizontal distance between centres of two members
  double height = 0.0;                // m, from the lowest member's centre to the highest one's
  Vec3 gyration = Vec3::Zero();       // m2, eigenvalues of the mean of (x - mean x)(x - mean x)^T over the members, increasing
};

/// The bridges, in the order of their smallest members. `support` is what supports() gave for this state.
/// Throws InputError unless there is one support for each ball.
std::vector<Bridge> bridges(const core::State& state, const std::vector<Support>& support);

/// Number of bridges by size: element n counts those of n members; elements 0 and 1 are 0.
std::vector<std::int64_t> count_by_size(const std::vector<Bridge>& all);

/// Speeds on both sides of a bridge.
struct Sides {
  std::int64_t above = 0, below = 0;  // balls
  double speed_above = 0.0;           // m/s, mean of their speeds; 0 without balls
  double speed_below = 0.0;           // m/s
  double speed_within = 0.0;          // m/s, mean over the members
};

/// For each bridge the content balls whose shadows (vertical projections) overlap a member's: above, or below, are those whose
/// centre is by more than their own radius, and at most by `reach` [m], higher, or lower, than the horizontally nearest member.
/// `turn` [rad] looks as if the bridges stood turned by that angle about the silo's axis x = y = 0, at places of the
/// same height and radius without them: what the field of flow alone does. Time: bridges times the balls at their heights.
std::vector<Sides> speeds_beside(const core::State& state, const std::vector<Bridge>& all, double reach, double turn = 0.0);

}  // namespace grainclock::silo
