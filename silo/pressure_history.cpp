#include "silo/pressure_history.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace grainclock::silo {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Samples from `first` up to, not with, `end`.
struct Range {
  std::size_t first, end;
};

void require_increasing(std::span<const double> time) {
  for (std::size_t i = 1; i < time.size(); ++i)
    GC_REQUIRE(time[i] > time[i - 1], "sample {} at {} s comes after one at {} s: times must increase", i, time[i], time[i - 1]);
}

Range samples_in(std::span<const double> time, const Window& window) {
  const auto first = std::lower_bound(time.begin(), time.end(), window.begin);
  const auto end = std::upper_bound(first, time.end(), window.end);
  GC_REQUIRE(first != end, "no sample between {} s and {} s: take a window within the series, or samples closer in time",
             window.begin, window.end);
  return {static_cast<std::size_t>(first - time.begin()), static_cast<std::size_t>(end - time.begin())};
}

void require_valid(const PressureSeries& series) {
  GC_REQUIRE(series.time.size() == series.pressure.size(), "{} times for {} rows of pressures: need one for each",
             series.time.size(), series.pressure.size());
  for (const auto& row : series.pressure)
    GC_REQUIRE(row.size() == series.pressure.front().size(), "a row of {} pressures after one of {}: all need the same places",
               row.size(), series.pressure.front().size());
  require_increasing(series.time);
}

/// Adds the times above a level, one stretch between two samples after the other.
class TimeAbove {
 public:
  explicit TimeAbove(Overpressure& found) : found_(found) {}

  void add(double t0, double p0, double t1, double p1) {
    const double level = found_.level;
    if (p0 <= level && p1 <= level) return;
    const double crossing = t0 + (t1 - t0) * std::clamp((level - p0) / (p1 - p0), 0.0, 1.0);
    const double from = p0 > level ? t0 : crossing, to = p1 > level ? t1 : crossing;
    if (p0 <= level) unbroken_ = 0.0;
    if (std::isnan(found_.begin)) found_.begin = from;
    found_.end = to;
    found_.total += to - from;
    unbroken_ += to - from;
    found_.longest = std::max(found_.longest, unbroken_);
  }

 private:
  Overpressure& found_;
  double unbroken_ = 0.0;  // s
};

}  // namespace

std::vector<double> static_pressure(const PressureSeries& series, const Window& rest) {
  require_valid(series);
  const Range range = samples_in(series.time, rest);
  std::vector<double> mean(series.pressure[range.first].size(), 0.0);
  for (std::size_t i = range.first; i < range.end; ++i)
    for (std::size_t k = 0; k < mean.size(); ++k) mean[k] += series.pressure[i][k];
  for (double& value : mean) value /= static_cast<double>(range.end - range.first);
  return mean;
}

std::vector<DynamicExtremes> dynamic_extremes(const PressureSeries& series, const Window& rest, const Window& motion,
                                              double floor) {
  GC_REQUIRE(floor >= 0.0, "floor = {} Pa: must be 0 or above", floor);
  const std::vector<double> at_rest = static_pressure(series, rest);
  const Range range = samples_in(series.time, motion);
  std::vector<DynamicExtremes> extremes;
  for (std::size_t k = 0; k < at_rest.size(); ++k) {
    const auto at = [&](std::size_t i) { return series.pressure[i][k]; };
    std::size_t lowest = range.first, highest = range.first;
    for (std::size_t i = range.first; i < range.end; ++i) {
      if (at(i) < at(lowest)) lowest = i;
      if (at(i) > at(highest)) highest = i;
    }
    const double base = at_rest[k] > floor ? at_rest[k] : kNaN;
    extremes.push_back({at_rest[k], at(lowest), series.time[lowest], at(highest), series.time[highest], at(lowest) / base,
                        at(highest) / base});
  }
  return extremes;
}

std::optional<Peak> peak(const PressureSeries& series, const Window& window) {
  require_valid(series);
  const Range range = samples_in(series.time, window);
  std::optional<Peak> highest;
  for (std::size_t i = range.first; i < range.end; ++i)
    for (std::size_t k = 0; k < series.pressure[i].size(); ++k) {
      const double pressure = series.pressure[i][k];
      if (std::isnan(pressure)) continue;
      if (!highest || pressure > highest->pressure) highest = Peak{pressure, series.time[i], k};
    }
  return highest;
}

bool Patch::holds(const Vec3& point) const {
  const double turn = std::remainder(std::atan2(point.y(), point.x()) - angle, 2.0 * std::numbers::pi);
  return std::abs(turn) <= half_angle && std::abs(point.z() - z) <= half_height;
}

Patch patch_above_hopper(const SiloShape& shape) {
  const double half = 3.0 * shape.mean_radius();  // one and a half diameters
  const double joint = shape.hopper_height > 0.0 ? shape.hopper_height : shape.half_outlet;
  return {0.0, joint + half, half / shape.half_width, half};
}

double patch_pressure(std::span<const WallLoad> loads, const Patch& patch) {
  double force = 0.0, area = 0.0;
  for (const WallLoad& load : loads) {
    if (!patch.holds(load.position)) continue;
    force += load.horizontal_force();
    area += load.area;
  }
  return area > 0.0 ? force / area : kNaN;
}

Overpressure overpressure(std::span<const double> time, std::span<const double> pressure, double at_rest, double share,
                          const Window& window) {
  GC_REQUIRE(time.size() == pressure.size(), "{} times for {} pressures: need one for each", time.size(), pressure.size());
  GC_REQUIRE(at_rest > 0.0 && share >= 0.0, "static pressure {} Pa, share {}: must be above 0, and 0 or above", at_rest, share);
  require_increasing(time);
  const Range range = samples_in(time, window);
  GC_REQUIRE(range.end - range.first >= 2, "one sample between {} s and {} s: a duration needs two", window.begin, window.end);

  Overpressure found{at_rest * (1.0 + share), 0.0, time[range.first], kNaN, kNaN, 0.0, 0.0};
  TimeAbove above(found);
  for (std::size_t i = range.first; i < range.end; ++i) {
    GC_REQUIRE(std::isfinite(pressure[i]), "pressure {} Pa at {} s: must be finite, of a place with wall", pressure[i], time[i]);
    if (pressure[i] / at_rest > found.highest) {
      found.highest = pressure[i] / at_rest;
      found.time_of_highest = time[i];
    }
    if (i > range.first) above.add(time[i - 1], pressure[i - 1], time[i], pressure[i]);
  }
  return found;
}

}  // namespace grainclock::silo
