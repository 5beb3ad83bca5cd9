// One point of a study of trajectories, from a start state over the horizon, and the file that keeps how it ended.
#pragma once

#include "benchmarks/first_phase.hpp"
#include "benchmarks/job_file.hpp"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace grainclock::benchmarks {

/// How a point ended.
struct Outcome {
  std::string status = "ok";  // or "failed: " and why
  std::string method_used;
  double step = 0.0;  // s, the coarsest; 0: SUNDIALS
  std::uint64_t steps = 0, restarts = 0;
  BranchChanges changes;  // SUNDIALS with roots only
  core::Costs costs;
  std::optional<double> momentum_residual, energy_residual, ideal_gain;
  core::LevelStatistics levels;    // `listed` is filled for SUNDIALS too
  double wall_s = 0.0;             // s, of the stepping alone
  core::State end;                 // content only; empty if the run failed or was a repetition
  std::vector<double> wall_force;  // N, by layer, at the end
  JobMaker made_by;                // read from a file only
  bool is_ok() const { return status == "ok"; }
};

/// Steps the start state over `horizon` [s] as the first phase of the scene says. Failing numerics are an outcome.
/// Throws InputError where no stepper offers the point's keys.
Outcome run_point(const core::Scene& scene, const StartState& start, const Point& point, double horizon, int threads);

/// A repetition adds to the clock alone: `with_end` false leaves the end state out. Throws FileError.
void write_outcome(const std::filesystem::path& path, const Outcome& outcome, const JobOrigin& origin, bool with_end);
/// Throws FileError where the file is missing or damaged.
Outcome read_outcome(const std::filesystem::path& path);

/// Separation of a start state from its perturbed copy over time.
struct DivergenceSeries {
  std::vector<double> time;      // s
  std::vector<double> rms, max;  // m
  double mean_diameter = 0.0;    // m, of the content
};

/// Throws NumericsError where the stepping fails.
DivergenceSeries run_divergence(const core::Scene& scene, const StartState& start, const Divergence& divergence,
                                int threads);
/// Throws FileError.
void write_divergence(const std::filesystem::path& path, const DivergenceSeries& series, const JobOrigin& origin);
/// Throws FileError where the file is missing or damaged.
DivergenceSeries read_divergence(const std::filesystem::path& path);

}  // namespace grainclock::benchmarks
