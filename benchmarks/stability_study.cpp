#include "benchmarks/stability_study.hpp"

#include "benchmarks/jobs.hpp"
#include "benchmarks/stability.hpp"
#include "benchmarks/study_plan.hpp"
#include "core/check.hpp"
#include "core/critical_step.hpp"
#include "core/files.hpp"
#include "core/hdf5.hpp"
#include "core/snapshot.hpp"
#include "core/toml_keys.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <variant>

namespace grainclock::benchmarks {
namespace {

using core::Integrator;
using core::TomlKeys;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kMostBalls = 100;  // of a packing: theory takes the third power of it, a minute per job
constexpr double kFitUpTo = 0.5;         // the growth's exponent is that of small steps
constexpr double kAgreement = 0.05;      // of measured and theoretical limits
constexpr std::size_t kLongestList = 1000;
constexpr const char* kFailure = "failure";

/// What a study file says.
struct StabilityPlan {
  std::vector<SystemKind> systems;
  std::string packing_path;  // empty: the small packing
  core::State packing;       // as in the file
  std::vector<Integrator> integrators;
  std::vector<core::Dashpot> dashpots;
  std::vector<double> damping_ratios;
  std::vector<double> step_ratios;  // of the map
  int steps = 2000;                 // of a run at most
  struct Growth {
    std::vector<int> ratios;  // coarse over fine step
    std::vector<double> damping_ratios;
    std::vector<double> step_ratios;
  };
  Growth growth;  // no ratios: none
};

template <class Value>
std::string joined(const std::vector<Value>& values, std::string_view between) {
  std::string text;
  for (const Value& value : values) text += fmt::format("{}{}", text.empty() ? "" : between, value);
  return text;
}

// ---- reading ----

/// The list `key`, read element by element; `what` says what one must be. Throws InputError unless it is a list of one or
/// more different values.
template <class Value, class Read>
std::vector<Value> read_list(TomlKeys& keys, const toml::table& table, std::string_view key, const std::string& what,
                             Read read) {
  keys.allow(key);
  const toml::node* node = table.get(key);
  keys.require(node && node->is_array() && !node->as_array()->empty(), key, fmt::format("give a list, each {}", what));
  keys.require(node->as_array()->size() <= kLongestList, key, fmt::format("must have at most {} values", kLongestList));
  std::vector<Value> values;
  for (const toml::node& one : *node->as_array()) {
    const std::optional<Value> value = read(one);
    keys.require(value.has_value(), key, fmt::format("each must be {}", what));
    keys.require(std::find(values.begin(), values.end(), *value) == values.end(), key, "give each value once");
    values.push_back(*value);
  }
  return values;
}

template <class Enum>
std::vector<Enum> read_names(TomlKeys& keys, const toml::table& table, std::string_view key,
                             std::initializer_list<Enum> all) {
  std::vector<std::string_view> names;
  for (const Enum one : all) names.push_back(name(one));
  const std::string what = fmt::format("\"{}\"", joined(names, "\" or \""));
  return read_list<Enum>(keys, table, key, what, [&](const toml::node& node) -> std::optional<Enum> {
    const auto text = node.value_exact<std::string>();
    for (const Enum one : all) {
      if (text && *text == name(one)) return one;
    }
    return std::nullopt;
  });
}

/// Numbers from `low` to `high`, or above `low` where that is 0 and `positive`.
std::vector<double> read_numbers(TomlKeys& keys, const toml::table& table, std::string_view key, double low, double high,
                                 bool positive) {
  const std::string what = positive ? fmt::format("above 0 and at most {}", high) : fmt::format("from {} to {}", low, high);
  return read_list<double>(keys, table, key, what, [&](const toml::node& node) -> std::optional<double> {
    const auto number = node.is_number() ? node.value<double>() : std::nullopt;
    const bool fits = number && *number >= low && *number <= high && !(positive && *number == 0.0);
    return fits ? number : std::nullopt;
  });
}

StabilityPlan::Growth read_growth(TomlKeys keys, const toml::table& table) {
  StabilityPlan::Growth growth;
  growth.ratios =
      read_list<int>(keys, table, "ratios", "1, 2, 4, 8 or 16", [](const toml::node& node) -> std::optional<int> {
        const auto ratio = node.value_exact<std::int64_t>();
        for (const int one : {1, 2, 4, 8, 16}) {
          if (ratio == one) return one;
        }
        return std::nullopt;
      });
  // More damping would need stiffer pins; the growth is long gone there.
  growth.damping_ratios = read_numbers(keys, table, "damping_ratios", 0.0, 0.1, false);
  growth.step_ratios = read_numbers(keys, table, "step_ratios", 0.0, 0.9, true);
  keys.finish();
  return growth;
}

void read_packing(TomlKeys& keys, const std::string& path, StabilityPlan& plan) {
  const auto packing = keys.string("packing");
  if (!packing) return;
  keys.require(std::count(plan.systems.begin(), plan.systems.end(), SystemKind::packing) > 0, "packing",
               "no system takes it; add \"packing\" to systems or remove this key");
  plan.packing_path = file_of_study(*packing, path, keys.where("packing"));
  plan.packing = core::read_state(plan.packing_path);
  const std::size_t balls = plan.packing.count(core::Kind::content);
  keys.require(balls >= 1 && balls <= kMostBalls, "packing",
               fmt::format("the state holds {} content balls, but theory takes 1 to {}", balls, kMostBalls));
}

StabilityPlan read_plan(const std::string& text, const std::string& path) {
  const toml::table root = core::parse_toml(text, path);
  TomlKeys keys(root, "", path);
  StabilityPlan plan;
  keys.choice("kind", {"stability"});
  plan.systems =
      read_names(keys, root, "systems", {SystemKind::pair, SystemKind::wall, SystemKind::chain, SystemKind::packing});
  read_packing(keys, path, plan);
  plan.integrators = read_names(keys, root, "integrators", {Integrator::lagged, Integrator::predicted, Integrator::pece});
  plan.dashpots = read_names(keys, root, "dashpots", {core::Dashpot::explicit_});
  plan.damping_ratios = read_numbers(keys, root, "damping_ratios", 0.0, 10.0, false);
  plan.step_ratios = read_numbers(keys, root, "step_ratios", 0.0, 2.0, true);
  const std::int64_t steps = keys.integer("steps").value_or(plan.steps);
  keys.require(steps >= 100 && steps <= 1000000, "steps", "must be 100 to 1000000");
  plan.steps = static_cast<int>(steps);
  if (const auto growth = keys.table("growth")) plan.growth = read_growth(*growth, *root["growth"].as_table());
  keys.finish();
  return plan;
}

// ---- jobs ----

/// The limits of one system, and its line of the map.
struct LimitPart {
  SystemKind system;
  Integrator integrator;
  core::Dashpot dashpot;
  double damping_ratio;
};
/// The growth of one chain over all steps.
struct GrowthPart {
  int ratio;
  double damping_ratio;
};
using Part = std::variant<LimitPart, GrowthPart>;

std::vector<Part> parts_of(const StabilityPlan& plan) {
  std::vector<Part> parts;
  for (const SystemKind system : plan.systems)
    for (const Integrator integrator : plan.integrators)
      for (const core::Dashpot dashpot : plan.dashpots)
        for (const double damping_ratio : plan.damping_ratios) {
          parts.emplace_back(LimitPart{system, integrator, dashpot, damping_ratio});
        }
  for (const int ratio : plan.growth.ratios)
    for (const double damping_ratio : plan.growth.damping_ratios) parts.emplace_back(GrowthPart{ratio, damping_ratio});
  return parts;
}

std::string slug(const Part& part) {
  if (const auto* growth = std::get_if<GrowthPart>(&part)) {
    return fmt::format("growth-ratio-{}-damping-{}", growth->ratio, growth->damping_ratio);
  }
  const auto& limit = std::get<LimitPart>(part);
  return fmt::format("{}-{}-{}-damping-{}", name(limit.system), name(limit.integrator), name(limit.dashpot),
                     limit.damping_ratio);
}

std::string depends_on(const Part& part, const StabilityPlan& plan) {
  constexpr int kVersion = 1;  // of what a job computes and writes
  if (std::holds_alternative<GrowthPart>(part)) {
    return fmt::format("{} {} {}", kVersion, slug(part), joined(plan.growth.step_ratios, " "));
  }
  const bool from_file = std::get<LimitPart>(part).system == SystemKind::packing && !plan.packing_path.empty();
  return fmt::format("{} {} {} {} {}", kVersion, slug(part), joined(plan.step_ratios, " "), plan.steps,
                     from_file ? core::checksum(plan.packing) : 0);
}

Job job_of(const Part& part, const StabilityPlan& plan) {
  const auto* limit = std::get_if<LimitPart>(&part);
  const double work = !limit ? 0.05 : limit->system == SystemKind::packing ? 2.0 : 0.1;  // about seconds
  std::string label = slug(part);
  std::replace(label.begin(), label.end(), '-', ' ');
  return {job_id("stability-" + slug(part), depends_on(part, plan)), label, work};
}

PressedSystem pressed(const LimitPart& part, const StabilityPlan& plan) {
  switch (part.system) {
    case SystemKind::pair:
      return pressed_pair(part.damping_ratio);
    case SystemKind::wall:
      return pressed_wall(part.damping_ratio);
    case SystemKind::chain:
      return pressed_chain(part.damping_ratio);
    case SystemKind::packing:
      break;
  }
  return pressed_packing(part.damping_ratio,
                         plan.packing_path.empty() ? small_packing() : settled(plan.packing, plan.packing_path));
}

/// The names under which a job's numbers stand in its file, and in the tables.
using Numbers = std::vector<std::pair<std::string, std::vector<double>>>;

Numbers results(const LimitPart& part, const StabilityPlan& plan) {
  const PressedSystem system = pressed(part, plan);
  const LinearSystem linear = linearised(system);
  const double undamped = undamped_critical_step(linear);
  const double bound = core::critical_steps(system.state, system.materials, false, part.integrator).smallest;
  std::vector<double> measured, theory;
  for (const double ratio : plan.step_ratios) {
    const double step = ratio * undamped;
    measured.push_back(measured_growth(system, part.integrator, step, plan.steps).per_step);
    theory.push_back(spectral_radius(amplification_matrix(linear, step, part.integrator)));
  }
  return {{"undamped_critical_step", {undamped}},
          {"theory_limit", {stability_limit(linear, part.integrator) / undamped}},
          {"bound", {bound / undamped}},
          {"measured_limit", {measured_limit(system, part.integrator, plan.steps) / undamped}},
          {"growth_per_step", measured},
          {"theory_growth", theory}};
}

/// Slope of log rate over log step by least squares, over small steps; nan where a rate is not above what can be seen.
double exponent(const std::vector<double>& step_ratio, const std::vector<double>& step, const std::vector<double>& rate) {
  std::vector<double> x, y;
  for (std::size_t i = 0; i < step.size(); ++i) {
    if (step_ratio[i] > kFitUpTo) continue;
    if (rate[i] * step[i] <= kRateResolution * step_ratio[i]) return kNan;
    x.push_back(std::log(step[i]));
    y.push_back(std::log(rate[i]));
  }
  if (x.size() < 2) return kNan;
  const Eigen::Map<const Eigen::ArrayXd> at(x.data(), static_cast<Eigen::Index>(x.size()));
  const Eigen::Map<const Eigen::ArrayXd> value(y.data(), static_cast<Eigen::Index>(y.size()));
  const Eigen::ArrayXd from_mean = at - at.mean();
  return (from_mean * value).sum() / from_mean.square().sum();
}

Numbers results(const GrowthPart& part, const StabilityPlan& plan) {
  std::vector<double> step, rate;
  for (const double ratio : plan.growth.step_ratios) {
    const LevelledChain chain = levelled_chain(part.ratio, ratio, part.damping_ratio);
    step.push_back(chain.step);
    rate.push_back(multirate_growth_rate(chain));
  }
  const double fitted = exponent(plan.growth.step_ratios, step, rate);
  return {{"step", step}, {"growth_rate", rate}, {"exponent", std::vector<double>(step.size(), fitted)}};
}

// ---- tables ----

/// A row of table `stability`; steps over the undamped critical one.
struct LimitRow {
  LimitPart part;
  double undamped_critical_step;  // s
  double theory, bound, measured;
  std::string failure;
};
/// A row of table `stability_map`.
struct MapRow {
  LimitPart part;
  double step_ratio, growth, theory;
};
/// A row of table `growth`.
struct GrowthRow {
  GrowthPart part;
  double step_ratio, step, rate;  // 1, s, 1/s
  double exponent;
  std::string failure;
};

/// The columns that say what a row of limits is about.
template <class Row>
std::vector<TableColumn> named_columns(const std::vector<Row>& rows) {
  return {column(rows, "system", "", [](const Row& row) { return name(row.part.system); }),
          column(rows, "integrator", "", [](const Row& row) { return name(row.part.integrator); }),
          column(rows, "dashpot", "", [](const Row& row) { return name(row.part.dashpot); }),
          column(rows, "damping_ratio", "", [](const Row& row) { return row.part.damping_ratio; })};
}

Table limits_table(const std::vector<LimitRow>& rows) {
  Table table{"stability", named_columns(rows)};
  table.columns.push_back(column(rows, "undamped_critical_step", "s", &LimitRow::undamped_critical_step));
  table.columns.push_back(column(rows, "theory_limit", "", &LimitRow::theory));
  table.columns.push_back(column(rows, "bound", "", &LimitRow::bound));
  table.columns.push_back(column(rows, "measured_limit", "", &LimitRow::measured));
  table.columns.push_back(column(rows, kFailure, "", &LimitRow::failure));
  return table;
}

Table map_table(const std::vector<MapRow>& rows) {
  Table table{"stability_map", named_columns(rows)};
  table.columns.push_back(column(rows, "step_ratio", "", &MapRow::step_ratio));
  table.columns.push_back(column(rows, "growth_per_step", "", &MapRow::growth));
  table.columns.push_back(column(rows, "theory_growth", "", &MapRow::theory));
  return table;
}

Table growth_table(const std::vector<GrowthRow>& rows) {
  return {"growth",
          {column(rows, "system", "", [](const GrowthRow&) { return name(SystemKind::chain); }),
           column(rows, "ratio", "", [](const GrowthRow& row) { return row.part.ratio; }),
           column(rows, "damping_ratio", "", [](const GrowthRow& row) { return row.part.damping_ratio; }),
           column(rows, "step_ratio", "", &GrowthRow::step_ratio), column(rows, "step", "s", &GrowthRow::step),
           column(rows, "growth_rate", "1/s", &GrowthRow::rate), column(rows, "exponent", "", &GrowthRow::exponent),
           column(rows, kFailure, "", &GrowthRow::failure)}};
}

/// What a job's file says: numbers by name, or why there are none.
class JobFile {
 public:
  explicit JobFile(const std::filesystem::path& path) : file_(core::Hdf5File::open(path)) {
    if (file_.has(kFailure)) failure_ = file_.read_text(kFailure);
  }
  const std::string& failure() const { return failure_; }
  /// `count` numbers; nan if the job failed.
  std::vector<double> numbers(const std::string& name, std::size_t count) const {
    if (!failure_.empty()) return std::vector<double>(count, kNan);
    std::vector<double> values = file_.read<double>(name);
    if (values.size() != count) file_.fail(name, fmt::format("has {} numbers where {} were written", values.size(), count));
    return values;
  }

