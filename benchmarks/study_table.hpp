// The table `study` of a study of trajectories: one row per point.
#pragma once

#include "benchmarks/table.hpp"

#include <optional>
#include <string>
#include <vector>

namespace grainclock::benchmarks {

/// What is known about one point; what is not stays empty.
struct Row {
  using Number = std::optional<double>;

  std::string name, method, method_used, integrator, events, dashpot, interface;
  Number step, tolerance, levels;
  Number error_rms, error_median, error_p99, error_wall_force, momentum_residual, energy_residual;
  Number contact_evaluations, ball_updates, wall_s;
  Number ideal_gain, counted_gain, measured_gain;    // against the plain uniform scheme
  Number gain_events_counted, gain_events_measured;  // against the uniform scheme with events
  Number sweeps, missed_contacts, events_count, missing_balls, velocity_error_rms, rtol;
  std::string variant, roots;              // SUNDIALS only
  Number steps, restarts, branch_changes;  // steps: coarsest ones, or SUNDIALS' own
  std::string scene, start, status;
  std::string host, threads, revision;  // where the jobs ran, and with which program
};

/// One row each, in this order; the columns' order is a contract.
Table study_table(const std::vector<Row>& rows);

}  // namespace grainclock::benchmarks
