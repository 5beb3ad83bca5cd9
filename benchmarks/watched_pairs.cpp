#include "benchmarks/watched_pairs.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace grainclock::benchmarks {

using core::Approach;
using core::ContactLaw;
using core::Part;

namespace {

ContactLaw law_of(const core::Materials& materials, const core::PairLaw& pair) {
  return {pair.k, pair.c, materials.cohesion > 0.0 ? materials.cohesion / pair.k : 0.0, materials.tension};
}

core::SkinRule skin_rule(double mean_diameter, double ahead) {
  core::SkinRule rule = core::SkinRule::for_diameter(mean_diameter);
  rule.ahead = 2.0 * ahead;  // so that a set just renewed is not worn
  return rule;
}

/// A few roundings of the largest coordinate and of the speeds that the scene begins with or gravity soon gives; or, if that
/// is more, a hundredth of what an integration with these tolerances tells apart.
Rounding rounding_of(const core::Balls& balls, const Rounding& tolerance) {
  constexpr double kRoundings = 4.0, kShare = 0.01;
  double length = 0.0, speed = std::sqrt(10.0 * balls.mean_diameter);
  for (std::uint32_t row = 0; row < balls.rows.size(); ++row) {
    if (row == balls.far_row()) continue;
    const core::BallRow& r = balls.rows[row];
    length = std::max({length, std::abs(r.x) + r.r, std::abs(r.y) + r.r, std::abs(r.z) + r.r});
    speed = std::max({speed, std::abs(r.vx), std::abs(r.vy), std::abs(r.vz)});
  }
  const double unit = kRoundings * std::numeric_limits<double>::epsilon();
  return {std::max(unit * length, kShare * tolerance.overlap), std::max(unit * speed, kShare * tolerance.rate)};
}

bool before(const WatchedPair& a, const WatchedPair& b) { return a.i != b.i ? a.i < b.i : a.j < b.j; }

/// What a part of the accelerations takes from a pair's formula and from the law beyond it [N].
double beyond_law(const ContactLaw& law, Branch branch, const Approach& at, Part part) {
  ContactLaw undamped = law;
  undamped.c = 0.0;
  const double spring = branch_spring(law, branch, at) - core::contact_force(undamped, at.overlap, at.rate);
  if (part == Part::springs) return spring;
  const double whole = branch_force(law, branch, at) - core::contact_force(law, at.overlap, at.rate);
  return part == Part::dashpots ? whole - spring : whole;
}

}  // namespace

WatchedPairs::WatchedPairs(const core::State& state, const core::Materials& materials, bool outlet_open, double ahead,
                           const Rounding& tolerance)
    : ball_(law_of(materials, materials.ball)),
      wall_(law_of(materials, materials.wall)),
      balls_(state, materials, !outlet_open),
      list_(materials.reach(), skin_rule(balls_.mean_diameter, ahead), 1),
      ahead_(ahead),
      ids_(balls_.id),
      rounding_(rounding_of(balls_, tolerance)) {
  std::sort(ids_.begin(), ids_.end());
  inverse_mass_.resize(content_count());
  for (std::uint32_t row = 0; row < content_count(); ++row) {
    const auto number = std::lower_bound(ids_.begin(), ids_.end(), balls_.id[row]) - ids_.begin();
    inverse_mass_[static_cast<std::size_t>(number)] = balls_.inverse_mass[row];
  }
  ids_.insert(ids_.end(), balls_.fixed_id.begin(), balls_.fixed_id.end());
}

void WatchedPairs::append_fixed(Motion& motion) const {
  motion.x.resize(3 * content_count());
  motion.v.resize(3 * content_count());
  for (std::size_t row = balls_.first_fixed_row(); row < balls_.rows.size(); ++row) {
    const core::BallRow& r = balls_.rows[row];
    motion.x.insert(motion.x.end(), {r.x, r.y, r.z});
    motion.v.insert(motion.v.end(), 3, 0.0);
  }
}

std::uint32_t WatchedPairs::number_of(std::uint32_t row) const { return row < content_count() ? number_[row] : row - 1; }

core::BallId WatchedPairs::id_of(std::uint32_t number) const { return ids_[number]; }

