// Error measures between two runs or states.
#pragma once

#include "silo/report.hpp"

#include <optional>
#include <string>

namespace grainclock::benchmarks {

struct CompareOptions {
  std::optional<double> at;          // s; default: the last frame that both have
  std::optional<std::string> start;  // state that both began with; default: the reference's first frame, if it is a run
};

/// Errors of `path` against the reference: runs, checkpoints or states (.h5, .csv). Throws InputError where the two
/// have no moment or no balls in common, FileError.
silo::Report compare(const std::string& path, const std::string& reference, const CompareOptions& options);

}  // namespace grainclock::benchmarks
