// One long run of a study of statistics: its time series, the file that keeps them, and the measures read off them.
#pragma once

#include "benchmarks/job_file.hpp"
#include "core/stepper.hpp"

#include <compare>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace grainclock::benchmarks {

/// How long a run is, and what is written down how often.
struct Sampling {
  double duration = 0.0;  // s, a whole multiple of `every`
  double every = 0.0;     // s
  double layer = 1.0;     // m, height of the wall's layers
};

struct LongRun {
  std::string status = "ok";  // or "failed: " and why; the series then end before it
  std::string method_used;
  double step = 0.0;  // s, the coarsest
  core::Costs costs;
  double momentum_residual = 0.0, energy_residual = 0.0;  // nan if the run failed
  double wall_s = 0.0;                                    // of the stepping alone
  JobMaker made_by;                                       // read from a file only

  // A value per sample, the start's first.
  std::vector<double> time;            // s, since the start
  std::vector<double> discharged;      // balls that have left since the start
  std::vector<double> kinetic_energy;  // J
  std::vector<double> wall_force;      // N, horizontal force by layer, lowest first, sample after sample
  // By layer; empty without a wall.
  std::vector<double> layer_edges;  // m, whole multiples of Sampling::layer, one more than there are layers
  std::vector<double> wall_area;    // m2

  bool is_ok() const { return status == "ok"; }
};

/// Runs the scene's first phase from this state with this stepping. Failing numerics are told by the status.
/// Throws InputError for keys that no stepper offers, and if the silo runs empty: its rate would mean nothing.
LongRun run_long(const core::Scene& scene, const core::State& start, const core::Stepping& stepping,
                 const Sampling& sampling, int threads);

/// Throws FileError.
void write_long_run(const std::filesystem::path& path, const LongRun& run, const JobOrigin& origin);
/// Throws FileError where the file is missing or damaged.
LongRun read_long_run(const std::filesystem::path& path);

/// What is read off a run, in the order of the tables.
enum class Quantity {
  discharge_rate,
  stoppages,
  stoppage_length,
  stoppage_share,
  kinetic_energy,
  wall_force,
  wall_pressure
};
std::string_view name(Quantity quantity);
std::string_view unit(Quantity quantity);

/// A quantity, of a layer where it has layers: layer b reaches from b to b + 1 times the layers' height.
struct Measure {
  Quantity quantity;
  std::optional<int> bin;
  auto operator<=>(const Measure&) const = default;
};
using Measures = std::map<Measure, double>;  // nan: not known

/// The measures over the samples from `settle` [s] on: rate and stoppages (statistics.hpp) with stoppages of at least
/// `stop` [s], time means of kinetic energy, of the horizontal force on the whole wall, and of the pressure by layer (force
/// over area; nan where a layer holds no wall ball). Throws InputError if fewer than two samples are left.
Measures measures(const LongRun& run, double settle, double stop);

}  // namespace grainclock::benchmarks
