// What several runs of one scene (seeds) tell together: the paper's complaint a) that envelopes of pressures take too many
// passes.
#pragma once

#include "silo/confidence.hpp"

#include <vector>

namespace grainclock::silo {

/// Values of several runs at one time, or in one layer.
struct Spread {
  double min = 0.0, max = 0.0;  // nan without values
  Interval mean;                // with the 95 % interval of the mean (not of a single run) by Student's t
};

/// Spread of independent values; nan is an unknown one and left out.
Spread spread(const std::vector<double>& values);

/// Spread over runs at each place of a series or profile: runs[run][place], values at the same times or layers in each run.
/// What a run does not know (it was over by then) is nan there. Throws InputError without runs or if they differ in length.
std::vector<Spread> envelope(const std::vector<std::vector<double>>& runs);

}  // namespace grainclock::silo
