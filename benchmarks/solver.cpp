#include "benchmarks/solver.hpp"

#include "core/check.hpp"

#include <arkode/arkode_arkstep.h>
#include <arkode/arkode_erkstep.h>
#include <arkode/arkode_mristep.h>
#include <cvode/cvode.h>
#include <sunlinsol/sunlinsol_spgmr.h>
#include <sunnonlinsol/sunnonlinsol_fixedpoint.h>
#include <sunnonlinsol/sunnonlinsol_newton.h>

namespace grainclock::benchmarks {
namespace {

using core::Part;

constexpr long kMostSteps = 100'000'000;
constexpr int kMostErrorTestFailures = 30;  // without roots a step that meets a kink shrinks many times
constexpr int kFixedPointVectors = 0;       // plain iteration: the problem is only mildly stiff
constexpr int kKrylovVectors = 30;          // printed dampers: h c / m far above 1
constexpr int kExplicitOrder = 5, kImplicitOrder = 5, kMixedOrder = 5, kFastOrder = 5, kSlowOrder = 3;
constexpr int kInterpolantDegree = 3;  // used at ends of steps only, where any degree is exact

template <Part part, bool moves>
int slope(realtype, N_Vector y, N_Vector out, void* system) {
  return static_cast<ContactSystem*>(system)->slope(part, moves, y, out);
}

template <Part part, bool moves>
int jacobian_times(N_Vector direction, N_Vector out, realtype, N_Vector y, N_Vector at_y, void* system, N_Vector scratch) {
  return static_cast<ContactSystem*>(system)->jacobian_times(part, moves, direction, out, y, at_y, scratch);
}

/// The calls that differ between SUNDIALS' packages only in their names.
struct Calls {
  const char* package;
  int one_step;
  int (*evolve)(void*, realtype, N_Vector, realtype*, int);
  int (*restart)(void*, realtype, N_Vector);
  int (*stop_at)(void*, realtype);
  int (*set_tolerances)(void*, realtype, N_Vector);
  int (*set_user_data)(void*, void*);
  int (*set_most_steps)(void*, long);
  int (*set_error_handler)(void*, void (*)(int, const char*, const char*, char*, void*), void*);
  int (*set_longest_step)(void*, realtype);
  int (*set_most_failures)(void*, int);
  void (*free)(void**);
};
constexpr Calls kCvode{"CVODE",
                       CV_ONE_STEP,
                       CVode,
                       CVodeReInit,
                       CVodeSetStopTime,
                       CVodeSVtolerances,
                       CVodeSetUserData,
                       CVodeSetMaxNumSteps,
                       CVodeSetErrHandlerFn,
                       CVodeSetMaxStep,
                       CVodeSetMaxErrTestFails,
                       CVodeFree};
constexpr Calls kErkStep{"ERKStep",
                         ARK_ONE_STEP,
                         ERKStepEvolve,
                         ERKStepReset,
                         ERKStepSetStopTime,
                         ERKStepSVtolerances,
                         ERKStepSetUserData,
                         ERKStepSetMaxNumSteps,
                         ERKStepSetErrHandlerFn,
                         ERKStepSetMaxStep,
                         ERKStepSetMaxErrTestFails,
                         ERKStepFree};
constexpr Calls kArkStep{"ARKStep",
                         ARK_ONE_STEP,
                         ARKStepEvolve,
                         ARKStepReset,
                         ARKStepSetStopTime,
                         ARKStepSVtolerances,
                         ARKStepSetUserData,
                         ARKStepSetMaxNumSteps,
                         ARKStepSetErrHandlerFn,
                         ARKStepSetMaxStep,
                         ARKStepSetMaxErrTestFails,
                         ARKStepFree};
/// The slow step is fixed: neither its length nor its error is controlled.
constexpr Calls kMriStep{"MRIStep",
                         ARK_ONE_STEP,
                         MRIStepEvolve,
                         MRIStepReset,
                         MRIStepSetStopTime,
                         MRIStepSVtolerances,
                         MRIStepSetUserData,
                         MRIStepSetMaxNumSteps,
                         MRIStepSetErrHandlerFn,
                         nullptr,
                         nullptr,
                         MRIStepFree};

/// Keeps SUNDIALS' last complaint instead of printing it.
void keep_text(int, const char*, const char* function, char* message, void* text) {
  *static_cast<std::string*>(text) = fmt::format("{}: {}", function, message);
}

/// One of SUNDIALS' integrators.
class Package {
 public:
  Package(const Calls& calls, void* memory)
      : calls_(&calls), memory_(memory, calls.free), complaint_(std::make_unique<std::string>()) {
    if (!memory) throw core::NumericsError(fmt::format("{} could not be created; free some memory", calls.package));
  }

  void* memory() const { return memory_.get(); }
  const Calls& calls() const { return *calls_; }

