// The pairs whose branch changes stop the reference: all that may meet soon, each with the branch it is on.
#pragma once

#include "benchmarks/branch_changes.hpp"
#include "core/force_field.hpp"

namespace grainclock::benchmarks {

/// Positions [m] and velocities [m/s] of all balls, three numbers each: content in order of id, then the fixed balls.
struct Motion {
  std::vector<double> x, v;
};

struct WatchedPair {
  std::uint32_t i, j;  // numbers of balls in Motion; i is content
  double radii;        // m, their sum
  Branch branch;
  core::Approach start, end;  // at both ends of the step in question
  double window = 0.0;        // s, time of the change since which the changes are counted
  int changes = 0;            // within the window
};

class WatchedPairs {
 public:
  /// `ahead` [s]: the longest step; a pair is watched at least so long before it can meet. `tolerance`: of the integration.
  WatchedPairs(const core::State& state, const core::Materials& materials, bool outlet_open, double ahead,
               const Rounding& tolerance);

  std::size_t content_count() const { return balls_.content_count(); }
  std::size_t ball_count() const { return balls_.content_count() + balls_.fixed_count(); }
  /// Writes the fixed balls into a motion that holds the content.
  void append_fixed(Motion& motion) const;

  /// Renews the set; pairs new to it are apart, or, the first time, on the branch that the law says.
  /// Throws NumericsError if a pair has met unseen.
  void renew(const Motion& motion);
  /// Whether a ball may meet one that is not watched before another longest step is over.
  bool is_worn(const Motion& motion) const;

  /// Notes where all pairs are at a step's end; and makes that the start of the next step.
  void note_end(const Motion& motion);
  void begin_step();

  std::vector<WatchedPair>& pairs() { return pairs_; }
  const core::ContactLaw& law(const WatchedPair& pair) const { return pair.j < content_count() ? ball_ : wall_; }
  core::BallId id_of(std::uint32_t number) const;
  const Rounding& rounding() const { return rounding_; }
  core::Approach approach(const WatchedPair& pair, const Motion& motion) const;

  /// Adds to the accelerations what the branches' formulas say beyond the law: nothing, except where a trial
  /// state is past the end of a branch.
  void keep_branches(const Motion& motion, core::Part part, std::span<double> a);
  std::uint64_t evaluations() const { return evaluations_; }

 private:
  std::uint32_t number_of(std::uint32_t row) const;

  core::ContactLaw ball_, wall_;
  core::Balls balls_;
  core::NeighbourList list_;
  double ahead_;                       // s
  std::vector<core::BallId> ids_;      // of all balls, by number
  std::vector<double> inverse_mass_;   // 1/kg, of the content, by number
  std::vector<std::uint32_t> number_;  // of each content row
  std::vector<WatchedPair> pairs_;     // sorted by i, j
  Rounding rounding_;
  std::uint64_t evaluations_ = 0;
  bool is_new_ = true;
};

}  // namespace grainclock::benchmarks
