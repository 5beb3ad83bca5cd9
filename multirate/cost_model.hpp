// What selective stepping should buy, before and after it ran.
#pragma once

#include "core/stepper.hpp"

namespace grainclock::multirate {

struct Prediction {
  std::vector<double> step;             // s, per level; level 0 is the finest used
  std::vector<std::int64_t> balls;      // per level
  std::vector<std::int64_t> contacts;   // per level, evaluated at it
  double ideal_gain = 1.0;   // contacts / sum over contacts of 2^-(levels above the finest)
  double gain = 1.0;         // the same with classification sweeps charged: contact evaluations of a uniform
                             // run at the finest used step over those of this one
};

/// Classifies the state once and counts; runs nothing.
Prediction predict(const core::State& state, const core::StepperSetup& setup);

}  // namespace grainclock::multirate
