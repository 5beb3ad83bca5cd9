// SUNDIALS' integrators behind one face: a step at a time, the solution within the last step, a new start.
#pragma once

#include "benchmarks/contact_system.hpp"
#include "benchmarks/sundials_handles.hpp"

namespace grainclock::benchmarks {

class Solver {
 public:
  virtual ~Solver() = default;
  /// One internal step from where the last one ended; y gets the solution there. Returns the time reached [s].
  virtual double step(N_Vector y) = 0;
  /// The solution at a time within the last step. The next step() starts at its end all the same.
  virtual void evaluate_at(double time, N_Vector y) = 0;
  /// Forgets what it knows of the solution and starts anew; no step goes beyond `stop` [s].
  virtual void restart(double time, N_Vector y, double stop) = 0;
};

/// What all integrators are told.
struct SolverSetup {
  SUNContext context;
  ContactSystem& system;
  N_Vector y;           // the start, at time 0
  N_Vector tolerances;  // absolute
  double rtol;
  double longest_step;  // s
  double slow_step;     // s, mristep only
};

/// Calls of the solver throw NumericsError with SUNDIALS' reason.
std::unique_ptr<Solver> make_solver(Scheme scheme, const SolverSetup& setup);

}  // namespace grainclock::benchmarks
