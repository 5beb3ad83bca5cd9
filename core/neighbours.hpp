// Which pairs may touch: fixed cubes (paper, section 3) with a skin per ball, and brute force beside it.
#pragma once

#include "core/fixed_balls.hpp"
#include "core/kernels.hpp"

#include <utility>

namespace grainclock::core {

/// Pairs of rows i, j, filled up with far rows to a multiple of kLanes.
struct PairList {
  std::vector<std::uint32_t> i, j;
  std::size_t count = 0;  // true pairs; the rest fills up vectors
  PairSpan span() const { return {i.data(), j.data(), i.size()}; }
  void clear();
  void add(std::uint32_t a, std::uint32_t b) {
    i.push_back(a);
    j.push_back(b);
  }
  /// Sets count and fills up with pairs of the first row and the row `far`, which cannot touch.
  void finish(std::uint32_t far);
};

/// How far ahead a list looks: skin = floor + (lifetime / 2 + ahead) |v| about x + v lifetime / 2. A ball that keeps its
/// velocity uses up nothing but the lifetime. Never changes results, only how often a list is made.
struct SkinRule {
  double floor = 0.004;     // m, skin of a ball at rest, to begin with; the default is for balls of 0.44 m
  double lifetime = 0.012;  // s, for which a moving ball's skin should last, to begin with
  double ahead = 0.0;       // s, by which partners must be listed before they meet
  /// A default in proportion to the balls.
  static SkinRule for_diameter(double mean_diameter);
};

/// Half lists: content against content (i < j) and content against fixed balls, both in ascending order of i, and of j where
/// i is the same. All memory is kept from build to build.
class NeighbourList {
 public:
  NeighbourList() = default;
  /// `reach`: largest gap at which a pair interacts [m].
  NeighbourList(double reach, SkinRule rule, int threads, const Kernels& kernels = core::kernels())
      : reach_(reach), rule_(rule), threads_(threads), kernels_(&kernels) {}

  /// Sorts the content of `balls` into cubes and lists all pairs that can come within reach while every
  /// ball keeps to its skin. Returns the order applied (see Balls::reorder), which lasts until the next build: arrays that
  /// run beside the rows must follow it. The fixed balls must be the same at every call.
  const std::vector<std::uint32_t>& build(Balls& balls);
  /// Removes the content that `leaving` marks by row, and its pairs, without a new list. Returns the order as build() does.
  const std::vector<std::uint32_t>& remove(Balls& balls, const std::vector<std::uint8_t>& leaving);

  /// To be told of each evaluation of all listed pairs. By these counts the skins adapt from build to build, so
  /// that making lists and evaluating the pairs which are listed only because of the skin cost about least together.
  /// Never told, they stay as they are.
  void count_sweep() { ++sweeps_; }

  const PairList& ball_pairs() const { return ball_pairs_; }
  const PairList& fixed_pairs() const { return fixed_pairs_; }
  /// One reference per content row; a ball within sqrt(skin2) of it cannot meet an unlisted one.
  const std::vector<SkinReference>& skins() const { return skins_; }
  std::uint64_t builds() const { return builds_; }

 private:
  /// What one thread finds.
  struct Share {
    PairList balls, fixed;              // of its rows; the first thread's own are in the list itself
    std::vector<std::uint32_t> wide;    // its rows whose sphere is larger than the common one
    std::vector<std::uint64_t> beyond;  // pairs of these, i 2^32 + j, in any order
    std::vector<std::uint64_t> late;    // pairs of its rows that any thread found so, sorted
  };
  void adapt_skins(double diameter);
  Vec3 reference(const BallRow& row) const;
  double skin(const BallRow& row) const;
  void choose_cubes(const Balls& balls);
  void sort_content(Balls& balls);
  void place_spheres(const Balls& balls, int thread);
  void find_beyond(int thread);
  void find_ball_pairs(int thread);
  void find_fixed_pairs(const Balls& balls, int thread);
  void join(PairList& list, PairList Share::*part, std::uint32_t far);
  /// Where a thread's share of the cubes and their rows begins; shares are about equal in rows.
  std::size_t first_cube(int thread) const;
  std::uint32_t first_row(int thread) const;

  double reach_ = 0.0;
  SkinRule rule_;
  int threads_ = 1;
  const Kernels* kernels_ = nullptr;
  PairList ball_pairs_, fixed_pairs_;
  std::vector<SkinReference> skins_;
  std::uint64_t builds_ = 0, sweeps_ = 0;  // sweeps since the last build

  CubeGrid grid_;
  double common_ = 0.0;  // m, largest sphere that the grid allows for
  CubeSort sorted_;
  std::vector<std::uint32_t> kept_, new_row_;  // of remove(): rows that stay, and where rows are then
  std::vector<double> x_, y_, z_, sphere_;  // m, references and spheres of the sorted rows; wide ones have no x
  std::vector<double> sample_;
  std::vector<Share> shares_;
  FixedBalls fixed_;
};

/// Every pair (i < j, i content) whose gap is at most `reach` [m], by testing all; sorted.
std::vector<std::pair<std::uint32_t, std::uint32_t>> brute_force_pairs(const Balls& balls, double reach);

}  // namespace grainclock::core
