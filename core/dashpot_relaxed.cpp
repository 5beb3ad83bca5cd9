// The predicted scheme with delayed dashpots: f' = f + (f* - f) / d, where f is the dashpot's last force (0 before the first
// touch), f* what the law says at the predicted rate, and d the delay() in steps. The clamp acts on f', and it is the
// clamped force that is remembered.
//
// For one pair, with z = h c / m_eff, the limit is h2 k / m_eff < 4 (1 - z / (2 d - 1)). h lambda is at least z, whatever else the
// balls touch (Gershgorin's bound of the dashpots' spectrum), so that d keeps the limit at 1 or above: stable for any dashpot
// while h2 times the springs' stiffness form (critical_step.hpp) is at most 1.
// Order 2: while h lambda <= 3/4 nothing needs a delay, d = 1, and the scheme is the explicit one.
// Energy: a delayed force may push along the motion for a moment. At h lambda far above 1 it acts as a spring in series with
// the dashpot, of stiffness (3/2) m / h2 at most: impacts that the law stops dead bounce.
#include "core/dashpot_stepper.hpp"

#include <algorithm>

namespace grainclock::core {

namespace {

class RelaxedStepper final : public DashpotStepper {
 public:
  RelaxedStepper(const State& state, const StepperSetup& setup) : DashpotStepper(state, setup) {
    opening_.resize(balls_.content_count());
    restart();
    costs_ = setup.costs;
  }

 private:
  void follow_order(std::span<const std::uint32_t> order) override {
    DashpotStepper::follow_order(order);
    if (!opening_.empty()) reorder_like(opening_, order, balls_.spare, setup_.threads);
  }

  /// Opens the next step with the remembered forces.
  void restart() override {
    find_touches();
    add_up_forces();
    take_as_opening();
  }

  void take_step() override {
    predict();
    keep_list_safe();
    find_touches();
    add_up_dashpots();
    for (Touch& touch : touches_) {
      const double wanted = touch.c * touch.rate;
      touch.dashpot = std::max(touch.least, touch.dashpot + (wanted - touch.dashpot) / delay(touch));
    }
    add_up_forces();
    correct();
    book(opening_totals_.ball, opening_totals_.fixed, 0.5 * step_);
    take_as_opening();
    book(opening_totals_.ball, opening_totals_.fixed, 0.5 * step_);
  }

  void predict() {
    for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
      BallRow& r = balls_.rows[row];
      const Vec3 a = path_acceleration(row, opening_[row]);
      r.x += step_ * (r.vx + 0.5 * step_ * a.x());
      r.y += step_ * (r.vy + 0.5 * step_ * a.y());
      r.z += step_ * (r.vz + 0.5 * step_ * a.z());
      r.vx += step_ * a.x();
      r.vy += step_ * a.y();
      r.vz += step_ * a.z();
    }
  }

  /// From the predicted velocities to those of the trapezoid rule.
  void correct() {
    for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
      BallRow& r = balls_.rows[row];
      const double per_unit = 0.5 * step_ * scale_.unit * balls_.inverse_mass[row];
      const std::int64_t *now = sums_[row].v, *before = opening_[row].v;
      r.vx += per_unit * static_cast<double>(now[0] - before[0]);
      r.vy += per_unit * static_cast<double>(now[1] - before[1]);
      r.vz += per_unit * static_cast<double>(now[2] - before[2]);
    }
  }

  void take_as_opening() {
    opening_ = sums_;
    opening_totals_ = totals([this](const Touch& touch) { return rate_of(touch); });
  }

  std::vector<IntVec> opening_;  // force units, the force that opens the next step
  Totals opening_totals_;
};

}  // namespace

std::unique_ptr<Stepper> make_relaxed_stepper(const State& state, const StepperSetup& setup) {
  return std::make_unique<RelaxedStepper>(state, setup);
}

}  // namespace grainclock::core
