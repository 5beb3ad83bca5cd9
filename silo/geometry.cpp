#include "silo/geometry.hpp"

#include "core/check.hpp"
#include "core/state.hpp"
#include "silo/random.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace grainclock::silo {
namespace {

constexpr double kRingSpacing = 0.99;  // of the mean diameter: neighbours in a ring overlap by about 1 %
constexpr std::uint32_t kWallStream = 1;

/// Perimeter over half width, and section area over its square.
double perimeter_factor(Section section) { return section == Section::round ? 2.0 * std::numbers::pi : 8.0; }
double area_factor(Section section) { return section == Section::round ? std::numbers::pi : 4.0; }

double distance(const MeridianPoint& a, const MeridianPoint& b) { return std::hypot(b.half_width - a.half_width, b.z - a.z); }

/// The point at a share u of the perimeter of a section.
Vec3 section_point(Section section, double half_width, double z, double u) {
  u -= std::floor(u);
  if (section == Section::round) {
    const double angle = 2.0 * std::numbers::pi * u;
    return {half_width * std::cos(angle), half_width * std::sin(angle), z};
  }
  const int side = std::min(3, static_cast<int>(4.0 * u));
  const double along = half_width * (2.0 * (4.0 * u - side) - 1.0);
  switch (side) {
    case 0: return {half_width, along, z};
    case 1: return {-along, half_width, z};
    case 2: return {-half_width, -along, z};
    default: return {along, -half_width, z};
  }
}

struct Ring {
  MeridianPoint at;
  MeridianPoint outward;  // unit normal, zero where radii do not shift the ball
  std::int64_t balls;
};

/// Balls in a closed ring from a random start, each as far from the next as their radii ask.
void add_ring(const SiloShape& shape, const Ring& ring, Random& random, std::vector<FixedBall>& balls) {
  const auto n = static_cast<std::size_t>(ring.balls);
  std::vector<double> radius(n);
  double twice_sum = 0.0;
  for (double& r : radius) {
    r = random.between(shape.r_min, shape.r_max);
    twice_sum += 2.0 * r;
  }
  double u = random.between(0.0, 1.0);
  for (std::size_t i = 0; i < n; ++i) {
    const double shift = radius[i] - shape.mean_radius();
    balls.push_back({section_point(shape.section, ring.at.half_width + shift * ring.outward.half_width,
                                   ring.at.z + shift * ring.outward.z, u),
                     radius[i]});
    u += (radius[i] + radius[(i + 1) % n]) / twice_sum;
  }
}

/// The surface on which the centres of mean balls lie.
Meridian centre_line(const SiloShape& shape) {
  return meridian(shape, shape.surface == Surface::inner ? shape.mean_radius() : 0.0);
}

}  // namespace

Meridian meridian(const SiloShape& shape, double outward) {
  const double run = shape.half_width - shape.half_outlet;
  const double slant = std::hypot(run, shape.hopper_height);
  // The hopper's line, moved along its normal, then followed to the wanted half width.
  const MeridianPoint start{shape.half_outlet + outward * shape.hopper_height / slant, -outward * run / slant};
  const auto hopper_at = [&](double half_width) {
    return MeridianPoint{half_width, start.z + (half_width - start.half_width) * shape.hopper_height / run};
  };
  return {hopper_at(shape.half_outlet + outward), hopper_at(shape.half_width + outward),
          {shape.half_width + outward, shape.rim()}};
}

double Meridian::length() const { return distance(outlet, joint) + distance(joint, rim); }

MeridianPoint Meridian::at(double along) const {
  const double slant = distance(outlet, joint);
  if (along >= slant) return {joint.half_width, joint.z + (along - slant)};
  const double share = along / slant;
  return {outlet.half_width + share * (joint.half_width - outlet.half_width), outlet.z + share * (joint.z - outlet.z)};
}

MeridianPoint Meridian::outward_normal(double along) const {
  const double slant = distance(outlet, joint);
  if (along >= slant) return {1.0, 0.0};
  return {(joint.z - outlet.z) / slant, -(joint.half_width - outlet.half_width) / slant};
}

Meridian inside_of(const SiloShape& shape) {
  return meridian(shape, shape.surface == Surface::centres ? -shape.mean_radius() : 0.0);
}

double area(Section section, const Meridian& line) {
  const double hopper = 0.5 * (line.outlet.half_width + line.joint.half_width) * distance(line.outlet, line.joint);
  return perimeter_factor(section) * (hopper + line.joint.half_width * distance(line.joint, line.rim));
}

