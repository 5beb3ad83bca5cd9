// Balls of many sizes that fall together in empty space, turning: nothing acts from outside, so angular momentum should
// stay.
#pragma once

#include "multirate/stepper.hpp"
#include "tests/support/cage.hpp"
#include "tests/support/packing.hpp"

namespace grainclock::tests {

struct SpinningCloud {
  core::State start;
  core::StepperSetup setup;

  explicit SpinningCloud(core::Interface interface) {
    setup.gravity = core::Vec3::Zero();
    setup.materials.ball = {1e6, 2e3};
    setup.stepping.interface = interface;
    setup.stepping.events = false;
    Random random(5);
    constexpr double kSpacing = 0.32;  // m
    core::BallId id = 0;
    for (int x = -2; x <= 2; ++x)
      for (int y = -2; y <= 2; ++y)
        for (int z = -2; z <= 2; ++z) {
          const core::Vec3 at = kSpacing * core::Vec3(x, y, z) + random.in_cube(0.02);
          start.add(id++, core::Kind::content, at, core::Vec3(0.0, 0.0, 1.0).cross(at) - 1.5 * at,
                    random.between(0.05, 0.13));
        }
  }
  double mass(std::size_t ball) const { return setup.materials.mass(start.radius[ball]); }
  core::Vec3 angular_momentum(const core::State& state) const {
    core::Vec3 sum = core::Vec3::Zero();
    for (std::size_t b = 0; b < state.size(); ++b) sum += mass(b) * state.position[b].cross(state.velocity[b]);
    return sum;
  }
  /// Change of angular momentum over 0.2 s, relative to what it was; `step` [s] is the coarsest one.
  double defect(double step) {
    setup.stepping.step = step;
    const auto stepper = multirate::make_multirate_stepper(start, setup);
    const core::Vec3 before = angular_momentum(stepper->state());
    bool mixed = false;
    for (std::int64_t k = 0; k < std::llround(0.2 / step); ++k) {
      stepper->advance(1);
      const std::vector<int> levels = levels_of(*stepper);
      for (const core::Contact& c : stepper->contacts()) mixed = mixed || levels[c.i] != levels[c.j];
    }
    EXPECT_TRUE(mixed) << "no contact between levels";
    EXPECT_GT(stepper->ledger().dissipated, 0.03 * stepper->energies().kinetic) << "few collisions";
    return (angular_momentum(stepper->state()) - before).norm() / before.norm();
  }
};

}  // namespace grainclock::tests
