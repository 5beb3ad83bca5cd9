#include "core/neighbours.hpp"

#include "core/share_work.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace grainclock::core {

namespace {

constexpr std::size_t kSample = 1024;     // balls that speak for all when cubes are chosen
constexpr std::uint32_t kGone = ~std::uint32_t{0};  // row of a ball that has left
constexpr double kWideShare = 0.01;       // of the balls, may have a sphere too large for the cubes
constexpr double kWorthWide = 1.1;        // unless it is larger by no more than this
constexpr double kRounding = 1.0 + 1e-6;  // of cube edges, far above that of cube coordinates
constexpr double kPairsAtFirst = 3.5;     // expected per ball
// Measured on the silo at rest and in flow; half or twice as much changes the time of a step by 1 %.
constexpr double kBuildWorth =
    20.0;                          // evaluations of pairs, per ball, that take as long as a build with all that follows it
constexpr double kSurplus = 33.0;  // pairs per ball that a small floor lists in a packing, over floor in diameters
constexpr double kLeastFloor = 3e-4, kMostFloor = 0.06;  // diameters
constexpr double kCubesAnyway = 4096.0;                  // so many cubes may be, however few the balls
constexpr double kMostCubes = 4.0;  // per ball: scattered balls (free fall, blow-up) must not cost memory

/// Makes room for `wanted` pairs and all that the memory holds; a little to spare, where a vector would double.
void make_room(PairList& pairs, std::size_t wanted) {
  for (auto* rows : {&pairs.i, &pairs.j}) {
    if (rows->capacity() < wanted) rows->reserve(wanted + wanted / 16);
    rows->resize(rows->capacity());
  }
}

/// Merges `late` pairs, i 2^32 + j, into the first `count` of `pairs`; both are sorted.
void merge(PairList& pairs, const std::vector<std::uint64_t>& late) {
  std::size_t from = pairs.count, to = pairs.count + late.size();
  make_room(pairs, to);
  pairs.count = to;
  for (auto pair = late.rbegin(); pair != late.rend(); ++pair) {
    while (from > 0 && (std::uint64_t{pairs.i[from - 1]} << 32 | pairs.j[from - 1]) > *pair) {
      --from, --to;
      pairs.i[to] = pairs.i[from];
      pairs.j[to] = pairs.j[from];
    }
    --to;
    pairs.i[to] = static_cast<std::uint32_t>(*pair >> 32);
    pairs.j[to] = static_cast<std::uint32_t>(*pair);
  }
}

}  // namespace

void PairList::clear() {
  i.clear();
  j.clear();
  count = 0;
}

void PairList::finish(std::uint32_t far) {
  count = i.size();
  while (i.size() % kLanes != 0) add(0, far);
}

SkinRule SkinRule::for_diameter(double mean_diameter) {
  SkinRule rule;
  const double scale = mean_diameter / 0.44;
  rule.floor *= scale;
  rule.lifetime *= std::sqrt(scale);  // speeds go with sqrt(g d)
  return rule;
}

const std::vector<std::uint32_t>& NeighbourList::build(Balls& balls) {
  ++builds_;
  if (sweeps_ > 0) adapt_skins(balls.mean_diameter);
  sweeps_ = 0;
  shares_.resize(static_cast<std::size_t>(threads_));
  choose_cubes(balls);
  sort_content(balls);
  const double common_reach = common_ + 0.5 * reach_;
  if (balls.fixed_count() > 0 && !fixed_.serves(common_reach)) fixed_.prepare(balls, common_reach);
  const std::size_t n = balls.content_count();
  skins_.resize(n);
  for (auto* values : {&x_, &y_, &z_, &sphere_}) values->resize(n + kLanes);
  share_work(threads_, [&](int t) { place_spheres(balls, t); });
  share_work(threads_, [&](int t) { find_beyond(t); });
  share_work(threads_, [&](int t) {
    find_ball_pairs(t);
    find_fixed_pairs(balls, t);
  });
  join(ball_pairs_, &Share::balls, balls.far_row());
  join(fixed_pairs_, &Share::fixed, balls.far_row());
  return sorted_.order();
}

const std::vector<std::uint32_t>& NeighbourList::remove(Balls& balls, const std::vector<std::uint8_t>& leaving) {
  kept_.clear();
  new_row_.clear();
  for (std::uint32_t row = 0; row < balls.rows.size(); ++row) {
    const bool leaves = row < leaving.size() && leaving[row] != 0;
    new_row_.push_back(leaves ? kGone : row + static_cast<std::uint32_t>(kept_.size()) - std::min(row, balls.content_count()));
    if (!leaves && row < balls.content_count()) kept_.push_back(row);
  }
  balls.reorder(kept_, threads_);
  reorder_like(skins_, kept_, balls.spare, threads_);
  for (PairList* pairs : {&ball_pairs_, &fixed_pairs_}) {
    std::size_t n = 0;
    for (std::size_t p = 0; p < pairs->count; ++p) {
      const std::uint32_t i = new_row_[pairs->i[p]], j = new_row_[pairs->j[p]];
      pairs->i[n] = i;
      pairs->j[n] = j;
      n += i != kGone && j != kGone ? 1 : 0;
    }
    pairs->i.resize(n);
    pairs->j.resize(n);
    pairs->finish(balls.far_row());
  }
  return kept_;
}