 private:
  core::Hdf5File file_;
  std::string failure_;
};

class StabilityStudy final : public StudyKind {
 public:
  StabilityStudy(StabilityPlan plan, std::string text, int threads)
      : plan_(std::move(plan)), parts_(parts_of(plan_)), text_(std::move(text)), threads_(threads) {}

  std::vector<Job> jobs() const override {
    std::vector<Job> jobs;
    for (const Part& part : parts_) jobs.push_back(job_of(part, plan_));
    return jobs;
  }

  void run(const Job& job, const std::filesystem::path& path) const override {
    const auto part =
        std::find_if(parts_.begin(), parts_.end(), [&](const Part& p) { return job_of(p, plan_).id == job.id; });
    core::AsideFile aside(path);
    core::Hdf5File file = core::Hdf5File::create(aside.part());
    try {
      const Numbers all = std::visit([this](const auto& one) { return results(one, plan_); }, *part);
      for (const auto& [name, values] : all) file.write(name, values);
    } catch (const core::NumericsError& error) {
      file.write_text(kFailure, error.what());
    }
    file.close();
    aside.commit();
  }

  std::vector<Table> tables(const JobFiles& files) const override {
    std::vector<LimitRow> limits;
    std::vector<MapRow> map;
    std::vector<GrowthRow> growth;
    for (const Part& part : parts_) {
      const JobFile file(files.at(job_of(part, plan_).id));
      if (const auto* limit = std::get_if<LimitPart>(&part)) {
        add_limit(limits, *limit, file);
        add_map(map, *limit, file);
      } else {
        add_growth(growth, std::get<GrowthPart>(part), file);
      }
    }
    std::vector<Table> out{limits_table(limits), map_table(map)};
    if (!growth.empty()) out.push_back(growth_table(growth));
    return out;
  }

