// Dense scenes of a few hundred balls, made once per test program.
#pragma once

#include "core/stepper.hpp"
#include "silo/filling.hpp"
#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace grainclock::tests {

/// The paper's dampable materials: stiff wall, damping ratio about a half.
inline core::Materials silo_materials() { return {}; }

/// A small silo of fixed shape, its outlet wide enough not to clog.
inline silo::SiloShape small_shape() {
  silo::SiloShape shape;
  shape.half_width = 1.3;
  shape.height = 4.5;
  shape.hopper_height = 0.8;
  shape.half_outlet = 0.8;
  shape.balls = 300;
  shape.surface = silo::Surface::inner;
  shape.collar = 6.0;
  return shape;
}

/// Stepping of the small silo; the step [s] is the coarsest one of multirate.
inline core::StepperSetup silo_setup(core::Method method, double step, bool open) {
  core::StepperSetup setup;
  setup.materials = silo_materials();
  setup.domain.outlet_z = -0.5;
  setup.domain.lower = core::Vec3(-3.0, -3.0, -3.0);
  setup.domain.upper = core::Vec3(3.0, 3.0, 15.0);
  setup.stepping.method = method;
  setup.stepping.step = step;
  setup.outlet_open = open;
  return setup;
}

/// What a stepper left, as the start of another run.
inline core::State fresh(core::State state) {
  state.evaluated_position.clear();
  state.evaluated_velocity.clear();
  state.level.clear();
  state.impacted.clear();
  return state;
}

/// The silo filled and nearly at rest.
inline const core::State& resting_silo() {
  static const core::State state = [] {
    silo::Silo built = silo::build_silo(small_shape(), 1);
    core::StepperSetup soft = silo_setup(core::Method::uniform, 2e-4, false);
    soft.materials.wall = {1e8, 9e4};
    soft.materials.ball.c = 3e4;
    soft.first_impact = true;
    const auto filling = core::make_uniform_stepper(built.state, soft);
    filling->advance(10000);
    core::State filled = fresh(filling->state());
    silo::remove_collar(filled, built.first_collar);
    const auto resting = core::make_uniform_stepper(filled, silo_setup(core::Method::uniform, 1e-4, false));
    resting->advance(10000);
    return fresh(resting->state());
  }();
  return state;
}

/// The same 0.4 s after opening: balls fall, collide and leave through the outlet.
inline const core::State& flowing_silo() {
  static const core::State state = [] {
    const auto opening = core::make_uniform_stepper(resting_silo(), silo_setup(core::Method::uniform, 1e-4, true));
    opening->advance(4000);
    return fresh(opening->state());
  }();
  return state;
}

/// Coarse steps between regular renewals of a selective stepper's classes.
inline int renew_every(const core::Stepper& stepper) { return stepper.level_statistics().renew_every; }

/// Expects the same balls at the same positions with the same velocities, bit for bit.
inline void expect_same_bits(const core::State& a, const core::State& b) {
  ASSERT_EQ(a.id, b.id);
  std::size_t different = 0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (a.position[i] == b.position[i] && a.velocity[i] == b.velocity[i]) continue;
    if (different++ == 0) {
      ADD_FAILURE() << "ball " << a.id[i] << ": " << a.position[i].transpose() << " or " << b.position[i].transpose()
                    << " m, " << a.velocity[i].transpose() << " or " << b.velocity[i].transpose() << " m/s";
    }
  }
  EXPECT_EQ(different, 0U) << "of " << a.size() << " balls";
}

}  // namespace grainclock::tests
