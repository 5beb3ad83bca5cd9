#include "silo/observables.hpp"

#include <algorithm>

namespace grainclock::silo {

std::optional<Layers> layers_of(const core::State& state) {
  constexpr int kLayers = 20;
  std::optional<Layers> layers;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] != core::Kind::wall) continue;
    const double z = state.position[i].z();
    if (!layers) layers = Layers{z, z, kLayers};
    layers->z0 = std::min(layers->z0, z);
    layers->z1 = std::max(layers->z1, z);
  }
  return layers && layers->z0 < layers->z1 ? layers : std::nullopt;
}

std::vector<double> edges(const Layers& layers) {
  std::vector<double> edges;
  for (int k = 0; k <= layers.n; ++k) edges.push_back(layers.z0 + (layers.z1 - layers.z0) * k / layers.n);
  return edges;
}

std::vector<Observable> observe(const core::Stepper& stepper, const core::State& state, const core::Energies& start,
                                const std::optional<Layers>& layers) {
  const core::Energies now = stepper.energies();
  const core::Ledger& ledger = stepper.ledger();
  const core::Costs costs = stepper.costs();
  const std::vector<core::Contact> contacts = stepper.contacts();
  double largest_overlap = 0.0;
  for (const core::Contact& contact : contacts) largest_overlap = std::max(largest_overlap, contact.overlap);

  const auto one = [](const char* name, const char* unit, auto value) {
    return Observable{name, unit, {}, {static_cast<double>(value)}};
  };
  const auto three = [](const char* name, const char* unit, const core::Vec3& value) {
    return Observable{name, unit, {3}, {value[0], value[1], value[2]}};
  };
  std::vector<Observable> all{
      one("kinetic_energy", "J", now.kinetic),
      one("potential_energy", "J", now.gravity),
      one("elastic_energy", "J", now.elastic),
      one("dissipated", "J", ledger.dissipated),
      one("first_impact", "J", ledger.first_impact),
      one("event_work", "J", ledger.event_work),
      one("removed_energy", "J", ledger.removed_energy),
      one("switched_energy", "J", ledger.switched_energy),
      one("turned_over", "J", ledger.turned_over),
      one("energy_residual", "", core::energy_residual(start, now, ledger)),
      three("momentum", "kg m s-1", now.momentum),
      three("wall_impulse", "N s", ledger.wall_impulse),
      one("momentum_residual", "", core::momentum_residual(start, now, ledger)),
      one("discharged", "", ledger.discharged),
      one("contacts", "", contacts.size()),
      one("largest_overlap", "m", largest_overlap),
      one("contact_evaluations", "", costs.contact_evaluations),
      one("ball_updates", "", costs.ball_updates),
      one("events", "", costs.events),
      one("missed_contacts", "", costs.missed_contacts),
  };
  if (layers)
    all.push_back({kWallForceByLayer, "N", {static_cast<std::uint64_t>(layers->n)}, wall_force_by_layer(state, contacts, *layers)});
  return all;
}

}  // namespace grainclock::silo
