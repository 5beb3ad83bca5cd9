// What one method saves against another at equal error. Pure functions.
#pragma once

#include <optional>
#include <vector>

namespace grainclock::benchmarks {

/// One point of a chart; both above zero.
struct ErrorAtCost {
  double error;
  double cost;
};

/// Cost at which `baseline` reaches this error, each at its own best: interpolated log-log along the points
/// that no other beats in both error and cost. At an error above all of theirs it is the cheapest point's
/// cost, since the baseline cannot run cheaper; below all of theirs it is unknown: nothing.
std::optional<double> cost_at(double error, const std::vector<ErrorAtCost>& baseline);

/// cost_at(point.error) over point.cost; nothing where that is unknown.
std::optional<double> gain(const ErrorAtCost& point, const std::vector<ErrorAtCost>& baseline);

}  // namespace grainclock::benchmarks
