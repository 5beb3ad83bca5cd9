// The files of a study of trajectories' jobs. Changing what they hold needs a new kFormat in trajectories_study.cpp.
#include "benchmarks/trajectories_run.hpp"
#include "core/check.hpp"
#include "core/files.hpp"
#include "core/hdf5.hpp"
#include "core/snapshot.hpp"
#include "silo/provenance.hpp"

#include <cmath>
#include <functional>
#include <limits>

namespace grainclock::benchmarks {
namespace {

using core::Hdf5Group;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

// One list of fields for writing and reading. Scalars are datasets of one value with their unit.
struct Writer {
  Hdf5Group group;
  void value(const char* name, const char* unit, double number) {
    group.write(name, std::vector{number}, {});
    if (*unit) group.write_attribute(name, "unit", std::string(unit));
  }
  void value(const char* name, const char*, std::uint64_t number) { group.write(name, std::vector{number}, {}); }
  void value(const char* name, const char* unit, const std::optional<double>& number) {
    value(name, unit, number.value_or(kUnknown));
  }
  void value(const char* name, const char*, const std::string& text) { group.write_text(name, text); }
  void value(const char* name, const char* unit, const std::vector<double>& numbers) {
    group.write(name, numbers);
    if (*unit) group.write_attribute(name, "unit", std::string(unit));
  }
};

struct Reader {
  Hdf5Group group;
  void value(const char* name, const char*, double& number) { number = group.read<double>(name).at(0); }
  void value(const char* name, const char*, std::uint64_t& number) { number = group.read<std::uint64_t>(name).at(0); }
  void value(const char* name, const char*, std::optional<double>& number) {
    const double read = group.read<double>(name).at(0);
    number = std::isnan(read) ? std::nullopt : std::optional(read);
  }
  void value(const char* name, const char*, std::string& text) { text = group.read_text(name); }
  void value(const char* name, const char*, std::vector<double>& numbers) { numbers = group.read<double>(name); }
};

template <class Access, class Its>
void each_field(Access& access, Its& outcome) {
  access.value("status", "", outcome.status);
  access.value("method_used", "", outcome.method_used);
  access.value("step", "s", outcome.step);
  access.value("steps", "", outcome.steps);
  access.value("restarts", "", outcome.restarts);
  access.value("touched", "", outcome.changes.touched);
  access.value("lost", "", outcome.changes.lost);
  access.value("clamped", "", outcome.changes.clamped);
  access.value("unclamped", "", outcome.changes.unclamped);
  access.value("out_of_reach", "", outcome.changes.out_of_reach);
  access.value("into_reach", "", outcome.changes.into_reach);
  access.value("parting", "", outcome.changes.parting);
  access.value("nearing", "", outcome.changes.nearing);
  access.value("contact_evaluations", "", outcome.costs.contact_evaluations);
  access.value("ball_updates", "", outcome.costs.ball_updates);
  access.value("list_builds", "", outcome.costs.list_builds);
  access.value("events", "", outcome.costs.events);
  access.value("missed_contacts", "", outcome.costs.missed_contacts);
  access.value("momentum_residual", "", outcome.momentum_residual);
  access.value("energy_residual", "", outcome.energy_residual);
  access.value("ideal_gain", "", outcome.ideal_gain);
  access.value("level_step", "s", outcome.levels.step);
  access.value("level_balls", "", outcome.levels.balls);
  access.value("level_contacts", "", outcome.levels.contacts);
  access.value("listed", "", outcome.levels.listed);
  access.value("wall_s", "s", outcome.wall_s);
  access.value("wall_force_by_layer", "N", outcome.wall_force);
}

template <class Access, class Its>
void each_series(Access& access, Its& series) {
  access.value("time", "s", series.time);
  access.value("separation_rms", "m", series.rms);
  access.value("separation_max", "m", series.max);
  access.value("mean_diameter", "m", series.mean_diameter);
}

constexpr const char* kGroup = "job";

/// Writes the fields below /job, and the provenance.
template <class Fields>
void write_file(const std::filesystem::path& path, const JobOrigin& origin, Fields fields) {
  core::AsideFile aside(path);
  core::Hdf5File file = core::Hdf5File::create(aside.part());
  {
    Writer writer{file.create_group(kGroup)};
    fields(writer);
  }
  silo::write_provenance(file, origin.threads, origin.scene.seed, origin.scene.text);
  file.close();
  aside.commit();
}

}  // namespace

void write_outcome(const std::filesystem::path& file, const Outcome& outcome, const JobOrigin& origin, bool with_end) {
  write_file(file, origin, [&](Writer& writer) {
    each_field(writer, outcome);
    if (with_end && outcome.ok()) core::write_state(writer.group, outcome.end);
  });
}

Outcome read_outcome(const std::filesystem::path& path) {
  const core::Hdf5File file = core::Hdf5File::open(path);
  Reader reader{file.group(kGroup)};
  Outcome outcome;
  each_field(reader, outcome);
  if (core::has_state(reader.group)) outcome.end = core::read_state(reader.group);
  const Hdf5Group origin = file.group("provenance");
  const std::string host = origin.read_text("host");
  outcome.host = host.substr(0, host.find(' '));  // the rest is its system
  outcome.revision = origin.read_text("git_revision");
  outcome.threads = origin.read<std::int64_t>("threads").at(0);
  return outcome;
}

void write_divergence(const std::filesystem::path& file, const DivergenceSeries& series, const JobOrigin& origin) {
  write_file(file, origin, [&](Writer& writer) { each_series(writer, series); });
}

DivergenceSeries read_divergence(const std::filesystem::path& path) {
  const core::Hdf5File file = core::Hdf5File::open(path);
  Reader reader{file.group(kGroup)};
  DivergenceSeries series;
  each_series(reader, series);
  return series;
}

}  // namespace grainclock::benchmarks
