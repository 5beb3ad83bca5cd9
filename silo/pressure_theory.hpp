// Closed forms for the pressure on a silo's wall, and the parameters that a state suggests for them.
//
// Horizontal slices of a heap with a level surface hang on the wall's friction. With the vertical stress s, the
// depth d, the section's area over its perimeter R and the density rho:
//   shaft   ds/dd = rho g - mu K s / R, normal pressure on the wall K s (Janssen 1895);
//   hopper  ds/dx = n s/x - rho g, x the height above the apex, normal pressure on the wall F s, wall at the angle
//           beta from the vertical (Walker 1966):  n = 2 (F (1 + mu_h / tan beta) - 1).
// For F and the friction mu_h in the hopper those of EN 1991-4, 6.1 and 6.3, for filling are taken:
//   F = 1 - b mu_h / (mu_h + tan beta), mu_h the wall's friction but at most (1 - K) / (2 tan beta),
// so that n = 2 (1 - b) mu_h / tan beta. Circle and square have the same R = half width / 2 and the same n.
// The wall here has no friction law: mu is what the shape of its balls does.
#pragma once

#include "core/state.hpp"
#include "core/stepper.hpp"
#include "silo/geometry.hpp"
#include "silo/measures.hpp"
#include "silo/wall_pressure.hpp"

#include <span>
#include <vector>

namespace grainclock::silo {

inline constexpr double kWaterDensity = 1000.0;  // kg/m3

/// A heap with a level surface.
struct Heap {
  double density;         // kg/m3, of the bulk: solid and voids
  double surface;         // m, height
  double gravity = 9.81;  // m/s2
};

struct WallLaw {
  double friction;              // mu, shear over normal stress at the wall
  double lateral;               // K, normal pressure on the shaft's wall over the mean vertical stress
  double hopper_deficit = 0.2;  // b; EN 1991-4 gives 0.2, Walker's hydrostatic hopper is 1
};

/// Stresses at one height [Pa]; all zero above the surface and below the hopper's apex.
struct WallStress {
  double vertical = 0.0;    // mean over the section
  double normal = 0.0;      // on the wall
  double shear = 0.0;       // on the wall, downward
  double horizontal = 0.0;  // horizontal part of the two, per area of the wall: what a wall ball's pressure measures
};

/// Janssen's shaft above Walker's hopper at a height z [m]. `inside`: the surface that bounds the content. Throws InputError
/// unless density and gravity are positive and finite, friction >= 0, lateral > 0 and hopper_deficit is within 0 to 1.
WallStress janssen(const Meridian& inside, const Heap& heap, const WallLaw& law, double z);

/// Water (density kWaterDensity), or frictionless material of the heap's density: rho g depth on all sides.
WallStress frictionless(const Meridian& inside, const Heap& heap, double z);

/// The heap of even density with a level surface that has the content's mass and centre of mass above the hopper's lower edge.
/// `density`: of the solid [kg/m3]. Throws InputError if no content is there.
Heap level_heap(const core::State& state, const SiloShape& shape, double density);

/// Mean stresses of the content in a layer [Pa], pressure positive; NaN in layers without volume.
struct LayerStress {
  double vertical;
  double horizontal;  // mean of the two directions
};

/// Stress by contacts (Love, Weber): the sum over contacts of force times the line from centre to centre over the volume inside
/// the wall, lines cut at the layers' edges and, at fixed balls, at the middle of the overlap. The vertical stress is then
/// exactly the layer's mean of the vertical force through horizontal planes, per area. Momentum flux is not in it.
std::vector<LayerStress> stress_by_layer(const core::State& state, const std::vector<core::Contact>& contacts,
                                         const SiloShape& shape, const Layers& layers);

/// What a state makes of the two parameters of a WallLaw; NaN where a ratio has no denominator.
struct LayerRatios {
  double friction;         // downward force along the nominal wall over the force normal to it
  double lateral;          // horizontal over vertical stress of the content
  double lateral_at_wall;  // normal pressure on the wall over vertical stress: Janssen's K
};

/// `stress` as stress_by_layer gives it for the same layers.
std::vector<LayerRatios> ratios_by_layer(std::span<const WallLoad> loads, std::span<const LayerStress> stress,
                                         const Layers& layers);

}  // namespace grainclock::silo
