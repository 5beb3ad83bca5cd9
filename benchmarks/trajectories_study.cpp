#include "benchmarks/trajectories_study.hpp"

#include "benchmarks/jobs.hpp"
#include "benchmarks/trajectories_rows.hpp"
#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "silo/provenance.hpp"

#include <algorithm>
#include <limits>
#include <set>

namespace grainclock::benchmarks {
namespace {

using Files = std::map<std::string, std::filesystem::path>;

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

/// The scene's resolved text without its initial state: a study brings its own.
std::string scene_text(const core::Scene& scene) {
  std::string text = scene.text;
  const std::size_t begin = text.find("\n[initial]\n");
  if (begin != std::string::npos) text.erase(begin, text.find("\n[", begin + 1) - begin);
  return text;
}

/// Contact sweeps that a run may take, for the estimate of the remaining time only.
double expected_sweeps(const Point& point, double horizon) {
  constexpr double kSelective = 4.0, kDefaultStep = 2e-4, kSundials = 2e4;  // coarse: seen on the Table 1 silo
  if (point.sundials) return kSundials;
  const core::Stepping& s = point.stepping;
  const double steps = horizon / s.step.value_or(kDefaultStep);
  return steps * (s.method == core::Method::multirate ? kSelective : 1.0) *
         (s.integrator == core::Integrator::pece ? 2.0 : 1.0);
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
    for (const Point& point : study_.points) runner().require_offered(starts_.front(), point);
    runner().require_offered(starts_.front(), study_.reference);
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
    const Outcome outcome = runner().run(start, point_of(task));
    if (task.role == Role::reference && !outcome.ok()) {
      throw core::NumericsError(fmt::format("{}: reference from {}: {}", study_.path, start.name, outcome.status));
    }
    write_outcome(file, outcome, origin, task.repetition == 1);
  }

  std::vector<Table> tables(const Files& files) const override {
    std::vector<Row> rows;
    Table series{"divergence",
                 {{"start", "", Texts()},
                  {"time", "s", Numbers()},
                  {"separation_rms", "m", Numbers()},
                  {"separation_max", "m", Numbers()}}};
    Table horizons{
        "horizon",
        {{"start", "", Texts()}, {"rate", "s-1", Numbers()}, {"trusted_until", "s", Numbers()}, {"floor", "m", Numbers()}}};
    for (std::size_t s = 0; s < starts_.size(); ++s) {
      const std::vector<Row> its_rows = rows_of(runs_of(s, files), scene_.domain.outlet_z);
      for (Row row : its_rows) {
        row.scene = std::filesystem::path(study_.scene).stem().string();
        rows.push_back(std::move(row));
      }
      if (study_.divergence) add_divergence(s, files, its_rows, series, horizons);
    }
    std::vector<Table> tables{study_table(rows)};
    if (study_.divergence) {
      tables.push_back(std::move(series));
      tables.push_back(std::move(horizons));
    }
    return tables;
  }

  TableOrigin origin() const override { return {study_.text, scene_.text, scene_.seed, threads_}; }

  std::vector<std::string> warnings(const std::vector<Table>& tables) const override {
    const Table& study = tables.at(0);
    const Texts &name = texts(study, "name"), &start = texts(study, "start"), &status = texts(study, "status");
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
  using Texts = std::vector<std::string>;
  using Numbers = std::vector<double>;

  Runner runner() const { return Runner(scene_, study_.horizon, threads_); }

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
  StartRuns runs_of(std::size_t s, const Files& files) const {
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

  void add_divergence(std::size_t s, const Files& files, const std::vector<Row>& rows, Table& table, Table& horizons) const {
    const auto task = std::find_if(tasks_.begin(), tasks_.end(),
                                   [=](const Task& one) { return one.role == Role::divergence && one.start == s; });
    const DivergenceSeries series = read_divergence(files.at(task->job.id));
    for (std::size_t k = 0; k < series.time.size(); ++k) {
      add_cells(table, {starts_[s].name, series.time[k], series.rms[k], series.max[k]});
    }
    const Growth growth = fitted_growth(series.time, series.rms, kSmallSeparation * series.mean_diameter);
    double change = 0.0, smallest = std::numeric_limits<double>::infinity();
    for (const Row& row : rows) {
      if (row.name == check_.name)
        change = row.error_rms.value_or(0.0);
      else if (row.name != study_.reference.name && row.status == "ok")
        smallest = std::min(smallest, row.error_rms.value_or(smallest));
    }
    constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
    const double rate = growth.rate.value_or(kUnknown);
    add_cells(horizons, {starts_[s].name, rate, trusted_until(rate, study_.horizon, change, smallest).value_or(kUnknown),
                         growth.floor});
  }

  using Cell = std::variant<std::string, double>;
  static void add_cells(Table& table, const std::vector<Cell>& cells) {
    for (std::size_t c = 0; c < cells.size(); ++c) {
      auto& values = table.columns[c].values;
      if (const auto* text = std::get_if<std::string>(&cells[c]))
        std::get<Texts>(values).push_back(*text);
      else
        std::get<Numbers>(values).push_back(std::get<double>(cells[c]));
    }
  }

  static const Texts& texts(const Table& table, std::string_view column) {
    return std::get<Texts>(std::find_if(table.columns.begin(), table.columns.end(), [=](const TableColumn& one) {
                             return one.name == column;
                           })->values);
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
