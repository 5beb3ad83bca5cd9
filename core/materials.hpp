// Pair parameters: the only place for mass, effective mass, stiffness and dashpot.
#pragma once

#include "core/state.hpp"

namespace grainclock::core {

/// Linear spring and dashpot of one kind of pair (paper, Fig. 1 and Table 1).
struct PairLaw {
  double k = 0.0;  // stiffness [N/m]
  double c = 0.0;  // dashpot [N s/m]
};

struct Materials {
  double density = 1250.0;       // kg/m3
  PairLaw ball{1e7, 2e4};        // content against content
  PairLaw wall{1e9, 2e5};        // content against wall or plug
  bool tension = false;          // true: the dashpot may pull while balls overlap
  double cohesion = 0.0;         // N, largest pull between separated balls (paper, Eq. 7)

  const PairLaw& pair(Kind other) const { return other == Kind::content ? ball : wall; }
  /// Mass of a ball of this radius [kg].
  double mass(double radius) const;
  /// Largest gap at which a pair still interacts [m]: N/k of the softer pair, 0 without cohesion.
  double reach() const;
};

/// Damping ratio c / (2 sqrt(k m_eff)) of a pair with effective mass m_eff [kg].
double damping_ratio(const PairLaw& law, double m_eff);
/// Dashpot that gives the restitution coefficient e in (0, 1] of a free collision.
/// `tension`: the contact ends at overlap zero (true) or at force zero (false). Throws InputError outside.
double dashpot_for_restitution(double k, double m_eff, double e, bool tension);
/// Restitution coefficient of a free collision of two balls (closed form; both endings, any damping).
double restitution(const PairLaw& law, double m_eff, bool tension);
/// Duration of that collision [s]; infinity where the pair never parts.
double collision_time(const PairLaw& law, double m_eff, bool tension);

}  // namespace grainclock::core
