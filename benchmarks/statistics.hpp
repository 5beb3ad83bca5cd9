// Statistics of long runs, where trajectories can no longer be compared: measures of one run's time series, and what
// the runs from several start states (seeds) tell together. Pure functions; nan is an unknown value.
//
// Reference: B. L. Welch, "The generalization of 'Student's' problem when several different population variances are
// involved", Biometrika 34 (1947) 28-35.
#pragma once

#include "silo/confidence.hpp"

#include <cstddef>
#include <vector>

namespace grainclock::benchmarks {

using silo::Interval;
using silo::mean;
using silo::mean_interval;

/// Difference of the means of two independent groups whose spreads may differ (Welch's t); n is the smaller group's.
/// The groups agree if it contains zero; how much they could differ unseen is its width.
Interval difference_interval(const std::vector<double>& a, const std::vector<double>& b);

/// Balls per second [1/s]: the balls counted from the first to the last sample, over the time between the two. `time`
/// increases [s], `discharged` counts the balls that have left until then. Throws InputError below two samples.
double discharge_rate(const std::vector<double>& time, const std::vector<double>& discharged);

/// Times without a single ball leaving.
struct Stoppages {
  std::size_t count = 0;
  double mean_length = 0.0;  // s; nan if there are none
  double share = 0.0;        // of the time between the first and the last sample
};

/// A stoppage is a longest run of samples with one and the same count whose first and last are at least `at_least` [s]
/// apart; its length is that distance. So the time between two balls is longer by up to two samplings, and a
/// stoppage at either end of the series counts with what is seen of it. Throws InputError below two samples or unless
/// at_least > 0.
Stoppages stoppages(const std::vector<double>& time, const std::vector<double>& discharged, double at_least);

}  // namespace grainclock::benchmarks
