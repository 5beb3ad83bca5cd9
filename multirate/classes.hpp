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

  /// The coarsest level with approach * step(level) <= length: half-open geometric classes of approach speed.
  /// Stiffer contacts live shorter by the square root of the stiffness ratio and count as that much faster.
  Level need(double approach, bool fixed) const {
    const double v = std::abs(approach) * (fixed ? fixed_weight_ : 1.0);
    return v > 0.0 ? ladder_.level_of(length_ / v) : ladder_.coarsest();
  }

 private:
  Ladder ladder_;
  double length_;        // m
  double fixed_weight_;
};

/// Sum over a ball's contacts of (1/m_i + 1/m_j) n n^T in exact integers (relative to the lightest ball), for contacts among
/// balls and with fixed balls apart. Entries xx, yy, zz, xy, xz, yz.
struct ContactMatrix {
  std::int64_t ball[6] = {0, 0, 0, 0, 0, 0};
  std::int64_t fixed[6] = {0, 0, 0, 0, 0, 0};
};
constexpr double kMatrixUnit = 1.0 / (1LL << 40);

/// Whether a step h [s] keeps every eigenvalue of sum (h2 k + 4 h c)(1/m_i + 1/m_j) n n^T below 4 (the predicted
/// scheme's bound, core/critical_step.hpp), by the signs of the leading minors of 4 - M.
/// `inertia`: the inverse mass [1/kg] that the matrix is relative to.
bool is_stable(const ContactMatrix& matrix, double h, const core::ContactLaw& ball, const core::ContactLaw& fixed,
               double inertia);

}  // namespace grainclock::multirate
