// Dashpots pair after pair, by Shardlow's splitting: each slows its own rate down implicitly over half a step, u' = u - h/2 f(u') / m_eff,
// and the next pair sees what it left; then once more in the reverse order.
//
// Order 1, as the implicit Euler rule. There and back the passes are a symmetric operator that takes energy, whatever the dashpots:
// so the limit is the springs', h2 times their stiffness form at most 4 (one pass alone fails below it). Two passes do not
// balance a network of contacts: where h c / m is large, a contact's rate after the step is of the order h F / m of its
// neighbours' forces, and packings creep at speeds that go with the step, not with the dashpots.
#include "core/dashpot_split.hpp"

namespace grainclock::core {

namespace {

class PairwiseStepper final : public SplitStepper {
 public:
  using SplitStepper::SplitStepper;

 private:
  void find_dashpots() override {
    kick_without_dashpots(velocity_);
    for (auto touch = touches_.begin(); touch != touches_.end(); ++touch) slow_down(*touch);
    for (auto touch = touches_.rbegin(); touch != touches_.rend(); ++touch) slow_down(*touch);
  }

  /// Half a step of one dashpot.
  void slow_down(Touch& touch) {
    const double inverse_i = balls_.inverse_mass[touch.i], inverse_j = touch.both ? balls_.inverse_mass[touch.j] : 0.0;
    const double half = 0.5 * step_;
    Vec3& v_i = velocity_[touch.i];
    const double rate = -touch.normal.dot(touch.both ? Vec3(v_i - velocity_[touch.j]) : v_i);
    const double force = std::max(touch.least, touch.c * rate / (1.0 + half * touch.c * (inverse_i + inverse_j)));
    const Vec3 impulse = half * force * touch.normal;
    v_i += inverse_i * impulse;
    if (touch.both) velocity_[touch.j] -= inverse_j * impulse;
    touch.dashpot += 0.5 * force;
  }

  std::vector<Vec3> velocity_;  // m/s, as the pairs so far have left them
};

}  // namespace

std::unique_ptr<Stepper> make_pairwise_stepper(const State& state, const StepperSetup& setup) {
  return std::make_unique<PairwiseStepper>(state, setup);
}

}  // namespace grainclock::core
