#include "benchmarks/trajectories_study.hpp"

#include "benchmarks/divergence.hpp"
#include "benchmarks/jobs.hpp"
#include "benchmarks/trajectories_rows.hpp"
#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "silo/provenance.hpp"

#include <algorithm>
#include <limits>
#include <optional>
#include <set>

namespace grainclock::benchmarks {
namespace {

/// Of the jobs' files and of what is computed into them; a new number lets every job run anew.
constexpr int kFormat = 1;
/// Separations are small below this share of a mean diameter: contacts are then the same ones in both copies.
constexpr double kSmallSeparation = 1e-3;

enum class Role { reference, check, point, divergence };

/// A job, and where its result belongs.
struct Task {
  Job job;
  Role role;
  std::size_t start;
  std::size_t point = 0;  // Role::point only
  int repetition = 1;     // the same
};

/// A row of table `divergence`.
struct SeparationRow {
  std::string start;
  double time, rms, max;  // s, m
};

/// A row of table `horizon`.
struct HorizonRow {
  std::string start;
  std::optional<double> rate, trusted_until;  // 1/s, s
  double floor;                               // m
};

Table divergence_table(const std::vector<SeparationRow>& rows) {
  return {
      "divergence",
      {column(rows, "start", "", &SeparationRow::start), column(rows, "time", "s", &SeparationRow::time),
       column(rows, "separation_rms", "m", &SeparationRow::rms), column(rows, "separation_max", "m", &SeparationRow::max)}};
}

Table horizon_table(const std::vector<HorizonRow>& rows) {
  return {"horizon",
          {column(rows, "start", "", &HorizonRow::start), column(rows, "rate", "s-1", &HorizonRow::rate),
           column(rows, "trusted_until", "s", &HorizonRow::trusted_until), column(rows, "floor", "m", &HorizonRow::floor)}};
}

class TrajectoriesStudy : public StudyKind {
 public:
  TrajectoriesStudy(const std::string& path, int threads)
      : study_(read_study(path)),
        scene_(core::read_scene(study_.scene)),
        threads_(threads),
        check_(coarser(study_.reference)) {
    GC_REQUIRE(!scene_.phases.empty(), "{}: has no [[phase]]; a study runs the first one", study_.scene);
    for (const std::string& start : study_.starts) starts_.push_back(read_start(start));
    // Key combinations that a stepper does not offer show now, not after an hour.
    for (const Point& point : study_.points) require_offered(scene_, starts_.front(), point, study_.horizon, threads_);
    require_offered(scene_, starts_.front(), study_.reference, study_.horizon, threads_);
    add_tasks();
  }

  std::vector<Job> jobs() const override {
    std::vector<Job> jobs;
    std::set<std::string> seen;  // methods that say the same in other words share their jobs
    for (const Task& task : tasks_) {
      if (seen.insert(task.job.id).second) jobs.push_back(task.job);
    }
    return jobs;
  }

  void run(const Job& job, const std::filesystem::path& file) const override {
    const Task& task = *std::find_if(tasks_.begin(), tasks_.end(), [&](const Task& one) { return one.job.id == job.id; });
    const StartState& start = starts_.at(task.start);
    const JobOrigin origin{scene_, threads_};
    if (task.role == Role::divergence) {
      write_divergence(file, run_divergence(scene_, start, *study_.divergence, threads_), origin);
      return;
    }
    const Outcome outcome = run_point(scene_, start, point_of(task), study_.horizon, threads_);
    if (task.role == Role::reference && !outcome.is_ok()) {
      throw core::NumericsError(fmt::format("{}: reference from {}: {}", study_.path, start.name, outcome.status));
    }
    write_outcome(file, outcome, origin, task.repetition == 1);
  }

  std::vector<Table> tables(const JobFiles& files) const override {
    std::vector<Row> rows;
    std::vector<SeparationRow> separations;
    std::vector<HorizonRow> horizons;
    for (std::size_t s = 0; s < starts_.size(); ++s) {
      const std::vector<Row> its_rows = rows_of(runs_of(s, files), scene_.domain.outlet_z);
      for (Row row : its_rows) {
        row.scene = std::filesystem::path(study_.scene).stem().string();
        rows.push_back(std::move(row));
      }
      if (!study_.divergence) continue;
      const DivergenceSeries series = divergence_of(s, files);
      for (std::size_t k = 0; k < series.time.size(); ++k) {
        separations.push_back({starts_[s].name, series.time[k], series.rms[k], series.max[k]});
      }
      horizons.push_back(horizon_row(starts_[s].name, series, its_rows));
    }
    std::vector<Table> tables{study_table(rows)};
    if (study_.divergence) {
      tables.push_back(divergence_table(separations));
      tables.push_back(horizon_table(horizons));
    }
    return tables;
  }

  TableOrigin origin() const override { return {study_.text, scene_.text, scene_.seed, threads_}; }