void WatchedPairs::renew(const Motion& motion) {
  const auto find_numbers = [this] {
    number_.resize(content_count());
    for (std::uint32_t row = 0; row < content_count(); ++row) {
      const auto end = ids_.begin() + static_cast<std::ptrdiff_t>(content_count());
      number_[row] = static_cast<std::uint32_t>(std::lower_bound(ids_.begin(), end, balls_.id[row]) - ids_.begin());
    }
  };
  find_numbers();
  for (std::uint32_t row = 0; row < content_count(); ++row) {
    const double* x = &motion.x[3 * std::size_t{number_[row]}];
    const double* v = &motion.v[3 * std::size_t{number_[row]}];
    balls_.rows[row] = {x[0], x[1], x[2], balls_.rows[row].r, v[0], v[1], v[2], 0.0};
  }
  list_.build(balls_);
  find_numbers();
  std::vector<WatchedPair> known;
  known.swap(pairs_);
  for (const core::PairList* list : {&list_.ball_pairs(), &list_.fixed_pairs()}) {
    for (std::size_t p = 0; p < list->count; ++p) {
      const std::uint32_t a = number_of(list->i[p]), b = number_of(list->j[p]);
      WatchedPair pair{
          std::min(a, b), std::max(a, b), balls_.rows[list->i[p]].r + balls_.rows[list->j[p]].r, Branch::apart, {}, {}};
      pair.start = approach(pair, motion);
      const auto same = std::lower_bound(known.begin(), known.end(), pair, before);
      if (same != known.end() && !before(pair, *same)) {
        pair = *same;
      } else {
        const Branch said = branch_of(law(pair), pair.start);
        if (is_new_)
          pair.branch = said;
        else if (said != Branch::apart) {
          throw core::NumericsError(
              fmt::format("reference: balls {} and {} met unseen; their overlap is {} m: use a smaller rtol", id_of(pair.i),
                          id_of(pair.j), pair.start.overlap));
        }
      }
      pairs_.push_back(pair);
    }
  }
  std::sort(pairs_.begin(), pairs_.end(), before);
  is_new_ = false;
}

bool WatchedPairs::is_worn(const Motion& motion) const {
  for (std::uint32_t row = 0; row < content_count(); ++row) {
    const double* x = &motion.x[3 * std::size_t{number_[row]}];
    const double* v = &motion.v[3 * std::size_t{number_[row]}];
    const core::SkinReference& skin = list_.skins()[row];
    const double away = std::hypot(x[0] - skin.x, x[1] - skin.y, x[2] - skin.z);
    // Half as much again for what the ball's acceleration adds within the step.
    if (!(away + 1.5 * ahead_ * std::hypot(v[0], v[1], v[2]) <= std::sqrt(skin.skin2))) return true;
  }
  return false;
}

Approach WatchedPairs::approach(const WatchedPair& pair, const Motion& motion) const {
  // The very operations of the sweep, so that both see the same overlap to the last bit.
  const double* xi = &motion.x[3 * std::size_t{pair.i}];
  const double* xj = &motion.x[3 * std::size_t{pair.j}];
  const double* vi = &motion.v[3 * std::size_t{pair.i}];
  const double* vj = &motion.v[3 * std::size_t{pair.j}];
  const double x = xi[0] - xj[0], y = xi[1] - xj[1], z = xi[2] - xj[2];
  const double length = std::sqrt(x * x + y * y + z * z);
  const double inverse = 1.0 / length;
  return {pair.radii - length, -(x * (vi[0] - vj[0]) + y * (vi[1] - vj[1]) + z * (vi[2] - vj[2])) * inverse};
}

void WatchedPairs::note_end(const Motion& motion) {
  for (WatchedPair& pair : pairs_) pair.end = approach(pair, motion);
  evaluations_ += pairs_.size();
}

void WatchedPairs::begin_step() {
  for (WatchedPair& pair : pairs_) pair.start = pair.end;
}

void WatchedPairs::keep_branches(const Motion& motion, Part part, std::span<double> a) {
  const std::uint32_t n = balls_.content_count();
  evaluations_ += pairs_.size();
  for (const WatchedPair& pair : pairs_) {
    const bool fixed = pair.j >= n;
    if (part == (fixed ? Part::ball_pairs : Part::fixed_pairs)) continue;
    const ContactLaw& its = fixed ? wall_ : ball_;
    const Approach at = approach(pair, motion);
    if (branch_of(its, at) == pair.branch) continue;
    const double force = beyond_law(its, pair.branch, at, part);
    const double* xi = &motion.x[3 * std::size_t{pair.i}];
    const double* xj = &motion.x[3 * std::size_t{pair.j}];
    const double inverse = 1.0 / (pair.radii - at.overlap);
    for (std::size_t k = 0; k < 3; ++k) {
      const double along = force * (xi[k] - xj[k]) * inverse;
      a[3 * std::size_t{pair.i} + k] += along * inverse_mass_[pair.i];
      if (!fixed) a[3 * std::size_t{pair.j} + k] -= along * inverse_mass_[pair.j];
    }
  }
}

}  // namespace grainclock::benchmarks
