#include "benchmarks/study.hpp"

#include "benchmarks/jobs.hpp"
#include "benchmarks/progress.hpp"
#include "benchmarks/stability_study.hpp"
#include "benchmarks/statistics_study.hpp"
#include "benchmarks/study_plan.hpp"
#include "benchmarks/trajectories_study.hpp"
#include "core/check.hpp"
#include "core/files.hpp"
#include "core/toml_keys.hpp"

#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <map>

namespace grainclock::benchmarks {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMarker = "study.toml";
constexpr std::string_view kMarkerLine = "# Copied here by `grainclock study`: the study whose jobs and tables these are.\n";
constexpr const char* kJobs = "jobs";
constexpr const char* kDrafts = ".study-";  // of the marker, one per process
constexpr const char* kPython = "/usr/bin/python3";
constexpr const char* kCharts = "share/grainclock/charts.py";  // beside the directory of the program

bool holds_study(const fs::path& dir) {
  return fs::exists(dir / kMarker) && core::read_text(dir / kMarker).starts_with(kMarkerLine);
}

/// Nothing of anybody else may be in the directory. Jobs of one study may all begin at once, the marker may come meanwhile.
void require_ours(const fs::path& dir) {
  if (!fs::exists(dir)) return;
  const auto is_ours = [&](const fs::directory_entry& entry) {
    const std::string name = entry.path().filename().string();
    return (name == kJobs && fs::is_empty(entry.path())) || name.starts_with(kDrafts) ||
           name.starts_with(fmt::format(".{}", kDrafts));
  };
  const bool is_new = fs::is_directory(dir) && std::all_of(fs::directory_iterator(dir), fs::directory_iterator(), is_ours);
  GC_REQUIRE(is_new || holds_study(dir),
             "--out {}: exists and is not empty, and it holds no study; give a new directory, an empty one, or that of the "
             "study to go on with",
             dir.string());
}

class StudyDirectory {
 public:
  /// Throws InputError unless the directory may be used.
  explicit StudyDirectory(const std::string& path) : path_(path) {
    GC_REQUIRE(!path.empty(), "--out is missing; give the directory of the study");
    require_ours(path_);
  }
  /// Makes it this study's: the marker first. Jobs of a study may do so at once.
  void prepare(const std::string& study_text) const {
    const std::string text = std::string(kMarkerLine) + study_text;
    fs::create_directories(path_);
    if (!fs::exists(path_ / kMarker) || core::read_text(path_ / kMarker) != text) {
      const fs::path draft = path_ / fmt::format("{}{}", kDrafts, ::getpid());
      core::write_text(draft, text);
      fs::rename(draft, path_ / kMarker);
    }
    fs::create_directories(path_ / kJobs);
  }
  fs::path file(const std::string& id) const { return path_ / kJobs / (id + ".h5"); }
  fs::path log(const std::string& id) const { return path_ / kJobs / (id + ".log"); }
  const fs::path& path() const { return path_; }

  std::vector<Job> missing(const std::vector<Job>& jobs) const {
    std::vector<Job> left;
    std::copy_if(jobs.begin(), jobs.end(), std::back_inserter(left),
                 [&](const Job& job) { return !fs::exists(file(job.id)); });
    return left;
  }

