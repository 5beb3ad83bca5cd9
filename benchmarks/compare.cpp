#include "benchmarks/compare.hpp"

#include "benchmarks/errors.hpp"
#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "silo/run_file.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>

namespace grainclock::benchmarks {
namespace {

namespace fs = std::filesystem;
using core::State;
using silo::Report;
using silo::RunReader;

/// One of the two: its balls at the moment, and the run that they are from.
struct Side {
  std::optional<RunReader> run;
  std::int64_t frame = 0;
  State state;
};

bool is_a_run(const std::string& path) {
  return fs::is_directory(path) || (fs::path(path).extension() == ".h5" && silo::is_run(path));
}

Side open(const std::string& path) {
  Side side;
  if (is_a_run(path)) {
    side.run.emplace(path);
    GC_REQUIRE(side.run->frames() > 0, "{}: holds no frames yet", path);
  } else {
    side.state = core::read_state(path);
  }
  return side;
}

double last_time(const Side& side) { return side.run ? side.run->times().back() : side.state.time; }

void choose(Side& side, double time) {
  if (!side.run) return;
  side.frame = side.run->frame_at(time);
  side.state = side.run->state(side.frame);
}

void add_summary(Report& report, const std::string& key, const std::string& label, const ErrorSummary& errors) {
  Report part;
  part.add("rms", "rms", errors.rms);
  part.add("median", "median", errors.median);
  part.add("p99", "99 %", errors.p99);
  report.add(key, label, part);
}

void add_run_measures(Report& report, const Side& a, const Side& b) {
  const auto wall = a.run->observable(silo::kWallForceByLayer, a.frame),
             wall_reference = b.run->observable(silo::kWallForceByLayer, b.frame);
  if (wall && wall_reference && wall->size() == wall_reference->size())
    report.add("wall_force", "wall force by layer, relative L2", relative_l2(*wall, *wall_reference));
  for (const char* name : {"energy_residual", "momentum_residual", "discharged", "contact_evaluations"}) {
    const auto value = a.run->observable(name, a.frame), reference = b.run->observable(name, b.frame);
    if (value && reference && !value->empty() && !reference->empty())
      report.add(name, std::string(name) + ", and of the reference", std::vector<double>{value->at(0), reference->at(0)});
  }
}

}  // namespace

Report compare(const std::string& path, const std::string& reference, const CompareOptions& options) {
  Side a = open(path), b = open(reference);
  const double time = options.at.value_or(std::min(last_time(a), last_time(b)));
  choose(a, time);
  choose(b, time);
  // CSV has no time, so states are taken to be of the same moment; frames must be.
  constexpr double kSameTime = 1e-9;
  GC_REQUIRE(!a.run || !b.run || std::abs(a.state.time - b.state.time) <= kSameTime * std::max(1.0, std::abs(time)),
             "{} and {} have no frame in common at {} s (nearest: {} and {} s); give another --at", path, reference, time,
             a.state.time, b.state.time);

  Report report;
  report.add("file", "file", path);
  report.add("reference", "reference", reference);
  report.add("time", "time", b.state.time, "s");
  const Distances apart = distances(a.state, b.state);
  GC_REQUIRE(apart.common > 0, "{} and {} have no content balls in common; compare states of the same scene", path,
             reference);
  report.add("common", "content balls in common", static_cast<std::int64_t>(apart.common));
  report.add("distance_rms", "distance, rms", apart.rms, "m");
  report.add("distance_median", "distance, median", apart.median, "m");
  report.add("distance_p99", "distance, 99 %", apart.p99, "m");
  report.add("distance_max", "distance, largest", apart.largest, "m");

  std::optional<State> start;
  if (options.start) start = silo::read_moment(*options.start);
  if (!start && b.run && b.frame > 0) start = b.run->state(0);
  if (start) {
    std::optional<double> outlet_z;
    if (b.run) outlet_z = b.run->scene()["domain"]["outlet_z"].value<double>();
    const TrajectoryErrors errors = trajectory_errors(*start, b.state, a.state, outlet_z);
    add_summary(report, "position", "position error over rms displacement of the reference", errors.position);
    add_summary(report, "velocity", "velocity error over rms speed of the reference", errors.velocity);
    report.add("displacement", "rms displacement of the reference", errors.displacement, "m");
    report.add("speed", "rms speed of the reference", errors.speed, "m/s");
    report.add("missing", "balls of the reference that are missing", static_cast<std::int64_t>(errors.missing));
  }
  if (a.run && b.run) add_run_measures(report, a, b);
  return report;
}

}  // namespace grainclock::benchmarks
