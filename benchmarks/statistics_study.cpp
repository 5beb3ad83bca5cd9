#include "benchmarks/statistics_study.hpp"

#include "benchmarks/first_phase.hpp"
#include "benchmarks/jobs.hpp"
#include "benchmarks/statistics.hpp"
#include "benchmarks/statistics_run.hpp"
#include "core/check.hpp"
#include "core/files.hpp"
#include "core/snapshot.hpp"
#include "core/toml_keys.hpp"
#include "silo/provenance.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

namespace grainclock::benchmarks {
namespace {

using core::TomlKeys;

/// Of the jobs' files and of what is computed into them; a new number lets every job run anew.
constexpr int kFormat = 1;
constexpr double kMostSamples = 1e6;  // of a run
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

/// What the study's file says.
struct Plan {
  std::string path, text;
  std::string scene;
  std::vector<std::string> starts;
  Sampling sampling;
  double settle = 0.0;   // s, left out of all measures
  double stop = 0.0;     // s, a stoppage is at least that long
  std::string baseline;  // name of the method that the others are compared with
  std::vector<Point> methods;
};

bool is_whole(double number) { return std::abs(number - std::round(number)) <= 1e-9 * std::max(1.0, number); }

void read_times(TomlKeys& keys, Plan& plan) {
  const auto needed = [&](const char* key, const char* remedy) {
    const auto value = keys.positive(key, "s");
    keys.require(value.has_value(), key, remedy);
    return *value;
  };
  const double duration = needed("duration", "give the length of each run in s"),
               every = needed("every", "give the time between samples in s");
  const double samples = duration / every;
  keys.require(samples <= kMostSamples, "every", fmt::format("makes {:.3g} samples of a run; take at most {:g}", samples, kMostSamples));
  keys.require(is_whole(samples) && samples >= 1.0, "duration",
               fmt::format("must be a whole multiple of every = {} s; nearest: {} s", every,
                           std::max(1.0, std::round(samples)) * every));
  plan.settle = keys.number("settle").value_or(0.0);
  keys.require(plan.settle >= 0.0 && plan.settle <= duration - every, "settle",
               fmt::format("must be from 0 to {} s: two samples at least must be left of the run", duration - every));
  plan.stop = needed("stop", "say from which length in s a time without discharge is a stoppage");
  keys.require(plan.stop >= every, "stop",
               fmt::format("must not be below every = {} s: shorter stoppages are not seen", every));
  plan.sampling = {duration, every, keys.positive("layer", "m").value_or(Sampling{}.layer)};
}

/// The methods by names of their own: points of one swept [[method]] also carry what is swept.
std::vector<Point> read_named_methods(const std::string& text, const std::string& path) {
  std::vector<Point> points = read_methods(text, path, 1);
  std::map<std::string, int> uses;
  for (const Point& point : points) ++uses[point.name];
  std::set<std::string> names;
  for (Point& point : points) {
    GC_REQUIRE(!point.sundials, "{}: [[method]] \"{}\": long runs are for our own steppers, uniform or multirate; remove it",
               path, point.name);
    GC_REQUIRE(point.repeat == 1,
               "{}: [[method]] \"{}\": repeat = {}: a run is repeated from other start states, not from one; remove it",
               path, point.name, point.repeat);
    if (uses[point.name] > 1) point.name += ", " + knob_text(point);
    GC_REQUIRE(names.insert(point.name).second,
               "{}: two methods are called \"{}\"; give each a [[method]] with a name of its own", path, point.name);
  }
  return points;
}

Plan read_plan(const std::string& path) {
  Plan plan;
  plan.path = path;
  plan.text = core::read_text(path, core::kMostToml);
  const toml::table root = core::parse_toml(plan.text, path);
  TomlKeys keys(root, "", path);
  keys.allow("kind");  // read by make_study()
  plan.scene = read_scene_path(keys, path);
  plan.starts = read_starts(keys, root, path);
  read_times(keys, plan);
  const auto baseline = keys.string("baseline");
  keys.require(baseline.has_value(), "baseline", "name the method that the others are compared with");
  plan.baseline = *baseline;
  keys.allow("method");
  keys.finish();
  plan.methods = read_named_methods(plan.text, path);
  std::vector<std::string> names;
  for (const Point& method : plan.methods) names.push_back(method.name);
  keys.require(std::find(names.begin(), names.end(), plan.baseline) != names.end(), "baseline",
               fmt::format("is no method here; there are \"{}\"", fmt::join(names, "\", \"")));
  return plan;
}

/// A row of table `statistics_runs`.
struct RunRow {
  std::string method, start;
  LongRun run;
};

/// A row of table `statistics`.
struct ValueRow {
  std::string method, start;
  Measure measure;
  double value = kUnknown;
};

/// A row of table `statistics_summary`.
struct SummaryRow {
  std::string method;
  Measure measure;
  Interval interval, difference;
  double agrees = kUnknown;  // 1, 0, or not known
  double contact_evaluations = kUnknown, wall_s = kUnknown;
};

/// The columns that say what a row measures, of a table with layers of this height [m].
template <class Row>
void add_measure_columns(Table& table, const std::vector<Row>& rows, double layer) {
  const auto of_bin = [](const Row& row, double factor, double offset) {
    return row.measure.bin ? factor * (*row.measure.bin + offset) : kUnknown;
  };
  table.columns.push_back(
      column(rows, "measure", "", [](const Row& row) { return std::string(name(row.measure.quantity)); }));
  table.columns.push_back(column(rows, "bin", "", [&](const Row& row) { return of_bin(row, 1.0, 0.0); }));
  table.columns.push_back(column(rows, "z_low", "m", [&](const Row& row) { return of_bin(row, layer, 0.0); }));
  table.columns.push_back(column(rows, "z_high", "m", [&](const Row& row) { return of_bin(row, layer, 1.0); }));
}

template <class Row>
TableColumn unit_column(const std::vector<Row>& rows) {
  return column(rows, "unit", "", [](const Row& row) { return std::string(unit(row.measure.quantity)); });
}

Table runs_table(const std::vector<RunRow>& rows) {
  const auto count = [](std::uint64_t n) { return static_cast<double>(n); };
  using Row = RunRow;
  return {"statistics_runs",
          {column(rows, "method", "", [](const Row& row) { return row.method; }),
           column(rows, "start", "", [](const Row& row) { return row.start; }),
           column(rows, "status", "", [](const Row& row) { return row.run.status; }),
           column(rows, "method_used", "", [](const Row& row) { return row.run.method_used; }),
           column(rows, "step", "s", [](const Row& row) { return row.run.step; }),
           column(rows, "discharged", "", [](const Row& row) { return row.run.discharged.back(); }),
           column(rows, "contact_evaluations", "", [=](const Row& row) { return count(row.run.costs.contact_evaluations); }),
           column(rows, "ball_updates", "", [=](const Row& row) { return count(row.run.costs.ball_updates); }),
           column(rows, "events", "", [=](const Row& row) { return count(row.run.costs.events); }),
           column(rows, "missed_contacts", "", [=](const Row& row) { return count(row.run.costs.missed_contacts); }),
           column(rows, "momentum_residual", "", [](const Row& row) { return row.run.momentum_residual; }),
           column(rows, "energy_residual", "", [](const Row& row) { return row.run.energy_residual; }),
           column(rows, "wall_s", "s", [](const Row& row) { return row.run.wall_s; }),
           column(rows, "host", "", [](const Row& row) { return row.run.made_by.host; })}};
}

Table values_table(const std::vector<ValueRow>& rows, double layer) {
  Table table{"statistics",
              {column(rows, "method", "", [](const ValueRow& row) { return row.method; }),
               column(rows, "start", "", [](const ValueRow& row) { return row.start; })}};
  add_measure_columns(table, rows, layer);
  table.columns.push_back(column(rows, "value", "", [](const ValueRow& row) { return row.value; }));
  table.columns.push_back(unit_column(rows));
  return table;
}

Table summary_table(const std::vector<SummaryRow>& rows, double layer) {
  using Row = SummaryRow;
  Table table{"statistics_summary", {column(rows, "method", "", [](const Row& row) { return row.method; })}};
  add_measure_columns(table, rows, layer);
  const auto add = [&](const char* its_name, const char* its_unit, auto cell) {
    table.columns.push_back(column(rows, its_name, its_unit, cell));
  };
  add("n", "", [](const Row& row) { return static_cast<double>(row.interval.n); });
  add("mean", "", [](const Row& row) { return row.interval.mean; });
  add("ci_low", "", [](const Row& row) { return row.interval.low; });
  add("ci_high", "", [](const Row& row) { return row.interval.high; });
  add("difference_low", "", [](const Row& row) { return row.difference.low; });
  add("difference_high", "", [](const Row& row) { return row.difference.high; });
  add("agrees", "", [](const Row& row) { return row.agrees; });
  add("contact_evaluations", "", [](const Row& row) { return row.contact_evaluations; });
  add("wall_s", "s", [](const Row& row) { return row.wall_s; });
  table.columns.push_back(unit_column(rows));
  return table;
}

/// The runs of one method from every start that did not fail.
struct MethodRuns {
  std::vector<Measures> measures;
  std::vector<double> contact_evaluations, wall_s;

