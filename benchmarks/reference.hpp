// The same force routine through SUNDIALS: the judge of all steppers, and methods to beat.
#pragma once

#include "core/stepper.hpp"

#include <cstdint>
#include <string_view>
#include <vector>

namespace grainclock::benchmarks {

/// SUNDIALS' integrators, as we use them.
enum class Scheme {
  cvode_adams,       // fixed-point iteration
  cvode_bdf,         // Newton with SPGMR
  erkstep,           // explicit Runge-Kutta
  arkstep_implicit,  // diagonally implicit Runge-Kutta, Newton with SPGMR
  arkstep_imex,      // dashpots implicit, the rest explicit
  mristep,           // contacts with fixed balls fast, the rest slow at a fixed step
};

struct ReferenceSettings {
  Scheme scheme = Scheme::cvode_adams;
  double rtol = 1e-8;
  double slow_step = 0.0;  // s, mristep only
  bool roots = false;      // stop and start anew at every branch change of the law
};

/// How often the law changed its branch, by kind; counted with roots only.
struct BranchChanges {
  std::uint64_t touched = 0, lost = 0;             // overlap became positive, or not
  std::uint64_t clamped = 0, unclamped = 0;        // the dashpot's pull reached the spring's push, or fell below it
  std::uint64_t out_of_reach = 0, into_reach = 0;  // of cohesion
  std::uint64_t parting = 0, nearing = 0;          // the rate's sign within the reach of cohesion
};

enum class ChangeKind : std::uint8_t { touched, lost, clamped, unclamped, out_of_reach, into_reach, parting, nearing };

/// One branch change of one pair.
struct BranchChange {
  double time;        // s, since the start of the integration
  core::BallId i, j;  // i is content
  ChangeKind kind;
};

struct ReferenceRun {
  core::State end;
  std::uint64_t contact_evaluations = 0;
  std::uint64_t steps = 0;     // internal steps of the integrator
  std::uint64_t restarts = 0;  // at branch changes
  BranchChanges changes;
  std::vector<BranchChange> log;  // the same one by one, in order of time; with roots only
  double wall_s = 0.0;            // of the integration alone
};

/// Integrates (displacement, velocity) of the content over `horizon` [s].
/// Balls that fall below the outlet stay in the system here. Throws NumericsError with SUNDIALS' reason.
ReferenceRun integrate(const ReferenceSettings& settings, const core::State& start, const core::StepperSetup& setup,
                       double horizon);

}  // namespace grainclock::benchmarks