double volume_between(Section section, const Meridian& line, double z0, double z1) {
  const auto& [outlet, joint, rim] = line;
  double integral = 0.0;  // of the half width squared
  const double low = std::max(z0, outlet.z), high = std::min(z1, joint.z);
  if (high > low) {
    const auto half_width = [&line](double z) {
      return line.outlet.half_width +
             (z - line.outlet.z) / (line.joint.z - line.outlet.z) * (line.joint.half_width - line.outlet.half_width);
    };
    const double a = half_width(low), b = half_width(high);
    integral += (high - low) * (a * a + a * b + b * b) / 3.0;
  }
  integral += std::max(0.0, z1 - std::max(z0, joint.z)) * joint.half_width * joint.half_width;
  return area_factor(section) * integral;
}

double depth_inside(Section section, const Meridian& line, const Vec3& point) {
  const double half_width =
      section == Section::round ? std::hypot(point[0], point[1]) : std::max(std::abs(point[0]), std::abs(point[1]));
  const MeridianPoint normal = line.outward_normal(0.0);
  const double from_hopper =
      (line.outlet.half_width - half_width) * normal.half_width + (line.outlet.z - point[2]) * normal.z;
  return std::min(from_hopper, line.joint.half_width - half_width);
}

SiloShape parse_silo(core::TomlKeys keys) {
  SiloShape shape;
  shape.where = keys.where() + ": [silo]";
  const bool is_square = keys.choice("shape", {"round", "square"}).value_or("round") == "square";
  shape.section = is_square ? Section::square : Section::round;
  const std::string_view width = is_square ? "width" : "radius";
  if (is_square) {
    if (keys.has("radius")) keys.fail("radius", "a square silo has a width: write width instead");
    shape.half_width = 0.5 * keys.positive("width", "m").value_or(8.0);
  } else {
    if (keys.has("width")) keys.fail("width", "a round silo has a radius: write radius instead, or shape = \"square\"");
    shape.half_width = keys.positive("radius", "m").value_or(shape.half_width);
  }
  shape.height = keys.positive("height", "m").value_or(shape.height);
  shape.hopper_height = keys.number("hopper_height").value_or(shape.hopper_height);
  keys.require(shape.hopper_height >= 0.0, "hopper_height", "must be 0 m (flat bottom) or above");
  shape.half_outlet = 0.5 * keys.positive("outlet", "m").value_or(2.0 * shape.half_outlet);
  shape.balls = keys.integer("balls").value_or(shape.balls);
  keys.require(shape.balls >= 1, "balls", "must be at least 1");
  core::require_room(static_cast<double>(shape.balls), keys.where("balls") + ": [silo] balls");
  shape.r_min = keys.positive("r_min", "m").value_or(shape.r_min);
  shape.r_max = keys.positive("r_max", "m").value_or(shape.r_max);
  shape.surface = keys.choice("surface", {"centres", "inner"}).value_or("centres") == "inner" ? Surface::inner : Surface::centres;
  shape.coverage = keys.positive("coverage", "").value_or(shape.coverage);
  shape.collar = keys.number("collar").value_or(shape.collar);
  keys.require(shape.collar >= 0.0, "collar", "must be 0 m (none) or above");
  keys.finish();

  keys.require(shape.r_max >= shape.r_min, keys.has("r_max") ? "r_max" : "r_min",
               fmt::format("r_min = {} m must not exceed r_max = {} m", shape.r_min, shape.r_max));
  keys.require(shape.half_outlet < shape.half_width, keys.has("outlet") ? "outlet" : width,
               fmt::format("the outlet must be narrower than the silo: below {} m", 2.0 * shape.half_width));
  const double lost = shape.surface == Surface::centres ? 2.0 * shape.r_max : 0.0;
  keys.require(2.0 * shape.half_outlet - lost > 2.0 * shape.r_max, keys.has("outlet") ? "outlet" : "r_max",
               fmt::format("the clear outlet is {:.4g} m and no ball of diameter {:.4g} m can leave: outlet must be above {:.4g} m",
                           2.0 * shape.half_outlet - lost, 2.0 * shape.r_max, lost + 2.0 * shape.r_max));
  try {
    build_walls(shape, 0);
  } catch (const core::InputError& error) {
    for (const std::string_view key : {std::string_view("coverage"), std::string_view("height"), std::string_view("collar"), width})
      if (keys.has(key)) keys.fail(key, error.what());
    throw core::InputError(fmt::format("{}: {}", shape.where, error.what()));
  }
  return shape;
}

SiloShape read_silo(const core::Scene& scene) {
  GC_REQUIRE(scene.has_silo && scene.silo, "{}: the scene has no [silo] table: add one, or start from [initial] state", scene.path);
  return parse_silo(core::TomlKeys(*scene.silo, "[silo]", scene.path));
}

