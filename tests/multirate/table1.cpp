// The selective stepper at the size that studies use: the paper's silo, 22,741 balls.
#include "multirate/stepper.hpp"
#include "silo/filling.hpp"
#include "silo/phases.hpp"

#include <gtest/gtest.h>

#include <algorithm>

namespace grainclock::multirate {
namespace {

/// The silo some time into a rough fill, then opened with its true stiffness: lively and dense enough for every level.
core::State poured_silo() {
  silo::SiloShape shape;
  shape.collar = 14.0;
  silo::Silo built = silo::build_silo(shape, 1);
  core::StepperSetup setup;
  setup.stepping.method = core::Method::uniform;
  setup.stepping.events = false;
  setup.stepping.step = 2e-4;
  setup.materials.ball.c = 3e4;
  setup.materials.wall = {1e8, 9e4};
  setup.first_impact = true;
  setup.threads = 2;
  const auto stepper = core::make_uniform_stepper(built.state, setup);
  stepper->advance(15000);  // 3 s
  return silo::fresh(stepper->state());
}

TEST(SlowTable1, MomentumIsExactNothingIsMissedAndThreadsAndSkinsDoNotChangeABit) {
  const core::State start = poured_silo();
  core::StepperSetup setup;
  setup.outlet_open = true;
  setup.domain.outlet_z = -0.5;
  setup.stepping.step = 3.2e-4;
  setup.stepping.tolerance = 1e-4;
  core::State first;
  for (const int threads : {1, 2}) {
    for (const double skin : {0.0, 0.02}) {  // m
      setup.threads = threads;
      setup.skin = skin;
      const auto stepper = make_multirate_stepper(start, setup);
      const core::Energies before = stepper->energies();
      stepper->advance(1200);  // long enough for the first balls to leave
      // Rounding of 22,741 velocities over some thousand steps each.
      EXPECT_LE(momentum_residual(before, stepper->energies(), stepper->ledger()), 1e-12);
      EXPECT_EQ(stepper->costs().missed_contacts, 0U);
      EXPECT_GT(stepper->ledger().discharged, 0);
      const core::State now = stepper->state();
      if (first.size() == 0) {
        first = now;
        const core::LevelStatistics levels = stepper->level_statistics();
        EXPECT_GE(std::count_if(levels.balls.begin(), levels.balls.end(), [](double n) { return n > 0.0; }), 4);
        continue;
      }
      ASSERT_EQ(now.size(), first.size());
      for (std::size_t i = 0; i < now.size(); ++i) {
        ASSERT_EQ(now.position[i], first.position[i]) << "ball " << now.id[i] << ", " << threads << " threads, skin " << skin;
        ASSERT_EQ(now.velocity[i], first.velocity[i]) << "ball " << now.id[i] << ", " << threads << " threads, skin " << skin;
      }
    }
  }
}

}  // namespace
}  // namespace grainclock::multirate
