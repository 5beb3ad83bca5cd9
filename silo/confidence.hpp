// Means of a few independent values, such as one per seed, with their confidence intervals. nan is an unknown value.
#pragma once

#include <cstddef>
#include <vector>

namespace grainclock::silo {

/// Quantile of Student's t: the value below which the share `p` in (0, 1) of it lies, at `freedom` from 1 to 1e6 degrees
/// (any real number). To nine digits for p from 0.001 to 0.999. Throws InputError outside these ranges.
double student_t(double p, double freedom);

/// A mean with its two-sided 95 % confidence interval.
struct Interval {
  std::size_t n = 0;             // values that are known
  double mean = 0.0;             // nan without values
  double low = 0.0, high = 0.0;  // nan below two values: nothing is known of their spread
  bool contains(double value) const { return low <= value && value <= high; }
};

/// Interval around a mean `centre` of n values; the square of its standard error was estimated with `freedom` degrees of
/// freedom.
Interval interval(std::size_t n, double centre, double squared, double freedom);

/// The values that are not nan.
std::vector<double> known(const std::vector<double>& values);
/// Mean of the known values; nan if there is none.
double mean(const std::vector<double>& values);
/// Square of the standard error of the mean of known values, at least two.
double squared_error(const std::vector<double>& values);
/// Mean of independent values of unknown spread (Student's t).
Interval mean_interval(const std::vector<double>& values);

}  // namespace grainclock::silo
