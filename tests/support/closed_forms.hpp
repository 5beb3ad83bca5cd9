// What one linear contact does, exactly.
#pragma once

#include "core/contact_law.hpp"
#include "core/events.hpp"
#include "core/materials.hpp"

#include <cmath>

namespace grainclock::tests {

/// Damped oscillator m d'' = load - k d - c d', `t` [s] after `start`; any damping but the critical one.
inline core::Approach oscillator(const core::PairLaw& law, double m, double load, const core::Approach& start, double t) {
  const double rest = load / law.k, g = law.c / (2.0 * m), square = law.k / m - g * g;
  const double y = start.overlap - rest, w = std::sqrt(std::abs(square)), fade = std::exp(-g * t);
  const double cosine = square > 0.0 ? std::cos(w * t) : std::cosh(w * t);
  const double sine = square > 0.0 ? std::sin(w * t) : std::sinh(w * t);
  const double b = (start.rate + g * y) / w;
  return {rest + fade * (y * cosine + b * sine), fade * (start.rate * cosine - (law.k / m * y + g * start.rate) / w * sine)};
}

/// Head-on collision of free balls that touch at time 0.
struct FreeCollision {
  core::PairLaw law;
  double m_eff;  // kg
  bool tension;
  double speed;  // m/s, of approach

  double duration() const { return core::collision_time(law, m_eff, tension); }
  core::Approach at(double t) const {
    if (t <= 0.0) return {speed * t, speed};
    if (t <= duration()) return oscillator(law, m_eff, 0.0, {0.0, speed}, t);
    const core::Approach end = oscillator(law, m_eff, 0.0, {0.0, speed}, duration());
    return {end.overlap + (t - duration()) * end.rate, end.rate};
  }
  /// Largest overlap without dashpot [m]: the scale of errors.
  double depth() const { return speed * std::sqrt(m_eff / law.k); }
};

/// Dashpot of a given damping ratio [N s/m].
inline double dashpot(double k, double m_eff, double damping_ratio) { return 2.0 * damping_ratio * std::sqrt(k * m_eff); }

}  // namespace grainclock::tests
