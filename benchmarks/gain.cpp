#include "benchmarks/gain.hpp"

#include <algorithm>
#include <cmath>

namespace grainclock::benchmarks {
namespace {

/// Points that no other beats, from the cheapest (largest error) to the dearest (smallest error).
std::vector<ErrorAtCost> unbeaten(std::vector<ErrorAtCost> points) {
  std::erase_if(points, [](const ErrorAtCost& p) { return !(p.error > 0.0 && p.cost > 0.0); });
  std::sort(points.begin(), points.end(), [](const ErrorAtCost& a, const ErrorAtCost& b) {
    return a.cost != b.cost ? a.cost < b.cost : a.error < b.error;
  });
  std::vector<ErrorAtCost> front;
  for (const ErrorAtCost& point : points) {
    if (front.empty() || point.error < front.back().error) front.push_back(point);
  }
  return front;
}

}  // namespace

std::optional<double> cost_at(double error, const std::vector<ErrorAtCost>& baseline) {
  const std::vector<ErrorAtCost> front = unbeaten(baseline);
  if (front.empty() || error < front.back().error) return std::nullopt;
  if (error >= front.front().error) return front.front().cost;
  const auto finer = std::find_if(front.begin(), front.end(), [&](const ErrorAtCost& p) { return p.error <= error; });
  const ErrorAtCost& a = *(finer - 1);
  const ErrorAtCost& b = *finer;
  const double share = std::log(a.error / error) / std::log(a.error / b.error);
  return a.cost * std::pow(b.cost / a.cost, share);
}

std::optional<double> gain(const ErrorAtCost& point, const std::vector<ErrorAtCost>& baseline) {
  const auto cost = cost_at(point.error, baseline);
  if (!cost || !(point.cost > 0.0)) return std::nullopt;
  return *cost / point.cost;
}

}  // namespace grainclock::benchmarks