/// Makes floor and lifetime longer or shorter: a ball that speeds up uses up a floor in a time that goes with its root.
void NeighbourList::adapt_skins(double diameter) {
  const double surplus = kSurplus * rule_.floor / diameter * static_cast<double>(sweeps_);  // evaluations per ball
  const double least = kLeastFloor * diameter, most = kMostFloor * diameter;
  const double floor = std::clamp(rule_.floor * std::clamp(std::sqrt(kBuildWorth / surplus), 0.5, 2.0), least, most);
  rule_.lifetime *= std::sqrt(floor / rule_.floor);
  rule_.floor = floor;
}

/// A moving ball's reference lies half a lifetime ahead of it; its skin covers the way there and on.
Vec3 NeighbourList::reference(const BallRow& row) const {
  const double t = 0.5 * rule_.lifetime;
  return {row.x + row.vx * t, row.y + row.vy * t, row.z + row.vz * t};
}

double NeighbourList::skin(const BallRow& row) const {
  const double speed = std::sqrt(row.vx * row.vx + row.vy * row.vy + row.vz * row.vz);
  return rule_.floor + (0.5 * rule_.lifetime + rule_.ahead) * speed;
}

/// Cubes for the box and the spheres of most balls: a few far or fast ones must not make them many or large. Balls outside
/// are counted to the rim.
void NeighbourList::choose_cubes(const Balls& balls) {
  const std::size_t n = balls.content_count(), stride = n / kSample + 1;
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  sample_.clear();
  for (std::size_t i = 0; i < n; i += stride) {
    const BallRow& row = balls.rows[i];
    const Vec3 x = reference(row);
    const double sphere = row.r + skin(row) + 0.5 * reach_;
    if (!x.allFinite() || !std::isfinite(sphere)) continue;
    low = low.cwiseMin(x);
    high = high.cwiseMax(x);
    sample_.push_back(sphere);
  }
  if (sample_.empty()) {
    low = high = Vec3::Zero();
    sample_.push_back(1.0);
  }
  const auto wide = static_cast<std::size_t>(kWideShare * static_cast<double>(sample_.size()));
  const auto most = sample_.end() - static_cast<std::ptrdiff_t>(wide) - 1;
  std::nth_element(sample_.begin(), most, sample_.end());
  const double largest = *std::max_element(most, sample_.end());
  common_ = largest <= kWorthWide * *most ? largest : *most;
  grid_ = CubeGrid(low, high, 2.0 * common_ * kRounding, kMostCubes * static_cast<double>(n) + kCubesAnyway);
}

void NeighbourList::sort_content(Balls& balls) {
  const std::size_t n = balls.content_count();
  std::vector<std::uint32_t>& cube = sorted_.cube();
  cube.resize(n);
  share_range(n, threads_, [&](int /*t*/, std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) cube[i] = static_cast<std::uint32_t>(grid_.index(reference(balls.rows[i])));
  });
  sorted_.sort(grid_.cubes(), threads_);
  balls.reorder(sorted_.order(), threads_);
}

void NeighbourList::place_spheres(const Balls& balls, int thread) {
  const std::size_t n = skins_.size();
  std::vector<std::uint32_t>& wide = shares_[static_cast<std::size_t>(thread)].wide;
  wide.clear();
  for (std::size_t i = n * thread / threads_; i < n * (thread + 1) / threads_; ++i) {
    const BallRow& row = balls.rows[i];
    const Vec3 x = reference(row);
    const double its = skin(row);
    skins_[i] = {x.x(), x.y(), x.z(), its * its};
    x_[i] = x.x();
    y_[i] = x.y();
    z_[i] = x.z();
    sphere_[i] = row.r + its + 0.5 * reach_;
    if (sphere_[i] <= common_) continue;
    x_[i] = std::numeric_limits<double>::quiet_NaN();  // meets nobody: see find_beyond()
    wide.push_back(static_cast<std::uint32_t>(i));
  }
}

/// Pairs of wide spheres, each from the larger of the two: it finds all others within twice its own.
void NeighbourList::find_beyond(int thread) {
  Share& share = shares_[static_cast<std::size_t>(thread)];
  share.beyond.clear();
  const std::uint32_t* start = sorted_.start();
  for (const std::uint32_t i : share.wide) {
    const SkinReference& a = skins_[i];
    grid_.visit_lines({a.x, a.y, a.z}, 2.0 * sphere_[i] * kRounding, [&](std::size_t first, std::size_t last) {
      for (std::uint32_t j = start[first]; j < start[last + 1]; ++j) {
        if (sphere_[j] > sphere_[i] || (sphere_[j] == sphere_[i] && j <= i)) continue;
        const SkinReference& b = skins_[j];
        const double dx = a.x - b.x, dy = a.y - b.y, dz = a.z - b.z, range = sphere_[i] + sphere_[j];
        if (j == i || !(dx * dx + dy * dy + dz * dz <= range * range)) continue;
        share.beyond.push_back(std::uint64_t{std::min(i, j)} << 32 | std::max(i, j));
      }
    });
  }
}

