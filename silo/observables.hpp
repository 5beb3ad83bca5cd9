// The quantities that a run records: with every frame, and between frames.
#pragma once

#include "core/stepper.hpp"
#include "silo/geometry.hpp"
#include "silo/measures.hpp"
#include "silo/pressure_history.hpp"
#include "silo/run_file.hpp"

#include <optional>
#include <vector>

namespace grainclock::silo {

/// Twenty layers over the height of the wall balls; nothing without a wall of some height.
std::optional<Layers> layers_of(const core::State& state);
/// Edges of the layers [m], one more than there are layers.
std::vector<double> edges(const Layers& layers);

/// The wall as the records see it: what each ball of it belongs to.
struct WatchedWall {
  struct Ball {
    core::BallId id;
    std::size_t layer;
    double patch_area;  // m2, (2 r)^2 in the patch, else 0
  };
  std::optional<Layers> layers;  // nothing: no wall to watch
  std::vector<Ball> balls;       // by id
};
/// `patch`: piece of the wall whose pressure is recorded, if any.
WatchedWall watch_wall(const core::State& state, const std::optional<Patch>& patch);

/// Costs and ledger of the moment, its residuals, energies that need all contacts: what frames hold. `start`: energies when
/// the run began.
std::vector<Observable> observe(const core::Stepper& stepper, const core::Energies& start);

/// What is worth to be recorded between frames, too, in a small part of the time of a step's contacts: motion, balls that
/// left, forces on the wall. `phase`: number of the phase, whose law the contacts follow.
///   lateral_force           N, (x, y), sum of the horizontal forces on the wall
///   lateral_force_by_layer  N, the same by layer
///   wall_force_by_layer     N, sum of their lengths
///   patch_pressure          Pa, their lengths over area, on the patch; only with one
///   wall_impulse            N s, time integral since the run began of the force on wall and plug: its differences are exact means over
///                           intervals, where forces of moments hold whatever is faster than the records
std::vector<Observable> observe_between(const core::Stepper& stepper, const WatchedWall& wall, std::int64_t phase);

}  // namespace grainclock::silo
