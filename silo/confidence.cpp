#include "silo/confidence.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>

namespace grainclock::silo {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
constexpr double kTwoSided95 = 0.975;  // quantile of a two-sided interval of 95 %

/// Student's t written as t = sqrt(freedom) tan(angle): its density by angle, but for a constant. It falls as the angle
/// grows.
double density(double angle, double freedom) { return std::pow(std::cos(angle), freedom - 1.0); }

/// Integral of the density from 0 to this angle, by Simpson's rule.
double integral_up_to(double angle, double freedom) {
  constexpr int kIntervals = 400;
  const double h = angle / kIntervals;
  double sum = density(0.0, freedom) + density(angle, freedom);
  for (int i = 1; i < kIntervals; ++i) sum += (i % 2 == 1 ? 4.0 : 2.0) * density(i * h, freedom);
  return sum * h / 3.0;
}

}  // namespace

double student_t(double p, double freedom) {
  GC_REQUIRE(p > 0.0 && p < 1.0 && freedom >= 1.0 && freedom <= 1e6,
             "Student's t at p = {} with {} degrees of freedom: give p between 0 and 1, and 1 to 1e6 degrees", p, freedom);
  if (p < 0.5) return -student_t(1.0 - p, freedom);
  const double whole =  // from -pi/2 to pi/2
      std::sqrt(std::numbers::pi) * std::exp(std::lgamma(freedom / 2.0) - std::lgamma((freedom + 1.0) / 2.0));
  // Newton's method: the integral is concave, so steps from below never pass the root.
  constexpr int kMostSteps = 100;
  constexpr double kSmallStep = 1e-13;
  double angle = 0.0, by = 1.0;
  for (int step = 0; step < kMostSteps && by > kSmallStep * angle; ++step) {
    by = ((p - 0.5) * whole - integral_up_to(angle, freedom)) / density(angle, freedom);
    angle += by;
  }
  return std::sqrt(freedom) * std::tan(angle);
}

Interval interval(std::size_t n, double centre, double squared, double freedom) {
  const double half = squared > 0.0 ? student_t(kTwoSided95, freedom) * std::sqrt(squared) : 0.0;
  return {n, centre, centre - half, centre + half};
}

std::vector<double> known(const std::vector<double>& values) {
  std::vector<double> left;
  std::copy_if(values.begin(), values.end(), std::back_inserter(left), [](double value) { return !std::isnan(value); });
  return left;
}

double mean(const std::vector<double>& values) {
  double sum = 0.0;
  std::size_t n = 0;
  for (const double value : values) {
    if (std::isnan(value)) continue;
    sum += value;
    ++n;
  }
  return n > 0 ? sum / static_cast<double>(n) : kUnknown;
}

double squared_error(const std::vector<double>& values) {
  const double centre = mean(values), n = static_cast<double>(values.size());
  double sum = 0.0;
  for (const double value : values) sum += (value - centre) * (value - centre);
  return sum / (n - 1.0) / n;
}

Interval mean_interval(const std::vector<double>& values) {
  const std::vector<double> left = known(values);
  const std::size_t n = left.size();
  if (n < 2) return {n, mean(left), kUnknown, kUnknown};
  return interval(n, mean(left), squared_error(left), static_cast<double>(n - 1));
}

}  // namespace grainclock::silo
