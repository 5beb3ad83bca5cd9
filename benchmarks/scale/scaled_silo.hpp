// Table 1's silo made larger: its shape scaled, its balls as they are.
//
// The content is a periodic packing cut out of the filled original, repeated; how close the balls are follows
// from what lies above them. Pouring a million balls in would take hours, this takes minutes.
#pragma once

#include "benchmarks/scale/packing.hpp"
#include "core/materials.hpp"
#include "silo/geometry.hpp"

namespace grainclock::scale {

/// A block from the middle of the filled original of this shape. Throws InputError unless it is round and filled so far.
Packing interior(const core::State& filled, const silo::SiloShape& shape);

/// The `original` shape `factor` times as wide and high, filled with `balls` balls of a packing, not yet at rest: overlaps
/// within the bulk are right, those at the wall are not. Ids: content, lowest first, then wall, then plug.
/// gravity: m/s2; `seed` draws the wall's radii. Throws InputError if the balls do not fit below the rim.
core::State tile(const Packing& block, const silo::SiloShape& original, double factor, std::int64_t balls,
                 const core::Materials& materials, double gravity, std::uint64_t seed);

}  // namespace grainclock::scale
