// Pressure on the wall, ball by ball on the unfolded wall, and what is uneven about it.
//
// The paper's section 5.4: the pressure on a wall ball is the horizontal part of its total contact
// force over the square that circumscribes it, (2 r)^2. A wall of closer balls, whose squares overlap, is shared among them: else
// its pressures would fall with the number of its balls. The plug is not part of the wall.
#pragma once

#include "core/state.hpp"
#include "core/stepper.hpp"
#include "silo/geometry.hpp"
#include "silo/measures.hpp"

#include <Eigen/Core>

#include <optional>
#include <span>
#include <vector>

namespace grainclock::silo {

/// A wall ball, its place on the unfolded wall and what presses on it: one point of the paper's Fig. 8.
struct WallLoad {
  core::BallId id;
  Vec3 position;  // m, of the centre
  double angle;   // rad, about the axis from +x counterclockwise, -pi to pi
  double around;  // m, along the perimeter of its own section from +x counterclockwise, half a perimeter either way
  double along;   // m, along the meridian from the outlet's edge
  double area;    // m2, of the wall that is the ball's: (2 r)^2, shared where a coverage above 1 makes the squares overlap
  Vec3 normal;    // outward unit normal of the nominal surface; horizontal on the shaft
  Vec3 force;     // N, of the content on the wall ball

  double horizontal_force() const { return force.head<2>().norm(); }  // N
  double pressure() const { return horizontal_force() / area; }       // Pa
};

/// Every wall ball by id, loaded or not. `contacts` belong to the state; throws InputError if a contact's wall ball is not
/// in it. Only the surface of `shape` is used: a wall ball belongs to the nearest point of its meridian.
std::vector<WallLoad> wall_loads(const core::State& state, const std::vector<core::Contact>& contacts, const SiloShape& shape);

/// Mean over the area of the wall by layer of any value, one for each load, in its unit; NaN in layers without wall balls.
/// Throws InputError unless z0 < z1 and n >= 1 (as the others here do) and there are as many values as loads.
std::vector<double> mean_by_layer(std::span<const WallLoad> loads, std::span<const double> values, const Layers& layers);
/// Mean pressure by layer [Pa], the paper's p_ha: wall_force_by_layer over wall_area_by_layer.
std::vector<double> pressure_by_layer(std::span<const WallLoad> loads, const Layers& layers);

/// One wave around the axis: amplitude cos(m (angle - crest)).
struct Mode {
  double amplitude;  // over the mean pressure
  double crest;      // rad, -pi/m to pi/m
};

/// p(angle) = mean (1 + sum over m of the modes), fitted by least squares with the areas of the wall balls as weights.
struct LayerModes {
  double mean;             // Pa, mode 0; NaN with no more wall balls than unknowns
  std::vector<Mode> mode;  // m = 1, 2, ...; NaN also where nothing presses
  /// Amplitude (rms, over the mean) that a mode would show if the misfits of the balls were independent of each other. An
  /// amplitude counts only well above it: chance exceeds a times it with probability exp(-a^2), and more often in truth, as
  /// neighbours share the balls that press on them.
  double scatter;
};

/// Modes 0 to `highest` by layer. A least squares fit, not Fourier sums: the balls stand at uneven angles, and sums would show
/// their density as modes of a uniform pressure. Throws InputError unless highest >= 0.
std::vector<LayerModes> azimuthal_modes(std::span<const WallLoad> loads, const Layers& layers, int highest);

/// What pushes the silo sideways. Vectors are (x, y). The content's weight has no part sideways: at rest the force, with the
/// plug's, is zero however uneven the pressures are, and the sum of the moments says only where the centre of mass is. What is
/// left is what the content's momentum changes by.
struct LateralResultant {
  Eigen::Vector2d force;                 // N, sum of the horizontal forces on the wall
  Eigen::Vector2d moment_of_horizontal;  // N m, of these about the x and y axes in the outlet plane z = 0
  Eigen::Vector2d moment_of_vertical;    // N m, of the vertical forces on the wall about the same axes
};
LateralResultant lateral_resultant(std::span<const WallLoad> loads);

}  // namespace grainclock::silo
