// Strategy *impulse* (r-RESPA, or asynchronous variational kicks): each contact kicks both its balls at the ticks of its own
// level, by half a contact step's impulse at either end of each contact step; in between balls fall freely. Contacts with
// fixed balls and those among balls have levels apart, so that a stiff wall does not drag the other contacts of its balls
// along.
//
// A ball's balance holds the kicks that open the contact steps that begin at the last tick. They are paid when the ball goes
// on, so that at a synchronised time its velocity is that at this time.
//
// Linear momentum: exact to rounding, for both balls of a contact get the same integers at the same time. Angular momentum:
// exact likewise, for kicks are central. Energy: without dashpots the map is symplectic and the error stays bounded, but for
// resonances. Order: 2 without dashpots; 1 with them, as a dashpot sees the velocity before its kick (the uniform scheme
// *lagged*, which one level is). Stability: the uniform bound is kept for the contacts of either kind alone. Kicks at
// intervals of half a period of a fast oscillation, or multiples of that, pump it up: growth in bands below these intervals,
// whatever the steps in between. A damping ratio of 0.1 does not close them, 0.3 does on two springs. Balls that rest loaded
// at a stiff wall are thrown off it by the kicks of their load, and stay hot. Event correction: none; what opens and closes
// between two kicks is not on any ball's path.
#include "multirate/interface.hpp"

namespace grainclock::multirate {

namespace {

class Impulse final : public InterfaceStrategy {
 public:
  explicit Impulse(const InterfaceSetup& setup) : setup_(setup) {}

  Level levels_below() const override { return kMostLevels; }

  void drift(core::BallRow* rows, BallSteps& steps, core::RowSpan which, double seconds) const override {
    const core::Vec3 fall = 0.5 * seconds * seconds * setup_.gravity, gain = seconds * setup_.gravity;
    for (std::size_t k = 0; k < which.n; ++k) {
      const std::uint32_t i = which.row[k];
      core::BallRow& row = rows[i];
      pay(row, steps.paths[i], steps.balance[i]);
      row.x += seconds * row.vx + fall.x();
      row.y += seconds * row.vy + fall.y();
      row.z += seconds * row.vz + fall.z();
      row.vx += gain.x();
      row.vy += gain.y();
      row.vz += gain.z();
    }
  }

  void kick(core::BallRow* rows, BallSteps& steps, const SummedRows& which, const core::KickParameters& p) override {
    for (std::size_t k = 0; k < which.rows.n; ++k) {
      const std::uint32_t i = which.rows.row[k];
      const core::WeightedSum sum = steps.take_sums(i, which);
      pay(rows[i], steps.paths[i], sum.impulse);
      steps.balance[i] = sum.impulse;
      // Where not all contacts act the path is none; only at a synchronised time does anyone look.
      begin_path(steps, i, rows[i], sum.force, setup_.gravity, p.unit);
    }
    if (p.drift > 0.0) drift(rows, steps, which.rows, p.drift);
  }

  /// Kicks go by the levels of contacts, whatever those of balls.
  void open(BallSteps& steps, bool is_new, std::uint32_t begin, std::uint32_t end) const override {
    if (is_new) std::fill(steps.balance.begin() + begin, steps.balance.begin() + end, core::IntVec{});
  }

 private:
  void pay(core::BallRow& row, const core::Path& path, const core::IntVec& impulse) const {
    const double per_unit = setup_.half_tick * (setup_.unit * path.inverse_mass);
    row.vx += static_cast<double>(impulse.v[0]) * per_unit;
    row.vy += static_cast<double>(impulse.v[1]) * per_unit;
    row.vz += static_cast<double>(impulse.v[2]) * per_unit;
  }

  InterfaceSetup setup_;
};

}  // namespace

std::unique_ptr<InterfaceStrategy> make_impulse(const InterfaceSetup& setup) { return std::make_unique<Impulse>(setup); }

}  // namespace grainclock::multirate
