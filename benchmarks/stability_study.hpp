// A study of kind "stability": where the steppers stop being stable, against theory and against our bound, and how
// selective steps grow on chains. Keys: benchmarks/stability.toml.
//
// Tables: `stability` (limits), `stability_map` (growth per step over step and damping ratio) and `growth` (selective
// steps). Steps without a unit are over the undamped critical step 2 / omega_max of the system, for `growth` over
// sqrt(m / k) of the chain's balls, which is the same.
#pragma once

#include "benchmarks/study_kind.hpp"

#include <memory>
#include <string>

namespace grainclock::benchmarks {

/// Throws as make_study(). The systems are too small for more than one thread: `threads` goes into the provenance only.
std::unique_ptr<StudyKind> read_stability_study(const std::string& path, int threads);

}  // namespace grainclock::benchmarks
