#include "benchmarks/reference.hpp"

#include "benchmarks/event_loop.hpp"
#include "core/check.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

namespace grainclock::benchmarks {
namespace {

using core::Kind;

/// Absolute tolerances where displacements and speeds are near zero: rtol times a hundredth of a
/// mean diameter d, and times the speed gained by falling through that.
Rounding absolute_tolerances(double rtol, double diameter, double gravity) {
  const double length = 0.01 * diameter;
  return {rtol * length, rtol * std::sqrt(2.0 * std::max(gravity, 1.0) * length)};
}

void fill(N_Vector tolerances, const Rounding& absolute) {
  const auto n = static_cast<std::size_t>(N_VGetLength(tolerances)) / 2;
  double* values = N_VGetArrayPointer(tolerances);
  std::fill_n(values, n, absolute.overlap);
  std::fill_n(values + n, n, absolute.rate);
}

/// The lightest ball's time scale on the stiffest spring [s]. Longer steps would be unstable in any contact;
/// without this cap a step in free flight, where nothing bounds it, ends deep inside another ball.
double longest_step(const core::State& state, const core::Materials& materials) {
  double lightest = std::numeric_limits<double>::infinity();
  for (std::size_t row = 0; row < state.size(); ++row) {
    if (state.kind[row] == Kind::content) lightest = std::min(lightest, materials.mass(state.radius[row]));
  }
  return std::sqrt(lightest / std::max(materials.ball.k, materials.wall.k));
}

Context make_context() {
  SUNContext context = nullptr;
  if (SUNContext_Create(nullptr, &context) != 0) throw core::NumericsError("SUNDIALS: no context; free some memory");
  return Context(context);
}

Vector make_vector(std::size_t n, const Context& context) {
  Vector vector(N_VNew_Serial(static_cast<sunindextype>(n), context.get()));
  if (!vector) throw core::NumericsError(fmt::format("SUNDIALS: no memory for {} unknowns", n));
  N_VEnableFusedOps_Serial(vector.get(), 1);  // combinations of many vectors in one pass
  return vector;
}

void check(const ReferenceSettings& settings, const core::State& start, double horizon) {
  GC_REQUIRE(start.count(Kind::content) > 0, "reference: the state has no content balls to integrate");
  GC_REQUIRE(horizon > 0.0, "reference: the horizon is {} s; it must be above 0", horizon);
  GC_REQUIRE(settings.rtol > 0.0 && settings.rtol < 1.0, "reference: rtol = {}; it must be between 0 and 1", settings.rtol);
  GC_REQUIRE(settings.scheme != Scheme::mristep || settings.slow_step > 0.0,
             "reference: slow_step = {} s; mristep needs one above 0", settings.slow_step);
}

}  // namespace

ReferenceRun integrate(const ReferenceSettings& settings, const core::State& start, const core::StepperSetup& setup,
                       double horizon) {
  check(settings, start, horizon);
  const double longest = longest_step(start, setup.materials);
  ContactSystem system(start, setup.materials, setup.gravity, setup.outlet_open, setup.threads);
  const Rounding tolerance = absolute_tolerances(settings.rtol, system.mean_diameter(), setup.gravity.norm());
  if (settings.roots) {
    system.watch(start, setup.materials, setup.outlet_open, std::max(longest, settings.slow_step), tolerance);
  }

  const Context context = make_context();
  const Vector y = make_vector(system.unknowns(), context), tolerances = make_vector(system.unknowns(), context);
  system.write_start(y.get());
  fill(tolerances.get(), tolerance);
  const auto solver = make_solver(
      settings.scheme, {context.get(), system, y.get(), tolerances.get(), settings.rtol, longest, settings.slow_step});

  ReferenceRun run;
  const auto begin = std::chrono::steady_clock::now();
  LoopResult result = run_to(horizon, *solver, system, y.get(), longest);
  run.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();

  run.end = start;
  system.read_into(run.end, y.get());
  run.end.time = start.time + horizon;
  run.end.evaluated_position.clear();
  run.end.evaluated_velocity.clear();
  run.contact_evaluations = system.contact_evaluations();
  run.steps = result.steps;
  run.restarts = result.restarts;
  run.changes = result.changes;
  run.log = std::move(result.log);
  return run;
}

}  // namespace grainclock::benchmarks
