#include "silo/velocity.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace grainclock::silo {
namespace {

void require_axis(const GridAxis& axis) {
  GC_REQUIRE(axis.n >= 2 && axis.from < axis.to, "grid of {} points from {} m to {} m: need at least two, in rising order",
             axis.n, axis.from, axis.to);
}

void require_thickness(double thickness) {
  GC_REQUIRE(thickness > 0.0, "section {} m thick: must be above 0 m, about a ball's diameter or more", thickness);
}

/// Points of an axis that are closer to `x` than the reach, perhaps one more at either end: [first, end).
struct Points {
  int first, end;
};
Points points_near(const GridAxis& axis, double x, double reach) {
  const double first = std::floor((x - reach - axis.from) / axis.spacing()),
               last = std::ceil((x + reach - axis.from) / axis.spacing());
  return {static_cast<int>(std::clamp(first, 0.0, double(axis.n))),
          static_cast<int>(std::clamp(last + 1.0, 0.0, double(axis.n)))};
}

/// Lucy's kernel but for its norm, which drops out; q >= 0.
double kernel(double q) { return q < 1.0 ? (1.0 + 3.0 * q) * (1.0 - q) * (1.0 - q) * (1.0 - q) : 0.0; }

/// Sums up what the balls give to the points of a grid.
class CoarseGraining {
 public:
  CoarseGraining(const GridAxis& first, const GridAxis& second, double reach) : field_{first, second, {}}, reach_(reach) {
    require_axis(first);
    require_axis(second);
    GC_REQUIRE(reach > 0.0, "coarse graining with a reach of {} m: must be above 0 m, about two ball diameters", reach);
    const std::size_t n = static_cast<std::size_t>(first.n) * static_cast<std::size_t>(second.n);
    field_.velocity.assign(n, Vec3::Zero());
    mass_.assign(n, 0.0);
  }

  /// A ball at (a, b) of the grid's plane [m].
  void add(double a, double b, double radius, const Vec3& velocity) {
    const double mass = radius * radius * radius;
    const Points rows = points_near(field_.first, a, reach_), columns = points_near(field_.second, b, reach_);
    for (int i = rows.first; i < rows.end; ++i)
      for (int j = columns.first; j < columns.end; ++j) {
        const double weight = mass * kernel(std::hypot(field_.first.at(i) - a, field_.second.at(j) - b) / reach_);
        const std::size_t at =
            static_cast<std::size_t>(i) * static_cast<std::size_t>(field_.second.n) + static_cast<std::size_t>(j);
        mass_[at] += weight;
        field_.velocity[at] += weight * velocity;
      }
  }

  VelocityField field() && {
    for (std::size_t at = 0; at < mass_.size(); ++at)
      if (mass_[at] > 0.0)
        field_.velocity[at] /= mass_[at];
      else
        field_.velocity[at].setConstant(std::numeric_limits<double>::quiet_NaN());
    return std::move(field_);
  }

 private:
  VelocityField field_;  // momentum while balls are added
  std::vector<double> mass_;
  double reach_;
};

}  // namespace

core::State mean_motion(const core::State& before, const core::State& after) {
  const double time = after.time - before.time;
  GC_REQUIRE(time > 0.0, "mean motion from {} s to {} s: give the earlier state first", before.time, after.time);
  core::State mean;
  mean.time = before.time + 0.5 * time;
  mean.length_scale = before.length_scale;
  for (std::size_t old = 0, now = 0; old < before.size() && now < after.size();) {
    if (before.id[old] < after.id[now]) {
      ++old;
    } else if (after.id[now] < before.id[old]) {
      ++now;
    } else {
      GC_REQUIRE(before.kind[old] == after.kind[now],
                 "mean motion: ball {} is {} before and {} after; give states of one run", before.id[old],
                 core::name(before.kind[old]), core::name(after.kind[now]));
      const Vec3 &x0 = before.position[old], &x1 = after.position[now];
      mean.add(before.id[old], before.kind[old], 0.5 * (x0 + x1), (x1 - x0) / time, before.radius[old]);
      ++old;
      ++now;
    }
  }
  return mean;
}

std::vector<SectionBall> section_balls(const core::State& state, const VerticalSection& section) {
  require_thickness(section.thickness);
  const double c = std::cos(section.azimuth), s = std::sin(section.azimuth);
  std::vector<SectionBall> balls;
  for (std::size_t ball = 0; ball < state.size(); ++ball) {
    const Vec3 &x = state.position[ball], &v = state.velocity[ball];
    if (std::abs(c * x[1] - s * x[0]) > 0.5 * section.thickness) continue;
    balls.push_back({state.id[ball], state.kind[ball], c * x[0] + s * x[1], x[2], c * v[0] + s * v[1], v[2], v.norm(),
                     state.radius[ball]});
  }
  return balls;
}

VelocityField meridional_velocity(const core::State& state, const GridAxis& r, const GridAxis& z, double reach) {
  GC_REQUIRE(r.from >= 0.0, "grid from radius {} m: must not be below 0 m", r.from);
  CoarseGraining sums(r, z, reach);
  for (std::size_t ball = 0; ball < state.size(); ++ball) {
    if (state.kind[ball] != core::Kind::content) continue;
    const Vec3 &x = state.position[ball], &v = state.velocity[ball];
    const double radius = std::hypot(x[0], x[1]);
    const double c = radius > 0.0 ? x[0] / radius : 1.0, s = radius > 0.0 ? x[1] / radius : 0.0;
    sums.add(radius, x[2], state.radius[ball], {c * v[0] + s * v[1], c * v[1] - s * v[0], v[2]});
  }
  return std::move(sums).field();
}

VelocityField horizontal_velocity(const core::State& state, const HorizontalSection& section, const GridAxis& x,
                                  const GridAxis& y, double reach) {
  require_thickness(section.thickness);
  CoarseGraining sums(x, y, reach);
  for (std::size_t ball = 0; ball < state.size(); ++ball) {
    const Vec3& at = state.position[ball];
    if (state.kind[ball] != core::Kind::content || std::abs(at[2] - section.z) > 0.5 * section.thickness) continue;
    sums.add(at[0], at[1], state.radius[ball], state.velocity[ball]);
  }
  return std::move(sums).field();
}

}  // namespace grainclock::silo
