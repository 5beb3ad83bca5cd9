// The content of a state by itself, as measures of its packing need it.
#pragma once

#include "core/state.hpp"

#include <cstddef>
#include <vector>

namespace grainclock::silo {

using core::Vec3;

struct Content {
  std::vector<std::size_t> ball;  // index in the state, increasing
  std::vector<Vec3> centre;       // m
  double mean_diameter = 0.0;     // m, 0 without content
  double largest_radius = 0.0;    // m, likewise
};
Content content_of(const core::State& state);

}  // namespace grainclock::silo
