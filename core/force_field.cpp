#include "core/force_field.hpp"

#include "core/check.hpp"

#include <algorithm>

namespace grainclock::core {

ForceField::ForceField(const State& state, const Materials& materials, const Vec3& gravity, bool outlet_open, int threads)
    : materials_(materials), undamped_(materials), gravity_(gravity), balls_(state, materials, !outlet_open) {
  undamped_.ball.c = undamped_.wall.c = 0.0;
  const double length = state.length_scale > 0.0 ? state.length_scale : balls_.mean_diameter;
  list_ = NeighbourList(materials.reach(), SkinRule::for_diameter(length), threads);
  scale_ = force_scale(materials, gravity.norm(), length, 1, balls_.content_count());
  ids_ = balls_.id;
  std::sort(ids_.begin(), ids_.end());
  sums_.resize(balls_.content_count() + std::size_t{1});
  find_places();
}

void ForceField::find_places() {
  place_.resize(balls_.content_count());
  for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
    place_[row] = static_cast<std::uint32_t>(std::lower_bound(ids_.begin(), ids_.end(), balls_.id[row]) - ids_.begin());
  }
}

bool ForceField::load(std::span<const double> x, std::span<const double> v) {
  bool safe = has_list_;
  for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
    const std::size_t at = 3 * std::size_t{place_[row]};
    BallRow& r = balls_.rows[row];
    r = {x[at], x[at + 1], x[at + 2], r.r, v[at], v[at + 1], v[at + 2], 0.0};
    if (!safe) continue;
    const SkinReference& skin = list_.skins()[row];
    const double dx = r.x - skin.x, dy = r.y - skin.y, dz = r.z - skin.z;
    safe = dx * dx + dy * dy + dz * dz <= skin.skin2;
  }
  return safe;
}

void ForceField::sweep(bool fixed, bool damped) {
  const PairList& pairs = fixed ? list_.fixed_pairs() : list_.ball_pairs();
  const SweepLaw law = sweep_law(damped ? materials_ : undamped_, fixed, scale_, 0.0);
  SweepTotals totals;
  kernels().sweep(balls_.rows.data(), pairs.span(), law, sums_.data(), totals, nullptr);
  contact_evaluations_ += pairs.count;
  overloaded_ = overloaded_ || totals.overloaded;
}

void ForceField::sum_up(Part part) {
  if (part == Part::springs || part == Part::dashpots) {
    for (const bool fixed : {false, true}) sweep(fixed, false);
  }
  if (part == Part::dashpots) {
    for (IntVec& sum : sums_)
      for (std::int64_t& component : sum.v) component = -component;
  }
  if (part == Part::all || part == Part::dashpots || part == Part::ball_pairs) sweep(false, true);
  if (part == Part::all || part == Part::dashpots || part == Part::fixed_pairs) sweep(true, true);
}

void ForceField::acceleration(std::span<const double> x, std::span<const double> v, std::span<double> a, Part part) {
  if (!load(x, v)) {
    list_.build(balls_);
    has_list_ = true;
    find_places();
  }
  overloaded_ = false;
  sum_up(part);
  const double none[3] = {0.0, 0.0, 0.0};
  const double* gravity = part == Part::dashpots || part == Part::fixed_pairs ? none : gravity_.data();
  for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
    const double inertia = scale_.unit * balls_.inverse_mass[row];
    double* out = &a[3 * std::size_t{place_[row]}];
    for (int k = 0; k < 3; ++k) out[k] = gravity[k] + static_cast<double>(sums_[row].v[k]) * inertia;
    sums_[row] = {};
  }
  sums_.back() = {};
  if (overloaded_) {
    throw NumericsError(
        "a contact force or overlap is beyond the limit, or not finite, in a force evaluation; use a smaller step or "
        "tolerance");
  }
}

}  // namespace grainclock::core
