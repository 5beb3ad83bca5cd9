#include "benchmarks/scale/scaled_silo.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace grainclock::scale {

namespace {

constexpr double kColumnStep = 0.05;    // m, of the integral over height
constexpr double kSpare = 1.01;         // as many balls are laid out as are wanted, and some; the highest are left out
// Mean diameters from the surface of the wall balls' centres to a smooth wall that holds as many balls. Found by trial at factor
// 2: with it the mean overlap there is 1.6 times the original's. Ordered layers as in the original would take 0.43.
constexpr double kWallGap = 0.6;
constexpr double kTopPressure = 8e3;    // Pa, lowest of the ladder: about 1 m of balls

silo::SiloShape scaled(silo::SiloShape shape, double factor, std::int64_t balls) {
  shape.half_width *= factor;
  shape.height *= factor;
  shape.hopper_height *= factor;
  shape.half_outlet *= factor;
  shape.balls = balls;
  return shape;
}

/// A pile of the ladder's packing: pressure against height, and the height of a share of boxes stacked from z = 0.
class Column {
 public:
  Column(const PressureLadder& ladder, double weight, double top) : top_(top), weight_(weight) {
    double stacked = 0.0;
    for (double z = 0.0; z < top + kColumnStep; z += kColumnStep) {
      stacked_.push_back(stacked);
      stacked += kColumnStep / ladder.box(pressure(z + 0.5 * kColumnStep)).z();
    }
  }

  /// Pa, at a height [m].
  double pressure(double z) const { return weight_ * std::max(0.0, top_ - z); }
  /// Boxes that the column is high.
  double boxes() const { return stacked_.back(); }
  /// Height [m] of a number of boxes; that of the column's ends beyond them.
  double height(double boxes) const {
    boxes = std::clamp(boxes, 0.0, stacked_.back());
    const auto above = std::upper_bound(stacked_.begin() + 1, stacked_.end() - 1, boxes);
    const double share = (boxes - above[-1]) / (above[0] - above[-1]);
    return (static_cast<double>(above - stacked_.begin() - 1) + share) * kColumnStep;
  }

 private:
  double top_;     // m
  double weight_;  // Pa/m
  std::vector<double> stacked_;  // boxes below i * kColumnStep
};

double mean_mass(const std::vector<double>& radii, const core::Materials& materials) {
  double sum = 0.0;
  for (const double r : radii) sum += materials.mass(r);
  return sum / static_cast<double>(radii.size());
}

/// Height to which so many balls fill what is inside `inner` [m], at most the rim.
double fill_height(const PressureLadder& ladder, double weight, silo::Section section, const silo::Meridian& inner,
                   double bottom, double balls) {
  const auto held = [&](double top) {
    double sum = 0.0;
    for (double z = bottom; z < top; z += kColumnStep) {
      const double density = ladder.number_density(weight * (top - z));
      sum += density * silo::volume_between(section, inner, z, std::min(z + kColumnStep, top));
    }
    return sum;
  };
  double low = bottom, high = inner.rim.z;
  while (high - low > kColumnStep) {
    const double middle = 0.5 * (low + high);
    (held(middle) < balls ? low : high) = middle;
  }
  return high;
}

}  // namespace

Packing interior(const core::State& filled, const silo::SiloShape& shape) {
  GC_REQUIRE(shape.section == silo::Section::round, "only the round silo is scaled; take a round one");
  // Well inside the cylinder, where the wall's layers have faded out: a square within 3/4 of the radius.
  const double edge = 0.75 * std::numbers::sqrt2 * shape.half_width;
  const double low = shape.hopper_height + 0.2 * shape.height;
  return cut(filled, {-0.5 * edge, -0.5 * edge, low}, {edge, edge, 0.5 * shape.height});
}

core::State tile(const Packing& block, const silo::SiloShape& original, double factor, std::int64_t balls,
                 const core::Materials& materials, double gravity, std::uint64_t seed) {
  const silo::SiloShape shape = scaled(original, factor, balls);
  const double gap = kWallGap * 2.0 * shape.mean_radius();
  const silo::Meridian inner = silo::meridian(shape, -gap);
  const double bottom = gap;  // the plug's centres lie at z = 0

  const double density = static_cast<double>(block.radius.size()) / block.box.prod();
  const double weight = density * mean_mass(block.radius, materials) * gravity;  // Pa/m
  const PressureLadder ladder(block, materials.ball.k, kTopPressure, std::max(2.0 * kTopPressure, weight * inner.rim.z));
  const double top = fill_height(ladder, weight, shape.section, inner, bottom, kSpare * static_cast<double>(balls));
  const Column column(ladder, weight, top);

  struct Place {
    Vec3 at;
    double radius;
  };
  std::vector<Place> places;
  places.reserve(static_cast<std::size_t>(1.1 * static_cast<double>(balls)));
  // Ball by ball over the layers of boxes: in a layer all of a ball's copies are at one height.
  for (int layer = -1; layer <= static_cast<int>(column.boxes()); ++layer) {
    for (std::size_t ball = 0; ball < ladder.radius().size(); ++ball) {
      // Where a ball is in its box depends on the pressure, and that on the height: from the layer's middle, then from there.
      const double guess = layer + ladder.share(ball, column.pressure(column.height(layer + 0.5))).z();
      const double boxes = layer + ladder.share(ball, column.pressure(column.height(guess))).z();
      const double z = column.height(boxes);
      if (boxes < 0.0 || boxes >= column.boxes() || z < bottom || z > top) continue;
      const double pressure = column.pressure(z);
      const Vec3 box = ladder.box(pressure), share = ladder.share(ball, pressure);
      const int reach = static_cast<int>(shape.half_width / box.x()) + 2;
      for (int i = -reach; i <= reach; ++i) {
        for (int j = -reach; j <= reach; ++j) {
          const Vec3 at((i + share.x()) * box.x(), (j + share.y()) * box.y(), z);
          if (silo::depth_inside(shape.section, inner, at) > 0.0) places.push_back({at, ladder.radius()[ball]});
        }
      }
    }
  }
  const auto wanted = static_cast<std::size_t>(balls);
  GC_REQUIRE(places.size() >= wanted, "only {} of {} balls fit below the rim: use fewer or a larger factor", places.size(), balls);
  std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) { return a.at.z() < b.at.z(); });
  places.resize(wanted);

  core::State state;
  state.length_scale = 2.0 * shape.mean_radius();
  core::BallId id = 0;
  for (const Place& place : places) state.add(id++, core::Kind::content, place.at, Vec3::Zero(), place.radius);
  const silo::Walls walls = silo::build_walls(shape, seed);
  for (const silo::FixedBall& ball : walls.wall) state.add(id++, core::Kind::wall, ball.at, Vec3::Zero(), ball.radius);
  for (const silo::FixedBall& ball : walls.plug) state.add(id++, core::Kind::plug, ball.at, Vec3::Zero(), ball.radius);
  return state;
}

}  // namespace grainclock::scale
