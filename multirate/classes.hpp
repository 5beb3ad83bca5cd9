// Which step a pair and a ball need: velocity classes within stability.
//
// A pair is taken as an oscillator about its equilibrium with omega^2 = k (1/m_i + 1/m_j). The rate of its overlap and its
// balls' acceleration towards each other give the amplitude v of its speed, v^2 = rate^2 + (acceleration / omega)^2.
// A second-order step h resolves the collision of a pair to a velocity of about v (omega h)^2, up to a factor. Relative
// to a speed v_ref of the whole scene that is (h u)^2 with the pair's *urgency* u = omega sqrt(v / v_ref) [1/s].
//
// An impact leaves its balls with that error for good; less where other contacts hold a ball. A pair that stays closed
// (smooth) only swings a little wrongly. At each renewal the pairs of either kind share one reach r, h u <= r, such
// that their expected errors, as rms over the whole content, make up the tolerance (shared_reach4()): few fast
// collisions may be resolved less well than many. The error factors are measured, benchmarks/README.md.
#pragma once

#include "core/kernels.hpp"
#include "multirate/ladder.hpp"

#include <vector>

namespace grainclock::multirate {

constexpr double kImpactError = 0.3;    // relative error that an impact at h u = 1 leaves
constexpr double kSmoothError = 0.02;   // the same for a smooth pair
constexpr double kConfinedReach = 3.0;  // times the reach of impacts for a ball that smooth pairs hold
/// A pair is an impact if its speed's amplitude is at least this share of the one that would open it.
constexpr double kOpening = 0.5;
/// A ball gets coarser only if it would still do so at this many times its urgency.
constexpr double kHysteresis = 2.0;

/// How a pair moves; squared quantities, so that a pair costs no root. Real is double or a vector of it.
template <class Real>
struct PairMotion {
  Real urgency4;                            // 1/s4, fourth power of the urgency
  decltype(Real{} <= Real{}) is_impact;  // it will open, or is about to close
};

/// `overlap` [m], its `rate` [m/s] and the balls' `acceleration` towards each other [m/s2] (ignored while open),
/// `omega2` [1/s2] and the scene's speed squared [m2/s2], above zero.
template <class Real>
[[gnu::always_inline]] inline PairMotion<Real> motion_of(Real overlap, Real rate, Real acceleration, Real omega2, double speed2) {
  const auto is_open = overlap <= Real{};
  const Real a = is_open ? Real{} : acceleration;
  const Real amplitude = omega2 * rate * rate + a * a;  // (omega v)^2
  const Real opening = kOpening * omega2 * overlap;
  PairMotion<Real> motion{omega2 * amplitude / speed2, is_open};
  motion.is_impact |= amplitude > opening * opening;
  return motion;
}

constexpr double fourth(double x) { return (x * x) * (x * x); }

/// 1/s4, urgency of a ball's impacts, eased where smooth pairs hold it.
template <class Real>
[[gnu::always_inline]] inline Real eased_impact4(Real impact4, Real smooth4) {
  return smooth4 > Real{} ? impact4 / fourth(kConfinedReach) : impact4;
}

/// The sum of (h u)^4 over `balls` at which the rms of error_factor (h u)^2 is the tolerance.
inline double affordable4(std::size_t balls, double error_factor, double tolerance) {
  const double share = tolerance / error_factor;
  return share * share * static_cast<double>(balls);
}

/// The fourth power of the reach r at which the rms over `balls` of error_factor min(r^2, (h u)^2) is the tolerance, or
/// less by up to 6 %; `strides4` holds (h u)^4 of each ball concerned at the step that it could take otherwise.
/// Infinity if all may take that. The order of the balls changes no bit.
double shared_reach4(const std::vector<double>& strides4, std::size_t balls, double error_factor, double tolerance);

/// Adding it to a double within 2^51, and taking it away, rounds to a whole number: 1.5 * 2^52.
constexpr double kWholeNumber = 6755399441055744.0;

/// A sum of scaled n n^T in whole numbers, exact in any order: xx, yy, zz, xy, xz, yz.
struct NormalMatrix {
  double entry[6] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0};

  /// `scale` up to 2^33.
  static NormalMatrix of(double x, double y, double z, double scale) {
    const auto whole = [](double a) { return (a + kWholeNumber) - kWholeNumber; };
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

/// (h2 k + 4 h c) relative to the units of a ContactMatrix, for contacts among balls and with fixed balls.
struct StepWeights {
  double ball, fixed;

  /// `step` h [s]; `inertia`: the inverse mass [1/kg] that matrices are relative to.
  StepWeights(double step, const core::ContactLaw& ball_law, const core::ContactLaw& fixed_law, double inertia)
      : ball(weight(step, ball_law) * inertia), fixed(weight(step, fixed_law) * inertia) {}

 private:
  static double weight(double h, const core::ContactLaw& law) { return (h * h * law.k + 4.0 * h * law.c) * kMatrixUnit; }
};

/// Whether a step keeps every eigenvalue of sum (h2 k + 4 h c)(1/m_i + 1/m_j) n n^T below 4 (the predicted
/// scheme's bound, core/critical_step.hpp), by the signs of the leading minors of 4 - M. `ball` and `fixed` hold the entries
/// of a ContactMatrix. Real is double or a vector of it.
template <class Real>
[[gnu::always_inline]] inline auto is_stable(const Real (&ball)[6], const Real (&fixed)[6], const StepWeights& weights) {
  Real entry[6];
  for (int k = 0; k < 6; ++k) entry[k] = weights.ball * ball[k] + weights.fixed * fixed[k];
  const Real xx = 4.0 - entry[0], yy = 4.0 - entry[1], zz = 4.0 - entry[2];
  const Real xy = -entry[3], xz = -entry[4], yz = -entry[5];
  const Real minor = xx * yy - xy * xy;
  const Real determinant = xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz);
  return (xx > Real{}) & (minor > Real{}) & (determinant > Real{});
}
inline bool is_stable(const ContactMatrix& matrix, const StepWeights& weights) {
  return is_stable(matrix.ball.entry, matrix.fixed.entry, weights) != 0;
}

}  // namespace grainclock::multirate