  /// Throws unless the flag is one of success; `cause`: what else is known.
  void require(int flag, std::string_view cause = {}) const {
    if (flag >= 0) return;
    throw core::NumericsError(fmt::format("{} failed with flag {} ({}{}{}); try another rtol", calls_->package, flag,
                                          *complaint_, cause.empty() ? "" : " ", cause));
  }
  /// What every package is told.
  void configure(const SolverSetup& setup) const {
    require(calls_->set_error_handler(memory(), keep_text, complaint_.get()));
    require(calls_->set_tolerances(memory(), setup.rtol, setup.tolerances));
    require(calls_->set_user_data(memory(), &setup.system));
    require(calls_->set_most_steps(memory(), kMostSteps));
    if (calls_->set_longest_step) require(calls_->set_longest_step(memory(), setup.longest_step));
    if (calls_->set_most_failures) require(calls_->set_most_failures(memory(), kMostErrorTestFailures));
  }

 private:
  struct Free {
    void (*call)(void**);
    Free(void (*its_call)(void**)) : call(its_call) {}
    void operator()(void* memory) const { call(&memory); }
  };
  const Calls* calls_;
  std::unique_ptr<void, Free> memory_;
  std::unique_ptr<std::string> complaint_;
};

void free_inner(MRIStepInnerStepper it) { MRIStepInnerStepper_Free(&it); }

/// What an integrator points to and does not own.
struct Parts {
  LinearSolver linear;
  NonlinearSolver iteration;
  std::unique_ptr<Package> fast;
  Owned<MRIStepInnerStepper, free_inner> inner;
};

/// What both kinds of solvers have in common.
class PackageSolver : public Solver {
 public:
  PackageSolver(Package package, Parts parts, ContactSystem& system)
      : parts_(std::move(parts)), package_(std::move(package)), system_(system) {}

  double step(N_Vector y) override {
    realtype reached = 0.0;
    const int flag = package_.calls().evolve(package_.memory(), stop_, y, &reached, package_.calls().one_step);
    system_.rethrow();
    package_.require(flag, system_.complaint());
    return reached;
  }
  void restart(double time, N_Vector y, double stop) override {
    stop_ = stop;
    package_.require(package_.calls().restart(package_.memory(), time, y));
    package_.require(package_.calls().stop_at(package_.memory(), stop));
  }

 protected:
  const Package& package() const { return package_; }

 private:
  Parts parts_;  // outlive the package
  Package package_;
  ContactSystem& system_;
  double stop_ = 0.0;  // s
};

/// Multistep methods: within a step the solution is their own polynomial.
class Multistep : public PackageSolver {
 public:
  using PackageSolver::PackageSolver;
  void evaluate_at(double time, N_Vector y) override { package().require(CVodeGetDky(package().memory(), time, 0, y)); }
};

/// One-step methods: within a step the solution is what a shorter step from the same start gives. It is as accurate as
/// the step, which an interpolant of lower order, or one across many fast steps, would not be.
class OneStep : public PackageSolver {
 public:
  OneStep(Package package, Parts parts, const SolverSetup& setup)
      : PackageSolver(std::move(package), std::move(parts), setup.system),
        start_(N_VClone(setup.y)),
        end_(N_VClone(setup.y)) {}

  double step(N_Vector y) override {
    if (is_moved_) PackageSolver::restart(end_time_, end_.get(), goal_);
    is_moved_ = false;
    start_time_ = end_time_;
    N_VScale(1.0, end_.get(), start_.get());
    end_time_ = PackageSolver::step(y);
    N_VScale(1.0, y, end_.get());
    return end_time_;
  }
  void evaluate_at(double time, N_Vector y) override {
    is_moved_ = true;
    N_VScale(1.0, start_.get(), y);
    if (time <= start_time_) return;
    PackageSolver::restart(start_time_, start_.get(), time);
    while (PackageSolver::step(y) < time) {
    }
  }
  void restart(double time, N_Vector y, double stop) override {
    goal_ = stop;
    end_time_ = time;
    is_moved_ = false;
    N_VScale(1.0, y, end_.get());
    PackageSolver::restart(time, y, stop);
  }