 private:
  fs::path path_;
};

std::vector<std::string> job_call(const StudyCall& call, const std::string& id) {
  return {"study", call.study, "--out", call.out, "--job", id, "--threads", fmt::format("{}", call.threads)};
}

/// Runs these jobs, a few at once, to the first that fails.
void run_all(const StudyCall& call, const StudyDirectory& dir, const std::vector<Job>& jobs, Progress& progress) {
  std::map<std::string, Job> by_id;
  for (const Job& job : jobs) by_id[job.id] = job;
  std::size_t next = 0, done = 0;
  JobProcesses children(call.processes);
  try {
    while (next < jobs.size() || !children.is_idle()) {
      while (next < jobs.size() && !children.is_full()) {
        const Job& job = jobs[next++];
        children.start(job.id, call.program, job_call(call, job.id), dir.log(job.id));
      }
      const Ended ended = children.next();
      if (ended.code != core::ExitCode::done) {
        throw core::Error(ended.code,
                          fmt::format("job {}: {}\n{} of {} jobs of this call are done and kept; the same call goes on",
                                      ended.id, ended.message, done, jobs.size()));
      }
      if (!fs::exists(dir.file(ended.id)))
        throw core::FileError(fmt::format("job {}: ended without its file {}", ended.id, dir.file(ended.id).string()));
      ++done;
      progress.done(by_id[ended.id].work, fmt::format("{} ({:.3g} s)", by_id[ended.id].label, ended.seconds));
    }
  } catch (const core::Stopped& stop) {
    throw core::Stopped(fmt::format("{}; {} of {} jobs of this call are done and kept, the same call goes on", stop.what(),
                                    done, jobs.size()));
  }
}

/// Draws the charts; tables are worth having without them, so that trouble is told and no more.
void draw_charts(const fs::path& dir, const Progress& progress) {
  const fs::path script = fs::read_symlink("/proc/self/exe").parent_path().parent_path() / kCharts;
  if (!fs::exists(script) || !fs::exists(kPython)) {
    progress.note(fmt::format(
        "no charts: {} is not there; {}", fs::exists(script) ? kPython : script.string(),
        fs::exists(script) ? "install python3, python3-h5py and python3-matplotlib" : "build grainclock's target again"));
    return;
  }
  const fs::path log = dir / "charts.log";
  JobProcesses children(1);
  children.start("charts", kPython, {script.string(), dir.string()}, log);
  const Ended ended = children.next();
  if (ended.code == core::ExitCode::done) return progress.note(fmt::format("charts: {}", (dir / "*.png").string()));
  const std::string last_line = ended.message.substr(ended.message.rfind('\n') + 1);
  progress.note(
      fmt::format("no charts: {}; install python3-h5py and python3-matplotlib, or see {}", last_line, log.string()));
}

void write_results(const StudyCall& call, const StudyKind& study, const StudyDirectory& dir, const Progress& progress) {
  JobFiles files;
  for (const Job& job : study.jobs()) files[job.id] = dir.file(job.id);
  const std::vector<Table> tables = study.tables(files);
  std::string written;
  for (const Table& table : tables) {
    const fs::path path = dir.path() / (table.name + ".csv");
    core::write_text(path, csv(table));
    written += path.string() + ", ";
  }
  write_tables(dir.path() / "study.h5", tables, study.origin());
  for (const std::string& warning : study.warnings(tables)) progress.note("warning: " + warning);
  progress.note(fmt::format("written: {}{}", written, (dir.path() / "study.h5").string()));
  if (call.charts) draw_charts(dir.path(), progress);
}

}  // namespace

std::unique_ptr<StudyKind> make_study(const std::string& path, int threads) {
  const toml::table root = core::parse_toml_file(path);
  const auto kind = core::TomlKeys(root, "", path).choice("kind", {"trajectories", "statistics", "stability"});
  if (kind == "statistics") return read_statistics_study(path, threads);
  if (kind == "stability") return read_stability_study(path, threads);
  return read_trajectories_study(path, threads);
}

std::string job_list(const StudyCall& call) {
  std::string text;
  for (const Job& job : make_study(call.study, call.threads)->jobs()) text += job.id + '\n';
  return text;
}

void run_study(const StudyCall& call) {
  const auto study = make_study(call.study, call.threads);
  const StudyDirectory dir(call.out);
  fs::create_directories(dir.path());
  const core::DirectoryLock lock(
      dir.path(), fmt::format("--out {}: another study is at work there; wait for it, or give another directory", call.out));
  dir.prepare(study->origin().study_text);
  const std::vector<Job> jobs = study->jobs(), missing = dir.missing(jobs);
  double work = 0.0;
  for (const Job& job : missing) work += job.work;
  Progress progress(work);
  progress.note(fmt::format("{} jobs, {} of {} done before", jobs.size(), jobs.size() - missing.size(), jobs.size()));
  run_all(call, dir, missing, progress);
  write_results(call, *study, dir, progress);
}

void run_job(const StudyCall& call, const std::string& id) {
  end_with_parent();
  const auto study = make_study(call.study, call.threads);
  const std::vector<Job> jobs = study->jobs();
  const auto job = std::find_if(jobs.begin(), jobs.end(), [&](const Job& one) { return one.id == id; });
  GC_REQUIRE(job != jobs.end(), "--job {}: {} has no such job; `grainclock study {} --list` names them", id, call.study,
             call.study);
  const StudyDirectory dir(call.out);
  dir.prepare(study->origin().study_text);
  const Progress progress(job->work);
  if (fs::exists(dir.file(id))) return progress.note(fmt::format("{}: done before", job->label));
  study->run(*job, dir.file(id));
  progress.note(fmt::format("{}: done", job->label));
}

void collect_study(const StudyCall& call) {
  const auto study = make_study(call.study, call.threads);
  const StudyDirectory dir(call.out);
  const std::vector<Job> jobs = study->jobs();
  const std::size_t missing = dir.missing(jobs).size();
  GC_REQUIRE(missing == 0, "--collect: {} of {} jobs are not done; run them with `grainclock study {} --out {}`", missing,
             jobs.size(), call.study, call.out);
  dir.prepare(study->origin().study_text);
  write_results(call, *study, dir, Progress(1.0));
}

}  // namespace grainclock::benchmarks
