#include "core/neighbours.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace grainclock::core {

namespace {

constexpr std::size_t kSample = 1024;    // balls that speak for all when cubes are chosen
constexpr double kWideShare = 0.01;      // of the balls, may have a sphere too large for the cubes
constexpr double kWorthWide = 1.1;       // unless it is larger by no more than this
constexpr double kRounding = 1.0 + 1e-6;  // of cube edges, far above that of cube coordinates
constexpr double kPairsAtFirst = 4.0;    // expected per ball
constexpr double kFixedRoom = 1.1;       // so that somewhat faster content needs no new cubes for the fixed balls
constexpr double kCubesAnyway = 4096.0;  // so many cubes may be, however few the balls
constexpr double kMostCubes = 4.0;       // per ball: scattered balls (free fall, blow-up) must not cost memory

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

const std::vector<std::uint32_t>& NeighbourList::build(Balls& balls, const std::vector<std::uint8_t>& leaving) {
  ++builds_;
  shares_.resize(static_cast<std::size_t>(threads_));
  choose_cubes(balls);
  sort_content(balls, leaving);
  const double common_reach = common_ + 0.5 * reach_;
  if (balls.fixed_count() > 0 && (fixed_.start.empty() || !fixed_.serves(common_reach))) fixed_.sort(balls, common_reach);
  const std::size_t n = balls.content_count();
  skins_.resize(n);
  for (auto* values : {&x_, &y_, &z_, &sphere_}) values->resize(n + kLanes);
  in_parallel([&](int t) { place_spheres(balls, t); });
  in_parallel([&](int t) { find_beyond(t); });
  in_parallel([&](int t) {
    find_ball_pairs(t);
    find_fixed_pairs(balls, t);
  });
  join(ball_pairs_, &Share::balls, balls.far_row());
  join(fixed_pairs_, &Share::fixed, balls.far_row());
  return sorted_.order();
}

template <class Work>
void NeighbourList::in_parallel(Work work) {
#pragma omp parallel for num_threads(threads_) schedule(static, 1) if (threads_ > 1)
  for (int t = 0; t < threads_; ++t) work(t);
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

/// Cubes for the box and the spheres of most balls: a few far or fast ones must not make them many or large. Balls outside are
/// counted to the rim.
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

void NeighbourList::sort_content(Balls& balls, const std::vector<std::uint8_t>& leaving) {
  const std::size_t n = balls.content_count();
  std::vector<std::uint32_t>& cube = sorted_.cube();
  cube.resize(n);
  in_parallel([&](int t) {
    for (std::size_t i = n * t / threads_; i < n * (t + 1) / threads_; ++i) {
      const bool leaves = !leaving.empty() && leaving[i] != 0;
      cube[i] = leaves ? CubeSort::kNowhere : static_cast<std::uint32_t>(grid_.index(reference(balls.rows[i])));
    }
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
  return thread < threads_ ? static_cast<std::size_t>(std::lower_bound(start, start + grid_.cubes(), row) - start) : grid_.cubes();
}

std::uint32_t NeighbourList::first_row(int thread) const { return sorted_.start()[first_cube(thread)]; }

void NeighbourList::find_ball_pairs(int thread) {
  Share& share = shares_[static_cast<std::size_t>(thread)];
  PairList& out = thread == 0 ? ball_pairs_ : share.balls;
  const CubedSpheres spheres{x_.data(), y_.data(), z_.data(), sphere_.data(), sorted_.start(),
                             {grid_.size()[0], grid_.size()[1], grid_.size()[2]}};
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

/// Whether all that content with this reach [m] can meet is in the cube where it is, or in a neighbour.
bool NeighbourList::FixedBalls::serves(double reach) const { return (reach + largest_radius) * kRounding <= grid.edge(); }

void NeighbourList::FixedBalls::sort(const Balls& balls, double reach) {
  Vec3 low = Vec3::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (std::size_t row = balls.first_fixed_row(); row < balls.rows.size(); ++row) {
    low = low.cwiseMin(position(balls.rows[row]));
    high = high.cwiseMax(position(balls.rows[row]));
    largest_radius = std::max(largest_radius, balls.rows[row].r);
  }
  grid = CubeGrid(low, high, kFixedRoom * (reach + largest_radius), kMostCubes * static_cast<double>(balls.rows.size()) + kCubesAnyway);
  const auto for_each_place = [&](auto use) {
    for (std::uint32_t f = 0; f < balls.fixed_count(); ++f) {
      const Vec3 x = position(balls.rows[balls.first_fixed_row() + f]);
      grid.visit_lines(x, grid.edge() * kRounding, [&](std::size_t first, std::size_t last) {
        for (std::size_t c = first; c <= last; ++c) use(f, c);
      });
    }
  };
  start.assign(grid.cubes() + 2, 0);  // see CubeSort::sort()
  for_each_place([&](std::uint32_t, std::size_t cube) { ++start[cube + 2]; });
  std::partial_sum(start.begin(), start.end(), start.begin());
  ball.resize(start.back());
  for_each_place([&](std::uint32_t f, std::size_t cube) { ball[start[cube + 1]++] = f; });
}

void NeighbourList::find_fixed_pairs(const Balls& balls, int thread) {
  PairList& out = thread == 0 ? fixed_pairs_ : shares_[static_cast<std::size_t>(thread)].fixed;
  out.clear();
  if (balls.fixed_count() == 0) return;
  const auto add_from = [&](std::uint32_t i, const Vec3& x, double reach, std::size_t cube) {
    for (std::uint32_t k = fixed_.start[cube]; k < fixed_.start[cube + 1]; ++k) {
      const std::uint32_t row = balls.first_fixed_row() + fixed_.ball[k];
      const double range = reach + balls.rows[row].r;
      if ((x - position(balls.rows[row])).squaredNorm() <= range * range) out.add(i, row);
    }
  };
  for (std::uint32_t i = first_row(thread); i < first_row(thread + 1); ++i) {
    const Vec3 x(skins_[i].x, skins_[i].y, skins_[i].z);
    const double reach = sphere_[i] + 0.5 * reach_;
    if (fixed_.serves(reach)) {
      add_from(i, x, reach, fixed_.grid.index(x));
      continue;
    }
    // A wide one looks into all cubes that it reaches, and finds most fixed balls more than once.
    const auto before = static_cast<std::ptrdiff_t>(out.i.size());
    fixed_.grid.visit_lines(x, (reach + fixed_.largest_radius) * kRounding, [&](std::size_t first, std::size_t last) {
      for (std::size_t c = first; c <= last; ++c) add_from(i, x, reach, c);
    });
    std::sort(out.j.begin() + before, out.j.end());
    out.j.erase(std::unique(out.j.begin() + before, out.j.end()), out.j.end());
    out.i.resize(out.j.size());
  }
  out.count = out.i.size();
}

/// Puts the other threads' shares behind the first one's.
void NeighbourList::join(PairList& list, PairList Share::*part, std::uint32_t far) {
  const auto end_of = [&](int thread) {
    std::size_t end = list.count;
    for (int t = 1; t <= thread; ++t) end += (shares_[static_cast<std::size_t>(t)].*part).count;
    return end;
  };
  const std::size_t total = end_of(threads_ - 1);
  make_room(list, total + kLanes);
  in_parallel([&](int t) {
    if (t == 0) return;
    const PairList& from = shares_[static_cast<std::size_t>(t)].*part;
    const auto n = static_cast<std::ptrdiff_t>(from.count), to = static_cast<std::ptrdiff_t>(end_of(t - 1));
    std::copy_n(from.i.begin(), n, list.i.begin() + to);
    std::copy_n(from.j.begin(), n, list.j.begin() + to);
  });
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