  /// The measure's values from start to start; none where a run does not have it.
  std::vector<double> values(const Measure& measure) const {
    std::vector<double> found;
    for (const Measures& run : measures) {
      if (const auto at = run.find(measure); at != run.end()) found.push_back(at->second);
    }
    return found;
  }
};

std::vector<SummaryRow> summary_rows(const std::vector<Point>& methods, const std::vector<MethodRuns>& runs,
                                     const std::string& baseline) {
  std::set<Measure> all;
  for (const MethodRuns& one : runs) {
    for (const Measures& measures : one.measures) {
      for (const auto& [measure, value] : measures) all.insert(measure);
    }
  }
  const auto base = static_cast<std::size_t>(
      std::find_if(methods.begin(), methods.end(), [&](const Point& method) { return method.name == baseline; }) -
      methods.begin());
  std::vector<SummaryRow> rows;
  for (std::size_t m = 0; m < methods.size(); ++m) {
    for (const Measure& measure : all) {
      const std::vector<double> values = runs[m].values(measure);
      SummaryRow row{methods[m].name, measure, mean_interval(values), {0, kUnknown, kUnknown, kUnknown}};
      if (m != base) {
        row.difference = difference_interval(values, runs[base].values(measure));
        if (row.difference.n >= 2) row.agrees = row.difference.contains(0.0) ? 1.0 : 0.0;
      }
      row.contact_evaluations = mean(runs[m].contact_evaluations);
      row.wall_s = mean(runs[m].wall_s);
      rows.push_back(std::move(row));
    }
  }
  return rows;
}

class StatisticsStudy : public StudyKind {
 public:
  StatisticsStudy(const std::string& path, int threads)
      : plan_(read_plan(path)), scene_(core::read_scene(plan_.scene)), threads_(threads) {
    GC_REQUIRE(!scene_.phases.empty(), "{}: has no [[phase]]; a study runs the first one", plan_.scene);
    GC_REQUIRE(!scene_.phases.front().outlet_open || scene_.domain.outlet_z,
               "{}: its outlet is open but there is no [domain] outlet_z below which balls count as discharged; give one",
               plan_.scene);
    std::map<std::uint64_t, std::string> seen;
    for (const std::string& start : plan_.starts) {
      starts_.push_back(read_start(start));
      const auto [same, is_new] = seen.emplace(core::checksum(starts_.back().state), start);
      GC_REQUIRE(
          is_new,
          "{}: start \"{}\" is the same state as \"{}\": it tells nothing new of the spread; give states of other seeds",
          path, start, same->second);
    }
    // Key combinations that a stepper does not offer show now, not after an hour.
    for (const Point& method : plan_.methods)
      require_offered(scene_, starts_.front(), method, plan_.sampling.every, threads_);
    add_jobs();
  }

