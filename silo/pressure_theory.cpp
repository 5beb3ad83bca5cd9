#include "silo/pressure_theory.hpp"

#include "core/check.hpp"
#include "silo/contact_graph.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace grainclock::silo {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

void require_valid(const Heap& heap) {
  GC_REQUIRE(heap.density > 0.0 && std::isfinite(heap.density) && heap.gravity > 0.0 && std::isfinite(heap.gravity) &&
                 std::isfinite(heap.surface),
             "a heap of {} kg/m3 up to {} m under {} m/s2: must be finite, density and gravity above 0", heap.density,
             heap.surface, heap.gravity);
}

void require_valid(const WallLaw& law) {
  GC_REQUIRE(law.friction >= 0.0 && law.lateral > 0.0 && law.hopper_deficit >= 0.0 && law.hopper_deficit <= 1.0,
             "wall friction {}, lateral ratio {}, hopper deficit {}: must be 0 or above, above 0, and from 0 to 1", law.friction,
             law.lateral, law.hopper_deficit);
}

/// The hopper's wall at the angle beta from the vertical; its line meets the axis at the apex.
struct Hopper {
  double tangent;  // of beta
  double apex;     // m, height

  double cosine() const { return 1.0 / std::hypot(1.0, tangent); }
  double sine() const { return tangent * cosine(); }
};
Hopper hopper_of(const Meridian& inside) {
  const double tangent = (inside.joint.half_width - inside.outlet.half_width) / (inside.joint.z - inside.outlet.z);
  return {tangent, inside.joint.z - inside.joint.half_width / tangent};
}
bool is_in_hopper(const Meridian& inside, double z) { return z < inside.joint.z && inside.joint.z > inside.outlet.z; }

/// Vertical stress in a shaft at a depth [Pa].
double shaft_stress(const Meridian& inside, const Heap& heap, const WallLaw& law, double depth) {
  const double weight = heap.density * heap.gravity, hold = law.friction * law.lateral * 2.0 / inside.joint.half_width;
  return hold > 0.0 ? -weight / hold * std::expm1(-hold * depth) : weight * depth;
}

/// Vertical stress in a hopper [Pa] at x above the apex, if it is `load` at the height `top` above the apex.
double hopper_stress(const Heap& heap, double n, double top, double load, double x) {
  const double u = x / top;
  // (u - u^n) / (n - 1) as u times a function that is smooth through n = 1.
  const double log_u = std::log(u), exponent = (n - 1.0) * log_u;
  const double share = exponent == 0.0 ? -log_u : -log_u * std::expm1(exponent) / exponent;
  return heap.density * heap.gravity * top * u * share + load * std::pow(u, n);
}

/// Integral from z0 to z1 of a cubic f.
template <class Function>
double integral_of_cubic(const Function& f, double z0, double z1) {
  return (z1 - z0) / 6.0 * (f(z0) + 4.0 * f(0.5 * (z0 + z1)) + f(z1));
}

/// Height of the centre of a volume that fills the silo up to a surface [m].
double centre_below(Section section, const Meridian& inside, double surface) {
  const double bottom = inside.outlet.z;
  const auto volume = [&](double z) { return volume_between(section, inside, bottom, z); };
  const double joint = std::min(surface, inside.joint.z);
  const double below = integral_of_cubic(volume, bottom, joint) + integral_of_cubic(volume, joint, surface);
  return surface - below / volume(surface);
}

/// Adds a contact's part to each layer through which its line goes: force times line, not yet over the volume.
void add_line(std::vector<LayerStress>& stress, const Layers& layers, const Vec3& force, const Vec3& end, const Vec3& line) {
  const double vertical = force[2] * line[2], horizontal = 0.5 * (force[0] * line[0] + force[1] * line[1]);
  const double low = std::min(end[2], end[2] - line[2]), high = std::max(end[2], end[2] - line[2]);
  const double height = (layers.z1 - layers.z0) / layers.n;
  const double above = layers.n;
  const auto layer_of = [&](double z) { return static_cast<int>(std::clamp(std::floor((z - layers.z0) / height), -1.0, above)); };
  for (int k = std::max(0, layer_of(low)); k <= std::min(layers.n - 1, layer_of(high)); ++k) {
    const double inside = std::min(high, layers.z0 + (k + 1.0) * height) - std::max(low, layers.z0 + k * height);
    const double share = high > low ? std::max(0.0, inside) / (high - low) : 1.0;
    stress[static_cast<std::size_t>(k)].vertical += share * vertical;
    stress[static_cast<std::size_t>(k)].horizontal += share * horizontal;
  }
}

double ratio(double above, double below) { return below > 0.0 ? above / below : kNaN; }

}  // namespace

