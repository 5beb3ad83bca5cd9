#include "multirate/cost_model.hpp"

#include "multirate/stepper.hpp"

#include <cmath>

namespace grainclock::multirate {

Prediction predict(const core::State& state, const core::StepperSetup& setup) {
  // A stepper classifies when it is made; nothing is run.
  const core::LevelStatistics counts = make_multirate_stepper(state, setup)->level_statistics();
  Prediction out;
  double contacts = 0.0, weighted = 0.0;
  const std::size_t levels = counts.step.size();
  std::size_t finest = 0;
  while (finest + 1 < levels && counts.balls[finest] == 0.0) ++finest;
  for (std::size_t l = finest; l < levels; ++l) {
    out.step.push_back(counts.step[l]);
    out.balls.push_back(std::llround(counts.balls[l]));
    out.contacts.push_back(std::llround(counts.contacts[l]));
    contacts += counts.contacts[l];
    weighted += std::ldexp(counts.contacts[l], -static_cast<int>(l - finest));
  }
  if (weighted <= 0.0) return out;
  out.ideal_gain = contacts / weighted;
  // Per coarse step: every level at its own rate; at a regular renewal the last evaluation is one of all listed pairs.
  const double fine_steps = std::ldexp(1.0, static_cast<int>(levels - 1 - finest));
  const double evaluations = weighted * fine_steps + (counts.listed - contacts) * counts.renewals;
  out.gain = counts.listed * fine_steps / evaluations;
  return out;
}

}  // namespace grainclock::multirate
