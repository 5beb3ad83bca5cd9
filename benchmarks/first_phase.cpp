#include "benchmarks/first_phase.hpp"

#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "multirate/stepper.hpp"
#include "silo/phases.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <limits>

namespace grainclock::benchmarks {
namespace {

using core::Kind;
using core::State;

/// Wall forces are compared by layers this many mean diameters thick.
constexpr double kLayerDiameters = 2.0;

/// Layers about kLayerDiameters thick over the height of the wall; nothing without a wall.
std::optional<silo::Layers> wall_layers(const State& state) {
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  for (std::size_t row = 0; row < state.size(); ++row) {
    if (state.kind[row] != Kind::wall) continue;
    lowest = std::min(lowest, state.position[row].z());
    highest = std::max(highest, state.position[row].z());
  }
  if (!(lowest < highest)) return std::nullopt;
  const double layers = (highest - lowest) / (kLayerDiameters * mean_diameter(state));
  return silo::Layers{lowest, highest, std::max(1, static_cast<int>(std::lround(layers)))};
}

}  // namespace

StartState read_start(const std::string& path) {
  StartState start;
  start.name = std::filesystem::path(path).stem().string();
  start.state = silo::fresh(core::read_state(path));
  GC_REQUIRE(start.state.count(Kind::content) > 0, "{}: the start state has no content balls; nothing would move", path);
  start.layers = wall_layers(start.state);
  return start;
}

double mean_diameter(const State& state) {
  double sum = 0.0;
  for (std::size_t row = 0; row < state.size(); ++row) {
    if (state.kind[row] == Kind::content) sum += 2.0 * state.radius[row];
  }
  return sum / static_cast<double>(std::max<std::size_t>(1, state.count(Kind::content)));
}

core::StepperSetup first_phase_setup(const core::Scene& scene, const State& state, const core::Stepping& stepping,
                                     double every, int threads) {
  core::Phase phase = scene.phases.front();
  phase.stepping = stepping;
  phase.every = every;
  return silo::phase_setup(scene, phase, state, threads);
}

void require_offered(const core::Scene& scene, const StartState& start, const Point& point, double every, int threads) {
  if (point.sundials) return;
  // One ball: what a stepper says about its keys does not depend on the rest. The highest is in no outlet.
  std::size_t highest = start.state.size();
  for (std::size_t row = 0; row < start.state.size(); ++row) {
    if (start.state.kind[row] != Kind::content) continue;
    if (highest == start.state.size() || start.state.position[row].z() > start.state.position[highest].z()) highest = row;
  }
  State one;
  one.add(start.state.id[highest], Kind::content, start.state.position[highest], start.state.velocity[highest],
          start.state.radius[highest]);
  (void)multirate::make_stepper(one, first_phase_setup(scene, one, point.stepping, every, threads));
}

std::string_view method_used(const core::Stepping& stepping, const core::LevelStatistics& levels) {
  const bool is_selective = stepping.method == core::Method::multirate && levels.step.size() > 1;
  return core::name(is_selective ? core::Method::multirate : core::Method::uniform);
}

}  // namespace grainclock::benchmarks
