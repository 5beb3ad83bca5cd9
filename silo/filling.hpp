// The start of a fill: walls, plug and loosely hung balls that gravity will settle.
#pragma once

#include "core/state.hpp"
#include "silo/geometry.hpp"

#include <cstdint>
#include <vector>

namespace grainclock::silo {

/// Ids: content 0 .. balls - 1 (lowest first), then wall, plug, and the collar last.
struct Silo {
  SiloShape shape;
  WallReport report;
  core::BallId first_collar;  // ids from here on are collar balls (kind wall)
  core::State state;
};

/// Builds the fixed balls and hangs `shape.balls` content balls clear of them and of each other: layers of a loose
/// square lattice, each turned and shifted at random so that no crystal grows from it, with small random velocities.
/// Throws InputError if they do not fit, saying how many do and what to change.
Silo build_silo(const SiloShape& shape, std::uint64_t seed);

/// Takes the collar away after filling; `first_collar` as in Silo.
void remove_collar(core::State& state, core::BallId first_collar);

/// Takes away the content in the way of the plug when the outlet is closed under flow, and returns its ids: a gate
/// cannot shut inside a ball, and the overlap would throw the silo apart. To be counted as discharged.
std::vector<core::BallId> clear_gate(core::State& state);

}  // namespace grainclock::silo
