#include "silo/measures.hpp"

#include "core/check.hpp"
#include "silo/contact_graph.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace grainclock::silo {
namespace {

double height_of(const Layers& layers) { return (layers.z1 - layers.z0) / layers.n; }
double edge(const Layers& layers, int i) { return i == layers.n ? layers.z1 : layers.z0 + i * height_of(layers); }

/// Volume of the part of a ball of radius r around the origin below height h [m3].
double volume_below(double r, double h) {
  const double cap = std::clamp(h + r, 0.0, 2.0 * r);
  return std::numbers::pi * cap * cap * (3.0 * r - cap) / 3.0;
}

}  // namespace

void require_valid(const Layers& layers) {
  GC_REQUIRE(layers.n >= 1 && layers.z0 < layers.z1, "{} layers between z = {} m and {} m: need at least one, and z0 below z1",
             layers.n, layers.z0, layers.z1);
}

std::optional<std::size_t> layer_of(const Layers& layers, double z) {
  if (z < layers.z0 || z > layers.z1) return std::nullopt;
  return static_cast<std::size_t>(std::min(layers.n - 1, static_cast<int>((z - layers.z0) / height_of(layers))));
}

std::vector<double> packing_by_layer(const core::State& state, const SiloShape& shape, const Layers& layers) {
  require_valid(layers);
  std::vector<double> packing(static_cast<std::size_t>(layers.n), 0.0);
  for (std::size_t ball = 0; ball < state.size(); ++ball) {
    if (state.kind[ball] != core::Kind::content) continue;
    const double z = state.position[ball][2], r = state.radius[ball];
    const double first = std::floor((z - r - layers.z0) / height_of(layers)), last = std::floor((z + r - layers.z0) / height_of(layers));
    if (last < 0.0 || first >= layers.n) continue;
    for (int i = static_cast<int>(std::max(0.0, first)); i <= static_cast<int>(std::min(last, layers.n - 1.0)); ++i)
      packing[static_cast<std::size_t>(i)] += volume_below(r, edge(layers, i + 1) - z) - volume_below(r, edge(layers, i) - z);
  }
  const Meridian inside = inside_of(shape);
  for (int i = 0; i < layers.n; ++i) {
    double& share = packing[static_cast<std::size_t>(i)];
    const double volume = volume_between(shape.section, inside, edge(layers, i), edge(layers, i + 1));
    share = volume > 0.0 ? share / volume : 0.0;
  }
  return packing;
}

std::vector<Vec3> forces_on_wall(const core::State& state, const std::vector<core::Contact>& contacts) {
  std::vector<Vec3> force(state.size(), Vec3::Zero());
  for (const core::Contact& contact : contacts) {
    if (contact.other == core::Kind::wall) force[place_of(state, contact.j)] -= contact.force;
  }
  return force;
}

std::vector<double> wall_force_by_layer(const core::State& state, const std::vector<core::Contact>& contacts,
                                        const Layers& layers) {
  require_valid(layers);
  const std::vector<Vec3> on_ball = forces_on_wall(state, contacts);
  std::vector<double> force(static_cast<std::size_t>(layers.n), 0.0);
  for (std::size_t ball = 0; ball < state.size(); ++ball) {
    if (state.kind[ball] != core::Kind::wall) continue;
    if (const auto layer = layer_of(layers, state.position[ball][2])) force[*layer] += std::hypot(on_ball[ball][0], on_ball[ball][1]);
  }
  return force;
}

std::vector<double> wall_area_by_layer(const core::State& state, const Layers& layers) {
  require_valid(layers);
  std::vector<double> area(static_cast<std::size_t>(layers.n), 0.0);
  for (std::size_t ball = 0; ball < state.size(); ++ball) {
    if (state.kind[ball] != core::Kind::wall) continue;
    if (const auto layer = layer_of(layers, state.position[ball][2])) area[*layer] += 4.0 * state.radius[ball] * state.radius[ball];
  }
  return area;
}

std::optional<Layers> whole_layers(const core::State& state, double height) {
  GC_REQUIRE(height > 0.0, "layers {} m high: must be above 0 m", height);
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  for (std::size_t ball = 0; ball < state.size(); ++ball) {
    if (state.kind[ball] != core::Kind::wall) continue;
    lowest = std::min(lowest, state.position[ball][2]);
    highest = std::max(highest, state.position[ball][2]);
  }
  if (lowest > highest) return std::nullopt;
  const double first = std::floor(lowest / height), end = std::max(first + 1.0, std::ceil(highest / height));
  constexpr double kMostLayers = 1e6;
  GC_REQUIRE(end - first <= kMostLayers, "layers {} m high over a wall from {} m to {} m: too many, take higher ones", height, lowest, highest);
  return Layers{first * height, end * height, static_cast<int>(end - first)};
}

std::int64_t count_above(const core::State& state, double z) {
  std::int64_t count = 0;
  for (std::size_t ball = 0; ball < state.size(); ++ball)
    if (state.kind[ball] == core::Kind::content && state.position[ball][2] > z) ++count;
  return count;
}

}  // namespace grainclock::silo
