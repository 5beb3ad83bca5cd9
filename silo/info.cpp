#include "silo/info.hpp"

#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "silo/checkpoint.hpp"
#include "silo/run_file.hpp"

#include <fmt/ranges.h>

#include <filesystem>

namespace grainclock::silo {
namespace {

namespace fs = std::filesystem;
using core::Kind;
using core::State;

void add_balls(Report& report, const State& state) {
  report.add("time", "time", state.time, "s");
  for (const Kind kind : {Kind::content, Kind::wall, Kind::plug})
    report.add(std::string(name(kind)), fmt::format("{} balls", name(kind)), static_cast<std::int64_t>(state.count(kind)));
}

void add_run(Report& report, const std::string& path) {
  const RunReader run(path);
  report.add("kind", "kind", std::string("run (H5MD)"));
  report.add("frames", "frames", run.frames());
  if (run.frames() > 0) {
    report.add("times", "first and last frame", std::vector<double>{run.times().front(), run.times().back()}, "s");
    Report last;
    add_balls(last, run.state(run.frames() - 1));
    for (const std::string& name : run.observables())
      if (const auto values = run.observable(name, run.frames() - 1)) last.add(name, name, *values);
    report.add("last_frame", "last frame", last);
  }
}

void add_state(Report& report, const core::Hdf5File& file, const std::string& path) {
  const State state = core::read_state(static_cast<const core::Hdf5Group&>(file));
  const bool is_checkpoint = file.names().size() > 1;
  report.add("kind", "kind", std::string(is_checkpoint ? "checkpoint" : "state"));
  add_balls(report, state);
  report.add("restart", "holds what an exact restart needs", std::string(state.evaluated_position.empty() ? "no" : "yes"));
  report.add("checksum", "checksum", fmt::format("{:016x}", core::checksum(state)));
  if (!is_checkpoint) return;
  const Position at = read_checkpoint(path).position;
  report.add("phase", "phase, counted from 0", at.phase);
  report.add("steps", "steps of the phase", at.steps);
  report.add("frames", "frames recorded until then", at.frames);
}

void add_provenance(Report& report, const core::Hdf5Group& group) {
  Report provenance;
  for (const std::string& name : group.names()) {
    if (name == "threads")
      provenance.add(name, name, group.read_one<std::int64_t>(name));
    else if (name == "seed")
      provenance.add(name, name, static_cast<std::int64_t>(group.read_one<std::uint64_t>(name)));
    else if (const std::string text = group.read_text(name); text.find('\n') == std::string::npos)
      provenance.add(name, name, text);
    else
      provenance.add(name, name, "\n" + text);
  }
  report.add("provenance", "provenance", provenance);
}

}  // namespace

Report file_info(const std::string& path) {
  const std::string file_path = fs::is_directory(path) ? (fs::path(path) / "run.h5").string() : path;
  const core::Hdf5File file = core::Hdf5File::open(file_path);
  Report report;
  report.add("file", "file", file_path);
  if (file.has("h5md"))
    add_run(report, file_path);
  else if (core::has_state(file))
    add_state(report, file, file_path);
  else
    report.add("kind", "holds", fmt::format("{}", fmt::join(file.names(), ", ")));
  if (file.has("provenance")) add_provenance(report, file.group("provenance"));
  return report;
}

}  // namespace grainclock::silo