  TableOrigin origin() const override { return {text_, {}, 0, threads_}; }

  std::vector<std::string> warnings(const std::vector<Table>& tables) const override {
    std::vector<std::string> out;
    for (const Table& table : tables) {
      if (table.name == "stability") warn_of_limits(table, out);
      if (table.name == "growth") warn_of_failures(table, out);
    }
    return out;
  }

 private:
  static void add_limit(std::vector<LimitRow>& rows, const LimitPart& part, const JobFile& file) {
    const auto number = [&](const char* name) { return file.numbers(name, 1)[0]; };
    rows.push_back({part, number("undamped_critical_step"), number("theory_limit"), number("bound"),
                    number("measured_limit"), file.failure()});
  }

  void add_map(std::vector<MapRow>& rows, const LimitPart& part, const JobFile& file) const {
    const std::size_t n = plan_.step_ratios.size();
    const std::vector<double> measured = file.numbers("growth_per_step", n), theory = file.numbers("theory_growth", n);
    for (std::size_t i = 0; i < n; ++i) rows.push_back({part, plan_.step_ratios[i], measured[i], theory[i]});
  }

  void add_growth(std::vector<GrowthRow>& rows, const GrowthPart& part, const JobFile& file) const {
    const std::vector<double>& ratios = plan_.growth.step_ratios;
    const std::vector<double> step = file.numbers("step", ratios.size()), rate = file.numbers("growth_rate", ratios.size()),
                              fit = file.numbers("exponent", ratios.size());
    for (std::size_t i = 0; i < ratios.size(); ++i) {
      rows.push_back({part, ratios[i], step[i], rate[i], fit[i], file.failure()});
    }
  }

