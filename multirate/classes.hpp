// Which step a pair and a ball need: velocity classes within stability.
#pragma once

#include "core/kernels.hpp"
#include "multirate/ladder.hpp"

#include <cmath>

namespace grainclock::multirate {

/// From the one tolerance to a length: what a pair may approach by within one step. The factor makes the
/// achieved error (rms, relative to the rms displacement over 0.064 s of table1-flow) about the tolerance.
constexpr double kApproachPerTolerance = 1.0;  // mean diameters
/// A pair gets coarser only if it would still do so at this many times its speed.
constexpr double kHysteresis = 2.0;

/// Velocity classes of pairs.
class Classes {
 public:
  /// `diameter`: mean ball diameter [m]; stiffness ratio of contacts with fixed balls to those among balls.
  Classes(const Ladder& ladder, double tolerance, double diameter, double stiffness_ratio)
      : ladder_(ladder),
        length_(kApproachPerTolerance * tolerance * diameter),
        fixed_weight_(std::sqrt(std::max(1.0, stiffness_ratio))) {}

  /// What the approach speed of a pair counts [m/s]: stiffer contacts live shorter by the square root of the stiffness
  /// ratio and count as that much faster.
  double weighted(double approach, bool fixed) const { return std::abs(approach) * (fixed ? fixed_weight_ : 1.0); }

  /// The coarsest level with speed * step(level) <= length: half-open geometric classes of approach speed.
  Level need(double speed) const { return speed > 0.0 ? ladder_.level_of(length_ / speed) : ladder_.coarsest(); }

 private:
  Ladder ladder_;
  double length_;        // m
  double fixed_weight_;
};

/// A sum of scaled n n^T in whole numbers, exact in any order: xx, yy, zz, xy, xz, yz.
struct NormalMatrix {
  double entry[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};

  /// `scale` up to 2^33.
  static NormalMatrix of(double x, double y, double z, double scale) {
    // Adding and taking away 1.5 * 2^52 rounds to a whole number.
    const auto whole = [](double a) { return (a + 6755399441055744.0) - 6755399441055744.0; };
    const double sx = scale * x, sy = scale * y, sz = scale * z;
    return {{whole(sx * x), whole(sy * y), whole(sz * z), whole(sx * y), whole(sx * z), whole(sy * z)}};
  }
  NormalMatrix& operator+=(const NormalMatrix& other) {
    for (int k = 0; k < 6; ++k) entry[k] += other.entry[k];
    return *this;
  }
};
/// Sum over a ball's contacts of (1/m_i + 1/m_j) n n^T, relative to the largest 1/m, for contacts among balls and with
/// fixed balls apart. 53 bits hold a million contacts.
struct ContactMatrix {
  NormalMatrix ball, fixed;
};
constexpr double kMatrixUnit = 1.0 / 4294967296.0;  // 2^-32

/// Whether a step h [s] keeps every eigenvalue of sum (h2 k + 4 h c)(1/m_i + 1/m_j) n n^T below 4 (the predicted
/// scheme's bound, core/critical_step.hpp), by the signs of the leading minors of 4 - M.
/// `inertia`: the inverse mass [1/kg] that the matrix is relative to.
bool is_stable(const ContactMatrix& matrix, double h, const core::ContactLaw& ball, const core::ContactLaw& fixed,
               double inertia);

}  // namespace grainclock::multirate
