#include "core/ledger.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace grainclock::core {

double created_energy(const Energies& start, const Energies& now, const Ledger& l) {
  return now.total() - start.total() + l.dissipated + l.first_impact + l.removed_energy - l.event_work - l.switched_energy;
}

double energy_residual(const Energies& start, const Energies& now, const Ledger& l) {
  const double scale = std::max(l.turned_over + start.kinetic + now.kinetic, std::numeric_limits<double>::min());
  return std::abs(created_energy(start, now, l)) / scale;
}

double momentum_residual(const Energies& start, const Energies& now, const Ledger& l) {
  const Vec3 missing = now.momentum - start.momentum + l.removed_momentum - l.gravity_impulse - l.wall_impulse -
                       l.first_impact_impulse;
  const double scale = std::max(l.total_impulse + l.gravity_impulse.norm(), std::numeric_limits<double>::min());
  return missing.norm() / scale;
}

}  // namespace grainclock::core
