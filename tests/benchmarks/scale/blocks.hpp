// Blocks of balls for the tests of the large silos.
#pragma once

#include "benchmarks/scale/packing.hpp"

#include <cmath>
#include <numbers>
#include <random>

namespace grainclock::scale::testing {

constexpr double kStiffness = 1e7;  // N/m
constexpr double kRadius = 0.22;    // m

/// A simple cubic lattice of edge^3 balls whose neighbours overlap by `overlap` [m].
inline Packing cubic_lattice(int edge, double overlap) {
  const double spacing = 2.0 * kRadius - overlap;
  Packing packing{core::Vec3::Constant(edge * spacing), {}, {}};
  for (int i = 0; i < edge; ++i)
    for (int j = 0; j < edge; ++j)
      for (int k = 0; k < edge; ++k) {
        packing.position.emplace_back(i * spacing, j * spacing, k * spacing);
        packing.radius.push_back(kRadius);
      }
  return packing;
}

/// Balls anywhere in a box that they fill to this share.
inline Packing scattered(int balls, double share) {
  std::mt19937_64 bits(7);
  const double volume = balls * 4.0 / 3.0 * std::numbers::pi * std::pow(kRadius, 3) / share, edge = std::cbrt(volume);
  std::uniform_real_distribution<double> place(0.0, edge), radius(0.215, 0.225);
  Packing packing{core::Vec3::Constant(edge), {}, {}};
  for (int b = 0; b < balls; ++b) {
    packing.position.emplace_back(place(bits), place(bits), place(bits));
    packing.radius.push_back(radius(bits));
  }
  return packing;
}

}  // namespace grainclock::scale::testing
