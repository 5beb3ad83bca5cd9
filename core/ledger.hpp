// Energies, dissipation, wall impulse and momentum, booked where they happen.
#pragma once

#include "core/state.hpp"

#include <cstdint>

namespace grainclock::core {

/// Running totals; every entry is booked when it happens, never found by difference.
struct Ledger {
  double dissipated = 0.0;         // J, integral of (F - k d) d' over all contacts
  double first_impact = 0.0;       // J, kinetic energy removed by first-impact stops
  double event_work = 0.0;         // J, energy put in by event position corrections
  double removed_energy = 0.0;     // J, kinetic + gravity + elastic energy of balls that left
  double switched_energy = 0.0;    // J, elastic energy put in by changing stiffness or closing the outlet
  Vec3 wall_impulse = Vec3::Zero();      // N s, of fixed balls on content
  Vec3 gravity_impulse = Vec3::Zero();   // N s
  Vec3 first_impact_impulse = Vec3::Zero();  // N s, put in by first-impact stops
  Vec3 removed_momentum = Vec3::Zero();  // N s, carried away by balls that left
  double total_impulse = 0.0;      // N s, sum of |impulse| over all contacts
  double turned_over = 0.0;        // J, sum of |force . velocity| dt over contacts: the scale of the energy residual
  std::int64_t discharged = 0;     // balls that left through the outlet
};

/// Energies and momentum of the moment.
struct Energies {
  double kinetic = 0.0;   // J
  double gravity = 0.0;   // J, potential
  double elastic = 0.0;   // J
  Vec3 momentum = Vec3::Zero();  // N s
  double total() const { return kinetic + gravity + elastic; }
};

/// E - E0 + dissipated + first_impact - event_work + removed - switched [J]: what nothing that was booked accounts for.
double created_energy(const Energies& start, const Energies& now, const Ledger& ledger);
/// |created energy| over energy turned over.
double energy_residual(const Energies& start, const Energies& now, const Ledger& ledger);
/// |P - P0 - impulses| over the sum of |impulses|.
double momentum_residual(const Energies& start, const Energies& now, const Ledger& ledger);

}  // namespace grainclock::core
