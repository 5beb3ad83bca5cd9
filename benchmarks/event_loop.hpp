// Steps a solver to a horizon and stops it at every branch change of a watched pair.
//
// Steps are taken as if every pair kept its branch (ContactSystem), so that the solution is smooth across a step. Then
// each pair's path is followed from end to end; where it left its branch, even if it came back, the time of the change is
// found on the solver's own solution within the step, and the solver starts anew from there with the pair on its new branch.
#pragma once

#include "benchmarks/solver.hpp"

namespace grainclock::benchmarks {

struct LoopResult {
  std::uint64_t steps = 0, restarts = 0;
  BranchChanges changes;
  std::vector<BranchChange> log;
};

/// From y at time 0 to y at `horizon` [s]. `window` [s]: a time in which no pair can change its branch often; it is an error
/// if one does. Throws NumericsError.
LoopResult run_to(double horizon, Solver& solver, ContactSystem& system, N_Vector y, double window);

}  // namespace grainclock::benchmarks
