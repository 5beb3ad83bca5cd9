// Error measures of a result against a reference, in one place. Pure functions.
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
  ErrorSummary position;       // |x - x_ref| over the rms displacement of the reference
  ErrorSummary velocity;       // |v - v_ref| over the rms speed of the reference
  double displacement = 0.0;   // m, the scale of `position`
  double speed = 0.0;          // m/s, the scale of `velocity`
  std::size_t compared = 0;    // content balls above the outlet plane in the reference, present in all three
  std::size_t missing = 0;     // of those above it in the reference, the ones that the result no longer has
};

/// Compares by id the content balls whose centre is above `outlet_z` [m] in the reference
/// (all of them without a plane): falling balls would dilute the error. Throws InputError if no ball
/// can be compared or if nothing moved, since no relative error exists then.
TrajectoryErrors trajectory_errors(const core::State& start, const core::State& reference,
                                   const core::State& result, std::optional<double> outlet_z);

/// Quantile q in [0, 1] of a non-empty sample, linear between order statistics.
double quantile(std::vector<double> sample, double q);

/// |a - reference| / |reference| in the Euclidean norm. Throws InputError on unequal lengths;
/// 0 if both vanish, infinity if only the reference does.
double relative_l2(const std::vector<double>& a, const std::vector<double>& reference);

}  // namespace grainclock::benchmarks
