// Strategy *accumulate*: a contact is evaluated at the finer level of its two balls, the coarser ball taken on
// the very path that it will take (x + t v + t2/2 a, velocity v + t a). The finer ball takes its impulse at its
// own step end; the equal and opposite impulse waits on the coarser ball's balance and is paid at that ball's
// own step end, with the same quadrature weights.
//
// Per ball, in integers (force units times half ticks): a step opens with balance = sum_c w_c F_c - W F, where w_c = 2^level
// of contact c, W = 2^(own level + 1) and F the force sum that the path takes as constant; evaluations within the
// step add 2 w_c F_c, the closing one w_c F_c. What the velocity gains beyond v + H a is the balance over
// the mass: the trapezoid rule on each contact's own time grid. Both balls of a contact get the same integers, so momentum,
// balances included, is exact to rounding of the velocities.
//
// Linear momentum: exact to rounding. Angular momentum: forces are central at the time of each evaluation, but the coarser
// ball is paid later, at another place: exact on one level, else the defect is of the scheme's order.
// Energy: drifts with the order of the scheme. Order: 2, with dashpots too. Stability: undamped chains grow weakly, with h3
// at every ratio of steps; a damping ratio of 0.02 stops the growth within the uniform scheme's bound.
// Event correction: yes.
#include "multirate/interface.hpp"

namespace grainclock::multirate {

namespace {

class Accumulate final : public InterfaceStrategy {
 public:
  explicit Accumulate(const core::Kernels& kernels) : kernels_(kernels) {}

  void drift(core::BallRow* rows, BallSteps& steps, core::RowSpan which, double seconds) const override {
    kernels_.drift(rows, steps.paths.data(), which, seconds);
  }

  void kick(core::BallRow* rows, BallSteps& steps, const SummedRows& which, const core::KickParameters& p) override {
    kernels_.kick(rows, steps.paths.data(), steps.balance.data(), steps.opening.data(), steps.level.data(), steps.sums_of(which.first),
                  steps.stride, which.parts, which.rows, p);
  }

  /// As far as the force goes that a ball's path takes as constant. What the last kick left holds for balls that keep
  /// their levels.
  void open(BallSteps& steps, bool is_new, std::uint32_t begin, std::uint32_t end) const override {
    open_balances(steps, is_new, begin, end);
  }

 private:
  const core::Kernels& kernels_;
};

}  // namespace

std::unique_ptr<InterfaceStrategy> make_accumulate(const InterfaceSetup& setup) {
  return std::make_unique<Accumulate>(setup.kernels);
}

}  // namespace grainclock::multirate
