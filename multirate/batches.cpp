#include "multirate/batches.hpp"

#include "core/share_work.hpp"

#include <algorithm>
#include <atomic>
#include <utility>

namespace grainclock::multirate {

namespace {

/// Lowers a level that several threads may lower at once.
void lower(Level& level, Level to) {
  std::atomic_ref<Level> shared(level);
  Level now = shared.load(std::memory_order_relaxed);
  while (to < now && !shared.compare_exchange_weak(now, to, std::memory_order_relaxed)) {
  }
}

}  // namespace

void ChangedPairs::clear() {
  pairs.clear();
  from.clear();
  to.clear();
}

void ChangedPairs::add(std::uint32_t i, std::uint32_t j, Level its_from, Level its_to) {
  pairs.add(i, j);
  from.push_back(its_from);
  to.push_back(its_to);
}

void ChangedPairs::finish(std::uint32_t far) {
  pairs.finish(far);
  from.resize(pairs.i.size(), kSkipped);
  to.resize(pairs.i.size(), kSkipped);
}

Batches::Batches(int levels, int threads)
    : threads_(threads),
      coarsest_(static_cast<Level>(levels - 1)),
      batches_(static_cast<std::size_t>(levels)),
      rows_(static_cast<std::size_t>(levels)),
      balls_(static_cast<std::size_t>(levels)),
      level_pairs_(static_cast<std::size_t>(threads)),
      changed_(static_cast<std::size_t>(threads)) {}

void Batches::sort_pairs(bool fixed, const core::PairList& pairs, PairBook& book, const std::vector<Level>& level_of,
                         double reach, std::uint32_t far_row) {
  // Pairs that are skipped are sorted, too, but nowhere: which are follows no pattern.
  const auto bin_of = [](Level level) { return std::min<std::size_t>(level, kMostLevels); };
  const auto begin_of = [&](int t) {
    return pairs.count * static_cast<std::size_t>(t) / static_cast<std::size_t>(threads_);
  };
  core::share_work(threads_, [&](int t) {
    LevelCount& count = level_pairs_[static_cast<std::size_t>(t)];
    count.fill(0);
    for (std::size_t p = begin_of(t); p < begin_of(t + 1); ++p) {
      const std::uint32_t i = pairs.i[p], j = fixed ? i : pairs.j[p];
      const Level level = std::max(book.level[p], std::min(level_of[i], level_of[j]));  // skipped, or 0 so far
      book.level[p] = level;
      lower(drift_level_[i], level);
      if (!fixed) lower(drift_level_[j], level);
      ++count[bin_of(level)];
    }
  });
  // Where each thread's pairs of a level begin in that level's batch.
  for (Level l = 0; l <= coarsest_; ++l) {
    std::size_t total = 0;
    for (LevelCount& count : level_pairs_) total += std::exchange(count[l], total);
    core::PairList& batch = batches_[l].pairs(fixed);
    batch.i.resize(total);
    batch.j.resize(total);
  }
  core::share_work(threads_, [&](int t) {
    struct Place {
      std::uint32_t *i, *j;
      std::size_t n, step;
    };
    std::uint32_t nowhere = 0;
    std::array<Place, kMostLevels + 1> places;
    places.fill({&nowhere, &nowhere, 0, 0});
    for (Level l = 0; l <= coarsest_; ++l) {
      core::PairList& batch = batches_[l].pairs(fixed);
      places[l] = {batch.i.data(), batch.j.data(), level_pairs_[static_cast<std::size_t>(t)][l], 1};
    }
    ChangedPairs& changed = changed_[static_cast<std::size_t>(t)];
    changed.clear();
    for (std::size_t p = begin_of(t); p < begin_of(t + 1); ++p) {
      const Level level = book.level[p];
      Place& to = places[bin_of(level)];
      to.i[to.n] = pairs.i[p];
      to.j[to.n] = pairs.j[p];
      to.n += to.step;
      const bool has_force = book.overlap[p] >= -reach;
      if (has_force && book.before[p] != level) changed.add(pairs.i[p], pairs.j[p], book.before[p], level);
    }
    changed.finish(far_row);
  });
  for (Batch& batch : batches_) batch.pairs(fixed).finish(far_row);
}

void Batches::sort_balls(const std::vector<Level>& level) {
  for (auto& rows : rows_) rows.clear();
  std::fill(balls_.begin(), balls_.end(), std::size_t{0});
  finest_ = coarsest_;
  for (std::uint32_t row = 0; row < level.size(); ++row) {
    rows_[drift_level_[row]].push_back(row);
    ++balls_[level[row]];
    finest_ = std::min(finest_, drift_level_[row]);
  }
}

}  // namespace grainclock::multirate
