// Error against cost: every method of a study from every start state, judged by a converged reference.
#pragma once

#include "benchmarks/study_kind.hpp"

#include <memory>
#include <string>

namespace grainclock::benchmarks {

/// A study of `kind = "trajectories"`. Tables: `study`, a row per point; with [divergence] also `divergence`, the separation
/// from a perturbed copy over time, and `horizon`, its rate and the time until which errors can be trusted.
/// Throws FileError, or InputError with file:line, value and remedy; also for keys that no stepper offers together.
std::unique_ptr<StudyKind> read_trajectories_study(const std::string& path, int threads);

}  // namespace grainclock::benchmarks
