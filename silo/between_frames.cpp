#include "silo/between_frames.hpp"

#include "core/check.hpp"
#include "silo/observables.hpp"
#include "silo/phases.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace grainclock::silo {
namespace {

using Numbers = std::vector<double>;

constexpr double kRateWindow = 1.0;    // s
constexpr double kPause = 0.25;        // s
constexpr double kProminence = 0.25;   // of the mean
constexpr double kPiece = 10.0;        // s, of a spectrum's pieces
constexpr double kBefore = 20.0;       // s, that a hammer is compared with
constexpr double kOver = 0.1;          // above the reference, to count as overpressure
constexpr double kFloor = 0.1;         // of the largest static pressure; places with less have no ratio

double mean_of(const Numbers& values) {
  double sum = 0.0;
  for (const double value : values) sum += value;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

Numbers part(const Numbers& values, const RecordedPhase& phase) {
  return Numbers(values.begin() + static_cast<std::ptrdiff_t>(phase.first), values.begin() + static_cast<std::ptrdiff_t>(phase.end));
}

Numbers column(const Recorded& series, std::size_t k) {
  Numbers values;
  for (std::size_t i = k; i < series.values.size(); i += series.width) values.push_back(series.values[i]);
  return values;
}

BulkMotion motion_of(const RunReader& run, const core::State& start, const toml::table& scene) {
  const double density = scene["material"]["density"].value_or(core::Materials{}.density);
  core::Vec3 gravity{0.0, 0.0, -9.81};
  if (const toml::array* given = scene["gravity"].as_array())
    for (std::size_t k = 0; k < 3; ++k) gravity[static_cast<Eigen::Index>(k)] = (*given)[k].value_or(0.0);
  core::Materials materials;
  materials.density = density;
  const MeanBall ball = mean_ball(start, materials);
  const double balls = static_cast<double>(start.count(core::Kind::content));

  BulkMotion motion;
  motion.time = run.series("discharged")->time;
  motion.discharged = run.series("discharged")->values;
  motion.energy = energy_per_ball(run.series("kinetic_energy")->values, motion.discharged, {balls, ball.mass * gravity.norm() * ball.radius});
  motion.rate = sliding_discharge_rate(motion.time, motion.discharged, kRateWindow);
  const Numbers upward = column(*run.series("momentum"), 2);
  for (std::size_t k = 0; k < upward.size(); ++k) {
    const double left = balls - motion.discharged[k];
    motion.sinking_speed.push_back(left > 0.0 ? -upward[k] / (left * ball.mass) : 0.0);
  }
  return motion;
}

std::optional<BetweenFrames::Spectra> spectra_of(const RunReader& run, const BulkMotion& motion, const RecordedPhase& phase) {
  // Without the record that the phase begins with: it may stand closer to the next than the others do.
  const RecordedPhase even{phase.name, phase.is_open, phase.first + 1, phase.end - 1};  // and the last one: a condition may have cut it short
  if (even.end < even.first + 4) return std::nullopt;
  const Numbers time = part(motion.time, even);
  const double length = time.back() - time.front();
  if (length < 2.0 * kPiece) return std::nullopt;
  const int pieces = static_cast<int>(2.0 * length / kPiece) - 1;  // half overlap
  BetweenFrames::Spectra spectra;
  const auto density = [&](const Numbers& its_time, const Numbers& values) {
    Spectrum spectrum = mean_spectrum(its_time, values, pieces);
    spectra.frequency = std::move(spectrum.frequency);
    return std::move(spectrum.density);
  };
  spectra.energy = density(time, part(motion.energy, even));
  spectra.sinking_speed = density(time, part(motion.sinking_speed, even));
  if (const auto patch = run.series("patch_pressure")) spectra.patch_pressure = density(time, part(patch->values, even));
  if (const auto layers = run.series(kLateralForceByLayer)) {
    for (std::size_t layer = 0; 2 * layer < layers->width; ++layer) {
      Numbers both = density(time, part(column(*layers, 2 * layer), even));
      const Numbers y = density(time, part(column(*layers, 2 * layer + 1), even));
      std::transform(both.begin(), both.end(), y.begin(), both.begin(), std::plus<>());
      spectra.by_layer.push_back(std::move(both));
    }
  }
  const Recorded impulse = *run.series("wall_impulse");
  // Intervals that end at the records of this stretch; as many as there are records, so that the frequencies are the same.
  const RecordedPhase intervals{even.name, even.is_open, even.first - 1, even.end - 1};
  spectra.lateral_x = density(time, part(mean_force(impulse, 0), intervals));
  spectra.lateral_y = density(time, part(mean_force(impulse, 1), intervals));
  return spectra;
}

/// Pressures over time by place.
struct Places {
  std::vector<std::string> name;
  std::vector<Numbers> pressure;  // Pa
};

Places places_of(const RunReader& run, const core::State& start) {
  Places places;
  const auto force = run.series(kWallForceByLayer);
  const auto layers = layers_of(start);
  if (!force || !layers || force->width != static_cast<std::size_t>(layers->n)) return places;
  const Numbers area = wall_area_by_layer(start, *layers), edge = edges(*layers);
  Numbers whole(force->time.size(), 0.0);
  double whole_area = 0.0;
  for (std::size_t k = 0; k < area.size(); ++k) {
    places.name.push_back(fmt::format("{:.2f} to {:.2f} m", edge[k], edge[k + 1]));
    Numbers its = column(*force, k);
    for (std::size_t i = 0; i < its.size(); ++i) {
      whole[i] += its[i];
      its[i] = area[k] > 0.0 ? its[i] / area[k] : 0.0;
    }
    whole_area += area[k];
    places.pressure.push_back(std::move(its));
  }
  if (const auto patch = run.series("patch_pressure")) {
    places.name.push_back("patch");
    places.pressure.push_back(patch->values);
  }
  for (double& value : whole) value /= whole_area;
  places.name.push_back("wall");
  places.pressure.push_back(std::move(whole));
  return places;
}

std::optional<HammerPressures> hammer_of(const Places& places, const std::vector<RecordedPhase>& phases, const Numbers& time) {
  const auto opened = std::find_if(phases.begin(), phases.end(), [](const RecordedPhase& p) { return p.is_open; });
  const auto shut = std::find_if(opened, phases.end(), [](const RecordedPhase& p) { return !p.is_open; });
  if (places.name.empty() || opened == phases.begin() || opened == phases.end() || shut == phases.end()) return std::nullopt;
  const RecordedPhase &rest = *std::prev(opened), &flow = *std::prev(shut);
  const double begin = time[shut->first];
  RecordedPhase before = flow;
  while (time[before.first] < begin - kBefore) ++before.first;

  double largest = 0.0;
  for (const Numbers& pressure : places.pressure) largest = std::max(largest, mean_of(part(pressure, rest)));
  HammerPressures found;
  for (std::size_t k = 0; k < places.name.size(); ++k) {
    const double at_rest = mean_of(part(places.pressure[k], rest)), in_flow = mean_of(part(places.pressure[k], before));
    if (at_rest <= kFloor * largest || in_flow <= 0.0) continue;
    const Numbers its_time = part(time, *shut), pressure = part(places.pressure[k], *shut);
    const Window window{its_time.front(), its_time.back()};
    found.place.push_back(places.name[k]);
    found.over_rest.push_back(overpressure(its_time, pressure, at_rest, kOver, window));
    found.over_flow.push_back(overpressure(its_time, pressure, in_flow, kOver, window));
  }
  return found;
}

void write_numbers(core::Hdf5Group& group, const char* name, const char* unit, const Numbers& values, std::size_t width = 1) {
  core::Hdf5Group::Shape shape{values.size() / width};
  if (width > 1) shape.push_back(width);
  group.write(name, values, shape);
  group.write_attribute(name, "unit", std::string(unit));
}

void write_spans(core::Hdf5Group& group, const char* name, const std::vector<TimeSpan>& spans) {
  Numbers values;
  for (const TimeSpan& span : spans) values.insert(values.end(), {span.from, span.to});
  write_numbers(group, name, "s", values, 2);
}

void write_beats(core::Hdf5Group& group, const char* name, const std::vector<Beat>& beats) {
  Numbers values;
  for (const Beat& beat : beats) values.insert(values.end(), {beat.time, beat.energy, beat.prominence});
  write_numbers(group, name, "", values, 3);
  group.write_attribute(name, "columns", std::vector<std::string>{"time [s]", "height", "prominence"});
}

void write_spectra(core::Hdf5Group group, const BetweenFrames::Spectra& spectra) {
  write_numbers(group, "frequency", "Hz", spectra.frequency);
  write_numbers(group, "energy", "Hz-1", spectra.energy);
  write_numbers(group, "sinking_speed", "m2 s-2 Hz-1", spectra.sinking_speed);
  write_numbers(group, "lateral_x", "N2 Hz-1", spectra.lateral_x);
  write_numbers(group, "lateral_y", "N2 Hz-1", spectra.lateral_y);
  if (!spectra.patch_pressure.empty()) write_numbers(group, "patch_pressure", "Pa2 Hz-1", spectra.patch_pressure);
  Numbers layers;
  for (const Numbers& layer : spectra.by_layer) layers.insert(layers.end(), layer.begin(), layer.end());
  if (!layers.empty()) write_numbers(group, "lateral_by_layer", "N2 Hz-1", layers, spectra.frequency.size());
}

void write_overpressures(core::Hdf5Group& group, const char* name, const std::vector<Overpressure>& all) {
  Numbers values;
  for (const Overpressure& o : all) values.insert(values.end(), {o.level, o.highest, o.time_of_highest, o.total, o.longest});
  write_numbers(group, name, "", values, 5);
  group.write_attribute(name, "columns",
                        std::vector<std::string>{"level [Pa]", "highest over reference", "time of highest [s]", "time above level [s]", "longest [s]"});
}

}  // namespace

std::vector<RecordedPhase> recorded_phases(const Numbers& phase, const toml::table& scene) {
  const toml::array* tables = scene["phase"].as_array();
  std::vector<RecordedPhase> phases;
  for (std::size_t first = 0; first < phase.size();) {
    const auto end = static_cast<std::size_t>(
        std::find_if(phase.begin() + static_cast<std::ptrdiff_t>(first), phase.end(), [&](double its) { return its != phase[first]; }) - phase.begin());
    const toml::table* table =
        tables && phase[first] >= 0.0 && phase[first] < static_cast<double>(tables->size()) ? (*tables)[static_cast<std::size_t>(phase[first])].as_table() : nullptr;
    if (!table) throw core::FileError(fmt::format("record {} is of phase {}, which the run's scene does not have: the file is damaged", first, phase[first]));
    phases.push_back({(*table)["name"].value_or(std::string()), (*table)["outlet"].value_or(std::string()) == "open", first > 0 ? first - 1 : 0, end});
    first = end;
  }
  return phases;
}

Rhythm rhythm_of(const BulkMotion& motion, const RecordedPhase& phase) {
  Rhythm rhythm;
  if (phase.end < phase.first + 2) return rhythm;
  const Numbers time = part(motion.time, phase), discharged = part(motion.discharged, phase), energy = part(motion.energy, phase),
                speed = part(motion.sinking_speed, phase);
  const double any = std::numeric_limits<double>::infinity();
  rhythm.pauses = stoppages(time, discharged, energy, {kPause, any});
  rhythm.stoppages = stoppages(time, discharged, energy, {kPause});
  for (const TimeSpan& span : stoppages(time, discharged, energy, {std::numeric_limits<double>::min(), any}))
    rhythm.longest_pause = std::max(rhythm.longest_pause, span.length());
  if (const double mean = mean_of(energy); mean > 0.0) rhythm.energy_beats = beats(time, energy, kProminence * mean);
  if (const double mean = mean_of(speed); mean > 0.0) rhythm.speed_beats = beats(time, speed, kProminence * mean);
  return rhythm;
}

Numbers mean_force(const Recorded& impulse, std::size_t axis) {
  Numbers force;
  for (std::size_t k = 1; k < impulse.time.size(); ++k) {
    const double gained = impulse.values[k * impulse.width + axis] - impulse.values[(k - 1) * impulse.width + axis];
    force.push_back(gained / (impulse.time[k] - impulse.time[k - 1]));
  }
  return force;
}

std::optional<BetweenFrames> between_frames(const RunReader& run) {
  const auto phase = run.series("phase");
  if (!phase || phase->time.size() < 2 || !run.series("momentum")) return std::nullopt;
  const toml::table scene = run.scene();
  const core::State start = run.state(0);
  BetweenFrames found;
  found.motion = motion_of(run, start, scene);
  const std::vector<RecordedPhase> phases = recorded_phases(phase->values, scene);
  for (const RecordedPhase& its : phases)
    if (its.is_open) found.open.push_back({its, rhythm_of(found.motion, its), spectra_of(run, found.motion, its)});
  found.hammer = hammer_of(places_of(run, start), phases, found.motion.time);
  return found;
}

void write(core::Hdf5Group& group, const BetweenFrames& found) {
  write_numbers(group, "time", "s", found.motion.time);
  write_numbers(group, "energy_per_ball", "m g r", found.motion.energy);
  write_numbers(group, "sinking_speed", "m s-1", found.motion.sinking_speed);
  write_numbers(group, "discharge_rate", "s-1", found.motion.rate);
  for (std::size_t k = 0; k < found.open.size(); ++k) {
    const BetweenFrames::Phase& its = found.open[k];
    core::Hdf5Group phase = group.create_group(fmt::format("open_{}", k));
    phase.write_attribute(".", "name", its.phase.name);
    phase.write_attribute(".", "span", Numbers{found.motion.time[its.phase.first], found.motion.time[its.phase.end - 1]});
    phase.write_attribute(".", "longest_pause", Numbers{its.rhythm.longest_pause});
    write_spans(phase, "pauses", its.rhythm.pauses);
    write_spans(phase, "stoppages", its.rhythm.stoppages);
    write_beats(phase, "energy_beats", its.rhythm.energy_beats);
    write_beats(phase, "speed_beats", its.rhythm.speed_beats);
    if (its.spectra) write_spectra(phase.create_group("spectra"), *its.spectra);
  }
  if (!found.hammer) return;
  core::Hdf5Group hammer = group.create_group("hammer");
  hammer.write_texts("place", found.hammer->place);
  write_overpressures(hammer, "over_rest", found.hammer->over_rest);
  write_overpressures(hammer, "over_flow", found.hammer->over_flow);
}

}  // namespace grainclock::silo