  std::vector<Job> jobs() const override { return jobs_; }

  void run(const Job& job, const std::filesystem::path& file) const override {
    const auto at =
        std::find_if(jobs_.begin(), jobs_.end(), [&](const Job& one) { return one.id == job.id; }) - jobs_.begin();
    const auto index = static_cast<std::size_t>(at);
    const StartState& start = starts_.at(index / plan_.methods.size());
    const Point& method = plan_.methods.at(index % plan_.methods.size());
    write_long_run(file, run_long(scene_, start.state, method.stepping, plan_.sampling, threads_), {scene_, threads_});
  }

  std::vector<Table> tables(const JobFiles& files) const override {
    std::vector<RunRow> runs;
    std::vector<ValueRow> values;
    std::vector<MethodRuns> by_method(plan_.methods.size());
    for (std::size_t m = 0; m < plan_.methods.size(); ++m) {
      for (std::size_t s = 0; s < starts_.size(); ++s) {
        const LongRun run = read_long_run(files.at(jobs_[index_of(s, m)].id));
        runs.push_back({plan_.methods[m].name, starts_[s].name, run});
        if (!run.is_ok()) continue;
        by_method[m].measures.push_back(measures(run, plan_.settle, plan_.stop));
        by_method[m].contact_evaluations.push_back(static_cast<double>(run.costs.contact_evaluations));
        by_method[m].wall_s.push_back(run.wall_s);
        for (const auto& [measure, value] : by_method[m].measures.back()) {
          values.push_back({plan_.methods[m].name, starts_[s].name, measure, value});
        }
      }
    }
    const double layer = plan_.sampling.layer;
    return {values_table(values, layer), summary_table(summary_rows(plan_.methods, by_method, plan_.baseline), layer),
            runs_table(runs)};
  }