  static void warn_of_failures(const Table& table, std::vector<std::string>& out) {
    for (const std::string& failure : texts(table, kFailure)) {
      const std::string line = fmt::format("{}: {}", table.name, failure);
      if (!failure.empty() && std::find(out.begin(), out.end(), line) == out.end()) out.push_back(line);
    }
  }

  static void warn_of_limits(const Table& table, std::vector<std::string>& out) {
    warn_of_failures(table, out);
    const auto& theory = numbers(table, "theory_limit");
    const auto& measured = numbers(table, "measured_limit");
    const auto& bound = numbers(table, "bound");
    for (std::size_t i = 0; i < theory.size(); ++i) {
      const std::string where = fmt::format("{}, {}, damping ratio {}", texts(table, "system")[i],
                                            texts(table, "integrator")[i], numbers(table, "damping_ratio")[i]);
      if (std::abs(measured[i] - theory[i]) > kAgreement * theory[i]) {
        out.push_back(fmt::format("{}: the measured limit {:.4g} is not theory's {:.4g}", where, measured[i], theory[i]));
      }
      if (bound[i] > (1.0 + kLimitResolution) * theory[i]) {
        out.push_back(
            fmt::format("{}: the bound {:.4g} is above the limit {:.4g}, hence unsafe", where, bound[i], theory[i]));
      }
    }
  }

  StabilityPlan plan_;
  std::vector<Part> parts_;
  std::string text_;
  int threads_;
};

}  // namespace

std::unique_ptr<StudyKind> read_stability_study(const std::string& path, int threads) {
  std::string text = core::read_text(path, core::kMostToml);
  StabilityPlan plan = read_plan(text, path);
  return std::make_unique<StabilityStudy>(std::move(plan), std::move(text), threads);
}

}  // namespace grainclock::benchmarks
