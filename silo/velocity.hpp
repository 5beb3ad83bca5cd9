// Velocities as pictures show them (the paper's figures 5 to 7): the balls in a vertical section, and coarse-grained fields.
//
// Coarse graining: velocity at a point = momentum density over mass density, each a sum over balls weighted with a kernel
// of their distance, so that a uniform flow comes out as it is, at walls and free surfaces too. All balls are of one
// density: their mass counts as the cube of the radius. The kernel, (1 + 3 q) (1 - q)^3 with q = distance over reach, is
// smooth and ends at q = 1.
//
// References: I. Goldhirsch, Granular Matter 12 (2010) 239-252 (coarse graining); L. B. Lucy, Astronomical Journal 82
// (1977) 1013-1024 (kernel).
#pragma once

#include "core/state.hpp"

#include <vector>

namespace grainclock::silo {

using core::Vec3;

/// The balls that are in both states, in the middle of their way and with their mean velocities, at the mean time. Content
/// without friction jitters about as fast as it flows; over some tenths of a second the flow is left, for all measures of
/// velocities. `before` is the earlier state of the same run, else InputError.
core::State mean_motion(const core::State& before, const core::State& after);

/// A slab around the vertical plane through the silo's axis.
struct VerticalSection {
  double azimuth = 0.0;    // rad, of the direction in which the plane's abscissa grows; from x towards y
  double thickness = 0.0;  // m, half of it on either side of the plane
};

/// A ball as seen in a vertical section.
struct SectionBall {
  core::BallId id;
  core::Kind kind;
  double along, z;      // m, its centre in the plane; along = 0 on the axis
  double v_along, v_z;  // m/s, its velocity in the plane
  double speed;         // m/s, in all three directions
  double radius;        // m
};

/// Balls of every kind whose centres lie in the slab, its faces included, by id. Throws InputError unless thickness > 0.
std::vector<SectionBall> section_balls(const core::State& state, const VerticalSection& section);

/// n points, the first and the last at the ends.
struct GridAxis {
  double from, to;  // m
  int n;            // at least 2
  double spacing() const { return (to - from) / (n - 1); }
  double at(int i) const { return i == n - 1 ? to : from + i * spacing(); }
};

/// Velocities at the points of a grid.
struct VelocityField {
  GridAxis first, second;
  std::vector<Vec3> velocity;  // m/s, first.n x second.n, the second axis runs faster; nan where no ball is within reach
  const Vec3& at(int i, int j) const {
    return velocity[static_cast<std::size_t>(i) * static_cast<std::size_t>(second.n) + static_cast<std::size_t>(j)];
  }
};

/// Content's velocity over radius and height, averaged around the axis: (radial, tangential, vertical); distances are those
/// of the meridian plane. For a ball on the axis x is outward. Throws InputError for an axis that is none, unless
/// reach [m] > 0 (as the next one does), or for a negative radius.
VelocityField meridional_velocity(const core::State& state, const GridAxis& r, const GridAxis& z, double reach);

/// A slab around a horizontal plane.
struct HorizontalSection {
  double z = 0.0;          // m
  double thickness = 0.0;  // m, half of it above
};

/// Content's velocity (x, y, z) over x and y of the balls whose centres lie in the slab, its faces included; distances
/// are horizontal ones. Throws also unless thickness > 0.
VelocityField horizontal_velocity(const core::State& state, const HorizontalSection& section, const GridAxis& x,
                                  const GridAxis& y, double reach);

}  // namespace grainclock::silo
