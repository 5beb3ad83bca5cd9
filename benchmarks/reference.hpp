// The same force routine through SUNDIALS: methods to beat, and a cross-check of the reference.
#pragma once

#include "benchmarks/study_plan.hpp"
#include "core/stepper.hpp"

namespace grainclock::benchmarks {

struct ReferenceRun {
  core::State end;
  std::uint64_t contact_evaluations = 0;
  std::uint64_t steps = 0;     // internal steps of the integrator
  double wall_s = 0.0;         // of the integration alone
};

/// Integrates (displacement, velocity) of the content over `horizon` [s] with CVODE (Adams, fixed-point
/// iteration) or ARKODE (explicit Runge-Kutta, order 4 in 5 stages), at relative tolerance `rtol`.
/// Balls that fall below the outlet stay in the system here. Throws NumericsError with SUNDIALS' reason.
ReferenceRun integrate(Solver solver, double rtol, const core::State& start, const core::StepperSetup& setup,
                       double horizon);

}  // namespace grainclock::benchmarks
