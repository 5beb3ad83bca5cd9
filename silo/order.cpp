#include "silo/order.hpp"

#include "core/check.hpp"
#include "silo/content.hpp"
#include "silo/point_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// The 13 real spherical harmonics of degree 6, so normalised that h(u) . h(v) is the Legendre polynomial P6(u . v)
/// (addition theorem). They are the same for -u.
using Harmonics = Eigen::Matrix<double, 13, 1>;

Harmonics harmonics(const Vec3& unit) {
  const double theta = std::atan2(std::hypot(unit[0], unit[1]), unit[2]), phi = std::atan2(unit[1], unit[0]);
  Harmonics h;
  for (Eigen::Index m = 0; m <= 6; ++m) {
    const double both = std::sqrt((m > 0 ? 8.0 : 4.0) * std::numbers::pi / 13.0) * std::sph_legendre(6U, static_cast<unsigned>(m), theta);
    h[2 * m] = both * std::cos(static_cast<double>(m) * phi);
    if (m > 0) h[2 * m - 1] = both * std::sin(static_cast<double>(m) * phi);
  }
  return h;
}

struct Bond {
  std::size_t a, b;  // indices into the content, a < b
};

std::vector<Bond> bonds_of(const Content& content, double reach) {
  std::vector<Bond> bonds;
  if (content.ball.empty()) return bonds;
  const PointGrid grid(content.centre, reach);
  for (std::size_t a = 0; a < content.ball.size(); ++a) {
    grid.visit_within(content.centre[a], reach, [&](std::uint32_t b, double square) {
      if (a < b && square > 0.0) bonds.push_back({a, b});
    });
  }
  return bonds;
}

/// Solid-like bonds of each ball, from the sums over its bonds.
std::vector<int> solid_bonds(const std::vector<Bond>& bonds, const std::vector<Harmonics>& sum, double alike) {
  std::vector<int> count(sum.size(), 0);
  for (const auto& [a, b] : bonds) {
    if (!(sum[a].dot(sum[b]) > alike * sum[a].norm() * sum[b].norm())) continue;
    ++count[a];
    ++count[b];
  }
  return count;
}

/// The surface at this depth [m] below the nominal one, its hopper followed down to the axis, as depth_inside() sees it.
Meridian inside(const SiloShape& shape, double depth) {
  Meridian line = meridian(shape, -depth);
  const double share = line.outlet.half_width / (line.joint.half_width - line.outlet.half_width);
  line.outlet = {0.0, line.outlet.z - share * (line.joint.z - line.outlet.z)};
  return line;
}

}  // namespace

BondOrder bond_order(const State& state, const BondRule& rule) {
  GC_REQUIRE(rule.reach > 0.0, "bonds up to {} mean diameters: must be above 0", rule.reach);
  const Content content = content_of(state);
  const std::vector<Bond> bonds = bonds_of(content, rule.reach * content.mean_diameter);
  std::vector<Harmonics> sum(content.ball.size(), Harmonics::Zero());
  std::vector<int> count(content.ball.size(), 0);
  Harmonics all = Harmonics::Zero();
  for (const auto& [a, b] : bonds) {
    const Harmonics h = harmonics((content.centre[b] - content.centre[a]).normalized());
    sum[a] += h;
    sum[b] += h;
    all += h;
    ++count[a];
    ++count[b];
  }
  const std::vector<int> solid = solid_bonds(bonds, sum, rule.alike);

  BondOrder order{std::vector(state.size(), kNone), std::vector<std::uint8_t>(state.size(), 0)};
  std::size_t crystalline = 0;
  for (std::size_t a = 0; a < content.ball.size(); ++a) {
    if (count[a] > 0) order.q6[content.ball[a]] = sum[a].norm() / count[a];
    const bool is_crystalline = solid[a] >= rule.solid_bonds;
    order.crystalline[content.ball[a]] = is_crystalline;
    if (is_crystalline) ++crystalline;
  }
  order.global_q6 = all.norm() / static_cast<double>(bonds.size());
  order.crystalline_share = static_cast<double>(crystalline) / static_cast<double>(content.ball.size());
  return order;
}

std::vector<double> centres_by_depth(const State& state, const SiloShape& shape, double z0, double z1, double depth,
                                     int n) {
  GC_REQUIRE(z0 >= 0.0 && z0 < z1 && n >= 1, "{} shells between z = {} m and {} m: need at least one, and z0 from 0 m "
             "to below z1", n, z0, z1);
  GC_REQUIRE(depth > 0.0 && depth < shape.half_width, "shells to a depth of {} m: must be above 0 m and below the silo's half "
             "width, {} m", depth, shape.half_width);
  std::vector<double> density(static_cast<std::size_t>(n), 0.0);
  const Meridian wall = meridian(shape);
  for (std::size_t i = 0; i < state.size(); ++i) {
    const double z = state.position[i][2];
    if (state.kind[i] != Kind::content || z < z0 || z > z1) continue;
    const double at = depth_inside(shape.section, wall, state.position[i]) / depth * n;
    if (at >= 0.0 && at < n) density[static_cast<std::size_t>(at)] += 1.0;
  }
  const auto volume_within = [&](int shell) {
    return volume_between(shape.section, inside(shape, depth * shell / n), z0, z1);
  };
  for (int shell = 0; shell < n; ++shell) {
    const double volume = volume_within(shell) - volume_within(shell + 1);
    double& here = density[static_cast<std::size_t>(shell)];
    here = volume > 0.0 ? here / volume : 0.0;
  }
  return density;
}

}  // namespace grainclock::silo
