// Statistics over seeds: discharge, stoppages and wall pressures of long runs, where trajectories cannot be compared.
#pragma once

#include "benchmarks/study_kind.hpp"

#include <memory>
#include <string>

namespace grainclock::benchmarks {

/// A study of `kind = "statistics"`: every method from every start state (seed) through the scene's first phase. Tables:
/// `statistics`, a row per method, start and measure; `statistics_summary`, mean and 95 % interval over the starts, and the
/// interval of the difference to the baseline (Welch); `statistics_runs`, a row per run with its costs and residuals.
/// Throws FileError, or InputError with file:line, value and remedy; also for keys that no stepper offers together.
std::unique_ptr<StudyKind> read_statistics_study(const std::string& path, int threads);

}  // namespace grainclock::benchmarks
