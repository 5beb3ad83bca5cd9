#include "multirate/classes.hpp"

namespace grainclock::multirate {

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
