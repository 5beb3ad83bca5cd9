// Which pairs may touch: fixed cubes (paper, section 3) with a skin per ball, and brute force beside it.
#pragma once

#include "core/balls.hpp"
#include "core/kernels.hpp"

#include <utility>

namespace grainclock::core {

/// Pairs of rows i, j, filled up with far rows to a multiple of kLanes.
struct PairList {
  std::vector<std::uint32_t> i, j;
  std::size_t count = 0;  // true pairs; the rest fills up vectors
  PairSpan span() const { return {i.data(), j.data(), i.size()}; }
  void clear();
  void add(std::uint32_t a, std::uint32_t b) { i.push_back(a); j.push_back(b); }
  /// Sets count and fills up with pairs of the first row and the row `far`, which cannot touch.
  void finish(std::uint32_t far);
};

/// How far ahead a list looks: skin = floor + (lifetime / 2 + ahead) |v| about x + v lifetime / 2. A ball that keeps its
/// velocity uses up nothing but the lifetime. Never changes results, only how often a list is made.
struct SkinRule {
  double floor = 0.004;     // m, skin of a ball at rest; the default is for balls of 0.44 m
  double lifetime = 0.012;  // s, for which a moving ball's skin should last
  double ahead = 0.0;       // s, by which partners must be listed before they meet
  /// A default in proportion to the balls.
  static SkinRule for_diameter(double mean_diameter);
};

/// Half lists: content against content (i < j) and content against fixed balls.
class NeighbourList {
 public:
  NeighbourList() = default;
  /// `reach`: largest gap at which a pair interacts [m].
  NeighbourList(double reach, SkinRule rule, int threads) : reach_(reach), rule_(rule), threads_(threads) {}

  /// Sorts the content of `balls` into cubes and lists all pairs that can come within reach while every
  /// ball keeps to its skin. Returns the order applied (see Balls::reorder): arrays that
  /// run beside the rows must follow it. `leaving` marks rows to be removed (may be empty).
  std::vector<std::uint32_t> build(Balls& balls, const std::vector<std::uint8_t>& leaving = {});

  const PairList& ball_pairs() const { return ball_pairs_; }
  const PairList& fixed_pairs() const { return fixed_pairs_; }
  /// One reference per content row; a ball within sqrt(skin2) of it cannot meet an unlisted one.
  const std::vector<SkinReference>& skins() const { return skins_; }
  std::uint64_t builds() const { return builds_; }

 private:
  double reach_ = 0.0;
  SkinRule rule_;
  int threads_ = 1;
  PairList ball_pairs_, fixed_pairs_;
  std::vector<SkinReference> skins_;
  std::uint64_t builds_ = 0;
};

/// Every pair (i < j, i content) whose gap is at most `reach` [m], by testing all; sorted.
std::vector<std::pair<std::uint32_t, std::uint32_t>> brute_force_pairs(const Balls& balls, double reach);

}  // namespace grainclock::core
