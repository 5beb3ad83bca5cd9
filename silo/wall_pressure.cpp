#include "silo/wall_pressure.hpp"

#include "core/check.hpp"

#include <Eigen/QR>

#include <algorithm>
#include <cmath>
#include <limits>

namespace grainclock::silo {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Outward unit vector of the section at a point, horizontal; on a square's corner that of one of its sides.
Eigen::Vector2d outward(Section section, const Vec3& at) {
  if (section == Section::round) {
    const double radius = std::hypot(at[0], at[1]);
    return radius > 0.0 ? Eigen::Vector2d(at[0] / radius, at[1] / radius) : Eigen::Vector2d::UnitX();
  }
  if (std::abs(at[0]) >= std::abs(at[1])) return {std::copysign(1.0, at[0]), 0.0};
  return {0.0, std::copysign(1.0, at[1])};
}

/// Length along the perimeter of a point's own section from +x counterclockwise [m], half a perimeter either way.
double around(Section section, const Vec3& at) {
  const double x = at[0], y = at[1];
  if (section == Section::round) return std::hypot(x, y) * std::atan2(y, x);
  const double half_width = std::max(std::abs(x), std::abs(y));
  if (x >= std::abs(y)) return y;
  if (std::abs(x) <= std::abs(y)) return std::copysign(2.0 * half_width, y) - (y > 0.0 ? x : -x);
  return std::copysign(4.0 * half_width, y) - y;
}

/// Length along the meridian [m] of the point of it that is nearest to (half width, z); the shaft goes on above the rim.
double nearest_along(const Meridian& line, double half_width, double z) {
  const double run = line.joint.half_width - line.outlet.half_width, rise = line.joint.z - line.outlet.z;
  const double slant = std::hypot(run, rise);
  const double on_hopper =
      std::clamp(((half_width - line.outlet.half_width) * run + (z - line.outlet.z) * rise) / slant, 0.0, slant);
  const double on_shaft = slant + std::max(0.0, z - line.joint.z);
  const auto distance = [&](double along) {
    const MeridianPoint point = line.at(along);
    return std::hypot(half_width - point.half_width, z - point.z);
  };
  return distance(on_hopper) < distance(on_shaft) ? on_hopper : on_shaft;
}

/// The loads of each layer.
std::vector<std::vector<const WallLoad*>> by_layer(std::span<const WallLoad> loads, const Layers& layers) {
  require_valid(layers);
  std::vector<std::vector<const WallLoad*>> in_layer(static_cast<std::size_t>(layers.n));
  for (const WallLoad& load : loads)
    if (const auto layer = layer_of(layers, load.position[2])) in_layer[*layer].push_back(&load);
  return in_layer;
}

LayerModes unknown_modes(double mean, int highest) {
  return {mean, std::vector<Mode>(static_cast<std::size_t>(highest), {kNaN, kNaN}), kNaN};
}

/// Unknowns: the mean, then cosine and sine of each mode.
LayerModes fit_modes(const std::vector<const WallLoad*>& loads, int highest) {
  const Eigen::Index rows = std::ssize(loads), columns = 2 * highest + 1;
  if (rows <= columns) return unknown_modes(kNaN, highest);
  Eigen::MatrixXd waves(rows, columns);
  Eigen::VectorXd pressure(rows), area(rows);
  for (Eigen::Index i = 0; i < rows; ++i) {
    const WallLoad& load = *loads[static_cast<std::size_t>(i)];
    area[i] = load.area;
    pressure[i] = load.pressure();
    waves(i, 0) = 1.0;
    for (Eigen::Index m = 1; m <= highest; ++m) {
      waves(i, 2 * m - 1) = std::cos(static_cast<double>(m) * load.angle);
      waves(i, 2 * m) = std::sin(static_cast<double>(m) * load.angle);
    }
  }
  const Eigen::VectorXd root = area.cwiseSqrt();
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> fit(root.asDiagonal() * waves);
  if (fit.rank() < columns) return unknown_modes(kNaN, highest);  // balls at too few angles
  const Eigen::VectorXd found = fit.solve(root.cwiseProduct(pressure));
  if (pressure.isZero(0.0)) return unknown_modes(0.0, highest);

  LayerModes modes{found[0], {}, 0.0};
  for (Eigen::Index m = 1; m <= highest; ++m) {
    const double c = found[2 * m - 1], s = found[2 * m];
    modes.mode.push_back({std::hypot(c, s) / modes.mean, std::atan2(s, c) / static_cast<double>(m)});
  }
  // A sum 2 A p cos / sum A of independent p has variance 2 sum A^2 p^2 / (sum A)^2; cosine and sine add up.
  const double misfit = area.cwiseProduct(pressure - waves * found).norm();
  const double freedom = static_cast<double>(rows) / static_cast<double>(rows - columns);
  modes.scatter = 2.0 * misfit * std::sqrt(freedom) / area.sum() / modes.mean;
  return modes;
}

}  // namespace

