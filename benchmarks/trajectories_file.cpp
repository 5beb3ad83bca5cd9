// The files of a study of trajectories' jobs. Changing what they hold needs a new kFormat in trajectories_study.cpp.
#include "benchmarks/job_file.hpp"
#include "benchmarks/trajectories_run.hpp"
#include "core/snapshot.hpp"

namespace grainclock::benchmarks {
namespace {

template <class Access, class Its>
void each_field(Access& access, Its& outcome) {
  access("status", "", outcome.status);
  access("method_used", "", outcome.method_used);
  access("step", "s", outcome.step);
  access("steps", "", outcome.steps);
  access("restarts", "", outcome.restarts);
  access("touched", "", outcome.changes.touched);
  access("lost", "", outcome.changes.lost);
  access("clamped", "", outcome.changes.clamped);
  access("unclamped", "", outcome.changes.unclamped);
  access("out_of_reach", "", outcome.changes.out_of_reach);
  access("into_reach", "", outcome.changes.into_reach);
  access("parting", "", outcome.changes.parting);
  access("nearing", "", outcome.changes.nearing);
  access("contact_evaluations", "", outcome.costs.contact_evaluations);
  access("ball_updates", "", outcome.costs.ball_updates);
  access("list_builds", "", outcome.costs.list_builds);
  access("events", "", outcome.costs.events);
  access("missed_contacts", "", outcome.costs.missed_contacts);
  access("momentum_residual", "", outcome.momentum_residual);
  access("energy_residual", "", outcome.energy_residual);
  access("ideal_gain", "", outcome.ideal_gain);
  access("level_step", "s", outcome.levels.step);
  access("level_balls", "", outcome.levels.balls);
  access("level_contacts", "", outcome.levels.contacts);
  access("listed", "", outcome.levels.listed);
  access("wall_s", "s", outcome.wall_s);
  access("wall_force_by_layer", "N", outcome.wall_force);
}

template <class Access, class Its>
void each_series(Access& access, Its& series) {
  access("time", "s", series.time);
  access("separation_rms", "m", series.rms);
  access("separation_max", "m", series.max);
  access("mean_diameter", "m", series.mean_diameter);
}

}  // namespace

void write_outcome(const std::filesystem::path& path, const Outcome& outcome, const JobOrigin& origin, bool with_end) {
  write_job_file(path, origin, [&](FieldWriter& writer) {
    each_field(writer, outcome);
    if (with_end && outcome.is_ok()) core::write_state(writer.group(), outcome.end);
  });
}

Outcome read_outcome(const std::filesystem::path& path) {
  Outcome outcome;
  outcome.made_by = read_job_file(path, [&](FieldReader& reader) {
    each_field(reader, outcome);
    if (core::has_state(reader.group())) outcome.end = core::read_state(reader.group());
  });
  return outcome;
}

void write_divergence(const std::filesystem::path& path, const DivergenceSeries& series, const JobOrigin& origin) {
  write_job_file(path, origin, [&](FieldWriter& writer) { each_series(writer, series); });
}

DivergenceSeries read_divergence(const std::filesystem::path& path) {
  DivergenceSeries series;
  read_job_file(path, [&](FieldReader& reader) { each_series(reader, series); });
  return series;
}

}  // namespace grainclock::benchmarks
