// Measured order of convergence.
#pragma once

#include <cmath>
#include <span>

namespace grainclock::tests {

/// Slope of log(error) over log(step) by least squares.
inline double fitted_order(std::span<const double> step, std::span<const double> error) {
  const double n = static_cast<double>(step.size());
  double x = 0.0, y = 0.0, xx = 0.0, xy = 0.0;
  for (std::size_t i = 0; i < step.size(); ++i) {
    const double a = std::log(step[i]), b = std::log(error[i]);
    x += a;
    y += b;
    xx += a * a;
    xy += a * b;
  }
  return (n * xy - x * y) / (n * xx - x * x);
}

/// Root of the mean square of what is added.
class Rms {
 public:
  void add(double value) {
    sum_ += value * value;
    n_ += 1.0;
  }
  double value() const { return std::sqrt(sum_ / n_); }

 private:
  double sum_ = 0.0, n_ = 0.0;
};

}  // namespace grainclock::tests
