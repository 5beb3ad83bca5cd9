// Rows of the table `study` from what the jobs left: errors against the reference, costs, gains. Pure functions.
#pragma once

#include "benchmarks/study_plan.hpp"
#include "benchmarks/study_table.hpp"
#include "benchmarks/trajectories_run.hpp"

#include <optional>
#include <vector>

namespace grainclock::benchmarks {

/// A point with all its repetitions; the first one holds the end state.
struct PointRuns {
  Point point;
  std::vector<Outcome> outcomes;  // at least one
};

/// All that was run from one start state.
struct StartRuns {
  const StartState& start;
  std::vector<PointRuns> points;
  PointRuns reference, check;
};

/// The points, then the reference and its check, with gains. The reference's status says whether it is fine enough: its
/// change from the check must be below a tenth of the smallest error. Gains by wall clock are left out where the runs
/// that they would compare were not all made on one machine with one number of threads.
std::vector<Row> rows_of(const StartRuns& runs, std::optional<double> outlet_z);

}  // namespace grainclock::benchmarks
