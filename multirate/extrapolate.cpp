// Strategy *extrapolate*: as accumulate, but contacts may be one level coarser than the finer of their balls, so that a
// stiff wall does not drag the other contacts of its balls along. A ball that is finer than a contact sees its force
// extrapolated into the sub-step between two evaluations, and the next evaluation settles the difference exactly.
//
// Per ball of level b, in integers (force units times half ticks, see accumulate.cpp): be A the force sum of its slow
// contacts, of level b + 1, when last evaluated, and A' the time before. In mid of their step, when only the others'
// forces F are new, the ball is to feel G = A + (A - A')/2. Its velocity gets the trapezoid of the change, 2^b (G - A); the
// next step's path takes F + G as constant and its balance begins with that much less. At the slow contacts' next
// evaluation the balance gets 2^(b+1) A_new as from any contact: in all 2^(b+1) (A + A_new), the trapezoid rule on
// their own time grid, whatever G was. So both balls of every contact get the same integers, as in accumulate.
// After a renewal of classes the first sub-step takes A' = A: which contacts are slow may have changed.
//
// Linear momentum: exact to rounding. Angular momentum and energy: drift with the order of the scheme. Order: 2, with
// dashpots too. Stability: without damping every ratio above 1 grows, two springs by a tenth and more per coarse step in
// bands; a damping ratio of 0.02 does not stop that, 0.1 does. Event correction: yes; of a slow contact
// to the accuracy at which the finer ball's last sub-step tells its path over both.
#include "multirate/interface.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace grainclock::multirate {

namespace {

using core::IntVec;

class Extrapolate final : public InterfaceStrategy {
 public:
  explicit Extrapolate(const InterfaceSetup& setup) : setup_(setup), slow_rows_(kMostLevels + std::size_t{1}) {}

  Level levels_below() const override { return 1; }

  void drift(core::BallRow* rows, BallSteps& steps, core::RowSpan which, double seconds) const override {
    setup_.kernels.drift(rows, steps.paths.data(), which, seconds);
  }

  /// Balls without slow contacts, and all others in mid-step, are kicked as in accumulate.
  void kick(core::BallRow* rows, BallSteps& steps, const SummedRows& which, const core::KickParameters& p) override {
    std::array<std::uint32_t, kRowsAtOnce> plain, slow;
    for (std::size_t first = 0; first < which.rows.n; first += kRowsAtOnce) {
      const std::size_t end = std::min(first + kRowsAtOnce, which.rows.n);
      std::size_t plain_rows = 0, slow_rows = 0;
      for (std::size_t k = first; k < end; ++k) {
        const std::uint32_t row = which.rows.row[k];
        plain[plain_rows] = slow[slow_rows] = row;
        ++(has_slow_[row] != 0 && steps.level[row] <= p.level ? slow_rows : plain_rows);
      }
      setup_.kernels.kick(rows, steps.paths.data(), steps.balance.data(), steps.opening.data(), steps.level.data(),
                          steps.sums_of(which.first), steps.stride, which.parts, {plain.data(), plain_rows}, p);
      for (std::size_t k = 0; k < slow_rows; ++k) kick_slow(rows[slow[k]], steps, slow[k], which, p);
      if (p.drift > 0.0) drift(rows, steps, {slow.data(), slow_rows}, p.drift);
    }
  }

  /// As accumulate does it.
  void open(BallSteps& steps, bool is_new, std::uint32_t begin, std::uint32_t end) const override {
    open_balances(steps, is_new, begin, end);
  }

