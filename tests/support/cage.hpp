// Small multi-rate systems with smooth, closed contacts and a fixed split of levels.
#pragma once

#include "multirate/stepper.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <vector>

namespace grainclock::tests {

constexpr double kUnitRadius = 0.1;  // m
constexpr double kUnitMass =
    3.0 / (4.0 * std::numbers::pi * kUnitRadius * kUnitRadius * kUnitRadius);  // kg/m3, for balls of 1 kg

inline std::vector<int> levels_of(const core::Stepper& stepper) {
  const core::State state = stepper.state();
  std::vector<int> out;
  for (std::size_t i = 0; i < state.size(); ++i)
    if (state.kind[i] == core::Kind::content) out.push_back(state.level[i]);
  return out;
}

/// A ball circles between six stiff fixed ones, so that it is always fast at one of them; a soft column rests
/// on it along n. Every contact stays closed and, with tension, smooth.
struct Cage {
  static constexpr int kColumn = 3;
  static constexpr double kCoarsest = 4e-4;  // s, the largest coarse step; the circling ball's period is 6.3 ms
  static constexpr double kOverlap = 2e-3, kOrbit = 5e-4;  // m
  double tolerance = 2.3e-4;  // at the largest step: the circling ball at level 0, the column at the coarsest

  core::State start;
  core::StepperSetup setup;

  Cage() {
    constexpr double k_wall = 5e5, k_ball = k_wall / 3600.0;  // N/m
    const double w = std::sqrt(2.0 * k_wall);                 // 1/s, two wall contacts along each axis, 1 kg
    setup.materials.density = kUnitMass;
    setup.materials.wall = {k_wall, 0.01 * w};
    setup.materials.ball = {k_ball, 0.2 * std::sqrt(k_ball)};
    setup.materials.tension = true;
    const core::Vec3 n = core::Vec3(1.0, 1.0, 1.0).normalized();
    setup.gravity = -k_ball * kOverlap / kColumn * n;  // presses the lowest contact of the column by kOverlap
    setup.stepping.levels = 4;
    setup.stepping.limiter = 2;

    start.add(0, core::Kind::content, core::Vec3(kOrbit, 0.0, 0.0), core::Vec3(0.0, kOrbit * w, 0.0), kUnitRadius);
    double along = 0.0;
    for (int k = 0; k < kColumn; ++k) {
      along += 2.0 * kUnitRadius - kOverlap * (kColumn - k) / kColumn;
      start.add(k + 1, core::Kind::content, along * n, core::Vec3::Zero(), kUnitRadius);
    }
    core::BallId id = kColumn + 1;
    for (int axis = 0; axis < 3; ++axis)
      for (const double side : {-1.0, 1.0}) {
        core::Vec3 at = core::Vec3::Zero();
        at[axis] = side * (1.2 * kUnitRadius - kOverlap);
        start.add(id++, core::Kind::wall, at, core::Vec3::Zero(), 0.2 * kUnitRadius);
      }
  }

  /// Steps may be as long as the root of the tolerance: these two keep the split of levels.
  void divide(int division) {
    setup.stepping.step = kCoarsest / division;
    setup.stepping.tolerance = tolerance / (division * division);
  }
};

/// Errors of a cage's balls and of the energy, at coarse steps that halve.
struct CageErrors {
  static constexpr int kBalls = 1 + Cage::kColumn;
  std::vector<double> steps, energy;                           // s; relative to what was turned over
  std::array<std::vector<double>, kBalls> position, velocity;  // m, m/s

  const std::vector<double>& circling() const { return position[0]; }
  const std::vector<double>& resting() const { return position[1]; }  // on the circling one
};

/// Runs the cage with each of the steps over 19 ms. `split`: levels that the balls must keep, with every contact closed.
inline CageErrors cage_errors(Cage cage, const std::vector<int>& split) {
  constexpr int kSteps = 48;
  core::StepperSetup fine = cage.setup;
  fine.stepping.method = core::Method::uniform;
  fine.stepping.step = Cage::kCoarsest / 512.0;  // error below a thousandth of the finest one measured
  const auto reference = core::make_uniform_stepper(cage.start, fine);
  reference->advance(kSteps * 512);
  const core::State truth = reference->state();
  CageErrors errors;
  for (const int division : {1, 2, 4, 8}) {
    cage.divide(division);
    const auto stepper = multirate::make_multirate_stepper(cage.start, cage.setup);
    const core::Energies before = stepper->energies();
    for (int k = 0; k < kSteps * division; ++k) {
      EXPECT_EQ(levels_of(*stepper), split) << "coarse step " << k << " of " << kSteps * division;
      EXPECT_EQ(stepper->contacts().size(), 6U + Cage::kColumn);
      stepper->advance(1);
    }
    const core::State end = stepper->state();
    errors.steps.push_back(*cage.setup.stepping.step);
    for (std::size_t b = 0; b < CageErrors::kBalls; ++b) {
      errors.position[b].push_back((end.position[b] - truth.position[b]).norm());
      errors.velocity[b].push_back((end.velocity[b] - truth.velocity[b]).norm());
    }
    errors.energy.push_back(core::energy_residual(before, stepper->energies(), stepper->ledger()));
  }
  return errors;
}

}  // namespace grainclock::tests
