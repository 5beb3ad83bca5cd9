// What the paper reads off a silo, as pure functions of a state and its contacts.
#pragma once

#include "core/state.hpp"
#include "core/stepper.hpp"
#include "silo/geometry.hpp"

#include <cstdint>
#include <optional>
#include <vector>

namespace grainclock::silo {

/// n layers of equal height between z0 and z1; a layer holds its lower edge, the last one also z1.
struct Layers {
  double z0, z1;  // m
  int n;
};

/// Throws InputError unless z0 < z1 and n >= 1.
void require_valid(const Layers& layers);
/// The layer that holds the height z [m]; nothing outside.
std::optional<std::size_t> layer_of(const Layers& layers, double z);

/// Solid volume of content in each layer over the volume inside the silo's wall balls, balls cut exactly at the
/// layers' edges. Inside means within the innermost points of mean wall balls. Layers below the hopper's lower edge
/// or of no volume give 0. Throws InputError unless z0 < z1 and n >= 1 (as the next one does).
std::vector<double> packing_by_layer(const core::State& state, const SiloShape& shape, const Layers& layers);

/// Total contact force on each wall ball [N], one per ball of the state; zero on others. Throws InputError if a contact's
/// wall ball is not in the state (as the next one does).
std::vector<Vec3> forces_on_wall(const core::State& state, const std::vector<core::Contact>& contacts);

/// Horizontal force on the wall by layer [N]: for each wall ball whose centre lies in the layer the length of the
/// horizontal part of its total contact force (the paper's section 5.4), summed. The plug is not part of the wall.
std::vector<double> wall_force_by_layer(const core::State& state, const std::vector<core::Contact>& contacts,
                                        const Layers& layers);

/// Area of the wall by layer [m2] to which these forces belong: (2 r)^2 of each wall ball whose centre lies in the layer,
/// as the paper takes the pressure on a wall ball (section 5.4), summed.
std::vector<double> wall_area_by_layer(const core::State& state, const Layers& layers);

/// The layers of this height [m] that hold the centres of the wall balls, their edges at whole multiples of it, so that walls that
/// differ a little share them; nothing without a wall. Throws InputError unless height > 0.
std::optional<Layers> whole_layers(const core::State& state, double height);

/// Content balls whose centre is above z [m].
std::int64_t count_above(const core::State& state, double z);

}  // namespace grainclock::silo