  /// Force sums of slow contacts. Only what is extrapolated depends on them: they need not be the kernels' integers.
  void begin(const BallSteps& steps, const core::BallRow* rows, const Batches& batches) override {
    slow_.assign(steps.level.size(), Slow{});
    has_slow_.assign(steps.level.size(), 0);
    for (Level level = 1; int{level} < batches.levels(); ++level) {
      for (const bool fixed : {false, true}) {
        const core::PairList& pairs = fixed ? batches[level].fixed : batches[level].ball;
        for (std::size_t p = 0; p < pairs.count; ++p) {
          const std::uint32_t i = pairs.i[p], j = pairs.j[p];
          const bool slow_for_i = steps.level[i] < level, slow_for_j = !fixed && steps.level[j] < level;
          if (!slow_for_i && !slow_for_j) continue;
          const IntVec force = force_on(rows[i], rows[j], setup_.laws[fixed]);
          if (slow_for_i) add_slow(i, force, 1);
          if (slow_for_j) add_slow(j, force, -1);
        }
      }
    }
    for (auto& list : slow_rows_) list.clear();
    for (std::uint32_t row = 0; row < slow_.size(); ++row) {
      slow_[row].before = slow_[row].now;
      if (has_slow_[row] != 0) slow_rows_[steps.level[row] + std::size_t{1}].push_back(row);
    }
  }

  /// The slow contacts of a ball are the coarsest that it has: what has been summed before is the others'.
  void before_evaluation(const BallSteps& steps, Level level) override {
    for (const std::uint32_t row : slow_rows_[level]) slow_[row].others = steps.total_force(row);
  }

 private:
  static constexpr std::size_t kRowsAtOnce = 256;

  /// Of a ball's contacts that are one level coarser than itself; force units.
  struct Slow {
    IntVec now, before, others;  // at their last evaluation, and the one before; `others`: without them
  };
  void add_slow(std::uint32_t row, const IntVec& force, std::int64_t sign) {
    for (int a = 0; a < 3; ++a) slow_[row].now.v[a] += sign * force.v[a];
    has_slow_[row] = 1;
  }

  /// Ends a step of a ball with slow contacts.
  void kick_slow(core::BallRow& ball, BallSteps& steps, std::uint32_t row, const SummedRows& which, const core::KickParameters& p) {
    const core::WeightedSum sum = steps.take_sums(row, which);
    IntVec& balance = steps.balance[row];
    const Level level = steps.level[row];
    Slow& slow = slow_[row];
    const bool is_between = level == p.level;
    const double per_unit = p.half_tick * (p.unit * steps.paths[row].inverse_mass);
    double* v[3] = {&ball.vx, &ball.vy, &ball.vz};
    IntVec force = sum.force;
    for (int a = 0; a < 3; ++a) {
      std::int64_t gain = 0;  // the trapezoid of what extrapolation adds
      if (is_between) {
        const std::int64_t change = (slow.now.v[a] - slow.before.v[a]) / 2;
        force.v[a] += slow.now.v[a] + change;
        gain = change * ticks_of(level);
      } else {
        slow.before.v[a] = slow.now.v[a];
        slow.now.v[a] = force.v[a] - slow.others.v[a];
      }
      *v[a] += static_cast<double>(balance.v[a] + sum.impulse.v[a] + gain) * per_unit;
      balance.v[a] = sum.impulse.v[a] - gain - force.v[a] * 2 * ticks_of(level);
    }
    begin_path(steps, row, ball, force, setup_.gravity, p.unit);
  }

  /// On `a`, from `b`.
  static IntVec force_on(const core::BallRow& a, const core::BallRow& b, const core::SweepLaw& law) {
    const core::Vec3 d = position(a) - position(b);
    const double distance = d.norm(), overlap = a.r + b.r - distance;
    IntVec out;
    if (overlap <= -law.law.reach) return out;
    const double rate = -d.dot(velocity(a) - velocity(b)) / distance;
    const double per_length = core::contact_force(law.law, overlap, rate) * law.per_unit / distance;
    for (int k = 0; k < 3; ++k) out.v[k] = std::llround(per_length * d[k]);
    return out;
  }

  InterfaceSetup setup_;
  std::vector<Slow> slow_;                             // by row
  std::vector<std::uint8_t> has_slow_;                 // by row
  std::vector<std::vector<std::uint32_t>> slow_rows_;  // per level of slow contacts
};

}  // namespace

std::unique_ptr<InterfaceStrategy> make_extrapolate(const InterfaceSetup& setup) {
  return std::make_unique<Extrapolate>(setup);
}

}  // namespace grainclock::multirate
