// What any selective run of the flowing silo must do: keep its momentum, go on from a checkpoint as if nothing had been,
// and be the uniform stepper where there is one level.
#pragma once

#include "multirate/stepper.hpp"
#include "tests/support/packing.hpp"

#include <gtest/gtest.h>

#include <memory>

namespace grainclock::tests {

/// Runs a flowing silo for `pieces` of one to three coarse steps. Expects momentum to be exact to rounding after each of
/// them, balls to leave, and no contact to be missed.
inline void expect_exact_momentum(core::Stepper& stepper, int pieces) {
  const core::Energies before = stepper.energies();
  for (int k = 0; k < pieces; ++k) {
    stepper.advance(1 + k % 3);
    // Rounding: of each velocity at each of its kicks, 1e-16 of m v, against impulses of the same size.
    ASSERT_LE(core::momentum_residual(before, stepper.energies(), stepper.ledger()), 1e-12)
        << "step " << stepper.steps_done();
  }
  EXPECT_GT(stepper.ledger().discharged, 3);
  EXPECT_EQ(stepper.costs().missed_contacts, 0U);
}

/// Goes on to a time at which a checkpoint may be taken.
inline void to_checkpoint(core::Stepper& stepper) {
  for (int k = 0; k < 2 * renew_every(stepper) && !stepper.is_checkpointable(); ++k) stepper.advance(1);
  ASSERT_TRUE(stepper.is_checkpointable());
}

/// What continues from a checkpoint.
inline std::unique_ptr<core::Stepper> resumed(const core::Stepper& from, core::StepperSetup setup) {
  setup.ledger = from.ledger();
  setup.costs = from.costs();
  setup.steps_done = from.steps_done();
  return multirate::make_multirate_stepper(from.state(), setup);
}

/// Expects a run of the flowing silo that goes on from a checkpoint, after 60 coarse steps or a few more, to be 60 later
/// where a run without a break is.
inline void expect_restarts_bitwise(const core::StepperSetup& setup) {
  const auto whole = multirate::make_multirate_stepper(flowing_silo(), setup),
             first = multirate::make_multirate_stepper(flowing_silo(), setup);
  first->advance(60);
  to_checkpoint(*first);
  const auto second = resumed(*first, setup);
  second->advance(60);
  whole->advance(second->steps_done());
  expect_same_bits(whole->state(), second->state());
}

/// Expects 400 steps of the flowing silo with a single level to be those of the uniform stepper.
inline void expect_one_level_is_uniform(const core::StepperSetup& setup) {
  core::StepperSetup one = setup, uniform = setup;
  one.stepping.levels = 1;
  uniform.stepping.method = core::Method::uniform;
  const auto a = multirate::make_multirate_stepper(flowing_silo(), one);
  const auto b = core::make_uniform_stepper(flowing_silo(), uniform);
  a->advance(400);
  b->advance(400);
  expect_same_bits(a->state(), b->state());
}

}  // namespace grainclock::tests
