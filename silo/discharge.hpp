// A discharge over time: rate, stoppages, beats, how long it takes, and Beverloo's law beside it (the paper's section 5.3,
// conclusion 2). Pure functions of time series as runs record them: `time` increases [s], `discharged` counts the balls
// that have left until then, `kinetic_energy` [J] is the content's; all of one length, at least two samples, else
// InputError.
//
// Reference: W. A. Beverloo, H. A. Leniger, J. van de Velde, "The flow of granular solids through orifices", Chemical
// Engineering Science 15 (1961) 260-269.
#pragma once

#include <cstddef>
#include <vector>

namespace grainclock::silo {

/// Balls per second [1/s] in a window: the balls counted from the first to the last sample from `from` to `to` [s], over the
/// time between the two. Throws InputError with fewer than two samples in it.
double discharge_rate(const std::vector<double>& time, const std::vector<double>& discharged, double from, double to);

/// The same at each sample over the window from width / 2 [s] before to width / 2 after it, cut at the series' ends; nan
/// with fewer than two samples in it. Throws InputError unless width > 0.
std::vector<double> sliding_discharge_rate(const std::vector<double>& time, const std::vector<double>& discharged,
                                           double width);

/// What kinetic energies of a discharge are measured by.
struct EnergyScale {
  double balls = 0.0;        // that are there at a count of zero
  double ball_energy = 0.0;  // J, m g r of a mean ball: weight times radius
};

/// Kinetic energy per ball that is still there, in units of m g r; zero when none is. Throws InputError if more balls left
/// than there were or ball_energy is not above 0.
std::vector<double> energy_per_ball(const std::vector<double>& kinetic_energy, const std::vector<double>& discharged,
                                    const EnergyScale& scale);

struct TimeSpan {
  double from, to;  // s
  double length() const { return to - from; }
};

/// When a discharge counts as stopped.
struct StoppageRule {
  double at_least;       // s
  double energy = 5e-3;  // of m g r per ball; content behind an arch creeps with about 1e-3, in flow it has 1e-2 and more
};

/// A stoppage is a longest run of samples with one and the same count and energies per ball (energy_per_ball) below the
/// rule's, whose first and last are at least `at_least` apart. With energy = infinity these are the stoppages of
/// benchmarks/statistics; the energy leaves out what still moves after the last ball, and flow that makes a pause only at
/// the outlet. Throws InputError unless at_least > 0.
std::vector<TimeSpan> stoppages(const std::vector<double>& time, const std::vector<double>& discharged,
                                const std::vector<double>& energies, const StoppageRule& rule);

/// A time at which much of the content moves at once.
struct Beat {
  double time;        // s, of the maximum; of its middle if it is flat
  double energy;      // of the maximum, in the unit of the series
  double prominence;  // in the same unit
};

/// Local maxima of a series that rise by at least `prominence` (> 0, else InputError) above the higher of the two lowest
/// values that lie between them and the next higher values (or the end) on either side. The first and the last sample are
/// none.
std::vector<Beat> beats(const std::vector<double>& time, const std::vector<double>& kinetic_energy, double prominence);
/// Times between successive beats [s].
std::vector<double> beat_intervals(const std::vector<Beat>& beats);

/// How long a discharge takes.
struct Duration {
  double seconds = 0.0;          // from the first sample; infinite if nothing has left
  bool is_extrapolated = false;  // balls are still there: they leave at the mean rate so far
};

/// Time until `balls`, those there at the first sample, have left.
Duration discharge_duration(const std::vector<double>& time, const std::vector<double>& discharged, double balls);

/// Beverloo's law for a round outlet in a flat bottom, far above the clogging limit (outlets of six and more ball
/// diameters). A hopper and smooth balls let more through; the law is a comparison, no prediction.
struct Beverloo {
  double outlet;               // m, clear diameter D
  double ball;                 // m, diameter d
  double bulk_density;         // kg/m3, of the packing at the outlet
  double gravity = 9.81;       // m/s2
  double coefficient = 0.58;   // C, 0.55 to 0.65 in the literature
  double empty_annulus = 1.4;  // k, in ball diameters; 1 to 2 in the literature

  /// C bulk_density sqrt(g) (D - k d)^(5/2) [kg/s]; zero where D <= k d.
  double mass_rate() const;
};

}  // namespace grainclock::silo
