// Flat arrays of balls, laid out for vector evaluation: one 64-byte row per ball.
//
// Content rows come first, sorted in space, then one far-away row that fills up
// incomplete vectors of pairs, then the fixed balls. No physics here.
#pragma once

#include "core/materials.hpp"
#include "core/rows.hpp"
#include "core/state.hpp"

#include <cstddef>
#include <cstring>
#include <span>
#include <type_traits>

namespace grainclock::core {

class Balls {
 public:
  Balls() = default;
  /// Takes every ball of `state`; plug balls only if `with_plug`.
  /// Row velocities and positions are the state's.
  Balls(const State& state, const Materials& materials, bool with_plug);

  std::uint32_t content_count() const { return static_cast<std::uint32_t>(inverse_mass.size()); }
  std::uint32_t fixed_count() const { return static_cast<std::uint32_t>(fixed_id.size()); }
  /// The row that nothing ever touches.
  std::uint32_t far_row() const { return content_count(); }
  std::uint32_t first_fixed_row() const { return content_count() + 1; }

  Kind kind_of(std::uint32_t row) const;
  BallId id_of(std::uint32_t row) const;

  /// Reorders the content: new row i is old row order[i]; rows left out are removed.
  void reorder(std::span<const std::uint32_t> order, int threads = 1);

  std::vector<BallRow> rows;
  std::vector<double> inverse_mass;  // 1/kg, content only
  std::vector<BallId> id;            // content only
  std::vector<BallId> fixed_id;
  std::vector<Kind> fixed_kind;
  double largest_radius = 0.0;  // m, of all balls
  double mean_diameter = 0.0;   // m, of the content
  std::vector<BallRow> spare;   // see reorder_like(); also for arrays that others keep beside the rows
};

/// `values[i] = old values[order[i]]`, for arrays that others keep beside the rows. `spare` is memory for it, kept from call
/// to call so that reordering does not allocate.
template <class Value>
void reorder_like(std::vector<Value>& values, std::span<const std::uint32_t> order, std::vector<BallRow>& spare,
                  int threads = 1) {
  static_assert(std::is_trivially_copyable_v<Value>);
  const std::size_t n = order.size();
  if (spare.size() * sizeof(BallRow) < n * sizeof(Value)) spare.resize(n * sizeof(Value) / sizeof(BallRow) + 1);
  std::byte* moved = reinterpret_cast<std::byte*>(spare.data());
  Value* to = values.data();
#pragma omp parallel num_threads(threads) if (threads > 1)
  {
#pragma omp for schedule(static)
    for (std::size_t i = 0; i < n; ++i) std::memcpy(moved + i * sizeof(Value), to + order[i], sizeof(Value));
#pragma omp for schedule(static)
    for (std::size_t i = 0; i < n; ++i) std::memcpy(to + i, moved + i * sizeof(Value), sizeof(Value));
  }
  values.resize(n);
}
/// Rows change places with the spare ones: half the way.
void reorder_like(std::vector<BallRow>& rows, std::span<const std::uint32_t> order, std::vector<BallRow>& spare,
                  int threads = 1);

inline Vec3 position(const BallRow& row) { return {row.x, row.y, row.z}; }
inline Vec3 velocity(const BallRow& row) { return {row.vx, row.vy, row.vz}; }

}  // namespace grainclock::core
