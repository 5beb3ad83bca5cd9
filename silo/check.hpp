// What a scene will ask of its stepping, before it runs.
#pragma once

#include "core/scene.hpp"
#include "core/stepper.hpp"
#include "silo/report.hpp"

namespace grainclock::silo {

/// A phase that would begin with this state: the terms that are on, damping ratios, restitution, collision times,
/// critical steps, dt/dt_crit with warnings, and for multi-rate the levels, the predicted gains and whether it will pay.
Report phase_report(const core::Phase& phase, const core::State& state, const core::StepperSetup& setup);

/// The whole scene with its start state: balls, every phase, and a guess of time and memory from a few steps on a
/// stepper that is thrown away. Throws InputError for key combinations that are not offered.
Report check_scene(const core::Scene& scene, int threads);

}  // namespace grainclock::silo
