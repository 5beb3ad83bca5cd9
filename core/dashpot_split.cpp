#include "core/dashpot_split.hpp"

namespace grainclock::core {

void SplitStepper::take_step() {
  drift();
  keep_list_safe();
  find_touches();
  find_dashpots();
  add_up_forces();
  kick(step_, kicked_);
  for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
    BallRow& r = balls_.rows[row];
    const Vec3& v = kicked_[row];
    r = {r.x, r.y, r.z, r.r, v.x(), v.y(), v.z(), r.a};
  }
  // The mean of the rates before and after: with it the work of a kick is exact.
  const Totals booked = totals([this](const Touch& touch) { return 0.5 * (touch.rate + rate_of(touch)); });
  book(booked.ball, booked.fixed, step_);
  drift();
}

void SplitStepper::kick_without_dashpots(std::vector<Vec3>& velocity) {
  for (Touch& touch : touches_) touch.dashpot = 0.0;
  add_up_forces();
  kick(step_, velocity);
}

void SplitStepper::kick(double seconds, std::vector<Vec3>& velocity) const {
  velocity.resize(balls_.content_count());
  for (std::uint32_t row = 0; row < balls_.content_count(); ++row)
    velocity[row] = core::velocity(balls_.rows[row]) + seconds * path_acceleration(row, sums_[row]);
}

void SplitStepper::drift() {
  for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
    BallRow& r = balls_.rows[row];
    r.x += 0.5 * step_ * r.vx;
    r.y += 0.5 * step_ * r.vy;
    r.z += 0.5 * step_ * r.vz;
  }
}

}  // namespace grainclock::core
