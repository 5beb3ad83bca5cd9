// What selective stepping should buy, before and after it ran.
//
// Evaluations are counted on a short trial: the histogram of levels tells what they cost at their own rates, but not how
// often classes are renewed early, lists are made anew, or balls leave, each of which costs evaluations of all listed pairs.
//
// Time: pairs, balls, sweeps and renewals have prices, fitted to clocks on the scenes of benchmarks/ (README.md there).
// Small scenes pay mostly for sweeps over thin levels and for renewals.
#pragma once

#include "core/stepper.hpp"

namespace grainclock::multirate {

/// In units of one pair's evaluation in uniform steps with events.
struct Prices {
  double pair, ball;  // of each evaluation of a pair; of each step of a ball
  double call;        // of each uniform step, step of a level, or renewal, however small
};
constexpr Prices kUniformPrices{1.0, 1.2, 15.0};
constexpr Prices kSelectivePrices{2.1, 1.1, 10.0};
constexpr Prices kRenewalPrices{4.4, 9.6, 1600.0};  // of every listed pair and every ball

/// What was counted on a trial.
struct Trial {
  std::int64_t steps;  // coarsest ones, or uniform ones
  double evaluated;    // contact evaluations per step, everything included
};

/// Uniform steps with events that selective ones are compared with.
struct UniformSteps {
  double step;  // s
  Trial trial;
};

struct Prediction {
  std::vector<double> step;             // s, per level; level 0 is the finest used
  std::vector<std::int64_t> balls;      // per level
  std::vector<std::int64_t> contacts;   // per level, evaluated at it
  double ideal_gain = 1.0;   // contacts / sum over contacts of 2^-(levels above the finest)
  double uniform_step = 0.0; // s, of uniform steps with events that should be as accurate
  double gain = 1.0;         // contact evaluations of those over those of selective steps
  double wall_gain = 1.0;    // the same of wall clock
  std::int64_t tried = 0;    // coarsest steps of the trial
};

/// The gains that selective steps bring which ended a trial with these levels.
Prediction price(const core::LevelStatistics& levels, const Trial& selective, const UniformSteps& uniform);

/// Steps through a few renewals, selectively and uniformly, on steppers that are thrown away, and prices what is counted there.
/// A state in which most is still to happen, as before a filling, tells little of what follows.
Prediction predict(const core::State& state, const core::StepperSetup& setup);

/// Whether selective steps are expected to take less wall clock than uniform ones with events of the same accuracy.
inline bool pays(const Prediction& prediction) { return prediction.wall_gain >= 1.0; }

/// The longest uniform step [s] that the classes' expected error allows at the tolerance of `setup`; at most the coarsest
/// step and what uniform steps take without a given one.
double equally_accurate_step(const core::State& state, const core::StepperSetup& setup);

}  // namespace grainclock::multirate
