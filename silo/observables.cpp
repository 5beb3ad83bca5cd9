#include "silo/observables.hpp"

#include <algorithm>
#include <cmath>

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

namespace {

Observable one(const char* name, const char* unit, double value) { return {name, unit, {}, {value}}; }
Observable three(const char* name, const char* unit, const core::Vec3& value) { return {name, unit, {3}, {value[0], value[1], value[2]}}; }

/// Sums over the balls of a watched wall.
struct WallSums {
  std::vector<double> length;   // N, by layer
  std::vector<double> lateral;  // N, (x, y) by layer
  double x = 0.0, y = 0.0;      // N
  double on_patch = 0.0, patch_area = 0.0;  // N, m2
};

/// `forces` go by id as the wall's balls do, and may have others between them: plug and collar.
WallSums add_up(const std::vector<core::FixedForce>& forces, const WatchedWall& wall) {
  const auto layers = static_cast<std::size_t>(wall.layers->n);
  WallSums sums{std::vector<double>(layers), std::vector<double>(2 * layers)};
  auto at = forces.begin();
  for (const WatchedWall::Ball& ball : wall.balls) {
    while (at != forces.end() && at->id < ball.id) ++at;
    if (at == forces.end()) break;
    const double x = at->force.x(), y = at->force.y(), length = std::hypot(x, y);
    sums.length[ball.layer] += length;
    sums.lateral[2 * ball.layer] += x;
    sums.lateral[2 * ball.layer + 1] += y;
    sums.x += x;
    sums.y += y;
    if (ball.patch_area > 0.0) sums.on_patch += length;
    sums.patch_area += ball.patch_area;
  }
  return sums;
}

}  // namespace

WatchedWall watch_wall(const core::State& state, const std::optional<Patch>& patch) {
  WatchedWall wall{layers_of(state), {}};
  if (!wall.layers) return wall;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] != core::Kind::wall) continue;
    const core::Vec3& at = state.position[i];
    const double r = state.radius[i];
    wall.balls.push_back({state.id[i], *layer_of(*wall.layers, at.z()), patch && patch->holds(at) ? 4.0 * r * r : 0.0});
  }
  return wall;
}

std::vector<Observable> observe(const core::Stepper& stepper, const core::Energies& start) {
  const core::Energies now = stepper.energies();
  const core::Ledger& ledger = stepper.ledger();
  const core::Costs costs = stepper.costs();
  const std::vector<core::Contact> contacts = stepper.contacts();
  double largest_overlap = 0.0;
  for (const core::Contact& contact : contacts) largest_overlap = std::max(largest_overlap, contact.overlap);
  const auto count = [](const char* name, auto value) { return one(name, "", static_cast<double>(value)); };
  return {one("potential_energy", "J", now.gravity),
          one("elastic_energy", "J", now.elastic),
          one("dissipated", "J", ledger.dissipated),
          one("first_impact", "J", ledger.first_impact),
          one("event_work", "J", ledger.event_work),
          one("removed_energy", "J", ledger.removed_energy),
          one("switched_energy", "J", ledger.switched_energy),
          one("turned_over", "J", ledger.turned_over),
          one("energy_residual", "", core::energy_residual(start, now, ledger)),
          one("momentum_residual", "", core::momentum_residual(start, now, ledger)),
          count("contacts", contacts.size()),
          one("largest_overlap", "m", largest_overlap),
          count("contact_evaluations", costs.contact_evaluations),
          count("ball_updates", costs.ball_updates),
          count("events", costs.events),
          count("missed_contacts", costs.missed_contacts)};
}

std::vector<Observable> observe_between(const core::Stepper& stepper, const WatchedWall& wall, std::int64_t phase) {
  std::vector<Observable> all{one("kinetic_energy", "J", stepper.kinetic_energy()),
                              three("momentum", "kg m s-1", stepper.momentum()),
                              three("wall_impulse", "N s", stepper.ledger().wall_impulse),
                              one("discharged", "", static_cast<double>(stepper.ledger().discharged)),
                              one("phase", "", static_cast<double>(phase))};
  if (!wall.layers) return all;
  const WallSums sums = add_up(stepper.fixed_forces(), wall);
  const auto layers = static_cast<std::uint64_t>(wall.layers->n);
  all.push_back({kWallForceByLayer, "N", {layers}, sums.length});
  all.push_back({kLateralForceByLayer, "N", {layers, 2}, sums.lateral});
  all.push_back({"lateral_force", "N", {2}, {sums.x, sums.y}});
  if (sums.patch_area > 0.0) all.push_back(one("patch_pressure", "Pa", sums.on_patch / sums.patch_area));
  return all;
}

}  // namespace grainclock::silo