std::vector<WallLoad> wall_loads(const core::State& state, const std::vector<core::Contact>& contacts, const SiloShape& shape) {
  const std::vector<Vec3> force = forces_on_wall(state, contacts);
  const Meridian line = meridian(shape);
  const double sharing = std::max(1.0, shape.coverage);  // balls to a place
  std::vector<WallLoad> loads;
  for (std::size_t ball = 0; ball < state.size(); ++ball) {
    if (state.kind[ball] != core::Kind::wall) continue;
    const Vec3& at = state.position[ball];
    const Eigen::Vector2d away = outward(shape.section, at);
    const double along = nearest_along(line, away.dot(at.head<2>()), at[2]);
    const MeridianPoint normal = line.outward_normal(along);
    loads.push_back({state.id[ball], at, std::atan2(at[1], at[0]), around(shape.section, at), along,
                     4.0 * state.radius[ball] * state.radius[ball] / sharing,
                     {normal.half_width * away[0], normal.half_width * away[1], normal.z}, force[ball]});
  }
  return loads;
}

std::vector<double> mean_by_layer(std::span<const WallLoad> loads, std::span<const double> values, const Layers& layers) {
  require_valid(layers);
  GC_REQUIRE(values.size() == loads.size(), "{} values for {} wall balls: need one for each", values.size(), loads.size());
  std::vector<double> sum(static_cast<std::size_t>(layers.n), 0.0), area(sum);
  for (std::size_t i = 0; i < loads.size(); ++i) {
    const auto layer = layer_of(layers, loads[i].position[2]);
    if (!layer) continue;
    sum[*layer] += values[i] * loads[i].area;
    area[*layer] += loads[i].area;
  }
  for (std::size_t k = 0; k < sum.size(); ++k) sum[k] = area[k] > 0.0 ? sum[k] / area[k] : kNaN;
  return sum;
}

std::vector<double> pressure_by_layer(std::span<const WallLoad> loads, const Layers& layers) {
  std::vector<double> pressure;
  for (const WallLoad& load : loads) pressure.push_back(load.pressure());
  return mean_by_layer(loads, pressure, layers);
}

std::vector<LayerModes> azimuthal_modes(std::span<const WallLoad> loads, const Layers& layers, int highest) {
  GC_REQUIRE(highest >= 0, "azimuthal modes up to {}: need 0 or more", highest);
  std::vector<LayerModes> modes;
  for (const auto& in_layer : by_layer(loads, layers)) modes.push_back(fit_modes(in_layer, highest));
  return modes;
}

LateralResultant lateral_resultant(std::span<const WallLoad> loads) {
  LateralResultant sum{Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero(), Eigen::Vector2d::Zero()};
  for (const WallLoad& load : loads) {
    sum.force += load.force.head<2>();
    sum.moment_of_horizontal += load.position[2] * Eigen::Vector2d(-load.force[1], load.force[0]);
    sum.moment_of_vertical += load.force[2] * Eigen::Vector2d(load.position[1], -load.position[0]);
  }
  return sum;
}

}  // namespace grainclock::silo
