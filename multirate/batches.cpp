#include "multirate/batches.hpp"

#include "core/share_work.hpp"

#include <algorithm>
#include <utility>

namespace grainclock::multirate {

std::uint32_t* ChangedPairs::room_for(std::size_t n) {
  if (which_.size() < n + 1) which_.resize(n + 1);
  return which_.data();
}

void ChangedPairs::take(std::size_t count, const core::PairList& of, const PairBook& book, std::uint32_t far) {
  pairs.i.resize(count);
  pairs.j.resize(count);
  from.resize(count);
  to.resize(count);
  for (std::size_t c = 0; c < count; ++c) {
    const std::uint32_t p = which_[c];
    pairs.i[c] = of.i[p];
    pairs.j[c] = of.j[p];
    from[c] = book.before[p];
    to[c] = book.level[p];
  }
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
      finest_level_(static_cast<std::size_t>(threads)),
      level_pairs_(static_cast<std::size_t>(threads)),
      changed_(static_cast<std::size_t>(threads)) {}

void Batches::begin(std::size_t balls) {
  for (std::vector<Level>& finest : finest_level_) finest.assign(balls, kSkipped);
}

void Batches::sort_pairs(bool fixed, const core::PairList& pairs, PairBook& book, const std::vector<Level>& level_of,
                         double reach, std::uint32_t far_row) {
  // Pairs that are skipped are sorted, too, but nowhere: which are follows no pattern.
  const auto bin_of = [](Level level) { return std::min<std::size_t>(level, kMostLevels); };
  const auto begin_of = [&](int t) {
    return pairs.count * static_cast<std::size_t>(t) / static_cast<std::size_t>(threads_);
  };
  core::share_work(threads_, [&](int t) {
    LevelCount count{};  // those of level_pairs_ would share cache lines
    // Levels are bytes, which may alias anything: what the loop reads must be its own.
    const std::uint32_t *const of_i = pairs.i.data(), *const of_j = fixed ? of_i : pairs.j.data();
    const Level* const of_ball = level_of.data();
    Level *const finest = finest_level_[static_cast<std::size_t>(t)].data(), *const of_pair = book.level.data();
    for (std::size_t p = begin_of(t), end = begin_of(t + 1); p < end; ++p) {
      const std::uint32_t i = of_i[p], j = of_j[p];
      const Level level = std::max(of_pair[p], std::min(of_ball[i], of_ball[j]));  // skipped, or 0 so far
      of_pair[p] = level;
      ++count[bin_of(level)];
      finest[i] = std::min(finest[i], level);
      if (!fixed) finest[j] = std::min(finest[j], level);
    }
    level_pairs_[static_cast<std::size_t>(t)] = count;
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
    const std::size_t begin = begin_of(t), end = begin_of(t + 1);
    std::uint32_t* which = changed.room_for(end - begin);
    std::size_t count = 0;
    for (std::size_t p = begin; p < end; ++p) {
      const Level level = book.level[p];
      Place& to = places[bin_of(level)];
      to.i[to.n] = pairs.i[p];
      to.j[to.n] = pairs.j[p];
      to.n += to.step;
      which[count] = static_cast<std::uint32_t>(p);
      count += (book.overlap[p] >= -reach) & (book.before[p] != level) ? 1 : 0;
    }
    changed.take(count, pairs, book, far_row);
  });
  for (Batch& batch : batches_) batch.pairs(fixed).finish(far_row);
}

void Batches::cut(std::uint32_t rows) {
  for (Batch& batch : batches_) {
    batch.shares.resize(batch.ball.count + batch.fixed.count >= kWorthThreads ? static_cast<std::size_t>(threads_) : 1);
    core::cut_shares(batch.ball, batch.fixed, rows, batch.shares);
  }
  touched_.clear();
  for (Level finest = 0; finest <= coarsest_; ++finest) {
    TouchedRows touched(threads_);
    for (Level active = 0; active <= coarsest_; ++active) {
      if (active >= finest) touched.add(batches_[active].shares);
      touched_.push_back(touched);
    }
  }
}

void Batches::sort_balls(const std::vector<Level>& level) {
  for (auto& rows : rows_) rows.clear();
  std::fill(balls_.begin(), balls_.end(), std::size_t{0});
  finest_ = coarsest_;
  for (std::uint32_t row = 0; row < level.size(); ++row) {
    Level its = level[row];
    for (const std::vector<Level>& finest : finest_level_) its = std::min(its, finest[row]);
    rows_[its].push_back(row);
    ++balls_[level[row]];
    finest_ = std::min(finest_, its);
  }
}

}  // namespace grainclock::multirate
