// Error measures of a result against a reference, in one place. Pure functions.
//
// What is not finite in a result is infinitely wrong; a reference that is not finite judges nothing and is refused.
// The residuals of momentum and energy need no reference: core/ledger.hpp.
#pragma once

#include "core/state.hpp"

#include <optional>
#include <vector>

namespace grainclock::benchmarks {

/// Error per ball over one scale common to all balls, so the three numbers are relative.
struct ErrorSummary {
  double rms = 0.0;
  double median = 0.0;
  double p99 = 0.0;  // 99 % quantile
};

struct TrajectoryErrors {
  ErrorSummary position;      // |x - x_ref| over the rms displacement of the reference
  ErrorSummary velocity;      // |v - v_ref| over the rms speed of the reference
  double displacement = 0.0;  // m, the scale of `position`
  double speed = 0.0;         // m/s, the scale of `velocity`
  std::size_t compared = 0;   // content balls of the start above the outlet plane in the reference and in the result
  std::size_t missing = 0;    // of those above it in the reference, the ones that the result no longer has
};

/// Compares by id the content balls whose centre is not below `outlet_z` [m] in the reference
/// (all of them without a plane): falling balls would dilute the error. The scales are over the same balls,
/// missing ones included, so that no result moves its own yardstick. Throws InputError if no ball
/// can be compared, if nothing moved, since no relative error exists then, or if the reference is not finite.
TrajectoryErrors trajectory_errors(const core::State& start, const core::State& reference, const core::State& result,
                                   std::optional<double> outlet_z);

/// How far apart two states are, with no start to tell what is much.
struct Distances {
  double rms = 0.0, median = 0.0, p99 = 0.0, largest = 0.0;  // m
  std::size_t common = 0;                                    // content balls of both
};

/// Distances by id of the content balls that both have; all zero if there are none.
Distances distances(const core::State& a, const core::State& b);

/// Quantile q in [0, 1] of a non-empty sample, linear between order statistics; nan if a value is nan.
double quantile(std::vector<double> sample, double q);

/// |a - reference| / |reference| in the Euclidean norm, as for wall forces by layer. 0 if both vanish, infinity if only
/// the reference does or if `a` is not finite. Throws InputError on unequal lengths or a reference that is not finite.
double relative_l2(const std::vector<double>& a, const std::vector<double>& reference);

}  // namespace grainclock::benchmarks
