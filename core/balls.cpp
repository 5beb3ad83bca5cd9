#include "core/balls.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <numbers>

namespace grainclock::core {

namespace {

BallRow row_of(const Vec3& x, const Vec3& v, double r) { return {x.x(), x.y(), x.z(), r, v.x(), v.y(), v.z(), 0.0}; }

// Far enough to touch nothing, near enough that every intermediate of the sweep stays finite.
constexpr double kFar = 1e100;

}  // namespace

Balls::Balls(const State& state, const Materials& materials, bool with_plug) {
  const auto present = [&](std::size_t i) { return with_plug || state.kind[i] != Kind::plug; };
  const std::size_t content = state.count(Kind::content);
  rows.reserve(state.size() + 1);  // else they might take twice their room
  inverse_mass.reserve(content);
  id.reserve(content);
  double diameters = 0.0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] != Kind::content) continue;
    rows.push_back(row_of(state.position[i], state.velocity[i], state.radius[i]));
    inverse_mass.push_back(1.0 / materials.mass(state.radius[i]));
    id.push_back(state.id[i]);
    diameters += 2.0 * state.radius[i];
    largest_radius = std::max(largest_radius, state.radius[i]);
  }
  GC_REQUIRE(!id.empty(), "the state holds no content balls: nothing can move; add balls of kind content");
  rows.push_back(row_of({kFar, 0.0, 0.0}, Vec3::Zero(), 0.0));
  mean_diameter = diameters / static_cast<double>(id.size());
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] == Kind::content || !present(i)) continue;
    rows.push_back(row_of(state.position[i], Vec3::Zero(), state.radius[i]));
    fixed_id.push_back(state.id[i]);
    fixed_kind.push_back(state.kind[i]);
    largest_radius = std::max(largest_radius, state.radius[i]);
  }
}

Kind Balls::kind_of(std::uint32_t row) const {
  return row < content_count() ? Kind::content : fixed_kind[row - first_fixed_row()];
}

BallId Balls::id_of(std::uint32_t row) const { return row < content_count() ? id[row] : fixed_id[row - first_fixed_row()]; }

void Balls::reorder(std::span<const std::uint32_t> order, int threads) {
  const std::uint32_t far = far_row();
  reorder_like(rows, order, spare, threads);
  rows.insert(rows.end(), spare.begin() + far, spare.end());
  reorder_like(inverse_mass, order, spare, threads);
  reorder_like(id, order, spare, threads);
}

void reorder_like(std::vector<BallRow>& rows, std::span<const std::uint32_t> order, std::vector<BallRow>& spare,
                  int threads) {
  const std::size_t n = order.size();
  spare.reserve(rows.size());  // else it might double
  spare.resize(std::max(spare.size(), rows.size()));
  BallRow* to = spare.data();
#pragma omp parallel for num_threads(threads) schedule(static) if (threads > 1)
  for (std::size_t i = 0; i < n; ++i) to[i] = rows[order[i]];
  rows.swap(spare);
  rows.resize(n);
}

}  // namespace grainclock::core
