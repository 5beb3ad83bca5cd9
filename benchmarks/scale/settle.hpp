// From balls laid out to balls at rest: first without time, then by stepping with strong dampers.
#pragma once

#include "core/materials.hpp"
#include "core/state.hpp"

#include <cstdint>
#include <string>

namespace grainclock::scale {

/// Moves the content downhill in elastic and gravity energy, wall contacts as soft as the others, for a number of
/// rounds: overlaps of any depth become ordinary ones. Velocities are left alone. gravity: m/s2, downwards.
void push_apart(core::State& state, const core::Materials& materials, double gravity, int rounds, int threads);

/// Steps with the walls first soft, then as they are, and dampers stronger than the scene's.
/// Throws NumericsError if a force or overlap is beyond the limit.
core::State settle(const core::State& state, const core::Materials& materials, double gravity, int threads);

/// What makes a state the same load as another.
struct Load {
  double contacts_per_ball = 0.0;       // touching pairs over content balls
  double mean_overlap = 0.0;            // m, of those
  double kinetic_per_ball = 0.0;        // J
};
Load load_of(const core::State& state, const core::Materials& materials, double gravity, int threads);
std::string describe(const Load& load);

}  // namespace grainclock::scale
