#include "multirate/classes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace grainclock::multirate {

double shared_reach(std::vector<double> strides, std::size_t balls, double error_factor, double tolerance) {
  // Sorted, so that the sum does not depend on the order of the balls.
  std::sort(strides.begin(), strides.end());
  const double share = tolerance / error_factor;
  const double allowed = share * share * static_cast<double>(balls);  // of the sum of squares
  double below = 0.0;
  for (std::size_t k = 0; k < strides.size(); ++k) {
    const double stride = strides[k], above = static_cast<double>(strides.size() - k);
    if (below + above * stride * stride > allowed) return std::sqrt(std::sqrt((allowed - below) / above));
    below += stride * stride;
  }
  return std::numeric_limits<double>::infinity();
}

bool is_stable(const ContactMatrix& matrix, double h, const core::ContactLaw& ball, const core::ContactLaw& fixed,
               double inertia) {
  const auto weight = [&](const core::ContactLaw& law) { return (h * h * law.k + 4.0 * h * law.c) * inertia * kMatrixUnit; };
  const double b = weight(ball), f = weight(fixed);
  double m[6];
  for (int k = 0; k < 6; ++k) m[k] = b * matrix.ball.entry[k] + f * matrix.fixed.entry[k];
  const double xx = 4.0 - m[0], yy = 4.0 - m[1], zz = 4.0 - m[2], xy = -m[3], xz = -m[4], yz = -m[5];
  const double minor = xx * yy - xy * xy;
  const double determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
  return xx > 0.0 && minor > 0.0 && determinant > 0.0;
}

}  // namespace grainclock::multirate
