// Who takes part at which level: contacts in contiguous batches, balls at the finest level of their contacts.
#pragma once

#include "core/neighbours.hpp"
#include "multirate/level_choice.hpp"

#include <array>
#include <vector>

namespace grainclock::multirate {

/// Contacts of one level, contiguous.
struct Batch {
  core::PairList ball, fixed;
  core::PairList& pairs(bool with_fixed) { return with_fixed ? fixed : ball; }
};

/// Pairs that change level at a renewal, whole vectors.
struct ChangedPairs {
  core::PairList pairs;
  std::vector<Level> from, to;

  void clear();
  void add(std::uint32_t i, std::uint32_t j, Level its_from, Level its_to);
  void finish(std::uint32_t far);
};

class Batches {
 public:
  Batches(int levels, int threads);

  /// Balls take part at their own levels, until sort_pairs() lowers them.
  void begin(const std::vector<Level>& level) { drift_level_.assign(level.begin(), level.end()); }
  /// Sorts contacts by the finer of the levels `level` of their balls, lowers the levels at which their balls take part, and
  /// notes pairs that change level: those with a force, within `reach` [m].
  void sort_pairs(bool fixed, const core::PairList& pairs, PairBook& book, const std::vector<Level>& level, double reach,
                  std::uint32_t far_row);
  /// Sorts balls by the finest level at which they take part, and counts them by their own.
  void sort_balls(const std::vector<Level>& level);

  Batch& operator[](Level level) { return batches_[level]; }
  const Batch& operator[](Level level) const { return batches_[level]; }
  std::size_t contacts(Level level) const { return batches_[level].ball.count + batches_[level].fixed.count; }
  /// Rows that take part at this level and at coarser ones, no finer.
  const std::vector<std::uint32_t>& rows(Level level) const { return rows_[level]; }
  std::size_t balls(Level level) const { return balls_[level]; }
  Level finest() const { return finest_; }
  int levels() const { return coarsest_ + 1; }
  /// Of the last sort_pairs(), per thread.
  const std::vector<ChangedPairs>& changed() const { return changed_; }

 private:
  using LevelCount = std::array<std::size_t, kMostLevels + 1>;  // the last: skipped

  int threads_;
  Level coarsest_, finest_ = 0;
  std::vector<Batch> batches_;                    // per level
  std::vector<std::vector<std::uint32_t>> rows_;  // per drift level
  std::vector<std::size_t> balls_;                // per level of their own
  std::vector<Level> drift_level_;                // the finest level at which a ball takes part
  std::vector<LevelCount> level_pairs_;           // per thread
  std::vector<ChangedPairs> changed_;             // per thread, of one kind
};

}  // namespace grainclock::multirate
