#include "benchmarks/study.hpp"

#include "benchmarks/errors.hpp"
#include "benchmarks/gain.hpp"
#include "benchmarks/progress.hpp"
#include "benchmarks/reference.hpp"
#include "benchmarks/study_plan.hpp"
#include "benchmarks/study_table.hpp"
#include "core/check.hpp"
#include "core/files.hpp"
#include "core/snapshot.hpp"
#include "multirate/stepper.hpp"
#include "silo/measures.hpp"
#include "silo/phases.hpp"

#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <memory>

namespace grainclock::benchmarks {
namespace {

using core::State;
using core::Stepping;

/// A reference is accepted when halving its step changes it by less than this share of the smallest error.
constexpr double kReferenceShare = 0.1;
/// Wall forces are compared by layers this many mean diameters thick.
constexpr double kLayerDiameters = 2.0;

/// How one point ended, from the first of its runs; later ones only add to the clock.
struct Outcome {
  State end;
  std::vector<double> wall_force;  // N, by layer
  double step = 0.0;               // s
  std::uint64_t steps = 0;
  std::string method_used;
  core::Costs costs;
  std::optional<double> momentum_residual, energy_residual, ideal_gain;
  std::vector<double> wall_s;
  std::string status = "ok";
  bool ok() const { return status == "ok"; }
};

/// One start state with everything that was run from it.
struct Series {
  std::string name;
  State start;
  std::optional<silo::Layers> layers;  // of the wall
  Outcome reference, twice;
  std::vector<Outcome> points;
};

double mean_diameter(const State& state) {
  double sum = 0.0;
  for (std::size_t row = 0; row < state.size(); ++row) {
    if (state.kind[row] == core::Kind::content) sum += 2.0 * state.radius[row];
  }
  return sum / static_cast<double>(std::max<std::size_t>(1, state.count(core::Kind::content)));
}

/// Evaluations saved by an ideal scheme with this run's levels: all contacts at the finest step over each at its own.
std::optional<double> ideal_gain(const core::LevelStatistics& levels) {
  double all = 0.0, weighted = 0.0, finest = 0.0;
  for (std::size_t level = 0; level < levels.contacts.size(); ++level) {
    if (levels.contacts[level] <= 0.0) continue;
    if (finest == 0.0) finest = levels.step[level];
    all += levels.contacts[level];
    weighted += levels.contacts[level] * finest / levels.step[level];
  }
  if (weighted == 0.0) return std::nullopt;
  return all / weighted;
}

/// Layers about kLayerDiameters thick over the height of the wall; nothing without a wall.
std::optional<silo::Layers> wall_layers(const State& state) {
  double lowest = std::numeric_limits<double>::infinity(), highest = -lowest;
  for (std::size_t row = 0; row < state.size(); ++row) {
    if (state.kind[row] != core::Kind::wall) continue;
    lowest = std::min(lowest, state.position[row].z());
    highest = std::max(highest, state.position[row].z());
  }
  if (!(lowest < highest)) return std::nullopt;
  const double layers = (highest - lowest) / (kLayerDiameters * mean_diameter(state));
  return silo::Layers{lowest, highest, std::max(1, static_cast<int>(std::lround(layers)))};
}

/// Horizontal force on the wall by layer [N].
std::vector<double> wall_force(const Series& series, const std::vector<core::Contact>& contacts) {
  if (!series.layers) return {};
  return silo::wall_force_by_layer(series.start, contacts, *series.layers);
}

class Runner {
 public:
  Runner(const core::Scene& scene, double horizon, int threads) : scene_(scene), horizon_(horizon), threads_(threads) {}

  /// The setup of this stepping, its step a whole fraction of the horizon.
  core::StepperSetup setup(const State& state, const Stepping& stepping) const {
    core::Phase phase = scene_.phases.front();
    phase.stepping = stepping;
    phase.every = horizon_;
    return silo::phase_setup(scene_, phase, state, threads_);
  }