  TableOrigin origin() const override { return {plan_.text, scene_.text, scene_.seed, threads_}; }

  std::vector<std::string> warnings(const std::vector<Table>& tables) const override {
    std::vector<std::string> said;
    add_run_warnings(tables.at(2), said);
    if (starts_.size() < 2)
      said.push_back(
          "there is one start state only: without others nothing is known of the spread, nor whether methods agree");
    for (const Point& method : plan_.methods) add_disagreement(tables.at(1), method.name, said);
    return said;
  }

 private:
  using Texts = std::vector<std::string>;
  using Numbers = std::vector<double>;

  std::size_t index_of(std::size_t start, std::size_t method) const { return start * plan_.methods.size() + method; }

  /// All methods from one start state, then from the next: what slows the machine for a while slows all methods alike.
  void add_jobs() {
    std::set<std::string> ids;
    for (const StartState& start : starts_) {
      for (const Point& method : plan_.methods) {
        const Sampling& s = plan_.sampling;
        const std::string depends_on =
            fmt::format("statistics, format {}\nversion {}\n{}start {:016x}\nduration {} every {} layer {}\n{}\n", kFormat,
                        silo::version(), scene_text(scene_), core::checksum(start.state), s.duration, s.every, s.layer,
                        keys_text(method));
        Job job;
        job.id = job_id(fmt::format("{} {} {}", start.name, made_name(method), knob_text(method)), depends_on);
        job.label = fmt::format("{}: {}", start.name, method.name);
        job.work = expected_sweeps(method, s.duration) * static_cast<double>(start.state.count(core::Kind::content));
        GC_REQUIRE(ids.insert(job.id).second, "{}: [[method]] \"{}\" steps exactly as another one; remove one of the two",
                   plan_.path, method.name);
        jobs_.push_back(std::move(job));
      }
    }
  }

  void add_run_warnings(const Table& runs, Texts& said) const {
    const Texts &method = texts(runs, "method"), &start = texts(runs, "start"), &status = texts(runs, "status");
    for (std::size_t row = 0; row < status.size(); ++row) {
      if (status[row] != "ok")
        said.push_back(fmt::format("{}: {} {}; it is left out of the statistics", start[row], method[row], status[row]));
    }
    const std::set<std::string> hosts(texts(runs, "host").begin(), texts(runs, "host").end());
    if (hosts.size() > 1) {
      said.push_back(
          fmt::format("the jobs ran on {} machines ({}): wall_s cannot be compared", hosts.size(), fmt::join(hosts, ", ")));
    }
  }

  void add_disagreement(const Table& summary, const std::string& method, Texts& said) const {
    const Texts& methods = texts(summary, "method");
    const Numbers& agrees = numbers(summary, "agrees");
    std::size_t compared = 0, apart = 0;
    for (std::size_t row = 0; row < methods.size(); ++row) {
      if (methods[row] != method || std::isnan(agrees[row])) continue;
      ++compared;
      if (agrees[row] == 0.0) ++apart;
    }
    if (apart == 0) return;
    said.push_back(fmt::format(
        "{}: {} of {} measures differ from {} by more than the starts' 95 % interval; by chance alone one in twenty would",
        method, apart, compared, plan_.baseline));
  }

  Plan plan_;
  core::Scene scene_;
  int threads_;
  std::vector<StartState> starts_;
  std::vector<Job> jobs_;  // of index_of(start, method)
};

}  // namespace

std::unique_ptr<StudyKind> read_statistics_study(const std::string& path, int threads) {
  return std::make_unique<StatisticsStudy>(path, threads);
}

}  // namespace grainclock::benchmarks
