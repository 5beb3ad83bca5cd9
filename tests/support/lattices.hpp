// Perfect lattices of equal balls that touch.
#pragma once

#include "core/state.hpp"

#include <cmath>
#include <numbers>
#include <vector>

namespace grainclock::tests {

/// A box that fills space when repeated, in units of the balls' diameter.
struct Lattice {
  core::Vec3 edges;
  std::vector<core::Vec3> places;  // as shares of the edges
  double density;                  // packing fraction
  double q6;                       // of the bonds to the nearest balls (bcc: the nearest 14), rounded to 7 digits
};

inline Lattice simple_cubic() {
  return {{1.0, 1.0, 1.0}, {{0.0, 0.0, 0.0}}, std::numbers::pi / 6.0, std::sqrt(2.0) / 4.0};
}
inline Lattice body_centred() {
  const double a = 2.0 / std::sqrt(3.0);
  return {{a, a, a}, {{0.0, 0.0, 0.0}, {0.5, 0.5, 0.5}}, std::numbers::pi * std::sqrt(3.0) / 8.0, 0.5106882};
}
inline Lattice face_centred() {
  const double a = std::sqrt(2.0);
  return {{a, a, a},
          {{0.0, 0.0, 0.0}, {0.5, 0.5, 0.0}, {0.5, 0.0, 0.5}, {0.0, 0.5, 0.5}},
          std::numbers::pi / std::sqrt(18.0),
          0.5745243};
}
inline Lattice hexagonal() {
  return {{1.0, std::sqrt(3.0), std::sqrt(8.0 / 3.0)},
          {{0.0, 0.0, 0.0}, {0.5, 0.5, 0.0}, {0.5, 5.0 / 6.0, 0.5}, {0.0, 1.0 / 3.0, 0.5}},
          std::numbers::pi / std::sqrt(18.0),
          0.4847617};
}

/// n x n x n boxes of a lattice of balls of radius r [m]; the outermost `shell` boxes all around are wall. By id, place by
/// place.
inline core::State block(const Lattice& lattice, int n, int shell, double r) {
  core::State state;
  core::BallId id = 0;
  for (int k = 0; k < n; ++k)
    for (int j = 0; j < n; ++j)
      for (int i = 0; i < n; ++i) {
        const auto outside = [&](int index) { return index < shell || index >= n - shell; };
        const bool fixed = outside(i) || outside(j) || outside(k);
        for (const core::Vec3& place : lattice.places)
          state.add(id++, fixed ? core::Kind::wall : core::Kind::content,
                    2.0 * r * (core::Vec3(i, j, k) + place).cwiseProduct(lattice.edges), core::Vec3::Zero(), r);
      }
  return state;
}

}  // namespace grainclock::tests
