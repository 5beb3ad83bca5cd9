#include "benchmarks/errors.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <unordered_map>

namespace grainclock::benchmarks {
namespace {

using core::BallId;
using core::Kind;
using core::State;

/// Where each content ball stands in a state; states of a scene need not have the same balls.
std::unordered_map<BallId, std::size_t> content_rows(const State& state) {
  std::unordered_map<BallId, std::size_t> rows;
  for (std::size_t row = 0; row < state.size(); ++row) {
    if (state.kind[row] == Kind::content) rows.emplace(state.id[row], row);
  }
  return rows;
}

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The distance of two vectors; infinite where it is no number, so that a lost ball cannot look like a good one.
double distance(const core::Vec3& a, const core::Vec3& b) {
  const double apart = (a - b).norm();
  return std::isnan(apart) ? kInfinity : apart;
}

double root_mean_square(const std::vector<double>& values) {
  double sum = 0.0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

ErrorSummary summary(std::vector<double> errors, double scale) {
  for (double& error : errors) error /= scale;
  return {root_mean_square(errors), quantile(errors, 0.5), quantile(errors, 0.99)};
}

}  // namespace

TrajectoryErrors trajectory_errors(const State& start, const State& reference, const State& result,
                                   std::optional<double> outlet_z) {
  const auto start_rows = content_rows(start);
  const auto result_rows = content_rows(result);
  TrajectoryErrors errors;
  std::vector<double> moved, speed, position, velocity;
  for (std::size_t row = 0; row < reference.size(); ++row) {
    if (reference.kind[row] != Kind::content) continue;
    if (outlet_z && reference.position[row].z() < *outlet_z) continue;
    const auto before = start_rows.find(reference.id[row]);
    if (before == start_rows.end()) continue;
    GC_REQUIRE(reference.position[row].allFinite() && reference.velocity[row].allFinite(),
               "errors: ball {} of the reference has no finite position or velocity; take a reference that did not fail",
               reference.id[row]);
    moved.push_back((reference.position[row] - start.position[before->second]).norm());
    speed.push_back(reference.velocity[row].norm());
    const auto after = result_rows.find(reference.id[row]);
    if (after == result_rows.end()) {
      ++errors.missing;
      continue;
    }
    position.push_back(distance(result.position[after->second], reference.position[row]));
    velocity.push_back(distance(result.velocity[after->second], reference.velocity[row]));
  }
  GC_REQUIRE(!position.empty(),
             "errors: no content ball is in the start, the reference and the result at once; compare states of one scene");
  errors.compared = position.size();
  errors.displacement = root_mean_square(moved);
  errors.speed = root_mean_square(speed);
  GC_REQUIRE(errors.displacement > 0.0 && errors.speed > 0.0,
             "errors: rms displacement {} m and rms speed {} m/s of the reference leave no scale for a relative error; "
             "take a longer horizon",
             errors.displacement, errors.speed);
  errors.position = summary(std::move(position), errors.displacement);
  errors.velocity = summary(std::move(velocity), errors.speed);
  return errors;
}

Distances distances(const State& a, const State& b) {
  const auto rows = content_rows(b);
  std::vector<double> apart;
  for (std::size_t row = 0; row < a.size(); ++row) {
    if (a.kind[row] != Kind::content) continue;
    const auto other = rows.find(a.id[row]);
    if (other != rows.end()) apart.push_back(distance(a.position[row], b.position[other->second]));
  }
  if (apart.empty()) return {};
  return {root_mean_square(apart), quantile(apart, 0.5), quantile(apart, 0.99),
          *std::max_element(apart.begin(), apart.end()), apart.size()};
}

double quantile(std::vector<double> sample, double q) {
  GC_REQUIRE(!sample.empty() && q >= 0.0 && q <= 1.0, "quantile {} of {} values does not exist", q, sample.size());
  // Sorting needs an order, and nan has none.
  if (std::any_of(sample.begin(), sample.end(), [](double value) { return std::isnan(value); })) {
    return std::numeric_limits<double>::quiet_NaN();
  }
  std::sort(sample.begin(), sample.end());
  const double place = q * static_cast<double>(sample.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, sample.size() - 1);
  const double share = place - static_cast<double>(below);
  // Infinite values leave no difference to interpolate with.
  if (share == 0.0 || sample[below] == sample[above]) return sample[below];
  return sample[below] + share * (sample[above] - sample[below]);
}

double relative_l2(const std::vector<double>& a, const std::vector<double>& reference) {
  GC_REQUIRE(a.size() == reference.size(), "relative error of {} values against {}: the lengths must agree", a.size(),
             reference.size());
  double difference = 0.0, norm = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    GC_REQUIRE(std::isfinite(reference[i]),
               "relative error: value {} of the reference is {}; take a reference that did not fail", i, reference[i]);
    difference += (a[i] - reference[i]) * (a[i] - reference[i]);
    norm += reference[i] * reference[i];
  }
  if (difference == 0.0) return 0.0;
  return norm > 0.0 && std::isfinite(difference) ? std::sqrt(difference / norm) : kInfinity;
}

}  // namespace grainclock::benchmarks
