#include "silo/flux.hpp"

#include "core/check.hpp"

#include <cmath>
#include <limits>
#include <numbers>

namespace grainclock::silo {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

bool is_above_outlet(const core::State& state, std::size_t ball) {
  return state.kind[ball] == core::Kind::content && state.position[ball][2] > 0.0;
}

/// Mass but for the density's 4 pi / 3, which drops out of shares and means.
double weight(const core::State& state, std::size_t ball) {
  return state.radius[ball] * state.radius[ball] * state.radius[ball];
}

}  // namespace

double Flux::asymmetry(int m) const {
  return turnover > 0.0 ? std::abs(modes.at(static_cast<std::size_t>(m))) / turnover : kUnknown;
}

double Flux::direction(int m) const {
  GC_REQUIRE(m >= 1, "direction of azimuthal mode {}: modes from 1 on have one", m);
  return std::arg(modes.at(static_cast<std::size_t>(m))) / m;
}

Flux flux_through(const core::State& state, double density, double z, int highest) {
  GC_REQUIRE(density > 0.0 && highest >= 0,
             "flux of a density of {} kg/m3 in azimuthal modes up to {}: need a density above 0 and modes from 0", density,
             highest);
  Flux flux;
  flux.modes.assign(static_cast<std::size_t>(highest) + 1, 0.0);
  Eigen::Vector2d moment = Eigen::Vector2d::Zero();  // kg m/s, of what moves down
  double down = 0.0;                                 // kg/s
  for (std::size_t ball = 0; ball < state.size(); ++ball) {
    if (state.kind[ball] != core::Kind::content) continue;
    const core::Vec3& x = state.position[ball];
    const double r = state.radius[ball], off = z - x[2];
    if (std::abs(off) >= r) continue;
    const double q = -density * std::numbers::pi * (r - off) * (r + off) * state.velocity[ball][2];
    flux.modes[0] += q;
    flux.turnover += std::abs(q);
    if (const std::complex<double> from_axis(x[0], x[1]); from_axis != 0.0) {
      const std::complex<double> turn = from_axis / std::abs(from_axis);
      std::complex<double> power = q;
      for (std::size_t m = 1; m < flux.modes.size(); ++m) {
        power *= turn;
        flux.modes[m] += power;
      }
    }
    if (q > 0.0) {
      down += q;
      moment += q * x.head<2>();
    }
  }
  if (down > 0.0)
    flux.centroid = moment / down;
  else
    flux.centroid.setConstant(kUnknown);
  return flux;
}

double mean_flux_speed(const core::State& state) {
  double mass = 0.0, momentum = 0.0;
  for (std::size_t ball = 0; ball < state.size(); ++ball) {
    if (!is_above_outlet(state, ball)) continue;
    mass += weight(state, ball);
    momentum -= weight(state, ball) * state.velocity[ball][2];
  }
  return mass > 0.0 ? momentum / mass : 0.0;
}

Motion motion(const core::State& state, double intensive_above, double rest_below) {
  GC_REQUIRE(0.0 <= rest_below && rest_below <= intensive_above,
             "content in motion above {} m/s and at rest below {} m/s: the latter must be from 0 to the former",
             intensive_above, rest_below);
  double mass = 0.0;
  Motion found;
  for (std::size_t ball = 0; ball < state.size(); ++ball) {
    if (!is_above_outlet(state, ball)) continue;
    const double its = weight(state, ball), speed = state.velocity[ball].norm();
    mass += its;
    if (speed > intensive_above) found.intensive += its;
    if (speed < rest_below) found.at_rest += its;
  }
  if (mass > 0.0) found = {found.intensive / mass, found.at_rest / mass};
  return found;
}

}  // namespace grainclock::silo
