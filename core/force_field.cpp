#include "core/force_field.hpp"

#include "core/check.hpp"

#include <algorithm>

namespace grainclock::core {

ForceField::ForceField(const State& state, const Materials& materials, const Vec3& gravity, bool outlet_open, int threads)
    : materials_(materials), gravity_(gravity), balls_(state, materials, !outlet_open) {
  const double length = state.length_scale > 0.0 ? state.length_scale : balls_.mean_diameter;
  list_ = NeighbourList(materials.reach(), SkinRule::for_diameter(length), threads);
  scale_ = force_scale(materials, gravity.norm(), length, 1, balls_.content_count());
  ids_ = balls_.id;
  std::sort(ids_.begin(), ids_.end());
}

void ForceField::acceleration(std::span<const double> x, std::span<const double> v, std::span<double> a) {
  const std::uint32_t n = balls_.content_count();
  const auto find_places = [&] {
    place_.resize(n);
    for (std::uint32_t row = 0; row < n; ++row) {
      place_[row] = static_cast<std::uint32_t>(std::lower_bound(ids_.begin(), ids_.end(), balls_.id[row]) - ids_.begin());
    }
  };
  if (place_.empty()) find_places();
  const auto load = [&] {
    bool safe = has_list_;
    for (std::uint32_t row = 0; row < n; ++row) {
      const std::size_t at = 3 * std::size_t{place_[row]};
      BallRow& r = balls_.rows[row];
      r = {x[at], x[at + 1], x[at + 2], r.r, v[at], v[at + 1], v[at + 2], 0.0};
      if (!safe) continue;
      const SkinReference& skin = list_.skins()[row];
      const double dx = r.x - skin.x, dy = r.y - skin.y, dz = r.z - skin.z;
      safe = dx * dx + dy * dy + dz * dz <= skin.skin2;
    }
    return safe;
  };
  if (!load()) {
    list_.build(balls_);
    has_list_ = true;
    find_places();
  }
  sums_.assign(n + std::size_t{1}, IntVec{});  // the far row gets one too
  bool overloaded = false;
  for (const bool fixed : {false, true}) {
    const PairList& pairs = fixed ? list_.fixed_pairs() : list_.ball_pairs();
    SweepTotals totals;
    kernels().sweep(balls_.rows.data(), pairs.span(), sweep_law(materials_, fixed, scale_, 0.0), sums_.data(), totals, nullptr);
    contact_evaluations_ += pairs.count;
    overloaded = overloaded || totals.overloaded;
  }
  if (overloaded) {
    throw NumericsError("a contact force or overlap is beyond the limit, or not finite, in a force evaluation; use a smaller step or tolerance");
  }
  for (std::uint32_t row = 0; row < n; ++row) {
    for (int k = 0; k < 3; ++k) {
      a[3 * std::size_t{place_[row]} + k] =
          gravity_[k] + static_cast<double>(sums_[row].v[k]) * (scale_.unit * balls_.inverse_mass[row]);
    }
  }
}

}  // namespace grainclock::core