std::string describe(const WallReport& report) {
  return fmt::format("wall: {} balls on {:.1f} m2, circumscribed squares {:.1f} % of it (the paper: {} balls, {:.0f} %)",
                     report.balls, report.nominal_area, 100.0 * report.share(), kPaperWallBalls, 100.0 * kPaperShare);
}

Walls build_walls(const SiloShape& shape, std::uint64_t seed) {
  const Meridian centres = centre_line(shape);
  const double factor = perimeter_factor(shape.section);
  const double diameter = 2.0 * shape.mean_radius();
  const double spread = shape.r_max - shape.r_min;
  const double mean_square = diameter * diameter + spread * spread / 3.0;  // of 2 r, uniform radii
  const double wanted = shape.coverage * area(shape.section, centres) / mean_square;
  const double more = factor * centres.rim.half_width * shape.collar + area_factor(shape.section) * std::pow(centres.outlet.half_width, 2);
  core::require_room(wanted + more / mean_square, "the wall, the plug and the collar");

  // The most rings, from edge to rim, that leave enough balls for kRingSpacing or less in each.
  const auto ring_lengths = [&](std::int64_t rings) {
    double sum = 0.0;
    for (std::int64_t i = 0; i < rings; ++i)
      sum += factor * centres.at(static_cast<double>(i) * centres.length() / static_cast<double>(rings - 1)).half_width;
    return sum;
  };
  const double longest = kRingSpacing * diameter * wanted;
  std::int64_t rings = 2, beyond = 3;
  while (ring_lengths(beyond) <= longest) rings = std::exchange(beyond, 2 * beyond);
  while (beyond - rings > 1) {
    const std::int64_t middle = rings + (beyond - rings) / 2;
    (ring_lengths(middle) <= longest ? rings : beyond) = middle;
  }
  const double pitch = centres.length() / static_cast<double>(rings - 1);
  const double spacing = ring_lengths(rings) / wanted;

  // The farthest point between four balls of two rings; two balls of r_min on its far sides close it.
  const double hole = 0.5 * std::hypot(pitch, diameter);
  GC_REQUIRE(hole <= 0.9 * 2.0 * shape.r_min,
             "the wall's rings are {:.4g} m apart, and holes of {:.4g} m from centre to centre let a ball of {:.4g} m slip: "
             "raise the coverage (about {:.2g}), or r_min towards r_max",
             pitch, 2.0 * hole, shape.r_min, shape.coverage * pitch / (1.2 * diameter));

  Walls walls;
  Random random(seed, kWallStream);
  const bool shifts = shape.surface == Surface::inner;
  const auto ring_at = [&](double along, std::int64_t balls) {
    return Ring{centres.at(along), shifts ? centres.outward_normal(along) : MeridianPoint{0.0, 0.0}, balls};
  };
  const auto fewest = [&](double half_width) {
    return std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(factor * half_width / diameter)));
  };
  double exact = 0.0;
  for (std::int64_t i = 0; i < rings; ++i) {
    const double along = static_cast<double>(i) * pitch;
    // Rounding is carried from ring to ring, but no ring may have gaps.
    exact += factor * centres.at(along).half_width / spacing;
    const auto carried = std::llround(exact) - std::ssize(walls.wall);
    add_ring(shape, ring_at(along, std::max<std::int64_t>(carried, fewest(centres.at(along).half_width))), random, walls.wall);
  }

  const auto plug_rings = static_cast<std::int64_t>(std::ceil(centres.outlet.half_width / (kRingSpacing * diameter)));
  for (std::int64_t i = 0; i < plug_rings; ++i) {
    const double half_width = centres.outlet.half_width * static_cast<double>(i) / static_cast<double>(plug_rings);
    add_ring(shape, Ring{{half_width, centres.outlet.z}, {0.0, 0.0}, fewest(half_width / kRingSpacing)}, random, walls.plug);
  }

  const auto collar_rings = static_cast<std::int64_t>(std::ceil(shape.collar / pitch));
  for (std::int64_t i = 1; i <= collar_rings; ++i)
    add_ring(shape, ring_at(centres.length() + static_cast<double>(i) * pitch, fewest(centres.rim.half_width / kRingSpacing)),
             random, walls.collar);

  walls.report = {std::ssize(walls.wall), area(shape.section, meridian(shape)), 0.0};
  for (const FixedBall& ball : walls.wall) walls.report.squares += 4.0 * ball.radius * ball.radius;
  return walls;
}

}  // namespace grainclock::silo
