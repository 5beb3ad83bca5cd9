// Groups of measures of one moment; measure.cpp writes them down.
#include "silo/measure.hpp"

#include "silo/arches.hpp"
#include "silo/chains.hpp"
#include "silo/density.hpp"
#include "silo/flux.hpp"
#include "silo/order.hpp"
#include "silo/pressure_theory.hpp"
#include "silo/surface.hpp"
#include "silo/velocity.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

namespace grainclock::silo {
namespace {

using core::Contact;
using core::State;

constexpr std::size_t kNeighbours = 12;  // whose cells a local density is the mean of: a ball and those that could touch it
constexpr double kUnloaded = 0.1;        // of the mean force: the largest force on a ball that bears next to nothing
constexpr double kIntensive = 1.0, kAtRest = 0.1;  // of the mean flux speed
constexpr double kBeside = 4.0;          // mean diameters above and below a bridge
constexpr int kLargestBridge = 20;       // counts beyond it go into the last bin
constexpr int kRings = 10;               // of the free surface
constexpr int kModes = 3;                // around the axis

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

Observable one(const char* name, const char* unit, double value) { return {name, unit, {}, {value}}; }
Observable row(const char* name, const char* unit, std::vector<double> values) {
  return {name, unit, {values.size()}, std::move(values)};
}

std::vector<Observable> packing(const State& state, const MeasuredSilo& silo) {
  const std::vector<double> cells = cell_volumes(state);
  const double mean = mean_density(state, cells);
  const std::optional<DensityPeak> peak = densest(state, local_density(state, cells, kNeighbours), mean);
  const BondOrder order = bond_order(state);
  return {one("density", "", mean),
          one("density_peak_excess", "", peak ? peak->excess : kUnknown),
          one("density_peak_z", "m", peak ? peak->z : kUnknown),
          row("packing_by_layer", "", packing_by_layer(state, silo.shape, silo.layers)),
          one("global_q6", "", order.global_q6),
          one("crystalline_share", "", order.crystalline_share)};
}

std::vector<Observable> surface(const State& state, const MeasuredSilo& silo) {
  const SurfaceProfile profile = surface_profile(state, {silo.shape.half_width, kRings});
  const std::optional<Dish> dish = fit_dish(profile);
  return {row("surface_radius", "m", profile.radius), row("surface_height", "m", profile.height),
          one("surface_dish", "m-1", dish ? dish->b : kUnknown),
          one("surface_rise", "m", dish ? dish->rise(silo.shape.half_width) : kUnknown)};
}

std::vector<Observable> forces(const State& state, const std::vector<Contact>& contacts) {
  const ForceDistribution distribution = force_distribution(pushing_forces(state, contacts), force_edges());
  const std::vector<Chain> chains = compression_chains(state, contacts);
  return {one("force_mean", "N", distribution.mean), row("force_distribution", "", distribution.density),
          one("unloaded_share", "", unloaded_share(state, contacts, kUnloaded)),
          one("chains", "", static_cast<double>(chains.size())),
          one("chain_share", "", share_in_chains(state, chains))};
}

/// Bridges, and the mean over them of how fast balls above and below them move, as a share of the content's mean.
std::vector<Observable> arching(const State& state, const std::vector<Bridge>& all, double mean_diameter) {
  std::vector<double> by_size(kLargestBridge + 1, 0.0);
  double arches = 0.0, on_wall = 0.0, span = 0.0, in_bridges = 0.0;
  for (const Bridge& bridge : all) {
    by_size[std::min(bridge.members.size(), by_size.size() - 1)] += 1.0;
    arches += bridge.shape == Shape::arch;
    on_wall += bridge.on_wall;
    span = std::max(span, bridge.span);
    in_bridges += static_cast<double>(bridge.members.size());
  }
  double above = 0.0, below = 0.0;
  for (const Sides& sides : speeds_beside(state, all, kBeside * mean_diameter)) {
    above += sides.speed_above;
    below += sides.speed_below;
  }
  const double n = static_cast<double>(all.size()), content = static_cast<double>(state.count(core::Kind::content));
  return {row("bridges_by_size", "", by_size), one("bridges", "", n), one("bridges_flat", "", arches),
          one("bridges_on_wall", "", on_wall), one("bridge_widest", "m", span),
          one("bridge_share", "", content > 0.0 ? in_bridges / content : kUnknown),
          one("speed_above_bridges", "m s-1", n > 0.0 ? above / n : kUnknown),
          one("speed_below_bridges", "m s-1", n > 0.0 ? below / n : kUnknown)};
}

std::vector<Observable> flow(const State& state, const State* before, const MeasuredSilo& silo) {
  const State moved = before ? mean_motion(*before, state) : state;
  const double speed = mean_flux_speed(moved);
  const Motion shares = motion(moved, kIntensive * std::abs(speed), kAtRest * std::abs(speed));
  const double z = silo.shape.hopper_height > 0.0 ? silo.shape.hopper_height : silo.shape.half_outlet;
  const Flux flux = flux_through(moved, silo.density, z, kModes);
  std::vector<double> asymmetry, direction;
  for (int m = 1; m <= kModes; ++m) {
    asymmetry.push_back(flux.asymmetry(m));
    direction.push_back(flux.direction(m));
  }
  return {one("flux_speed", "m s-1", speed), one("intensive_share", "", shares.intensive), one("resting_share", "", shares.at_rest),
          one("flux", "kg s-1", flux.modes.front().real()), one("flux_turnover", "kg s-1", flux.turnover),
          row("flux_centroid", "m", {flux.centroid.x(), flux.centroid.y()}), row("flux_asymmetry", "", asymmetry),
          row("flux_direction", "rad", direction)};
}

std::vector<Observable> pressures(const std::vector<WallLoad>& loads, const std::vector<LayerStress>& stresses,
                                  const MeasuredSilo& silo) {
  std::vector<double> amplitude, crest, scatter;
  for (const LayerModes& layer : azimuthal_modes(loads, silo.layers, kModes)) {
    for (const Mode& mode : layer.mode) {
      amplitude.push_back(mode.amplitude);
      crest.push_back(mode.crest);
    }
    scatter.push_back(layer.scatter);
  }
  const std::uint64_t layers = static_cast<std::uint64_t>(silo.layers.n);
  const LateralResultant lateral = lateral_resultant(loads);
  std::vector<double> vertical, horizontal;
  for (const LayerStress& stress : stresses) {
    vertical.push_back(stress.vertical);
    horizontal.push_back(stress.horizontal);
  }
  return {row("pressure_by_layer", "Pa", pressure_by_layer(loads, silo.layers)),
          {"pressure_modes", "", {layers, kModes}, amplitude},
          {"pressure_crests", "rad", {layers, kModes}, crest},
          row("pressure_scatter", "", scatter),
          row("lateral_force", "N", {lateral.force.x(), lateral.force.y()}),
          row("lateral_moment", "N m", {lateral.moment_of_horizontal.x(), lateral.moment_of_horizontal.y()}),
          row("vertical_stress", "Pa", vertical), row("horizontal_stress", "Pa", horizontal)};
}

double median(std::vector<double> values) {
  std::erase_if(values, [](double value) { return !std::isfinite(value); });
  if (values.empty()) return kUnknown;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// The closed forms at the middle of each layer, for a level heap of the content's mass and centre of mass. Janssen's friction
/// and lateral ratio are what the state itself shows: medians over the layers of the shaft below the surface.
std::vector<Observable> theory(const State& state, const std::vector<WallLoad>& loads, const std::vector<LayerStress>& stresses,
                               const MeasuredSilo& silo) {
  const std::vector<LayerRatios> ratios = ratios_by_layer(loads, stresses, silo.layers);
  const auto n = static_cast<std::size_t>(silo.layers.n);
  std::vector<double> friction, lateral, of_janssen(n, kUnknown), of_water(n, kUnknown), of_fluid(n, kUnknown);
  const Meridian inside = inside_of(silo.shape);
  Heap heap{kUnknown, kUnknown};
  if (count_above(state, inside.outlet.z) > 0) heap = level_heap(state, silo.shape, silo.density);
  const double height = (silo.layers.z1 - silo.layers.z0) / silo.layers.n;
  const auto middle_of = [&](std::size_t k) { return silo.layers.z0 + (static_cast<double>(k) + 0.5) * height; };
  for (std::size_t k = 0; k < n; ++k) {
    if (!(middle_of(k) > silo.shape.hopper_height && middle_of(k) < heap.surface)) continue;
    friction.push_back(ratios[k].friction);
    lateral.push_back(ratios[k].lateral_at_wall);
  }
  const WallLaw law{std::max(0.0, median(friction)), median(lateral)};
  for (std::size_t k = 0; k < n && std::isfinite(heap.surface); ++k) {
    const double z = middle_of(k);
    of_water[k] = frictionless(inside, {kWaterDensity, heap.surface}, z).horizontal;
    of_fluid[k] = frictionless(inside, heap, z).horizontal;
    if (law.lateral > 0.0 && std::isfinite(law.friction)) of_janssen[k] = janssen(inside, heap, law, z).horizontal;
  }
  return {one("heap_surface", "m", heap.surface), one("heap_density", "kg m-3", heap.density),
          one("wall_friction", "", law.friction), one("lateral_ratio", "", law.lateral),
          row("janssen_by_layer", "Pa", of_janssen), row("water_by_layer", "Pa", of_water),
          row("frictionless_by_layer", "Pa", of_fluid)};
}

std::vector<Bond> bonds_of_large(const std::vector<Bridge>& all) {
  std::vector<Bond> bonds;
  for (const Bridge& bridge : all)
    if (bridge.members.size() >= kLargeBridge) bonds.insert(bonds.end(), bridge.bonds.begin(), bridge.bonds.end());
  return bonds;
}

}  // namespace

const std::vector<double>& force_edges() {
  static const std::vector<double> edges{0, 0.25, 0.5, 0.75, 1, 1.25, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10};
  return edges;
}

Reading moment_of(const State& state, const std::vector<Contact>& contacts, const State* before, const MeasuredSilo& silo) {
  const std::vector<Bridge> all_bridges = bridges(state, supports(state, contacts, Choice::strongest));
  Reading reading{{}, wall_loads(state, contacts, silo.shape), bonds_of_large(all_bridges)};
  std::vector<Observable>& all = reading.series;
  const auto add = [&all](std::vector<Observable> group) { std::move(group.begin(), group.end(), std::back_inserter(all)); };
  add(packing(state, silo));
  add(surface(state, silo));
  add(forces(state, contacts));
  add(arching(state, all_bridges, 2.0 * silo.shape.mean_radius()));
  add(flow(state, before, silo));
  const std::vector<LayerStress> stresses = stress_by_layer(state, contacts, silo.shape, silo.layers);
  add(pressures(reading.wall, stresses, silo));
  add(theory(state, reading.wall, stresses, silo));
  return reading;
}

}  // namespace grainclock::silo
