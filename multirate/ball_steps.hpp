// What every ball keeps between its own step ends, and the force sums of a tick.
#pragma once

#include "core/balls.hpp"
#include "core/kernels.hpp"
#include "multirate/summed_rows.hpp"
#include "multirate/time_line.hpp"

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

namespace grainclock::multirate {

/// By row. What `balance` stands for is the interface strategy's business (interface.hpp).
struct BallSteps {
  std::vector<core::Path> paths;
  std::vector<core::IntVec> balance;    // force units times half ticks; the far row has one too
  std::vector<core::IntVec> opening;    // force units, the force sums that open steps, where balls wait for others
  std::vector<Level> level;             // of the balls' own steps
  std::vector<Level> before;            // the same before the present renewal
  std::vector<core::WeightedSum> sums;  // one array per thread, of the content and the far row
  std::size_t stride = 0;               // length of such an array

  core::WeightedSum* sums_of(int thread) { return sums.data() + static_cast<std::size_t>(thread) * stride; }

  /// The force sum of a ball whose contacts have all been evaluated.
  core::IntVec total_force(std::uint32_t row) const {
    core::IntVec sum;
    for (std::size_t first = 0; first < sums.size(); first += stride) {
      const core::IntVec& part = sums[first + row].force;
      for (int k = 0; k < 3; ++k) sum.v[k] += part.v[k];
    }
    return sum;
  }
  /// A row's sums of this tick, which it uses up.
  core::WeightedSum take_sums(std::uint32_t row, const SummedRows& of) {
    core::WeightedSum sum;
    for (int t = of.first; t < of.first + of.parts; ++t) {
      core::WeightedSum& part = sums_of(t)[row];
      for (int k = 0; k < 3; ++k) {
        sum.force.v[k] += part.force.v[k];
        sum.impulse.v[k] += part.impulse.v[k];
      }
      part = {};
    }
    return sum;
  }
  void clear_sums() { std::fill(sums.begin(), sums.end(), core::WeightedSum{}); }
  /// Follows a new order of the rows; clears the sums.
  void follow_order(std::span<const std::uint32_t> order, std::vector<core::BallRow>& spare, int threads) {
    core::reorder_like(paths, order, spare, threads);
    core::reorder_like(balance, order, spare, threads);
    core::reorder_like(opening, order, spare, threads);
    core::reorder_like(level, order, spare, threads);
    stride = order.size() + 1;
    balance.resize(stride);
    sums.assign(static_cast<std::size_t>(threads) * stride, core::WeightedSum{});
  }
};

/// A path takes the force that opens it as constant, and the balance of its step begins with that much less, 2^(level + 1)
/// times: for rows [begin, end) at new levels, what that changes by; if `is_new`, balances begin with it.
inline void open_balances(BallSteps& steps, bool is_new, std::uint32_t begin, std::uint32_t end) {
  for (std::uint32_t row = begin; row < end; ++row) {
    if (is_new) steps.balance[row] = {};
    if (steps.before[row] == steps.level[row] && !is_new) continue;
    const std::int64_t had = is_new ? 0 : 2 * ticks_of(steps.before[row]), has = 2 * ticks_of(steps.level[row]);
    for (int k = 0; k < 3; ++k) steps.balance[row].v[k] += (had - has) * steps.opening[row].v[k];
  }
}

/// Lets a ball go on under `force` [units of `unit` N], its force sum at present. `gravity` in m/s2.
inline void begin_path(BallSteps& steps, std::uint32_t row, core::BallRow& ball, const core::IntVec& force,
                       const core::Vec3& gravity, double unit) {
  core::Path& path = steps.paths[row];
  steps.opening[row] = force;
  const double inertia = unit * path.inverse_mass;  // as the kernels do it
  double* a[3] = {&path.ax, &path.ay, &path.az};
  for (int k = 0; k < 3; ++k) *a[k] = gravity[k] + static_cast<double>(force.v[k]) * inertia;
  ball.a = std::abs(path.ax) + std::abs(path.ay) + std::abs(path.az);
}

}  // namespace grainclock::multirate
