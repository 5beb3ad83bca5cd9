#include "benchmarks/trajectories_rows.hpp"

#include "benchmarks/errors.hpp"
#include "benchmarks/gain.hpp"
#include "core/check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace grainclock::benchmarks {
namespace {

/// A reference is accepted when its change from a coarser run is less than this share of the smallest error.
constexpr double kReferenceShare = 0.1;

double number(std::uint64_t count) { return static_cast<double>(count); }

std::uint64_t total(const BranchChanges& c) {
  return c.touched + c.lost + c.clamped + c.unclamped + c.out_of_reach + c.into_reach + c.parting + c.nearing;
}

/// The different ones of all repetitions, as one text.
template <class Member>
std::string all_of(const std::vector<Outcome>& outcomes, Member member) {
  std::vector<std::string> seen;
  for (const Outcome& outcome : outcomes) {
    const std::string text = fmt::format("{}", outcome.made_by.*member);
    if (std::find(seen.begin(), seen.end(), text) == seen.end()) seen.push_back(text);
  }
  std::sort(seen.begin(), seen.end());
  return fmt::format("{}", fmt::join(seen, "; "));
}

Row described(const PointRuns& runs) {
  const Point& point = runs.point;
  const Outcome& outcome = runs.outcomes.front();
  Row row;
  row.name = point.name;
  row.method = method_name(point);
  row.method_used = outcome.method_used;
  row.variant = variant_name(point);
  if (point.sundials) {
    row.rtol = point.sundials->rtol;
    row.roots = point.sundials->roots ? "true" : "false";
    if (point.sundials->slow_step > 0.0) row.step = point.sundials->slow_step;
  } else {
    const core::Stepping& s = point.stepping;
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
  }
  row.host = all_of(runs.outcomes, &JobMaker::host);
  row.threads = all_of(runs.outcomes, &JobMaker::threads);
  row.revision = all_of(runs.outcomes, &JobMaker::revision);
  row.status = outcome.status;
  return row;
}

void add_costs(Row& row, const PointRuns& runs) {
  const Outcome& outcome = runs.outcomes.front();
  row.contact_evaluations = number(outcome.costs.contact_evaluations);
  row.ball_updates = number(outcome.costs.ball_updates);
  row.steps = number(outcome.steps);
  if (runs.point.sundials) {
    if (runs.point.sundials->roots) {
      row.restarts = number(outcome.restarts);
      row.branch_changes = number(total(outcome.changes));
    }
  } else {
    row.missed_contacts = number(outcome.costs.missed_contacts);
    row.events_count = number(outcome.costs.events);
  }
  std::vector<double> clock;
  for (const Outcome& one : runs.outcomes) {
    if (one.is_ok()) clock.push_back(one.wall_s);
  }
  row.wall_s = quantile(clock, 0.5);
}

void add_errors(Row& row, const Outcome& outcome, const StartRuns& runs, std::optional<double> outlet_z) {
  const Outcome& reference = runs.reference.outcomes.front();
  const TrajectoryErrors errors = trajectory_errors(runs.start.state, reference.end, outcome.end, outlet_z);
  row.error_rms = errors.position.rms;
  row.error_median = errors.position.median;
  row.error_p99 = errors.position.p99;
  row.velocity_error_rms = errors.velocity.rms;
  row.missing_balls = static_cast<double>(errors.missing);
  if (runs.start.layers) row.error_wall_force = relative_l2(outcome.wall_force, reference.wall_force);
  if (!std::isfinite(errors.position.rms)) row.status = "failed: positions are not finite";
}

/// Contact evaluations of one sweep over all pairs: what a step of a uniform reference takes, pece's two evaluations apart.
double per_sweep(const PointRuns& reference) {
  const Outcome& outcome = reference.outcomes.front();
  const core::Stepping& s = reference.point.stepping;
  const bool sweeps_once = s.method == core::Method::uniform && s.integrator != core::Integrator::pece;
  if (reference.point.sundials || !sweeps_once) return outcome.levels.listed;
  return number(outcome.costs.contact_evaluations) / number(outcome.steps);
}

/// The row of one point, gains excepted.
Row measured(const PointRuns& point, const StartRuns& runs, std::optional<double> outlet_z) {
  Row row = described(point);
  row.start = runs.start.name;
  const Outcome& outcome = point.outcomes.front();
  if (!outcome.is_ok()) return row;
  add_costs(row, point);
  row.sweeps = *row.contact_evaluations / per_sweep(runs.reference);
  row.momentum_residual = outcome.momentum_residual;
  row.energy_residual = outcome.energy_residual;
  row.ideal_gain = outcome.ideal_gain;
  if (&point != &runs.reference) add_errors(row, outcome, runs, outlet_z);
  return row;
}

bool is_uniform_predicted(const Row& row, std::string_view events) {
  return row.method == "uniform" && row.integrator == "predicted" && row.dashpot == "explicit" && row.events == events &&
         row.status == "ok";
}

bool share_a_clock(const std::vector<Row>& rows) {
  return std::all_of(rows.begin(), rows.end(), [&](const Row& row) {
    return row.host == rows.front().host && row.threads == rows.front().threads && row.host.find(';') == std::string::npos &&
           row.threads.find(';') == std::string::npos;
  });
}

/// Fills the gains of the points of one start state: against the plain uniform scheme and against ours with events.
void fill_gains(std::vector<Row>& rows) {
  for (const bool counted : {true, false}) {
    if (!counted && !share_a_clock(rows)) continue;
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

/// What the reference is worth, beside the smallest error of the points.
std::string reference_status(const Row& check, bool is_sundials, double smallest_error) {
  const char* const coarser = is_sundials ? "10 times its rtol" : "twice its step";
  if (!check.error_rms) return fmt::format("unchecked: the run at {} failed", coarser);
  if (*check.error_rms < kReferenceShare * smallest_error) return "ok";
  return fmt::format("too coarse: {} changes it by {:.2g}, above a tenth of the smallest error {:.2g}", coarser,
                     *check.error_rms, smallest_error);
}

}  // namespace

std::vector<Row> rows_of(const StartRuns& runs, std::optional<double> outlet_z) {
  std::vector<Row> rows;
  for (const PointRuns& point : runs.points) rows.push_back(measured(point, runs, outlet_z));
  fill_gains(rows);
  double smallest = std::numeric_limits<double>::infinity();
  for (const Row& row : rows) {
    if (row.status == "ok" && row.error_rms) smallest = std::min(smallest, *row.error_rms);
  }
  Row reference = measured(runs.reference, runs, outlet_z);
  const Row check = measured(runs.check, runs, outlet_z);
  reference.status = reference_status(check, runs.reference.point.sundials.has_value(), smallest);
  rows.push_back(reference);
  rows.push_back(check);
  return rows;
}

}  // namespace grainclock::benchmarks
