// How fast nearby trajectories part, and how long an error of trajectories therefore means something. Pure functions.
#pragma once

#include "core/state.hpp"

#include <optional>
#include <vector>

namespace grainclock::benchmarks {

/// Distances between the same balls of two states.
struct Separation {
  double rms = 0.0, max = 0.0;  // m
};

/// Over the content balls that both states have and whose centre is above `outlet_z` [m] in the first
/// (all of them without a plane); balls are told by id. Zero if there are none.
Separation separation(const core::State& state, const core::State& other, std::optional<double> outlet_z);

/// The state with every content ball displaced along each axis by a random length of at most `length` [m]:
/// the rms displacement is `length`. The same seed gives the same displacements on every machine.
core::State perturbed(core::State state, double length, std::uint64_t seed);

/// Exponential growth of a separation.
struct Growth {
  std::optional<double> rate;     // 1/s; nothing where no growth by a factor of ten is seen
  double floor = 0.0;             // m, the smallest separation seen: what perturbation and rounding leave
  double begin = 0.0, end = 0.0;  // s, the part that was fitted
};

/// Least squares of log(separation) over its rising part: from where it leaves three times its floor for good to where it
/// reaches `ceiling` [m]. Above that separations are no longer small and stop growing exponentially. Times [s] ascend,
/// separations [m] of zero are left out.
Growth fitted_growth(const std::vector<double>& time, const std::vector<double>& separation, double ceiling);

/// Time [s] until which a chart's smallest error can be told from the reference's own.
///
/// The reference's own error, known as its change from a coarser run at `horizon` [s], was `reference_change` there. It
/// grows as e(t) = reference_change exp(rate (t - horizon)). The chart holds while e(t) is at most a tenth of its smallest
/// error: t = horizon + ln(0.1 smallest_error / reference_change) / rate, and never below zero.
/// Nothing unless all four are above zero.
std::optional<double> trusted_until(double rate, double horizon, double reference_change, double smallest_error);

}  // namespace grainclock::benchmarks
