// Balls in uproar: many levels, many early renewals, many balls that leave.
#pragma once

#include "tests/support/balls.hpp"

#include <cstdlib>

namespace grainclock::tests {

/// Balls that press, knock and part above a floor with a plugged hole, at a time other than zero: so many that four threads
/// have work, which begins at 1024 balls or pairs each.
inline core::State crowd() {
  constexpr int kSide = 17, kLayers = 15, kHalf = 9;
  constexpr double kSpacing = 0.4395;  // m: with radii of 0.22 m give or take 2 % about half of the neighbours touch
  static_assert(kSide * kSide * kLayers > 4 * 1024);
  Random random(7);
  core::State state;
  state.time = 0.7;
  state.length_scale = 0.1;  // m, not the mean diameter: as if most of what a run began with were smaller and had left
  core::BallId id = 0;
  for (int k = 0; k < kLayers; ++k)
    for (int i = 0; i < kSide; ++i)
      for (int j = 0; j < kSide; ++j) {
        const core::Vec3 lattice(i - kSide / 2, j - kSide / 2, k + 1);
        state.add(id++, core::Kind::content, kSpacing * lattice + random.in_cube(1e-3), random.in_cube(k < 3 ? 2.0 : 0.3),
                  random.between(0.2156, 0.2244));
      }
  for (int i = -kHalf; i <= kHalf; ++i)
    for (int j = -kHalf; j <= kHalf; ++j)
      state.add(id++, std::abs(i) <= 2 && std::abs(j) <= 2 ? core::Kind::plug : core::Kind::wall, kSpacing * core::Vec3(i, j, 0), core::Vec3::Zero(), 0.22);
  return state;
}

}  // namespace grainclock::tests
