#include "silo/filling.hpp"

#include "core/check.hpp"
#include "silo/random.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>

namespace grainclock::silo {
namespace {

using core::BallId;
using core::Kind;
using core::State;

constexpr double kJitter = 0.02;       // of r_max, largest shift along each axis
constexpr double kStartSpeed = 0.05;   // m/s, largest along each axis
constexpr std::uint32_t kContentStream = 2;

void erase_if(State& state, const std::function<bool(std::size_t)>& goes) {
  std::vector<std::size_t> kept;
  for (std::size_t i = 0; i < state.size(); ++i)
    if (!goes(i)) kept.push_back(i);
  const auto keep = [&kept](auto& values) {
    if (values.empty()) return;
    for (std::size_t to = 0; to < kept.size(); ++to) values[to] = values[kept[to]];
    values.resize(kept.size());
  };
  keep(state.id);
  keep(state.kind);
  keep(state.position);
  keep(state.velocity);
  keep(state.radius);
  keep(state.evaluated_position);
  keep(state.evaluated_velocity);
  keep(state.level);
  keep(state.impacted);
}

/// Hangs balls layer by layer into the silo.
class Lattice {
 public:
  Lattice(const SiloShape& shape, std::uint64_t seed) : shape_(shape), surface_(meridian(shape)), random_(seed, kContentStream) {}

  /// Centres, lowest first: `wanted` of them, or as many as fit below the collar's edge.
  std::vector<Vec3> points(std::int64_t wanted) {
    std::vector<Vec3> found;
    const double top = shape_.rim() + shape_.collar;
    for (double z = 2.0 * shape_.r_max + jitter_; z + jitter_ <= top && std::ssize(found) < wanted; z += spacing_) {
      std::vector<Vec3> layer = layer_at(z);
      // A last layer that is not full lies around the axis.
      std::stable_sort(layer.begin(), layer.end(),
                       [](const Vec3& a, const Vec3& b) { return a.head<2>().squaredNorm() < b.head<2>().squaredNorm(); });
      const auto room = static_cast<std::size_t>(wanted - std::ssize(found));
      layer.resize(std::min(layer.size(), room));
      for (const Vec3& point : layer) found.push_back(jittered(point));
    }
    return found;
  }

 private:
  std::vector<Vec3> layer_at(double z) {
    const double angle = random_.between(0.0, 0.5 * std::numbers::pi);
    const double u = random_.between(0.0, 1.0), v = random_.between(0.0, 1.0);
    const double c = spacing_ * std::cos(angle), s = spacing_ * std::sin(angle);
    const auto reach = static_cast<int>(std::numbers::sqrt2 * shape_.half_width / spacing_) + 1;
    // Wall balls reach in from the nominal surface by their diameter, or not at all.
    const double clear = (shape_.surface == Surface::centres ? 2.0 : 1.0) * shape_.r_max + std::numbers::sqrt3 * jitter_;
    std::vector<Vec3> layer;
    for (int i = -reach - 1; i <= reach; ++i)
      for (int j = -reach - 1; j <= reach; ++j) {
        const Vec3 point{c * (i + u) - s * (j + v), s * (i + u) + c * (j + v), z};
        if (depth_inside(shape_.section, surface_, point) >= clear) layer.push_back(point);
      }
    return layer;
  }

  Vec3 jittered(const Vec3& point) {
    const double x = random_.between(-jitter_, jitter_), y = random_.between(-jitter_, jitter_);
    return point + Vec3{x, y, random_.between(-jitter_, jitter_)};
  }

  const SiloShape& shape_;
  Meridian surface_;
  Random random_;
  double jitter_ = kJitter * shape_.r_max;
  double spacing_ = (2.0 + 1e-3) * shape_.r_max + 2.0 * jitter_;  // neighbours keep apart whatever the jitter
};

}  // namespace

Silo build_silo(const SiloShape& shape, std::uint64_t seed) {
  const std::vector<Vec3> points = Lattice(shape, seed).points(shape.balls);
  if (std::ssize(points) < shape.balls) {
    // How many more a taller collar would take.
    constexpr double kTaller = 10.0;  // m
    SiloShape taller = shape;
    taller.collar += kTaller;
    const std::int64_t enough = 10 * shape.balls + 100000;  // for the estimate, where small balls in a wide silo are many
    const auto per_metre = static_cast<double>(std::ssize(Lattice(taller, seed).points(enough)) - std::ssize(points)) / kTaller;
    const auto missing = static_cast<double>(shape.balls - std::ssize(points));
    const std::string remedy =
        per_metre > 0.0 ? fmt::format("give collar = {:.1f} (m, there only while filling), or fewer balls",
                                      shape.collar + missing / per_metre + 4.0 * shape.r_max)
                        : "the silo is too narrow for balls of r_max: widen it";
    throw core::InputError(fmt::format("{} balls = {}, collar = {}: only {} fit loosely below {:.4g} m: {}", shape.where,
                                       shape.balls, shape.collar, points.size(), shape.rim() + shape.collar, remedy));
  }

  const Walls walls = build_walls(shape, seed);
  Silo silo{shape, walls.report, 0, {}};
  Random random(seed, kContentStream + 1);
  BallId next = 0;
  for (const Vec3& point : points) {
    const double radius = random.between(shape.r_min, shape.r_max);
    const double x = random.between(-kStartSpeed, kStartSpeed), y = random.between(-kStartSpeed, kStartSpeed);
    silo.state.add(next++, Kind::content, point, {x, y, random.between(-kStartSpeed, kStartSpeed)}, radius);
  }
  const auto add_fixed = [&](const std::vector<FixedBall>& balls, Kind kind) {
    for (const FixedBall& ball : balls) silo.state.add(next++, kind, ball.at, Vec3::Zero(), ball.radius);
  };
  add_fixed(walls.wall, Kind::wall);
  add_fixed(walls.plug, Kind::plug);
  silo.first_collar = next;
  add_fixed(walls.collar, Kind::wall);
  return silo;
}

void remove_collar(State& state, BallId first_collar) {
  erase_if(state, [&](std::size_t i) { return state.id[i] >= first_collar; });
}

std::vector<BallId> clear_gate(State& state) {
  std::vector<std::size_t> plug;
  for (std::size_t i = 0; i < state.size(); ++i)
    if (state.kind[i] == Kind::plug) plug.push_back(i);
  std::vector<BallId> cleared;
  std::vector<char> goes(state.size(), 0);
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] != Kind::content) continue;
    for (const std::size_t j : plug)
      if ((state.position[i] - state.position[j]).norm() < state.radius[i] + state.radius[j]) goes[i] = 1;
    if (goes[i]) cleared.push_back(state.id[i]);
  }
  erase_if(state, [&](std::size_t i) { return goes[i] != 0; });
  return cleared;
}

}  // namespace grainclock::silo
