#include "benchmarks/statistics_run.hpp"

#include "benchmarks/first_phase.hpp"
#include "benchmarks/statistics.hpp"
#include "core/check.hpp"
#include "multirate/stepper.hpp"
#include "silo/measures.hpp"
#include "silo/observables.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>

namespace grainclock::benchmarks {
namespace {

using Numbers = std::vector<double>;

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
/// Changing this list needs a new kFormat in statistics_study.cpp.
template <class Access, class Run>
void each_field(Access& access, Run& run) {
  access("status", "", run.status);
  access("method_used", "", run.method_used);
  access("step", "s", run.step);
  access("contact_evaluations", "", run.costs.contact_evaluations);
  access("ball_updates", "", run.costs.ball_updates);
  access("list_builds", "", run.costs.list_builds);
  access("events", "", run.costs.events);
  access("missed_contacts", "", run.costs.missed_contacts);
  access("momentum_residual", "", run.momentum_residual);
  access("energy_residual", "", run.energy_residual);
  access("wall_s", "s", run.wall_s);
  access("time", "s", run.time);
  access("discharged", "", run.discharged);
  access("kinetic_energy", "J", run.kinetic_energy);
  access("wall_force", "N", run.wall_force);
  access("layer_edges", "m", run.layer_edges);
  access("wall_area", "m2", run.wall_area);
}

/// Adds a sample of what the stepper stands at; `start` holds every wall ball.
void sample(LongRun& run, const core::Stepper& stepper, const core::State& start, const std::optional<silo::Layers>& layers,
            double time) {
  run.time.push_back(time);
  run.discharged.push_back(static_cast<double>(stepper.ledger().discharged));
  run.kinetic_energy.push_back(stepper.energies().kinetic);
  if (!layers) return;
  const Numbers force = silo::wall_force_by_layer(start, stepper.contacts(), *layers);
  run.wall_force.insert(run.wall_force.end(), force.begin(), force.end());
}

}  // namespace

LongRun run_long(const core::Scene& scene, const core::State& start, const core::Stepping& stepping,
                 const Sampling& sampling, int threads) {
  const core::StepperSetup setup = first_phase_setup(scene, start, stepping, sampling.every, threads);
  const auto stepper = multirate::make_stepper(start, setup);
  const std::int64_t steps = core::step_for(sampling.every, stepper->step()).n;
  const std::int64_t samples = std::llround(sampling.duration / sampling.every);
  const auto content = static_cast<std::int64_t>(start.count(core::Kind::content));
  const core::Energies before = stepper->energies();
  const std::optional<silo::Layers> layers = silo::whole_layers(start, sampling.layer);

  LongRun run;
  run.momentum_residual = run.energy_residual = kUnknown;
  run.step = *setup.stepping.step;
  run.method_used = method_used(stepping, stepper->level_statistics());
  if (layers) {
    run.layer_edges = silo::edges(*layers);
    run.wall_area = silo::wall_area_by_layer(start, *layers);
  }
  sample(run, *stepper, start, layers, 0.0);
  try {
    for (std::int64_t k = 1; k <= samples; ++k) {
      const auto begin = std::chrono::steady_clock::now();
      stepper->advance(steps);
      run.wall_s += std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
      sample(run, *stepper, start, layers, static_cast<double>(k) * sampling.every);
      GC_REQUIRE(stepper->ledger().discharged < content,
                 "the silo of {} balls is empty {:.6g} s after the start; take a shorter duration", content,
                 run.time.back());
    }
    run.momentum_residual = core::momentum_residual(before, stepper->energies(), stepper->ledger());
    run.energy_residual = core::energy_residual(before, stepper->energies(), stepper->ledger());
  } catch (const core::NumericsError& error) {
    run.status = fmt::format("failed: {}", error.what());
  }
  run.costs = stepper->costs();
  return run;
}

void write_long_run(const std::filesystem::path& path, const LongRun& run, const JobOrigin& origin) {
  write_job_file(path, origin, [&](FieldWriter& writer) { each_field(writer, run); });
}

LongRun read_long_run(const std::filesystem::path& path) {
  LongRun run;
  run.made_by = read_job_file(path, [&](FieldReader& reader) { each_field(reader, run); });
  return run;
}

std::string_view name(Quantity quantity) {
  switch (quantity) {
    case Quantity::discharge_rate:
      return "discharge_rate";
    case Quantity::stoppages:
      return "stoppages";
    case Quantity::stoppage_length:
      return "stoppage_length";
    case Quantity::stoppage_share:
      return "stoppage_share";
    case Quantity::kinetic_energy:
      return "kinetic_energy";
    case Quantity::wall_force:
      return "wall_force";
    case Quantity::wall_pressure:
      return "wall_pressure";
  }
  return "?";
}

std::string_view unit(Quantity quantity) {
  switch (quantity) {
    case Quantity::discharge_rate:
      return "s-1";
    case Quantity::stoppages:
      return "";
    case Quantity::stoppage_length:
      return "s";
    case Quantity::stoppage_share:
      return "";
    case Quantity::kinetic_energy:
      return "J";
    case Quantity::wall_force:
      return "N";
    case Quantity::wall_pressure:
      return "Pa";
  }
  return "?";
}

Measures measures(const LongRun& run, double settle, double stop) {
  // Times are multiples of the sampling; a rounding must not decide.
  constexpr double kGuard = 1.0 - 1e-9;
  std::size_t first = 0;
  while (first < run.time.size() && run.time[first] < kGuard * settle) ++first;
  const auto window = [first](const Numbers& series) {
    return Numbers(series.begin() + static_cast<std::ptrdiff_t>(std::min(first, series.size())), series.end());
  };
  const Numbers time = window(run.time), discharged = window(run.discharged);
  const Stoppages stopped = stoppages(time, discharged, stop);
  Measures found{{{Quantity::discharge_rate, {}}, discharge_rate(time, discharged)},
                 {{Quantity::stoppages, {}}, static_cast<double>(stopped.count)},
                 {{Quantity::stoppage_length, {}}, stopped.mean_length},
                 {{Quantity::stoppage_share, {}}, stopped.share},
                 {{Quantity::kinetic_energy, {}}, mean(window(run.kinetic_energy))}};
  const std::size_t layers = run.wall_area.size();
  if (layers == 0) return found;
  double whole = 0.0;
  const double height = run.layer_edges[1] - run.layer_edges[0];
  for (std::size_t layer = 0; layer < layers; ++layer) {
    Numbers force;
    for (std::size_t s = first; s < run.time.size(); ++s) force.push_back(run.wall_force[s * layers + layer]);
    whole += mean(force);
    const double area = run.wall_area[layer];
    found[{Quantity::wall_pressure, static_cast<int>(std::lround(run.layer_edges[layer] / height))}] =
        area > 0.0 ? mean(force) / area : kUnknown;
  }
  found[{Quantity::wall_force, {}}] = whole;
  return found;
}

}  // namespace grainclock::benchmarks
