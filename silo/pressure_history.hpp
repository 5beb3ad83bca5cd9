// Pressures over time: what is static, what motion adds to it, where and when it peaks, how long that lasts.
//
// A series holds one column per place: the layers of pressure_by_layer, patches, or single wall balls. A place
// without wall is NaN throughout, and so are the pressures and ratios found for it.
#pragma once

#include "silo/wall_pressure.hpp"

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace grainclock::silo {

struct PressureSeries {
  std::vector<double> time;                   // s, increasing
  std::vector<std::vector<double>> pressure;  // Pa, time x place
};

/// Times from begin to end [s], both included.
struct Window {
  double begin, end;
};

/// Mean over the samples within a window of rest by place [Pa]. Throws InputError if the window holds no sample or the
/// series is not one: unequal lengths, times that do not increase (as all others here do).
std::vector<double> static_pressure(const PressureSeries& series, const Window& rest);

/// What motion makes of a place's pressure (the paper's Table 2 and the marked lines of its Fig. 8).
struct DynamicExtremes {
  double at_rest;                        // Pa, as static_pressure
  double lowest, time_of_lowest;         // Pa, s
  double highest, time_of_highest;       // Pa, s
  double smallest_ratio, largest_ratio;  // lowest and highest over at_rest; NaN where at_rest is below the floor
};

/// Extremes within the window `motion` by place. `floor` [Pa]: places whose static pressure is not above it have no ratio, for
/// near the heap's surface almost nothing divides anything. Throws InputError if a window holds no sample or floor is negative.
std::vector<DynamicExtremes> dynamic_extremes(const PressureSeries& series, const Window& rest, const Window& motion,
                                              double floor);

struct Peak {
  double pressure;    // Pa
  double time;        // s
  std::size_t place;  // column
};
/// The highest pressure within a window, the earliest of equals; nothing if no place has a wall.
std::optional<Peak> peak(const PressureSeries& series, const Window& window);

/// A piece of the wall, its edges included.
struct Patch {
  double angle, z;                 // rad, m: its middle
  double half_angle, half_height;  // rad, m
  bool holds(const Vec3& point) const;
};
/// The patch of Fig. 9: above the transition from the hopper to the shaft, on the +x side, three mean ball diameters high and wide.
Patch patch_above_hopper(const SiloShape& shape);
/// Mean pressure over the wall balls with their centres in a patch [Pa]: over time the paper's Fig. 9. NaN without any.
double patch_pressure(std::span<const WallLoad> loads, const Patch& patch);

/// How far and how long a pressure exceeds its static value.
struct Overpressure {
  double level;            // Pa, beyond which it counts: static (1 + share)
  double highest;          // of the pressure over the static one
  double time_of_highest;  // s
  double begin, end;       // s, first and last time at the level; NaN if it never exceeds it
  double total;            // s, sum of all times above it
  double longest;          // s, longest time above it without a break
};

/// Overpressure within a window, the pressure taken as straight lines between samples; what is above the level at the
/// window's edges counts from the first sample or to the last one. Throws InputError unless at_rest > 0, share >= 0, and the
/// window holds at least two samples, all finite.
Overpressure overpressure(std::span<const double> time, std::span<const double> pressure, double at_rest, double share,
                          const Window& window);

}  // namespace grainclock::silo
