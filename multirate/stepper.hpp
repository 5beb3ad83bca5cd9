// The selective stepper: each ball steps by its own power-of-two fraction of the coarsest step.
#pragma once

#include "core/stepper.hpp"

namespace grainclock::multirate {

/// Throws InputError where a key combination is not offered (names the key and what is).
std::unique_ptr<core::Stepper> make_multirate_stepper(const core::State& state, const core::StepperSetup& setup);

/// The stepper that `setup.stepping.method` asks for.
std::unique_ptr<core::Stepper> make_stepper(const core::State& state, const core::StepperSetup& setup);

/// Coarsest step [s] for stepping without a given `step`, from the stability of the state.
double default_step(const core::State& state, const core::StepperSetup& setup);

}  // namespace grainclock::multirate
