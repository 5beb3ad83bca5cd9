// Strategy *frozen*, the bad example: no reconciliation. A contact is evaluated at the finer level of its two balls, the
// coarser one taken on its path, and the finer ball takes its impulse step by step. The coarser ball takes no notice: it
// steps by what the forces at its own step ends give. Every ball alone is a sound second-order stepper; together they are
// not.
//
// Linear momentum: what a contact gives its two balls differs by the error of the coarser ball's trapezoid rule, H3 F''/12 a
// step H, and by whole impulses where contacts open and close within a step: a defect that grows with the ratio of steps
// and that the ledger shows. Angular momentum: likewise. Energy: drifts, as the coarser ball
// feels collisions that the finer one does not. Order: 2 while contacts stay closed (with dashpots, too), none across
// events. Stability: measured only; damping hides the drift, nothing bounds it without.
// Event correction: none, for what it corrects is an impulse that both balls share.
#include "multirate/interface.hpp"

namespace grainclock::multirate {

namespace {

class Frozen final : public InterfaceStrategy {
 public:
  explicit Frozen(const InterfaceSetup& setup) : setup_(setup) {}

  void drift(core::BallRow* rows, BallSteps& steps, core::RowSpan which, double seconds) const override {
    setup_.kernels.drift(rows, steps.paths.data(), which, seconds);
  }

  void kick(core::BallRow* rows, BallSteps& steps, const SummedRows& which, const core::KickParameters& p) override {
    for (std::size_t k = 0; k < which.rows.n; ++k) {
      const std::uint32_t i = which.rows.row[k];
      const core::IntVec force = steps.take_sums(i, which).force;
      if (steps.level[i] > p.level) continue;  // in mid-step: lost on it
      core::BallRow& row = rows[i];
      const double per_unit = p.half_tick * (p.unit * steps.paths[i].inverse_mass);
      double* v[3] = {&row.vx, &row.vy, &row.vz};
      for (int axis = 0; axis < 3; ++axis) {
        const std::int64_t change = force.v[axis] - steps.opening[i].v[axis];
        *v[axis] += static_cast<double>(change * ticks_of(steps.level[i])) * per_unit;
      }
      begin_path(steps, i, row, force, setup_.gravity, p.unit);
    }
    if (p.drift > 0.0) drift(rows, steps, which.rows, p.drift);
  }

  /// Nothing waits between the steps of a ball.
  void open(BallSteps& /*steps*/, bool /*is_new*/, std::uint32_t /*begin*/, std::uint32_t /*end*/) const override {}

 private:
  InterfaceSetup setup_;
};

}  // namespace

std::unique_ptr<InterfaceStrategy> make_frozen(const InterfaceSetup& setup) { return std::make_unique<Frozen>(setup); }

}  // namespace grainclock::multirate