  /// Steps over the horizon; the stepper's construction (lists, first forces) is outside the clock.
  Outcome run(const Series& series, const Stepping& stepping) const {
    const core::StepperSetup made = setup(series.start, stepping);
    Outcome outcome;
    outcome.step = *made.stepping.step;
    const auto stepper = multirate::make_stepper(series.start, made);
    const std::int64_t n = core::step_for(horizon_, stepper->step()).n;
    const core::Energies before = stepper->energies();
    try {
      const auto begin = std::chrono::steady_clock::now();
      stepper->advance(n);
      outcome.wall_s.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    } catch (const core::NumericsError& error) {
      outcome.status = fmt::format("failed: {}", error.what());
      return outcome;
    }
    outcome.end = stepper->state();
    outcome.wall_force = wall_force(series, stepper->contacts());
    outcome.steps = static_cast<std::uint64_t>(n);
    outcome.costs = stepper->costs();
    outcome.momentum_residual = core::momentum_residual(before, stepper->energies(), stepper->ledger());
    outcome.energy_residual = core::energy_residual(before, stepper->energies(), stepper->ledger());
    const core::LevelStatistics levels = stepper->level_statistics();
    outcome.ideal_gain = ideal_gain(levels);
    const bool selective = stepping.method == core::Method::multirate && levels.step.size() > 1;
    outcome.method_used = core::name(selective ? core::Method::multirate : core::Method::uniform);
    return outcome;
  }

  Outcome run(const Series& series, const Point& point) const {
    if (point.solver == Solver::stepper) return run(series, point.stepping);
    Stepping stepping;
    stepping.method = core::Method::uniform;
    stepping.step = horizon_;
    const core::StepperSetup made = setup(series.start, stepping);
    Outcome outcome;
    outcome.method_used = name(point.solver);
    try {
      ReferenceRun run = integrate({point.solver == Solver::cvode ? Scheme::cvode_adams : Scheme::erkstep, point.rtol}, series.start, made, horizon_);
      outcome.end = std::move(run.end);
      outcome.wall_s.push_back(run.wall_s);
      outcome.costs.contact_evaluations = run.contact_evaluations;
      outcome.costs.ball_updates = run.steps * series.start.count(core::Kind::content);
      outcome.steps = run.steps;
      const auto contacts = core::make_uniform_stepper(outcome.end, made)->contacts();
      outcome.wall_force = wall_force(series, contacts);
    } catch (const core::NumericsError& error) {
      outcome.status = fmt::format("failed: {}", error.what());
    }
    return outcome;
  }

