// Who takes part at which level: contacts in contiguous batches, balls at the finest level of their contacts.
#pragma once

#include "core/row_shares.hpp"
#include "multirate/level_choice.hpp"

#include <array>
#include <vector>

namespace grainclock::multirate {

constexpr std::size_t kWorthThreads = 1024;  // pairs or balls

/// Contacts of one level, contiguous, and the threads' shares of them.
struct Batch {
  core::PairList ball, fixed;
  std::vector<core::RowShare> shares;
  core::PairList& pairs(bool with_fixed) { return with_fixed ? fixed : ball; }
};

/// Pairs that change level at a renewal, whole vectors.
struct ChangedPairs {
  core::PairList pairs;
  std::vector<Level> from, to;

  /// Room to write down the indices of those among n pairs of a list, and one more that need not be one.
  std::uint32_t* room_for(std::size_t n);
  /// Takes over what `count` of them stand for.
  void take(std::size_t count, const core::PairList& of, const PairBook& book, std::uint32_t far);

 private:
  std::vector<std::uint32_t> which_;
};

class Batches {
 public:
  Batches(int levels, int threads);

  /// So many balls have no contacts, until sort_pairs() is told of them.
  void begin(std::size_t balls);
  /// Sorts contacts by the finer of the levels `level` of their balls, and notes pairs that change level: those with a force,
  /// within `reach` [m].
  void sort_pairs(bool fixed, const core::PairList& pairs, PairBook& book, const std::vector<Level>& level, double reach,
                  std::uint32_t far_row);
  /// Cuts sorted contacts into shares for threads, where that pays.
  void cut(std::uint32_t rows);
  /// Sorts balls by the finest level at which they take part, and counts them by their own `level`.
  void sort_balls(const std::vector<Level>& level);

  Batch& operator[](Level level) { return batches_[level]; }
  const Batch& operator[](Level level) const { return batches_[level]; }
  std::size_t contacts(Level level) const { return batches_[level].ball.count + batches_[level].fixed.count; }
  /// Rows that take part at this level, their own or that of a contact, and at no finer one.
  const std::vector<std::uint32_t>& rows(Level level) const { return rows_[level]; }
  /// To which rows of rows(finest) the threads' sweeps of contacts up to `active` add.
  const TouchedRows& touched(Level finest, Level active) const {
    return touched_[static_cast<std::size_t>(finest) * batches_.size() + active];
  }
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
  std::vector<TouchedRows> touched_;              // per drift level and active level
  std::vector<std::size_t> balls_;                // per level of their own
  std::vector<std::vector<Level>> finest_level_;  // per thread and ball, of its contacts
  std::vector<LevelCount> level_pairs_;           // per thread
  std::vector<ChangedPairs> changed_;             // per thread, of one kind
};

}  // namespace grainclock::multirate
