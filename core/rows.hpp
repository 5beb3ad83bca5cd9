// The rows that the hot loops read and write. Plain data, no library.
#pragma once

#include <cstddef>
#include <cstdint>

namespace grainclock::core {

/// A ball as the sweep sees it: predicted or current position and velocity.
struct alignas(64) BallRow {
  double x, y, z;     // m
  double r;           // m
  double vx, vy, vz;  // m/s
  double a;           // m/s2, 1-norm of the acceleration: bounds what a step can change
};
static_assert(sizeof(BallRow) == 64);

/// Four 64-bit integers: a vector in integer force units and one unused lane. Sums of these are
/// exact, hence independent of the order of summation, of the sort and of the number of threads.
struct alignas(32) IntVec {
  std::int64_t v[4] = {0, 0, 0, 0};
};

/// Force sum of a ball, and the sum weighted by contact steps (multi-rate).
struct alignas(64) WeightedSum {
  IntVec force;     // force units
  IntVec impulse;   // force units times half ticks
};

/// Where a ball may be without the pair list missing a contact.
struct alignas(32) SkinReference {
  double x, y, z;       // m
  double skin2;         // m2
};

}  // namespace grainclock::core