std::size_t NeighbourList::first_cube(int thread) const {
  const std::size_t row = skins_.size() * static_cast<std::size_t>(thread) / static_cast<std::size_t>(threads_);
  const std::uint32_t* start = sorted_.start();
  return thread < threads_ ? static_cast<std::size_t>(std::lower_bound(start, start + grid_.cubes(), row) - start)
                           : grid_.cubes();
}

std::uint32_t NeighbourList::first_row(int thread) const { return sorted_.start()[first_cube(thread)]; }

void NeighbourList::find_ball_pairs(int thread) {
  Share& share = shares_[static_cast<std::size_t>(thread)];
  PairList& out = thread == 0 ? ball_pairs_ : share.balls;
  const CubedSpheres spheres{x_.data(),      y_.data(),       z_.data(),
                             sphere_.data(), sorted_.start(), {grid_.size()[0], grid_.size()[1], grid_.size()[2]}};
  PairSearch search{};
  search.cube = first_cube(thread);
  search.end_cube = first_cube(thread + 1);
  const std::uint32_t begin = search.row = first_row(thread), end = first_row(thread + 1);
  make_room(out, 0);
  for (;;) {
    search.i = out.i.data();
    search.j = out.j.data();
    search.room = out.i.size();
    kernels_->find_pairs(spheres, search);
    if (search.cube == search.end_cube) break;
    const double done = search.row - begin, all = end - begin;
    const double expected = done > 0.0 ? all / done * static_cast<double>(search.n) : kPairsAtFirst * all;
    make_room(out, std::max(search.wanted, static_cast<std::size_t>(expected)));
  }
  out.count = search.n;

  share.late.clear();
  for (const Share& other : shares_) {
    for (const std::uint64_t pair : other.beyond) {
      if (pair >> 32 >= begin && pair >> 32 < end) share.late.push_back(pair);
    }
  }
  std::sort(share.late.begin(), share.late.end());
  merge(out, share.late);
}

void NeighbourList::find_fixed_pairs(const Balls& balls, int thread) {
  PairList& out = thread == 0 ? fixed_pairs_ : shares_[static_cast<std::size_t>(thread)].fixed;
  make_room(out, 0);
  std::size_t n = 0;
  for (std::uint32_t i = first_row(thread), end = first_row(thread + 1); i < end; ++i) {
    const double reach = sphere_[i] + 0.5 * reach_;
    const std::size_t before = n;
    // Without a branch: whether a candidate is within reach cannot be foretold.
    fixed_.find({skins_[i].x, skins_[i].y, skins_[i].z}, reach, [&](std::uint32_t number, bool is_within) {
      if (n == out.i.size()) make_room(out, n + n / 4 + kLanes);
      out.i[n] = i;
      out.j[n] = balls.first_fixed_row() + number;
      n += is_within ? 1 : 0;
    });
    if (fixed_.serves(reach)) continue;
    const auto first = out.j.begin() + static_cast<std::ptrdiff_t>(before),
               last = out.j.begin() + static_cast<std::ptrdiff_t>(n);
    std::sort(first, last);
    n = before + static_cast<std::size_t>(std::unique(first, last) - first);
  }
  out.count = n;
}

/// Puts the other threads' shares behind the first one's.
void NeighbourList::join(PairList& list, PairList Share::*part, std::uint32_t far) {
  std::size_t total = list.count;
  for (std::size_t t = 1; t < shares_.size(); ++t) total += (shares_[t].*part).count;
  make_room(list, total + kLanes);
  if (threads_ > 1) {
    share_work(threads_, [&](int t) {
      auto to = static_cast<std::ptrdiff_t>(list.count);
      for (std::size_t s = 1; s < shares_.size(); ++s) {
        const PairList& from = shares_[s].*part;
        const auto n = static_cast<std::ptrdiff_t>(from.count), begin = n * t / threads_, end = n * (t + 1) / threads_;
        std::copy(from.i.begin() + begin, from.i.begin() + end, list.i.begin() + to + begin);
        std::copy(from.j.begin() + begin, from.j.begin() + end, list.j.begin() + to + begin);
        to += n;
      }
    });
  }
  list.i.resize(total);
  list.j.resize(total);
  list.finish(far);
}

std::vector<std::pair<std::uint32_t, std::uint32_t>> brute_force_pairs(const Balls& balls, double reach) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> pairs;
  for (std::uint32_t i = 0; i < balls.content_count(); ++i) {
    for (std::uint32_t j = i + 1; j < balls.rows.size(); ++j) {
      if (j == balls.far_row()) continue;
      const double distance = (position(balls.rows[i]) - position(balls.rows[j])).norm();
      if (distance - balls.rows[i].r - balls.rows[j].r <= reach) pairs.emplace_back(i, j);
    }
  }
  return pairs;
}

}  // namespace grainclock::core
