// The command line: sub-commands, their options, and the exit codes.
#include "benchmarks/compare.hpp"
#include "benchmarks/study.hpp"
#include "core/check.hpp"
#include "core/scene.hpp"
#include "core/snapshot.hpp"
#include "silo/check.hpp"
#include "silo/export.hpp"
#include "silo/import.hpp"
#include "silo/info.hpp"
#include "silo/measure.hpp"
#include "silo/provenance.hpp"
#include "silo/run.hpp"

#include <CLI/CLI.hpp>
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <cstdio>
#include <map>
#include <system_error>

namespace {

using namespace grainclock;
using core::ExitCode;

int code_of(ExitCode code) { return static_cast<int>(code); }

void print(const silo::Report& report, bool as_json) {
  fmt::print("{}", as_json ? report.json() + "\n" : report.text());
}

struct StudyOptions {
  benchmarks::StudyCall call;
  std::string job;
  bool list = false, collect = false, no_charts = false;
};

/// The options of all sub-commands; each call sets those of its own.
struct Options {
  std::string file, second, output;
  std::vector<std::string> overrides;
  silo::RunOptions run;
  silo::ExportOptions exported{};
  silo::MeasureOptions measured;
  benchmarks::CompareOptions compared;
  StudyOptions study;
  bool json = false;
};

void study_call(const Options& o) {
  benchmarks::StudyCall call = o.study.call;
  call.study = o.file;
  call.out = o.output;
  call.threads = o.run.threads;
  call.charts = !o.study.no_charts;
  if (o.study.list) return fmt::print("{}", benchmarks::job_list(call));
  if (!o.study.job.empty()) return benchmarks::run_job(call, o.study.job);
  o.study.collect ? benchmarks::collect_study(call) : benchmarks::run_study(call);
}

/// CLI11's ranges let nan pass.
const CLI::Validator kFinite(
    [](const std::string& text) {
      double value = 0.0;
      return CLI::detail::lexical_cast(text, value) && std::isfinite(value) ? std::string() : "must be a finite number, not " + text;
    },
    "");

CLI::App* command(CLI::App& app, const char* name, const char* text, std::function<void()> call) {
  CLI::App* sub = app.add_subcommand(name, text);
  sub->callback(std::move(call));
  return sub;
}

void add_threads(CLI::App* sub, Options& o) {
  sub->add_option("--threads", o.run.threads, "Threads; results are the same for any number")->check(CLI::Range(1, 1024))->capture_default_str();
}
void add_checkpoints(CLI::App* sub, Options& o) {
  sub->add_option("--checkpoint-every", o.run.checkpoint_every, "Wall-clock seconds between checkpoints")->check(kFinite & CLI::NonNegativeNumber)->capture_default_str();
}
void add_set(CLI::App* sub, Options& o) {
  sub->add_option("--set", o.overrides, "key=value: overrides a key of the scene, as in stepping.step=1e-5 or phase.0.outlet=open")
      ->allow_extra_args(false);
}
void add_json(CLI::App* sub, Options& o) { sub->add_flag("--json", o.json, "Print JSON"); }

void add_commands(CLI::App& app, Options& o) {
  auto* run = command(app, "run", "Run the phases of a scene", [&o] { silo::run_scene(core::read_scene(o.file, o.overrides), o.output, o.run); });
  run->add_option("SCENE", o.file, "Scene file (TOML)")->required();
  run->add_option("--out", o.output, "Output directory, new or empty")->required();
  add_set(run, o);
  add_threads(run, o);
  add_checkpoints(run, o);

  auto* resume = command(app, "resume", "Go on with a run from its newest intact checkpoint", [&o] { silo::resume_run(o.file, o.run); });
  resume->add_option("DIR", o.file, "Output directory of the run")->required();
  add_threads(resume, o);
  add_checkpoints(resume, o);

  auto* check = command(app, "check", "Critical steps, levels, predicted gain, time and memory of a scene, without a run",
                        [&o] { print(silo::check_scene(core::read_scene(o.file, o.overrides), o.run.threads), o.json); });
  check->add_option("SCENE", o.file, "Scene file (TOML)")->required();
  add_set(check, o);
  add_threads(check, o);
  add_json(check, o);

  auto* study = command(app, "study", "Methods compared: runs what is not done yet, each job in a process of its own; tables and charts",
                        [&o] { study_call(o); });
  study->add_option("STUDY", o.file, "Study file (TOML)")->required();
  auto* out = study->add_option("--out", o.output, "Output directory: new, empty, or that of a study to go on with");
  auto* list = study->add_flag("--list", o.study.list, "Print the ids of all jobs and run nothing");
  auto* job = study->add_option("--job", o.study.job, "Run this one job, here")->excludes(list)->needs(out);
  auto* collect = study->add_flag("--collect", o.study.collect, "Write tables and charts from the jobs that are done; all must be")
                      ->excludes(list)->excludes(job)->needs(out);
  study->add_option("--jobs", o.study.call.processes, "Jobs at once; with more than one the wall clock is not to be trusted")
      ->excludes(list)->excludes(job)->excludes(collect)->check(CLI::Range(1, 1024))->capture_default_str();
  study->add_flag("--no-charts", o.study.no_charts, "Write tables only");
  add_threads(study, o);

  auto* compare = command(app, "compare", "Error measures of A against the reference B, two runs or states",
                          [&o] { print(benchmarks::compare(o.file, o.second, o.compared), o.json); });
  compare->add_option("A", o.file, "Run or state")->required();
  compare->add_option("B", o.second, "Run or state that A is measured against")->required();
  compare->add_option("--at", o.compared.at, "Time in s (default: the last that both have)")->check(kFinite);
  compare->add_option("--start", o.compared.start, "State that both began with (default: the first frame of B)");
  add_json(compare, o);

  const std::map<std::string, silo::Format> formats{{"vtk", silo::Format::vtk},
                                                    {"paraview", silo::Format::paraview},
                                                    {"lammps-data", silo::Format::lammps_data},
                                                    {"lammps-dump", silo::Format::lammps_dump},
                                                    {"csv", silo::Format::csv},
                                                    {"scene", silo::Format::scene}};
  auto* exported = command(app, "export", "Write a run's frame or a state for ParaView, OVITO, LAMMPS or a spreadsheet",
                           [&o] { silo::export_file(o.file, o.exported); });
  exported->add_option("FILE", o.file, "Run, checkpoint or state")->required();
  exported->add_option("--to", o.exported.format, "vtk (.vtp, or .pvd with --all), paraview (balls, contacts and wall, of every frame), "
                                                      "lammps-data, lammps-dump (OVITO reads it too), csv, or scene (what repeats a run)")
      ->required()
      ->transform(CLI::CheckedTransformer(formats));
  exported->add_option("--output", o.exported.output, "File to write; for paraview and scene a new directory")->required();
  exported->add_option("--at", o.exported.at, "Time in s (default: the last frame; for paraview every frame)")->check(kFinite);
  exported->add_flag("--all", o.exported.all, "Every frame of the run (vtk, lammps-dump; paraview does it anyway)");

  auto* measure = command(app, "measure", "Densities, forces, arches, flow and pressures of a run's frames, into one file of series",
                          [&o] { silo::measure_run(o.file, o.measured); });
  measure->add_option("RUN", o.file, "Run: its directory, or run.h5 there")->required();
  measure->add_option("--output", o.measured.output, "File to write (default: measures.h5 beside the run)");
  measure->add_option("--silo", o.measured.silo, "Scene with the [silo] of the wall, where the run's own scene has none");
  measure->add_option("--every", o.measured.every, "Least time between measured frames in s (default: all frames)")->check(kFinite & CLI::PositiveNumber);
  measure->add_option("--threads", o.measured.threads, "Frames at once")->check(CLI::Range(1, 1024))->capture_default_str();

  auto* import = command(app, "import", "Turn a CSV, LAMMPS data or LAMMPS dump file into a state",
                         [&o] { core::write_state(o.output, silo::import_file(o.file)); });
  import->add_option("FILE", o.file, "CSV, LAMMPS data (atom_style sphere) or LAMMPS dump")->required();
  import->add_option("--output", o.output, "State to write (.h5 or .csv)")->required();

  auto* info = command(app, "info", "What is in a file, and where it comes from", [&o] { print(silo::file_info(o.file), o.json); });
  info->add_option("FILE", o.file, "Run, checkpoint, state or study (HDF5)")->required();
  add_json(info, o);
}

int report(const std::string& text, ExitCode code) {
  ::signal(SIGPIPE, SIG_IGN);  // the code says it even where nobody reads the text
  std::fputs(fmt::format("grainclock: {}\n", text).c_str(), stderr);
  return code_of(code);
}

/// A standard stream that the caller has closed becomes /dev/null: the next file to be opened would take its place, and
/// what we print would go into it.
void open_standard_streams() {
  int descriptor = 0;
  while (descriptor >= 0 && descriptor <= STDERR_FILENO) descriptor = ::open("/dev/null", O_RDWR);
  if (descriptor >= 0) ::close(descriptor);
}

}  // namespace

// What may be thrown still is lack of memory for a line of text.
int main(int argc, char** argv) {  // NOLINT(bugprone-exception-escape)
  open_standard_streams();
  CLI::App app("grainclock: multi-rate discrete elements for granular material in silos. SI units everywhere.", "grainclock");
  app.set_version_flag("--version", "grainclock " + silo::version());
  app.require_subcommand(1);
  Options options;
  add_commands(app, options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? code_of(ExitCode::done) : code_of(ExitCode::bad_input);
  } catch (const core::Error& error) {
    return report(error.what(), error.code());
  } catch (const std::system_error& error) {
    return report(error.what(), ExitCode::file_trouble);
  } catch (const std::bad_alloc&) {
    return report("there is not enough memory; take fewer balls", ExitCode::numerics_failed);
  } catch (const std::exception& error) {
    return report(fmt::format("an error that should have been found earlier, please report it: {}", error.what()), ExitCode::numerics_failed);
  }
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0)
    return report("standard output could not be written in full; the files are complete", ExitCode::file_trouble);
  return code_of(ExitCode::done);
}
