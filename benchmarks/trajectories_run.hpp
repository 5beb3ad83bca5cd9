// One point of a study of trajectories, from a start state over the horizon, and the file that keeps how it ended.
#pragma once

#include "benchmarks/divergence.hpp"
#include "benchmarks/study_plan.hpp"
#include "core/stepper.hpp"
#include "silo/measures.hpp"

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace grainclock::benchmarks {

struct StartState {
  std::string name;                    // stem of its file
  core::State state;                   // nothing is left of how it was stepped
  std::optional<silo::Layers> layers;  // of the wall, for its force; nothing without a wall
};

/// Reads a start state. Throws InputError, FileError.
StartState read_start(const std::string& path);

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
  std::string host, revision;      // read from a file only: what it was made with
  std::int64_t threads = 1;        // the same
  bool ok() const { return status == "ok"; }
};

/// Steps start states over a horizon [s] as the first phase of the scene says.
class Runner {
 public:
  Runner(const core::Scene& scene, double horizon, int threads) : scene_(scene), horizon_(horizon), threads_(threads) {}

  /// Throws InputError where no stepper offers these keys; at once, whatever the size of the state.
  void require_offered(const StartState& start, const Point& point) const;
  /// Runs the point. Failing numerics are an outcome.
  Outcome run(const StartState& start, const Point& point) const;

 private:
  core::StepperSetup setup(const core::State& state, const core::Stepping& stepping) const;
  Outcome step(const StartState& start, const core::Stepping& stepping) const;
  Outcome integrate(const StartState& start, const ReferenceSettings& settings) const;

  const core::Scene& scene_;
  double horizon_;
  int threads_;
};

/// What a file of results says about where it comes from, for /provenance.
struct JobOrigin {
  const core::Scene& scene;
  int threads;
};

/// The outcome as HDF5, aside and renamed. A repetition adds to the clock alone: `with_end` false leaves the end state out.
void write_outcome(const std::filesystem::path& file, const Outcome& outcome, const JobOrigin& origin, bool with_end);
/// Throws FileError where the file is missing or damaged.
Outcome read_outcome(const std::filesystem::path& file);

/// Separation of a start state from its perturbed copy over time.
struct DivergenceSeries {
  std::vector<double> time;      // s
  std::vector<double> rms, max;  // m
  double mean_diameter = 0.0;    // m, of the content
};

/// Throws NumericsError where the stepping fails.
DivergenceSeries run_divergence(const core::Scene& scene, const StartState& start, const Divergence& divergence,
                                int threads);
void write_divergence(const std::filesystem::path& file, const DivergenceSeries& series, const JobOrigin& origin);
DivergenceSeries read_divergence(const std::filesystem::path& file);

}  // namespace grainclock::benchmarks