 private:
  const core::Scene& scene_;
  double horizon_;
  int threads_;
};

/// Contact sweeps that a run may take, for the estimate of the remaining time only.
double expected_sweeps(const Point& point, double horizon) {
  constexpr double kSelective = 4.0, kDefaultStep = 2e-4, kSundials = 2e4;  // coarse: seen on the Table 1 silo
  if (point.solver != Solver::stepper) return kSundials;
  const Stepping& s = point.stepping;
  const double steps = horizon / s.step.value_or(kDefaultStep);
  return steps * (s.method == core::Method::multirate ? kSelective : 1.0) * (s.integrator == core::Integrator::pece ? 2.0 : 1.0);
}

Row described(const Point& point, const Outcome& outcome) {
  Row row;
  row.name = point.name;
  row.method = method_name(point);
  row.method_used = outcome.method_used;
  if (point.solver == Solver::stepper) {
    const Stepping& s = point.stepping;
    row.integrator = core::name(s.integrator);
    row.events = s.events ? "true" : "false";
    row.dashpot = core::name(s.dashpot);
    row.step = outcome.step;
    row.levels = 1;
    if (s.method == core::Method::multirate) {
      row.interface = core::name(s.interface);
      row.tolerance = s.tolerance;
      row.levels = s.levels;
    }
  } else {
    row.rtol = point.rtol;
  }
  row.status = outcome.status;
  return row;
}

/// The row of one outcome, gains excepted.
Row measured(const Point& point, const Outcome& outcome, const Series& series, const core::Domain& domain) {
  Row row = described(point, outcome);
  row.start = series.name;
  if (!outcome.ok()) return row;
  row.contact_evaluations = static_cast<double>(outcome.costs.contact_evaluations);
  row.ball_updates = static_cast<double>(outcome.costs.ball_updates);
  row.missed_contacts = static_cast<double>(outcome.costs.missed_contacts);
  row.events_count = static_cast<double>(outcome.costs.events);
  row.wall_s = quantile(outcome.wall_s, 0.5);
  row.momentum_residual = outcome.momentum_residual;
  row.energy_residual = outcome.energy_residual;
  row.ideal_gain = outcome.ideal_gain;
  const Outcome& reference = series.reference;
  const double per_sweep = static_cast<double>(reference.costs.contact_evaluations) / static_cast<double>(reference.steps);
  row.sweeps = *row.contact_evaluations / per_sweep;
  if (&outcome == &reference) return row;
  const TrajectoryErrors errors = trajectory_errors(series.start, reference.end, outcome.end, domain.outlet_z);
  row.error_rms = errors.position.rms;
  row.error_median = errors.position.median;
  row.error_p99 = errors.position.p99;
  row.velocity_error_rms = errors.velocity.rms;
  row.missing_balls = static_cast<double>(errors.missing);
  if (series.layers) row.error_wall_force = relative_l2(outcome.wall_force, reference.wall_force);
  if (!std::isfinite(errors.position.rms)) row.status = "failed: positions are not finite";
  return row;
}

bool is_uniform_predicted(const Row& row, std::string_view events) {
  return row.method == "uniform" && row.integrator == "predicted" && row.dashpot == "explicit" && row.events == events &&
         row.status == "ok";
}

/// Fills the gains of the points of one start state: against the plain uniform scheme and against ours with events.
void fill_gains(std::vector<Row>& rows) {
  for (const bool counted : {true, false}) {
    const auto chart_point = [counted](const Row& row) {
      return ErrorAtCost{row.error_rms.value_or(0.0), (counted ? row.contact_evaluations : row.wall_s).value_or(0.0)};
    };
    std::vector<ErrorAtCost> plain, with_events;
    for (const Row& row : rows) {
      if (is_uniform_predicted(row, "false")) plain.push_back(chart_point(row));
      if (is_uniform_predicted(row, "true")) with_events.push_back(chart_point(row));
    }
    for (Row& row : rows) {
      if (row.status != "ok") continue;
      (counted ? row.counted_gain : row.measured_gain) = gain(chart_point(row), plain);
      (counted ? row.gain_events_counted : row.gain_events_measured) = gain(chart_point(row), with_events);
    }
  }
}

Point reference_point(const Study& study, std::string_view its_name, double step_factor) {
  Point point;
  point.name = its_name;
  point.stepping = study.reference;
  point.stepping.step = step_factor * *study.reference.step;
  return point;
}

/// All rows of one start state: the points, then the reference and its check at twice the step.
std::vector<Row> rows_of(const Study& study, const Series& series, const core::Domain& domain) {
  std::vector<Row> rows;
  for (std::size_t p = 0; p < study.points.size(); ++p) {
    rows.push_back(measured(study.points[p], series.points[p], series, domain));
  }
  fill_gains(rows);
  double smallest = std::numeric_limits<double>::infinity();
  for (const Row& row : rows) {
    if (row.status == "ok" && row.error_rms) smallest = std::min(smallest, *row.error_rms);
  }
  Row reference = measured(reference_point(study, "reference", 1.0), series.reference, series, domain);
  Row check = measured(reference_point(study, "reference_check", 2.0), series.twice, series, domain);
  if (!check.error_rms) {
    reference.status = "unchecked: the run at twice its step failed";
  } else if (*check.error_rms >= kReferenceShare * smallest) {
    reference.status = fmt::format("too coarse: twice its step changes it by {:.2g}, above a tenth of the smallest error {:.2g}",
                                   *check.error_rms, smallest);
  }
  rows.push_back(reference);
  rows.push_back(check);
  return rows;
}

std::vector<Row> table(const Study& study, const std::vector<Series>& all, const core::Domain& domain) {
  std::vector<Row> rows;
  for (const Series& series : all) {
    for (Row& row : rows_of(study, series, domain)) rows.push_back(std::move(row));
  }
  return rows;
}

void require_empty(const std::string& out_dir) {
  const std::filesystem::path path(out_dir);
  if (!std::filesystem::exists(path)) return;
  GC_REQUIRE(std::filesystem::is_directory(path) && std::filesystem::is_empty(path),
             "--out {}: exists and is not empty; give a new directory or empty it", out_dir);
}

std::string label(const Point& point) {
  if (point.solver != Solver::stepper) return fmt::format("{} rtol {:g}", point.name, point.rtol);
  if (point.stepping.method == core::Method::uniform) return fmt::format("{} step {:g}", point.name, *point.stepping.step);
  return fmt::format("{} tolerance {:g}", point.name, point.stepping.tolerance);
}

}  // namespace

void run_study(const std::string& study_path, const std::string& out_dir, int threads) {
  const Study study = read_study(study_path);
  const core::Scene scene = core::read_scene(study.scene);
  require_empty(out_dir);
  GC_REQUIRE(!scene.phases.empty(), "{}: has no [[phase]]; a study runs the first one", study.scene);
  const Runner runner(scene, study.horizon, threads);

  std::vector<Series> all;
  for (const std::string& path : study.starts) {
    Series series;
    series.name = std::filesystem::path(path).stem().string();
    series.start = silo::fresh(core::read_state(path));
    series.layers = wall_layers(series.start);
    all.push_back(std::move(series));
  }
  // Key combinations that a stepper does not offer show now, not after an hour.
  for (const Point& point : study.points) {
    if (point.solver != Solver::stepper) continue;
    (void)multirate::make_stepper(all.front().start, runner.setup(all.front().start, point.stepping));
  }
  std::filesystem::create_directories(out_dir);

  const Point reference = reference_point(study, "reference", 1.0), twice = reference_point(study, "reference_check", 2.0);
  double sweeps = expected_sweeps(reference, study.horizon) + expected_sweeps(twice, study.horizon);
  for (const Point& point : study.points) sweeps += study.repeat * expected_sweeps(point, study.horizon);
  Progress progress(sweeps * static_cast<double>(all.size()));

  for (Series& series : all) {
    series.reference = runner.run(series, reference);
    if (!series.reference.ok()) {
      throw core::NumericsError(fmt::format("{}: reference from {}: {}", study.path, series.name, series.reference.status));
    }
    progress.done(expected_sweeps(reference, study.horizon), fmt::format("{}: {}", series.name, label(reference)));
    series.twice = runner.run(series, twice);
    progress.done(expected_sweeps(twice, study.horizon), fmt::format("{}: {}", series.name, label(twice)));
    series.points.resize(study.points.size());
  }
  for (int repetition = 0; repetition < study.repeat; ++repetition) {
    for (Series& series : all) {
      for (std::size_t p = 0; p < study.points.size(); ++p) {
        const Point& point = study.points[p];
        Outcome& kept = series.points[p];
        if (repetition == 0) {
          kept = runner.run(series, point);
        } else if (kept.ok()) {
          kept.wall_s.push_back(runner.run(series, point).wall_s.at(0));
        }
        const std::string text = kept.ok() ? fmt::format("{:.3g} s", kept.wall_s.back()) : kept.status;
        progress.done(expected_sweeps(point, study.horizon),
                      fmt::format("{}: {}, run {} of {}: {}", series.name, label(point), repetition + 1, study.repeat, text));
      }
    }
  }

  const std::vector<Row> rows = table(study, all, scene.domain);
  for (const Row& row : rows) {
    if (row.name == "reference" && row.status != "ok") {
      progress.note(fmt::format("warning: {}: the reference is {}; take a smaller [reference] step", row.start, row.status));
    }
  }
  const std::filesystem::path out(out_dir);
  core::write_text(out / "study.csv", csv(rows));
  write_table(out / "study.h5", rows, study.text, scene, threads);
  progress.note(fmt::format("written: {}, {}", (out / "study.csv").string(), (out / "study.h5").string()));
}

}  // namespace grainclock::benchmarks
