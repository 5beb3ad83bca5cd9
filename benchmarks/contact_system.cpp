#include "benchmarks/contact_system.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <cmath>

namespace grainclock::benchmarks {

using core::Kind;
using core::Part;

namespace {

/// Step of a difference quotient, in diameters. Half the digits of a position: SUNDIALS' own step is as small as the
/// tolerances, where the rounding of overlaps would be all that it sees.
constexpr double kQuotientStep = 1e-8;

double largest(const double* values, std::size_t n) {
  double out = 0.0;
  for (std::size_t k = 0; k < n; ++k) out = std::max(out, std::abs(values[k]));
  return out;
}

}  // namespace

ContactSystem::ContactSystem(const core::State& start, const core::Materials& materials, const core::Vec3& gravity,
                             bool outlet_open, int threads)
    : field_(start, materials, gravity, outlet_open, threads) {
  double radii = 0.0;
  for (std::size_t row = 0; row < start.size(); ++row) {
    if (start.kind[row] != Kind::content) continue;
    rows_.push_back(row);
    radii += start.radius[row];
    origin_.insert(origin_.end(), start.position[row].data(), start.position[row].data() + 3);
    start_velocity_.insert(start_velocity_.end(), start.velocity[row].data(), start.velocity[row].data() + 3);
  }
  mean_diameter_ = 2.0 * radii / static_cast<double>(rows_.size());
  motion_ = {origin_, start_velocity_};
  length_ = kQuotientStep * 2.0 * radii / static_cast<double>(rows_.size());
  speed_ = length_ * std::sqrt(std::max(materials.ball.k, materials.wall.k) /
                               materials.mass(radii / static_cast<double>(rows_.size())));
}

void ContactSystem::watch(const core::State& start, const core::Materials& materials, bool outlet_open, double ahead,
                          const Rounding& tolerance) {
  watched_.emplace(start, materials, outlet_open, ahead, tolerance);
  watched_->append_fixed(motion_);
  watched_->renew(motion_);
}

void ContactSystem::write_start(N_Vector y) const {
  double* values = N_VGetArrayPointer(y);
  std::fill_n(values, origin_.size(), 0.0);
  std::copy(start_velocity_.begin(), start_velocity_.end(), values + origin_.size());
}

void ContactSystem::read_into(core::State& state, N_Vector y) const {
  const double* u = N_VGetArrayPointer(y);
  const double* v = u + origin_.size();
  for (std::size_t ball = 0; ball < rows_.size(); ++ball) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto component = static_cast<Eigen::Index>(axis);
      state.position[rows_[ball]][component] = origin_[3 * ball + axis] + u[3 * ball + axis];
      state.velocity[rows_[ball]][component] = v[3 * ball + axis];
    }
  }
}

const Motion& ContactSystem::motion_at(N_Vector y) {
  const std::size_t n = origin_.size();
  const double* values = N_VGetArrayPointer(y);
  for (std::size_t k = 0; k < n; ++k) motion_.x[k] = origin_[k] + values[k];
  std::copy_n(values + n, n, motion_.v.begin());
  return motion_;
}

int ContactSystem::slope(Part part, bool moves, N_Vector y, N_Vector out) {
  const std::size_t n = origin_.size();
  double* slopes = N_VGetArrayPointer(out);
  try {
    motion_at(y);
    if (moves)
      std::copy_n(motion_.v.begin(), n, slopes);
    else
      std::fill_n(slopes, n, 0.0);
    field_.acceleration({motion_.x.data(), n}, {motion_.v.data(), n}, {slopes + n, n}, part);
    if (watched_) watched_->keep_branches(motion_, part, {slopes + n, n});
    complaint_.clear();
  } catch (const core::NumericsError& error) {  // a trial step went too far
    complaint_ = error.what();
    return 1;
  } catch (...) {
    failure_ = std::current_exception();
    return -1;
  }
  return 0;
}

int ContactSystem::jacobian_times(Part part, bool moves, N_Vector direction, N_Vector out, N_Vector y, N_Vector at_y,
                                  N_Vector scratch) {
  const std::size_t n = origin_.size();
  const double* values = N_VGetArrayPointer(direction);
  const double size = std::max(largest(values, n) / length_, largest(values + n, n) / speed_);
  if (size == 0.0) {
    N_VConst(0.0, out);
    return 0;
  }
  N_VLinearSum(1.0, y, 1.0 / size, direction, scratch);
  const int flag = slope(part, moves, scratch, out);
  N_VLinearSum(size, out, -size, at_y, out);
  return flag;
}

std::uint64_t ContactSystem::contact_evaluations() const {
  return field_.contact_evaluations() + (watched_ ? watched_->evaluations() : 0);
}

void ContactSystem::rethrow() const {
  if (failure_) std::rethrow_exception(failure_);
}

}  // namespace grainclock::benchmarks