WallStress janssen(const Meridian& inside, const Heap& heap, const WallLaw& law, double z) {
  require_valid(heap);
  require_valid(law);
  const double depth = heap.surface - z;
  if (depth <= 0.0) return {};
  if (!is_in_hopper(inside, z)) {
    if (z < inside.outlet.z) return {};  // below a flat bottom
    const double vertical = shaft_stress(inside, heap, law, depth), normal = law.lateral * vertical;
    return {vertical, normal, law.friction * normal, normal};
  }
  const Hopper hopper = hopper_of(inside);
  const double x = z - hopper.apex, top = std::min(heap.surface, inside.joint.z);
  if (x <= 0.0) return {};
  const double load = shaft_stress(inside, heap, law, heap.surface - top);
  const double mu = std::clamp((1.0 - law.lateral) / (2.0 * hopper.tangent), 0.0, law.friction);
  const double n = 2.0 * (1.0 - law.hopper_deficit) * mu / hopper.tangent;
  const double vertical = hopper_stress(heap, n, top - hopper.apex, load, x);
  const double normal = (1.0 - law.hopper_deficit * mu / (mu + hopper.tangent)) * vertical, shear = mu * normal;
  return {vertical, normal, shear, normal * hopper.cosine() - shear * hopper.sine()};
}

WallStress frictionless(const Meridian& inside, const Heap& heap, double z) {
  require_valid(heap);
  const double pressure = heap.density * heap.gravity * std::max(0.0, heap.surface - z);
  const double cosine = is_in_hopper(inside, z) ? hopper_of(inside).cosine() : 1.0;
  return {pressure, pressure, 0.0, pressure * cosine};
}

Heap level_heap(const core::State& state, const SiloShape& shape, double density) {
  const Meridian inside = inside_of(shape);
  double cubes = 0.0, moment = 0.0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] != core::Kind::content || state.position[i][2] <= inside.outlet.z) continue;
    const double cube = state.radius[i] * state.radius[i] * state.radius[i];
    cubes += cube;
    moment += cube * state.position[i][2];
  }
  GC_REQUIRE(cubes > 0.0, "no content above the outlet at z = {} m: there is no heap", inside.outlet.z);
  const double centre = moment / cubes;
  // Sections do not narrow upward: the centre is at half the height or above it.
  double low = centre, high = 2.0 * centre - inside.outlet.z;
  while (true) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    (centre_below(shape.section, inside, middle) < centre ? low : high) = middle;
  }
  const double volume = volume_between(shape.section, inside, inside.outlet.z, high);
  return {density * 4.0 / 3.0 * std::numbers::pi * cubes / volume, high};
}

std::vector<LayerStress> stress_by_layer(const core::State& state, const std::vector<core::Contact>& contacts,
                                         const SiloShape& shape, const Layers& layers) {
  require_valid(layers);
  std::vector<LayerStress> stress(static_cast<std::size_t>(layers.n), {0.0, 0.0});
  for (const core::Contact& contact : contacts) {
    const std::size_t i = place_of(state, contact.i), j = place_of(state, contact.j);
    Vec3 line = state.position[i] - state.position[j];
    if (contact.other != core::Kind::content) line *= (state.radius[i] - 0.5 * contact.overlap) / line.norm();
    add_line(stress, layers, contact.force, state.position[i], line);
  }
  const Meridian inside = inside_of(shape);
  const double height = (layers.z1 - layers.z0) / layers.n;
  for (std::size_t k = 0; k < stress.size(); ++k) {
    const double z = layers.z0 + static_cast<double>(k) * height;
    const double volume = volume_between(shape.section, inside, z, z + height);
    const double share = volume > 0.0 ? 1.0 / volume : kNaN;
    stress[k] = {stress[k].vertical * share, stress[k].horizontal * share};
  }
  return stress;
}

std::vector<LayerRatios> ratios_by_layer(std::span<const WallLoad> loads, std::span<const LayerStress> stress,
                                         const Layers& layers) {
  GC_REQUIRE(std::ssize(stress) == layers.n, "stresses of {} layers for {} layers: need those of the same", stress.size(), layers.n);
  std::vector<double> normal, downward;  // Pa
  for (const WallLoad& load : loads) {
    const double pressing = load.force.dot(load.normal);
    const double level = load.normal.head<2>().norm();
    normal.push_back(pressing / load.area);
    // Down along the wall is -z without its part along the normal.
    downward.push_back(level > 0.0 ? (load.normal[2] * pressing - load.force[2]) / level / load.area : 0.0);
  }
  const std::vector<double> mean_normal = mean_by_layer(loads, normal, layers);
  const std::vector<double> mean_downward = mean_by_layer(loads, downward, layers);
  std::vector<LayerRatios> ratios;
  for (std::size_t k = 0; k < stress.size(); ++k)
    ratios.push_back({ratio(mean_downward[k], mean_normal[k]), ratio(stress[k].horizontal, stress[k].vertical),
                      ratio(mean_normal[k], stress[k].vertical)});
  return ratios;
}

}  // namespace grainclock::silo