 private:
  Vector start_, end_;                        // of the last step
  double start_time_ = 0.0, end_time_ = 0.0;  // s
  double goal_ = 0.0;                         // s
  bool is_moved_ = false;                     // by evaluate_at
};

template <class Handle, class Raw>
Handle require_made(Raw it, const char* what) {
  if (!it) throw core::NumericsError(fmt::format("SUNDIALS: {} could not be created; free some memory", what));
  return Handle(it);
}

LinearSolver make_krylov(const SolverSetup& setup) {
  return require_made<LinearSolver>(SUNLinSol_SPGMR(setup.y, SUN_PREC_NONE, kKrylovVectors, setup.context), "SPGMR");
}

Package make_cvode(int method, const SolverSetup& setup) {
  Package package(kCvode, CVodeCreate(method, setup.context));
  package.require(CVodeInit(package.memory(), slope<Part::all, true>, 0.0, setup.y));
  package.configure(setup);
  return package;
}

std::unique_ptr<Solver> make_adams(const SolverSetup& setup) {
  Package package = make_cvode(CV_ADAMS, setup);
  Parts parts;
  parts.iteration = require_made<NonlinearSolver>(SUNNonlinSol_FixedPoint(setup.y, kFixedPointVectors, setup.context),
                                                  "the fixed-point iteration");
  package.require(CVodeSetNonlinearSolver(package.memory(), parts.iteration.get()));
  return std::make_unique<Multistep>(std::move(package), std::move(parts), setup.system);
}

std::unique_ptr<Solver> make_bdf(const SolverSetup& setup) {
  Package package = make_cvode(CV_BDF, setup);
  Parts parts;
  parts.iteration = require_made<NonlinearSolver>(SUNNonlinSol_Newton(setup.y, setup.context), "Newton's iteration");
  parts.linear = make_krylov(setup);
  package.require(CVodeSetNonlinearSolver(package.memory(), parts.iteration.get()));
  package.require(CVodeSetLinearSolver(package.memory(), parts.linear.get(), nullptr));
  package.require(CVodeSetJacTimes(package.memory(), nullptr, jacobian_times<Part::all, true>));
  return std::make_unique<Multistep>(std::move(package), std::move(parts), setup.system);
}

std::unique_ptr<Solver> make_explicit(const SolverSetup& setup) {
  Package package(kErkStep, ERKStepCreate(slope<Part::all, true>, 0.0, setup.y, setup.context));
  package.configure(setup);
  package.require(ERKStepSetOrder(package.memory(), kExplicitOrder));
  package.require(ERKStepSetInterpolantDegree(package.memory(), kInterpolantDegree));
  return std::make_unique<OneStep>(std::move(package), Parts{}, setup);
}

/// `explicit_part` may be null; `implicit_part` has the Jacobian `times`.
std::unique_ptr<Solver> make_implicit(ARKRhsFn explicit_part, ARKRhsFn implicit_part, ARKLsJacTimesVecFn times, int order,
                                      const SolverSetup& setup) {
  Package package(kArkStep, ARKStepCreate(explicit_part, implicit_part, 0.0, setup.y, setup.context));
  package.configure(setup);
  Parts parts;
  parts.iteration = require_made<NonlinearSolver>(SUNNonlinSol_Newton(setup.y, setup.context), "Newton's iteration");
  parts.linear = make_krylov(setup);
  package.require(ARKStepSetNonlinearSolver(package.memory(), parts.iteration.get()));
  package.require(ARKStepSetLinearSolver(package.memory(), parts.linear.get(), nullptr));
  package.require(ARKStepSetJacTimes(package.memory(), nullptr, times));
  package.require(ARKStepSetOrder(package.memory(), order));
  package.require(ARKStepSetInterpolantDegree(package.memory(), kInterpolantDegree));
  return std::make_unique<OneStep>(std::move(package), std::move(parts), setup);
}

/// Contacts with fixed balls, and du/dt = v, in small steps of their own within each slow one.
std::unique_ptr<Solver> make_two_rates(const SolverSetup& setup) {
  Parts parts;
  parts.fast = std::make_unique<Package>(
      kArkStep, ARKStepCreate(slope<Part::fixed_pairs, true>, nullptr, 0.0, setup.y, setup.context));
  const Package& fast = *parts.fast;
  fast.configure(setup);
  fast.require(ARKStepSetOrder(fast.memory(), kFastOrder));
  fast.require(ARKStepSetInterpolantDegree(fast.memory(), kInterpolantDegree));
  MRIStepInnerStepper inner = nullptr;
  fast.require(ARKStepCreateMRIStepInnerStepper(fast.memory(), &inner));
  parts.inner.reset(inner);
  Package package(kMriStep, MRIStepCreate(slope<Part::ball_pairs, false>, nullptr, 0.0, setup.y, inner, setup.context));
  package.configure(setup);
  package.require(MRIStepSetOrder(package.memory(), kSlowOrder));
  package.require(MRIStepSetFixedStep(package.memory(), setup.slow_step));
  package.require(MRIStepSetInterpolantDegree(package.memory(), kInterpolantDegree));
  return std::make_unique<OneStep>(std::move(package), std::move(parts), setup);
}

}  // namespace

std::unique_ptr<Solver> make_solver(Scheme scheme, const SolverSetup& setup) {
  switch (scheme) {
    case Scheme::cvode_adams:
      return make_adams(setup);
    case Scheme::cvode_bdf:
      return make_bdf(setup);
    case Scheme::erkstep:
      return make_explicit(setup);
    case Scheme::arkstep_implicit:
      return make_implicit(nullptr, slope<Part::all, true>, jacobian_times<Part::all, true>, kImplicitOrder, setup);
    case Scheme::arkstep_imex:
      return make_implicit(slope<Part::springs, true>, slope<Part::dashpots, false>, jacobian_times<Part::dashpots, false>,
                           kMixedOrder, setup);
    case Scheme::mristep:
      return make_two_rates(setup);
  }
  return nullptr;
}

}  // namespace grainclock::benchmarks
