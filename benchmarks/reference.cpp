#include "benchmarks/reference.hpp"

#include "core/check.hpp"
#include "core/force_field.hpp"

#include <arkode/arkode_erkstep.h>
#include <cvode/cvode.h>
#include <nvector/nvector_serial.h>
#include <sundials/sundials_context.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <exception>
#include <limits>
#include <memory>
#include <span>

namespace grainclock::benchmarks {
namespace {

using core::Kind;

constexpr long kMostSteps = 100'000'000;
constexpr int kFixedPointVectors = 0;  // plain iteration: the problem is only mildly stiff
constexpr int kRungeKuttaOrder = 4;

template <class T, void (*destroy)(T)>
struct Destroy {
  using pointer = T;
  void operator()(T it) const { destroy(it); }
};
template <class T, void (*destroy)(T)>
using Owned = std::unique_ptr<std::remove_pointer_t<T>, Destroy<T, destroy>>;

void free_context(SUNContext it) { SUNContext_Free(&it); }
void free_solver(SUNNonlinearSolver it) { SUNNonlinSolFree(it); }
void free_cvode(void* it) { CVodeFree(&it); }
void free_arkode(void* it) { ERKStepFree(&it); }

using Context = Owned<SUNContext, free_context>;
using Vector = Owned<N_Vector, N_VDestroy>;
using NonlinearSolver = Owned<SUNNonlinearSolver, free_solver>;

void require_success(int flag, const char* call) {
  if (flag < 0) throw core::NumericsError(fmt::format("SUNDIALS: {} failed with flag {}; try another rtol", call, flag));
}

/// The right-hand side. The unknowns are (u, v) with x = x0 + u: relative tolerances then mean
/// displacements, not distances from an arbitrary origin.
struct System {
  core::ForceField field;
  std::vector<double> origin;    // m, 3 n
  std::vector<double> position;  // m, 3 n, scratch
  std::exception_ptr failure;    // exceptions must not pass through C code

