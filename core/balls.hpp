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
  double largest_radius = 0.0;       // m, of all balls
  double mean_diameter = 0.0;        // m, of the content
  std::vector<std::byte> spare;      // see reorder_values(); also for arrays that others keep beside the rows
};

/// `values[i] = old values[order[i]]` for i below order.size(). `spare` is memory for it, kept from call to call so that
/// reordering does not allocate; arrays of any types may share it.
template <class Value>
void reorder_values(Value* values, std::span<const std::uint32_t> order, std::vector<std::byte>& spare, int threads) {
  static_assert(std::is_trivially_copyable_v<Value>);
  const std::size_t n = order.size();
  if (spare.size() < n * sizeof(Value)) spare = std::vector<std::byte>(n * sizeof(Value));
  std::byte* moved = spare.data();
#pragma omp parallel num_threads(threads) if (threads > 1)
  {
#pragma omp for schedule(static)
    for (std::size_t i = 0; i < n; ++i) std::memcpy(moved + i * sizeof(Value), values + order[i], sizeof(Value));
#pragma omp for schedule(static)
    for (std::size_t i = 0; i < n; ++i) std::memcpy(values + i, moved + i * sizeof(Value), sizeof(Value));
  }
}

/// The same for an array that others keep beside the rows, which takes the length of `order`.
template <class Value>
void reorder_like(std::vector<Value>& values, std::span<const std::uint32_t> order, std::vector<std::byte>& spare,
                  int threads = 1) {
  reorder_values(values.data(), order, spare, threads);
  values.resize(order.size());
}

inline Vec3 position(const BallRow& row) { return {row.x, row.y, row.z}; }
inline Vec3 velocity(const BallRow& row) { return {row.vx, row.vy, row.vz}; }

}  // namespace grainclock::core
