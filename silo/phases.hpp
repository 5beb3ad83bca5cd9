// How a scene begins, and what its phases ask of a stepper: no stepping yet.
#pragma once

#include "core/scene.hpp"
#include "core/stepper.hpp"

#include <optional>
#include <string>

namespace grainclock::silo {

/// The balls that a scene begins with.
struct Start {
  core::State state;
  core::BallId first_collar = -1;  // ids from here on are the collar of a filling; -1: there is none
};

/// Reads the initial state, or builds the silo and hangs its fill. Throws InputError (also without content), FileError.
Start start_of(const core::Scene& scene);

/// The state as a new phase sees it: nothing is left of how it was stepped.
core::State fresh(core::State state);

/// The start state as if the scene's phase `k` began with it: a gate that shuts later than at the start has cut off the
/// balls in its way.
core::State as_if_begun(const core::Scene& scene, std::size_t k, const core::State& start);

/// The setup of a phase that begins with this state; its step is `every` over a whole number. With fallback its method
/// is uniform where selective steps are not predicted to pay. Throws InputError.
core::StepperSetup phase_setup(const core::Scene& scene, const core::Phase& phase, const core::State& state, int threads);

/// Mean over the content: radius [m], and mass [kg] of a ball of that radius.
struct MeanBall {
  double radius = 0.0, mass = 0.0;
};
MeanBall mean_ball(const core::State& state, const core::Materials& materials);

/// What the end of a phase is judged by, from check to check; restart needs all of it.
struct Watch {
  std::int64_t slow_since = -1;        // step of the phase since which it has been creeping at most; -1: it flows
  std::int64_t rest_since = -1;        // step of the phase since which it has been at rest; -1: it moves
  std::int64_t discharged_before = 0;  // of the ledger, at the phase's start
  std::int64_t content_before = 0;     // at the phase's start
  std::int64_t discharged_last = 0;    // of the ledger, at the last check
  std::int64_t left_last = 0;          // step of the phase at which the last ball was seen to have left
};

/// Judges the state at a check after `steps` steps of `step` [s], by its kinetic energy [J] and the count of balls that
/// left; gives the reason where the phase is over.
/// Rest: kinetic energy per ball below 1e-6 m g r for 0.1 s. A permanent arch (for 5 s nothing left
/// and kinetic energy per ball below 5e-3 m g r) ends a phase that waits for a discharge.
std::optional<std::string> phase_end(const core::Phase& phase, const MeanBall& mean, double gravity, double step, std::int64_t steps,
                                     double kinetic_energy, std::int64_t discharged, Watch& watch);

}  // namespace grainclock::silo
