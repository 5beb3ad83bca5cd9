// How the content sinks: asymmetry and meandering of the funnel, and how much of the content takes part (the paper's
// section 5.3, conclusions 1, 3 and 4).
//
// The mass flux through a horizontal plane is exact for balls without rotation: each ball that the plane cuts carries
// q = density * (area of the cut) * (its downward velocity). Over time q adds up to the ball's mass as it passes.
#pragma once

#include "core/state.hpp"

#include <Eigen/Core>

#include <complex>
#include <vector>

namespace grainclock::silo {

/// Mass flux of the content through a horizontal plane; down is positive.
struct Flux {
  /// Azimuthal modes [kg/s]: modes[m] = sum of q exp(i m azimuth), azimuths of the balls' centres around the silo's axis
  /// from x towards y; modes[0] is the flux itself. A ball whose centre is on the axis counts in mode 0 only.
  std::vector<std::complex<double>> modes;
  double turnover = 0.0;                               // kg/s, sum of |q|: what moves up counts too
  Eigen::Vector2d centroid = Eigen::Vector2d::Zero();  // m, of what moves down, from the axis; nan if nothing does

  /// |mode m| over the turnover, from 0 (none) to 1 (all at one azimuth, or at m evenly spaced ones); nan where nothing
  /// moves. n balls that move alike at random azimuths show about 1 / sqrt(n).
  double asymmetry(int m) const;
  /// An azimuth at which mode m >= 1 is largest [rad], from -pi / m to pi / m.
  double direction(int m) const;
};

/// The flux through the plane at height z [m] in modes 0 to `highest`; density of the balls themselves [kg/m3]. A moment
/// is noisy: average over time (the sums, not the ratios). Throws InputError unless density > 0 and highest >= 0.
Flux flux_through(const core::State& state, double density, double z, int highest);

/// Mean downward velocity [m/s] of the content above the outlet plane (z > 0), by mass: the speed with which it would sink
/// as one body at the same momentum. Zero without content.
double mean_flux_speed(const core::State& state);

/// Shares of the mass above the outlet plane (z > 0); what is left moves in between.
struct Motion {
  double intensive = 0.0;
  double at_rest = 0.0;
};

/// Content whose speed (in all directions) is above `intensive_above` and below `rest_below` [m/s]. Take them as stated
/// shares of a mean flux speed, that of the moment or, for a time series with stoppages, that of the whole discharge.
/// Speeds of a moment are those of the flow and of the jitter, mean_motion (velocity.hpp) leaves the flow.
/// Both zero without content. Throws InputError unless 0 <= rest_below <= intensive_above.
Motion motion(const core::State& state, double intensive_above, double rest_below);

}  // namespace grainclock::silo
