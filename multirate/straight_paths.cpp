#include "multirate/straight_paths.hpp"

#include "core/share_work.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>

namespace grainclock::multirate {

namespace {

using core::BallRow;
using core::StraightPath;
using core::Vec3;

constexpr double kMargin = 2.4e-3;       // mean diameters that any ball may stray
constexpr std::size_t kRowsAtOnce = 64;  // among which strays are looked for

Vec3 start_of(const StraightPath& line) { return {line.x, line.y, line.z}; }
Vec3 velocity_of(const StraightPath& line) { return {line.vx, line.vy, line.vz}; }

}  // namespace

StraightPaths::StraightPaths(const core::Kernels& kernels, const core::AdvanceParameters& advance, double interval,
                             double length_scale, int threads)
    : kernels_(kernels), advance_(advance), interval_(interval), length_scale_(length_scale), threads_(threads) {}

/// How far a ball may stray from its line before the next renewal [m].
double StraightPaths::margin_of(const BallRow& row) const {
  const double most = kMargin * length_scale_;
  return most + std::min(most, 0.5 * interval_ * interval_ * row.a);
}

bool StraightPaths::begin(const core::Balls& balls, const std::vector<core::SkinReference>& skins) {
  const std::size_t n = balls.content_count();
  lines_.resize(n);
  margin_.resize(n);
  speed2_.resize(n);
  const double ahead = look_ahead(interval_);
  std::atomic<bool> is_worn = false;
  core::share_range(n, threads_, [&](int /*t*/, std::size_t begin, std::size_t end) {
    bool is_any_worn = false;
    for (std::size_t row = begin; row < end; ++row) {
      const BallRow& ball = balls.rows[row];
      const core::SkinReference& skin = skins[row];
      const double margin = margin_of(ball), way = ahead * velocity(ball).norm();
      margin_[row] = margin;
      speed2_[row] = ball.vx * ball.vx + ball.vy * ball.vy + ball.vz * ball.vz;
      lines_[row] = {ball.x, ball.y, ball.z, margin, ball.vx, ball.vy, ball.vz, margin + way};
      const double room = std::sqrt(skin.skin2) - margin - way;
      const Vec3 away = position(ball) - Vec3(skin.x, skin.y, skin.z);
      is_any_worn |= !((room > 0.0) & (away.squaredNorm() <= room * room));
    }
    if (is_any_worn) is_worn = true;
  });
  return is_worn;
}

core::AdvanceReport StraightPaths::watch(const core::Balls& balls, double seconds) const {
  std::atomic<bool> is_any_astray = false, has_any_crossed = false;
  core::share_range(lines_.size(), threads_, [&](int /*t*/, std::size_t begin, std::size_t end) {
    const auto report = kernels_.watch(balls.rows.data(), lines_.data(), seconds, advance_, begin, end);
    if (report.list_unsafe) is_any_astray = true;
    if (report.crossed) has_any_crossed = true;
  });
  return {is_any_astray, has_any_crossed};
}

bool StraightPaths::redirect_strays(const core::Balls& balls, const ClassedPairs (&kinds)[2], double seconds) {
  find_strays(balls, seconds);
  bool are_in_order = true;
  for (const std::uint32_t row : strays_) are_in_order = are_in_order && redirect(row, balls.rows[row], seconds);
  for (const ClassedPairs& kind : kinds) are_in_order = are_in_order && keep_their_classes(balls, kind, seconds);
  return are_in_order;
}

void StraightPaths::find_strays(const core::Balls& balls, double seconds) {
  strays_.clear();
  const auto has_stray = [&](std::size_t begin, std::size_t end) {
    return kernels_.watch(balls.rows.data(), lines_.data(), seconds, advance_, begin, end).list_unsafe;
  };
  for (std::size_t first = 0; first < lines_.size(); first += kRowsAtOnce) {
    const std::size_t end = std::min(first + kRowsAtOnce, lines_.size());
    if (!has_stray(first, end)) continue;
    for (std::size_t row = first; row < end; ++row) {
      if (has_stray(row, row + 1)) strays_.push_back(static_cast<std::uint32_t>(row));
    }
  }
}

/// A line through where the ball is now, as if it had begun with the others. Tells whether the list looked so far ahead.
bool StraightPaths::redirect(std::uint32_t row, const BallRow& ball, double seconds) {
  StraightPath& line = lines_[row];
  const double margin = margin_of(ball), ahead = kAccelerating * (interval_ - seconds) * velocity(ball).norm();
  const bool is_seen = (position(ball) - start_of(line)).norm() + margin + ahead <= line.outlook;
  const Vec3 start = position(ball) - seconds * velocity(ball);
  const double outlook = line.outlook - (start - start_of(line)).norm();
  line = {start.x(), start.y(), start.z(), margin, ball.vx, ball.vy, ball.vz, outlook};
  margin_[row] = margin;
  return is_seen;
}

/// Whether pairs of strays are out of reach as before.
bool StraightPaths::keep_their_classes(const core::Balls& balls, const ClassedPairs& kind, double seconds) const {
  bool all_do = true;
  for (const std::uint32_t row : strays_) {
    kind.by_ball.for_each(row, [&](std::uint32_t pair, std::uint32_t /*partner*/) {
      all_do = all_do && keeps_its_class(balls, kind, pair, seconds);
    });
  }
  return all_do;
}

bool StraightPaths::keeps_its_class(const core::Balls& balls, const ClassedPairs& kind, std::size_t pair,
                                    double seconds) const {
  const std::uint32_t i = kind.pairs.i[pair], j = kind.pairs.j[pair];
  const StraightPath& line = lines_[i];
  Vec3 apart = start_of(line) + seconds * velocity_of(line) - position(balls.rows[j]), speed = velocity_of(line);
  double room = margin_[i];
  if (!kind.fixed) {
    const StraightPath& other = lines_[j];
    apart = start_of(line) - start_of(other) + seconds * (velocity_of(line) - velocity_of(other));
    speed -= velocity_of(other);
    room += margin_[j];
  }
  const double distance = apart.norm(), left = interval_ - seconds;
  const double gap = distance - balls.rows[i].r - balls.rows[j].r - kind.reach;
  if (kind.book.level[pair] == kSkipped) return cannot_touch(gap, speed.norm(), left, room);
  const double soon = kSoon * length_scale_;
  const bool was_far = is_out_of_reach(-double{kind.book.overlap[pair]} - kind.reach, double{kind.book.rate[pair]}, interval_, soon);
  return !was_far || is_out_of_reach(gap, -apart.dot(speed) / distance, left, soon);
}

}  // namespace grainclock::multirate
