#include "core/materials.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace grainclock::core {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A free collision: m d'' = -(k d + c d'), d(0) = 0, d'(0) = v. With the
// undamped frequency w = sqrt(k/m) and the damping ratio z, the overlap returns
// to zero at w t = pi / sqrt(1 - z^2), never for z >= 1, and the force reaches
// zero at w t = 2 angle(z), where the balls part at v exp(-z w t). The same
// exponential holds at overlap zero.

/// acos(z) / sqrt(1 - z^2), continued through z = 1 by acosh(z) / sqrt(z^2 - 1).
double angle(double z) {
  // The factors of 1 - z^2 keep full precision near z = 1 and do not overflow.
  const double root = std::sqrt(std::abs(1.0 - z)) * std::sqrt(1.0 + z);
  if (root == 0.0) return 1.0;
  return (z < 1.0 ? std::atan2(root, z) : std::asinh(root)) / root;
}

/// w t at the end of the contact.
double scaled_duration(double z, bool tension) {
  if (!tension) return 2.0 * angle(z);
  return z < 1.0 ? std::numbers::pi / (std::sqrt(1.0 - z) * std::sqrt(1.0 + z)) : kInfinity;
}

}  // namespace

double Materials::mass(double radius) const { return density * 4.0 / 3.0 * std::numbers::pi * radius * radius * radius; }

double Materials::reach() const { return cohesion > 0.0 ? cohesion / std::min(ball.k, wall.k) : 0.0; }

double damping_ratio(const PairLaw& law, double m_eff) { return law.c / (2.0 * std::sqrt(law.k * m_eff)); }

double restitution(const PairLaw& law, double m_eff, bool tension) {
  const double z = damping_ratio(law, m_eff);
  return z == 0.0 ? 1.0 : std::exp(-z * scaled_duration(z, tension));
}

double collision_time(const PairLaw& law, double m_eff, bool tension) {
  return scaled_duration(damping_ratio(law, m_eff), tension) * std::sqrt(m_eff / law.k);
}

double dashpot_for_restitution(double k, double m_eff, double e, bool tension) {
  GC_REQUIRE(k > 0.0 && std::isfinite(k), "stiffness k = {} N/m: must be above 0 to reach a restitution", k);
  GC_REQUIRE(m_eff > 0.0 && std::isfinite(m_eff), "effective mass m_eff = {} kg: must be above 0", m_eff);
  GC_REQUIRE(e > 0.0 && e <= 1.0,
             "restitution e = {}: must be above 0 and at most 1 (no linear dashpot stops the balls for good)", e);
  const double wanted = -std::log(e);
  double low = 0.0, high = 1.0;
  const auto exponent = [tension](double z) { return z == 0.0 ? 0.0 : z * scaled_duration(z, tension); };
  while (exponent(high) < wanted) high *= 2.0;
  // The exponent grows with z; halve until the two ends are neighbours.
  for (;;) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    (exponent(middle) < wanted ? low : high) = middle;
  }
  const double z = wanted - exponent(low) < exponent(high) - wanted ? low : high;
  return 2.0 * z * std::sqrt(k * m_eff);
}

}  // namespace grainclock::core