  std::vector<std::string> warnings(const std::vector<Table>& tables) const override {
    const Table& study = tables.at(0);
    const std::vector<std::string>&name = texts(study, "name"), &start = texts(study, "start"),
          &status = texts(study, "status");
    std::vector<std::string> said;
    for (std::size_t row = 0; row < name.size(); ++row) {
      if (status[row] == "ok") continue;
      said.push_back(name[row] == study_.reference.name
                         ? fmt::format("{}: the reference is {}; take a finer [reference]", start[row], status[row])
                         : fmt::format("{}: {} {}", start[row], name[row], status[row]));
    }
    for (const StartState& one : starts_) {
      // The different texts of a column, over the points of this start.
      const auto seen = [&](const char* column) {
        std::set<std::string> values;
        for (std::size_t row = 0; row < name.size(); ++row) {
          if (start[row] == one.name && !name[row].starts_with(study_.reference.name)) {
            values.insert(texts(study, column)[row]);
          }
        }
        return fmt::format("{}", fmt::join(values, "; "));
      };
      const auto differ = [](const std::string& values) { return values.find(';') != std::string::npos; };
      const std::string hosts = seen("host"), threads = seen("threads"), revisions = seen("revision");
      if (differ(hosts) || differ(threads)) {
        said.push_back(
            fmt::format("{}: its jobs ran on different machines or numbers of threads (hosts {}; threads {}): "
                        "gains by wall clock are left out",
                        one.name, hosts, threads));
      }
      if (differ(revisions)) {
        said.push_back(
            fmt::format("{}: its jobs are of different revisions of the program ({}); remove the jobs to run "
                        "all of them anew",
                        one.name, revisions));
      }
    }
    return said;
  }

 private:
  const Point& point_of(const Task& task) const {
    if (task.role == Role::reference) return study_.reference;
    return task.role == Role::check ? check_ : study_.points.at(task.point);
  }

  /// References first, then one repetition of everything after the other: what slows the machine for a while slows all
  /// alike.
  void add_tasks() {
    const std::string common = fmt::format("format {}\nversion {}\n{}", kFormat, silo::version(), scene_text(scene_));
    const auto start_text = [&](std::size_t s) {
      return fmt::format("{}\nstart {:016x}\n", common, core::checksum(starts_[s].state));
    };
    const auto add_run = [&](Role role, std::size_t s, std::size_t p, int repetition, std::string label) {
      Task task{{}, role, s, p, repetition};
      const Point& point = point_of(task);
      const std::string depends_on =
          fmt::format("{}horizon {}\n{}\nrepetition {}\n", start_text(s), study_.horizon, keys_text(point), repetition);
      task.job.id =
          job_id(fmt::format("{} {} {} r{}", starts_[s].name, made_name(point), knob_text(point), repetition), depends_on);
      task.job.label = fmt::format("{}: {} {}{}", starts_[s].name, point.name, knob_text(point), label);
      task.job.work = expected_sweeps(point, study_.horizon);
      tasks_.push_back(std::move(task));
    };
    int most = 1;
    for (std::size_t s = 0; s < starts_.size(); ++s) {
      add_run(Role::reference, s, 0, 1, "");
      add_run(Role::check, s, 0, 1, "");
      if (study_.divergence) add_divergence_task(s, start_text(s));
    }
    for (const Point& point : study_.points) most = std::max(most, point.repeat);
    for (int repetition = 1; repetition <= most; ++repetition) {
      for (std::size_t s = 0; s < starts_.size(); ++s) {
        for (std::size_t p = 0; p < study_.points.size(); ++p) {
          const int repeat = study_.points[p].repeat;
          if (repetition <= repeat)
            add_run(Role::point, s, p, repetition, fmt::format(", run {} of {}", repetition, repeat));
        }
      }
    }
  }

  void add_divergence_task(std::size_t s, const std::string& start_text) {
    const Divergence& d = *study_.divergence;
    Task task{{}, Role::divergence, s};
    task.job.id = job_id(fmt::format("{} divergence {:g} step {:g}", starts_[s].name, d.perturbation, d.step),
                         fmt::format("{}divergence {} step {} horizon {} samples {}\n", start_text, d.perturbation, d.step,
                                     d.horizon, d.samples));
    task.job.label = fmt::format("{}: divergence from a perturbation of {:g} m", starts_[s].name, d.perturbation);
    task.job.work = 2.0 * d.horizon / d.step;
    tasks_.push_back(std::move(task));
  }

  /// Reads what the jobs of a start state left.
  StartRuns runs_of(std::size_t s, const JobFiles& files) const {
    StartRuns runs{starts_[s], {}, {study_.reference, {}}, {check_, {}}};
    for (const Point& point : study_.points) runs.points.push_back({point, {}});
    for (const Task& task : tasks_) {
      if (task.start != s || task.role == Role::divergence) continue;
      PointRuns& its = task.role == Role::reference ? runs.reference
                       : task.role == Role::check   ? runs.check
                                                    : runs.points[task.point];
      its.outcomes.push_back(read_outcome(files.at(task.job.id)));
    }
    return runs;
  }

  DivergenceSeries divergence_of(std::size_t s, const JobFiles& files) const {
    const auto task = std::find_if(tasks_.begin(), tasks_.end(),
                                   [=](const Task& one) { return one.role == Role::divergence && one.start == s; });
    return read_divergence(files.at(task->job.id));
  }

  /// `rows`: those of the table `study` from this start.
  HorizonRow horizon_row(const std::string& start, const DivergenceSeries& series, const std::vector<Row>& rows) const {
    const Growth growth = fitted_growth(series.time, series.rms, kSmallSeparation * series.mean_diameter);
    double change = 0.0, smallest = std::numeric_limits<double>::infinity();
    for (const Row& row : rows) {
      if (row.name == check_.name)
        change = row.error_rms.value_or(0.0);
      else if (row.name != study_.reference.name && row.status == "ok")
        smallest = std::min(smallest, row.error_rms.value_or(smallest));
    }
    const auto trusted = trusted_until(growth.rate.value_or(0.0), study_.horizon, change, smallest);
    return {start, growth.rate, trusted, growth.floor};
  }

  Study study_;
  core::Scene scene_;
  int threads_;
  Point check_;
  std::vector<StartState> starts_;
  std::vector<Task> tasks_;
};

}  // namespace

std::unique_ptr<StudyKind> read_trajectories_study(const std::string& path, int threads) {
  return std::make_unique<TrajectoriesStudy>(path, threads);
}

}  // namespace grainclock::benchmarks
