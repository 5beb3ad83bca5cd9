// Uniform steps whose dashpots are not explicit: what the schemes share.
//
//   relaxed    the predicted scheme; a dashpot's force follows its law with a delay (dashpot_relaxed.cpp)
//   pairwise   drift, kick, drift; the kick's dashpots are implicit, pair after pair (dashpot_split.cpp)
//   solve      the same, all dashpots of the kick at once (dashpot_solve.cpp)
//
// Momentum is exact to rounding in all of them, as in explicit stepping: forces are summed as integer vectors. What
// depends on an order goes by ids, and everything but the making of lists is done by one thread: results depend on
// neither list nor threads. Events are not corrected.
#pragma once

#include "core/ball_stepper.hpp"
#include "core/dashpot_touches.hpp"

#include <algorithm>

namespace grainclock::core {

class DashpotStepper : public BallStepper {
 public:
  DashpotStepper(const State& state, const StepperSetup& setup);
  bool is_checkpointable() const final { return true; }
  void advance(std::int64_t n) final;
  State state() const final;
  LevelStatistics level_statistics() const final;

 protected:
  /// One step between synchronised states, with its bookings. Leaves the touches of its forces in touches_, the rows in
  /// their order.
  virtual void take_step() = 0;
  /// Balls have left, or velocities were changed from outside.
  virtual void restart() = 0;
  void follow_order(std::span<const std::uint32_t> order) override;
  /// With the dashpot's last force: where c is large, the law makes forces of what rates are uncertain by.
  double force_of(BallId i, BallId j, const ContactLaw& its, double overlap, double rate) const final;

  void find_touches();
  /// Finds C/m of each ball for delay().
  void add_up_dashpots();
  /// Steps in which a dashpot's force follows its law: d = max(1, 1/2 + 2/3 h lambda) with lambda = C_i/m_i + C_j/m_j, C being
  /// the sum of the dashpots on a ball.
  double delay(const Touch& touch) const {
    const double lambda = losses_[touch.i] + (touch.both ? losses_[touch.j] : 0.0);
    return std::max(1.0, 0.5 + 2.0 / 3.0 * step_ * lambda);
  }
  IntVec in_units(const Touch& touch, double force) const;
  /// Adds up the touches' forces. Throws NumericsError where one is beyond the limit.
  void add_up_forces();
  double rate_of(const Touch& touch) const { return rate_along(touch.normal, balls_.rows[touch.i], balls_.rows[touch.j]); }

  struct Totals {
    SweepTotals ball, fixed;
  };
  /// Of the touches' forces; `rate(touch)` [m/s] is the one that power is taken with.
  template <class Rate>
  Totals totals(Rate rate) const;

  std::span<Touch> touches_;
  std::vector<IntVec> sums_;  // force units, per content row

 private:
  /// A restart needs nothing but the synchronised state and the dashpots' memory.
  void keep_evaluated() { evaluated_ = balls_.rows; }
  std::vector<std::uint32_t> first_hits() const;

  DashpotTouches pairs_;
  std::vector<double> losses_;  // 1/s, C/m per content row
};

template <class Rate>
DashpotStepper::Totals DashpotStepper::totals(Rate rate) const {
  Totals out;
  for (const Touch& touch : touches_) {
    SweepTotals& to = touch.both ? out.ball : out.fixed;
    const double per_total = 1.0 / scale_.total, speed = rate(touch) * per_total;
    to.magnitude += std::llround(std::abs(touch.force()) * per_total);
    to.power += std::llround(touch.dashpot * speed);
    to.turned += std::llround(std::abs(touch.force() * speed));
    if (touch.both) continue;
    const IntVec force = in_units(touch, touch.force());
    for (int k = 0; k < 3; ++k) to.force[k] += force.v[k];
  }
  return out;
}

std::unique_ptr<Stepper> make_relaxed_stepper(const State& state, const StepperSetup& setup);
std::unique_ptr<Stepper> make_pairwise_stepper(const State& state, const StepperSetup& setup);
std::unique_ptr<Stepper> make_solve_stepper(const State& state, const StepperSetup& setup);
/// The one that `setup.stepping.dashpot` asks for.
std::unique_ptr<Stepper> make_dashpot_stepper(const State& state, const StepperSetup& setup);

}  // namespace grainclock::core
