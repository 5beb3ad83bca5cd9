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

  void kick(core::BallRow* rows, BallSteps& steps, const SummedRows& which, const core::KickParameters& p) override {
    for (std::size_t k = 0; k < which.rows.n; ++k) {
      const std::uint32_t i = which.rows.row[k];
      const core::WeightedSum sum = steps.take_sums(i, which);
      IntVec& balance = steps.balance[i];
      const Level level = steps.level[i];
      if (level > p.level) {
        for (int a = 0; a < 3; ++a) balance.v[a] += 2 * sum.impulse.v[a];
        continue;
      }
      const bool is_between = slow_[i].any && level == p.level;
      const double per_unit = p.half_tick * (p.unit * steps.paths[i].inverse_mass);
      double* v[3] = {&rows[i].vx, &rows[i].vy, &rows[i].vz};
      IntVec force = sum.force;
      for (int a = 0; a < 3; ++a) {
        Slow& slow = slow_[i];
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
      begin_path(steps, i, rows[i], force, setup_.gravity, p.unit);
    }
    if (p.drift > 0.0) drift(rows, steps, which.rows, p.drift);
  }

  /// As accumulate does it.
  void open(BallSteps& steps, bool is_new, std::uint32_t begin, std::uint32_t end) const override {
    open_balances(steps, is_new, begin, end);
  }

  /// Force sums of slow contacts. Only what is extrapolated depends on them: they need not be the kernels' integers.
  void begin(const BallSteps& steps, const core::BallRow* rows, const Batches& batches) override {
    slow_.assign(steps.level.size(), Slow{});
    for (Level level = 1; int{level} < batches.levels(); ++level) {
      for (const bool fixed : {false, true}) {
        const core::PairList& pairs = fixed ? batches[level].fixed : batches[level].ball;
        for (std::size_t p = 0; p < pairs.count; ++p) {
          const std::uint32_t i = pairs.i[p], j = pairs.j[p];
          const bool slow_for_i = steps.level[i] < level, slow_for_j = !fixed && steps.level[j] < level;
          if (!slow_for_i && !slow_for_j) continue;
          const IntVec force = force_on(rows[i], rows[j], setup_.laws[fixed]);
          if (slow_for_i) slow_[i].add(force, 1);
          if (slow_for_j) slow_[j].add(force, -1);
        }
      }
    }
    for (auto& list : slow_rows_) list.clear();
    for (std::uint32_t row = 0; row < slow_.size(); ++row) {
      slow_[row].before = slow_[row].now;
      if (slow_[row].any) slow_rows_[steps.level[row] + std::size_t{1}].push_back(row);
    }
  }

  /// The slow contacts of a ball are the coarsest that it has: what has been summed before is the others'.
  void before_evaluation(const BallSteps& steps, Level level) override {
    for (const std::uint32_t row : slow_rows_[level]) slow_[row].others = steps.total_force(row);
  }

 private:
  /// Of a ball's contacts that are one level coarser than itself; force units.
  struct Slow {
    IntVec now, before, others;  // at their last evaluation, and the one before; `others`: without them
    bool any = false;

    void add(const IntVec& force, std::int64_t sign) {
      for (int a = 0; a < 3; ++a) now.v[a] += sign * force.v[a];
      any = true;
    }
  };

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
  std::vector<std::vector<std::uint32_t>> slow_rows_;  // per level of slow contacts
};

}  // namespace

std::unique_ptr<InterfaceStrategy> make_extrapolate(const InterfaceSetup& setup) {
  return std::make_unique<Extrapolate>(setup);
}

}  // namespace grainclock::multirate