  int evaluate(N_Vector y, N_Vector slope) {
    const std::size_t n = origin.size();
    const double* values = N_VGetArrayPointer(y);
    double* out = N_VGetArrayPointer(slope);
    for (std::size_t k = 0; k < n; ++k) position[k] = origin[k] + values[k];
    std::copy_n(values + n, n, out);
    try {
      field.acceleration(position, {values + n, n}, {out + n, n});
    } catch (const core::NumericsError&) {
      return 1;  // a trial step went too far: SUNDIALS tries a shorter one
    } catch (...) {
      failure = std::current_exception();
      return -1;
    }
    return 0;
  }
};

int right_hand_side(realtype, N_Vector y, N_Vector slope, void* system) {
  return static_cast<System*>(system)->evaluate(y, slope);
}

/// Absolute tolerances where displacements and speeds are near zero: rtol times a hundredth of a
/// mean diameter d, and times the speed gained by falling through that.
void fill_tolerances(N_Vector tolerances, double rtol, double diameter, double gravity) {
  const auto n = static_cast<std::size_t>(N_VGetLength(tolerances)) / 2;
  const double length = 0.01 * diameter;
  double* values = N_VGetArrayPointer(tolerances);
  std::fill_n(values, n, rtol * length);
  std::fill_n(values + n, n, rtol * std::sqrt(2.0 * std::max(gravity, 1.0) * length));
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

/// One integration as the two solvers need it.
struct Problem {
  SUNContext context;
  System& system;
  N_Vector y;           // in: the start, out: the end
  N_Vector tolerances;  // absolute
  double rtol;
  double horizon;       // s
  double longest_step;  // s
};

std::uint64_t run_cvode(const Problem& problem) {
  const Owned<void*, free_cvode> solver(CVodeCreate(CV_ADAMS, problem.context));
  const NonlinearSolver iteration(SUNNonlinSol_FixedPoint(problem.y, kFixedPointVectors, problem.context));
  if (!solver || !iteration) throw core::NumericsError("SUNDIALS: CVODE could not be created; free some memory");
  require_success(CVodeInit(solver.get(), right_hand_side, 0.0, problem.y), "CVodeInit");
  require_success(CVodeSVtolerances(solver.get(), problem.rtol, problem.tolerances), "CVodeSVtolerances");
  require_success(CVodeSetNonlinearSolver(solver.get(), iteration.get()), "CVodeSetNonlinearSolver");
  require_success(CVodeSetUserData(solver.get(), &problem.system), "CVodeSetUserData");
  require_success(CVodeSetMaxNumSteps(solver.get(), kMostSteps), "CVodeSetMaxNumSteps");
  require_success(CVodeSetMaxStep(solver.get(), problem.longest_step), "CVodeSetMaxStep");
  require_success(CVodeSetStopTime(solver.get(), problem.horizon), "CVodeSetStopTime");
  realtype reached = 0.0;
  const int flag = CVode(solver.get(), problem.horizon, problem.y, &reached, CV_NORMAL);
  if (problem.system.failure) std::rethrow_exception(problem.system.failure);
  require_success(flag, "CVode");
  long steps = 0;
  require_success(CVodeGetNumSteps(solver.get(), &steps), "CVodeGetNumSteps");
  return static_cast<std::uint64_t>(steps);
}

std::uint64_t run_arkode(const Problem& problem) {
  const Owned<void*, free_arkode> solver(ERKStepCreate(right_hand_side, 0.0, problem.y, problem.context));
  if (!solver) throw core::NumericsError("SUNDIALS: ERKStep could not be created; free some memory");
  require_success(ERKStepSVtolerances(solver.get(), problem.rtol, problem.tolerances), "ERKStepSVtolerances");
  require_success(ERKStepSetOrder(solver.get(), kRungeKuttaOrder), "ERKStepSetOrder");
  require_success(ERKStepSetUserData(solver.get(), &problem.system), "ERKStepSetUserData");
  require_success(ERKStepSetMaxNumSteps(solver.get(), kMostSteps), "ERKStepSetMaxNumSteps");
  require_success(ERKStepSetMaxStep(solver.get(), problem.longest_step), "ERKStepSetMaxStep");
  require_success(ERKStepSetStopTime(solver.get(), problem.horizon), "ERKStepSetStopTime");
  realtype reached = 0.0;
  const int flag = ERKStepEvolve(solver.get(), problem.horizon, problem.y, &reached, ARK_NORMAL);
  if (problem.system.failure) std::rethrow_exception(problem.system.failure);
  require_success(flag, "ERKStepEvolve");
  long steps = 0;
  require_success(ERKStepGetNumSteps(solver.get(), &steps), "ERKStepGetNumSteps");
  return static_cast<std::uint64_t>(steps);
}

}  // namespace

ReferenceRun integrate(const ReferenceSettings& settings, const core::State& start, const core::StepperSetup& setup,
                       double horizon) {
  GC_REQUIRE(settings.scheme == Scheme::cvode_adams || settings.scheme == Scheme::erkstep,
             "reference: this scheme is not offered yet");
  const double rtol = settings.rtol;
  ReferenceRun run;
  run.end = start;
  std::vector<std::size_t> rows;  // of the content balls, in the order of the unknowns
  for (std::size_t row = 0; row < start.size(); ++row) {
    if (start.kind[row] == Kind::content) rows.push_back(row);
  }
  GC_REQUIRE(!rows.empty(), "reference: the state has no content balls to integrate");

  System system{core::ForceField(start, setup.materials, setup.gravity, setup.outlet_open, setup.threads), {}, {}, {}};
  const std::size_t n = 3 * rows.size();
  system.origin.resize(n);
  system.position.resize(n);

  SUNContext raw_context = nullptr;
  require_success(SUNContext_Create(nullptr, &raw_context), "SUNContext_Create");
  const Context context(raw_context);
  const Vector y(N_VNew_Serial(static_cast<sunindextype>(2 * n), context.get()));
  const Vector tolerances(N_VNew_Serial(static_cast<sunindextype>(2 * n), context.get()));
  if (!y || !tolerances) throw core::NumericsError(fmt::format("SUNDIALS: no memory for {} unknowns", 2 * n));
  double* values = N_VGetArrayPointer(y.get());
  double mean_diameter = 0.0;
  for (std::size_t ball = 0; ball < rows.size(); ++ball) {
    mean_diameter += 2.0 * start.radius[rows[ball]] / static_cast<double>(rows.size());
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto component = static_cast<Eigen::Index>(axis);
      system.origin[3 * ball + axis] = start.position[rows[ball]][component];
      values[3 * ball + axis] = 0.0;
      values[n + 3 * ball + axis] = start.velocity[rows[ball]][component];
    }
  }
  fill_tolerances(tolerances.get(), rtol, mean_diameter, setup.gravity.norm());

  const Problem problem{context.get(), system, y.get(), tolerances.get(), rtol, horizon, longest_step(start, setup.materials)};
  const auto begin = std::chrono::steady_clock::now();
  run.steps = settings.scheme == Scheme::cvode_adams ? run_cvode(problem) : run_arkode(problem);
  run.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();

  for (std::size_t ball = 0; ball < rows.size(); ++ball) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto component = static_cast<Eigen::Index>(axis);
      run.end.position[rows[ball]][component] = system.origin[3 * ball + axis] + values[3 * ball + axis];
      run.end.velocity[rows[ball]][component] = values[n + 3 * ball + axis];
    }
  }
  run.end.time = start.time + horizon;
  run.end.evaluated_position.clear();
  run.end.evaluated_velocity.clear();
  run.contact_evaluations = system.field.contact_evaluations();
  return run;
}

}  // namespace grainclock::benchmarks
