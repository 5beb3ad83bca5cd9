// The classical test of multi-rate schemes: a light ball on a stiff spring, between fixed balls, and a heavier ball that
// rests on it softly. Linear for small swings, so that theory is one matrix per scheme.
#pragma once

#include "multirate/stepper.hpp"
#include "tests/support/cage.hpp"

#include <Eigen/Eigenvalues>

namespace grainclock::tests {

/// Deviations from equilibrium: light ball's place and velocity, heavy ball's.
using Swing = Eigen::Vector4d;

struct TwoSprings {
  static constexpr double kHeavy = 8.0;     // kg; the light one 1 kg
  static constexpr double kWall = 1e6;      // N/m
  static constexpr double kOverlap = 2e-3;  // m, of each of the six wall contacts: no swing opens them
  static constexpr double kDistance = 1.2 * kUnitRadius - kOverlap;             // m, to their fixed balls
  static constexpr double kStiff = kWall * (2.0 - 4.0 * kOverlap / kDistance);  // N/m; those across push outwards
  static constexpr double kSoft = 0.1 * kWall;                                  // N/m
  static constexpr double kPressed = 1e-5;                                      // m, overlap of the soft contact at rest
  core::Vec3 up = core::Vec3(1.0, 1.0, 1.0).normalized();
  core::State rest;
  core::StepperSetup setup;

  explicit TwoSprings(core::Interface interface) {
    setup.gravity = -kPressed * kSoft / kHeavy * up;
    setup.materials.density = kUnitMass;
    setup.materials.ball = {kSoft, 0.0};
    setup.materials.wall = {kWall, 0.0};
    setup.materials.tension = true;
    setup.stepping.interface = interface;
    setup.stepping.events = false;
    setup.stepping.tolerance = 1e3;  // levels from stability alone
    setup.stepping.limiter = 7;
    rest.add(0, core::Kind::content, core::Vec3::Zero(), core::Vec3::Zero(), kUnitRadius);
    rest.add(1, core::Kind::content, (3.0 * kUnitRadius - kPressed) * up, core::Vec3::Zero(), 2.0 * kUnitRadius);
    for (int k = 0; k < 6; ++k) {
      const core::Vec3 at = (k % 2 == 0 ? kDistance : -kDistance) * core::Vec3::Unit(k / 2);
      rest.add(2 + static_cast<core::BallId>(k), core::Kind::wall, at, core::Vec3::Zero(), 0.2 * kUnitRadius);
    }
  }

  /// Gives both springs a dashpot of this damping ratio.
  void damp(double ratio) {
    setup.materials.wall.c = 2.0 * ratio * std::sqrt(0.5 * kWall);
    setup.materials.ball.c = 2.0 * ratio * std::sqrt(kSoft * kHeavy / (1.0 + kHeavy));
  }
  /// Circular frequency of the light ball on the stiff spring [1/s].
  static double stiff_frequency() { return std::sqrt(kStiff); }
  /// Time [s] in which the stiff spring passes through this phase [rad].
  static double step_of(double phase) { return phase / stiff_frequency(); }
  static double stiff_force(const Swing& s) { return -kStiff * s[0]; }
  static double soft_force(const Swing& s) { return kSoft * (s[2] - s[0]); }  // on the light ball

  std::unique_ptr<core::Stepper> stepper(const Swing& swing, double step) {
    core::State start = rest;
    for (const std::size_t b : {0U, 1U}) {
      start.position[b] += swing[2 * static_cast<int>(b)] * up;
      start.velocity[b] += swing[2 * static_cast<int>(b) + 1] * up;
    }
    setup.stepping.step = step;
    return multirate::make_multirate_stepper(start, setup);
  }
  Swing swing(const core::Stepper& stepper) const {
    const core::State now = stepper.state();
    return {(now.position[0] - rest.position[0]).dot(up), now.velocity[0].dot(up),
            (now.position[1] - rest.position[1]).dot(up), now.velocity[1].dot(up)};
  }
};

/// log of the largest modulus of an eigenvalue of a coarse step, a linear map of swings: the growth per step.
template <class Step>
double growth_of(Step step) {
  // In units in which all entries are of a size.
  const double place = 1e-7;  // m, small against every overlap
  const Swing unit = place * Swing(1.0, TwoSprings::stiff_frequency(), 1.0, TwoSprings::stiff_frequency());
  Eigen::Matrix4d map;
  for (int k = 0; k < 4; ++k) map.col(k) = step(Swing(unit[k] * Swing::Unit(k))).cwiseQuotient(unit);
  return std::log(map.eigenvalues().cwiseAbs().maxCoeff());
}

/// The same of a stepper's first coarse step of `step` [s]. A scheme need not have its equilibrium where the forces
/// have theirs: what it makes of no swing is taken away.
inline double measured_growth(TwoSprings& springs, double step) {
  const auto after = [&](const Swing& swing) {
    const auto stepper = springs.stepper(swing, step);
    stepper->advance(1);
    return springs.swing(*stepper);
  };
  const Swing none = after(Swing::Zero());
  return growth_of([&](const Swing& swing) { return Swing(after(swing) - none); });
}

}  // namespace grainclock::tests
