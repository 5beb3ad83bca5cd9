// Which balls touch which: the contacts of a state sorted by ball, and connected sets of balls.
#pragma once

#include "core/state.hpp"
#include "core/stepper.hpp"

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

namespace grainclock::silo {

using core::Vec3;

/// A contact as one of its two balls sees it.
struct Touch {
  std::size_t other;  // place of the other ball in the state
  Vec3 towards;       // unit vector to the other's centre
  double push;        // N, normal force that drives the two apart; negative: it pulls
};

/// Contacts by ball, each seen from both of its balls, in the order of the other ball's id. Forces must lie on the line of
/// centres (there is no friction): a part across it is left out.
class ContactGraph {
 public:
  /// Throws InputError if a contact names a ball that the state does not hold, or two balls with one centre.
  ContactGraph(const core::State& state, const std::vector<core::Contact>& contacts);
  std::size_t size() const { return begin_.size() - 1; }
  std::span<const Touch> of(std::size_t ball) const;

 private:
  std::vector<std::size_t> begin_;  // first touch of each ball, and their number
  std::vector<Touch> touches_;
};

/// Place of a ball in the state. Throws InputError if it is not there.
std::size_t place_of(const core::State& state, core::BallId ball);

/// Pairs of numbers, of places in a state.
using Links = std::vector<std::pair<std::size_t, std::size_t>>;

/// Sets of at least two of the numbers below n that these links connect, directly or through others; each set increasing,
/// the sets in the order of their smallest numbers.
std::vector<std::vector<std::size_t>> connected_sets(std::size_t n, const Links& links);

/// Largest distance between two of the points [m]; 0 for fewer than two. Time: square of their number.
double widest(const std::vector<Vec3>& points);

}  // namespace grainclock::silo
