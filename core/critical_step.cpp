#include "core/critical_step.hpp"

#include "core/neighbours.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace grainclock::core {

double dashpot_factor(Integrator integrator) { return integrator == Integrator::predicted ? 4.0 : 2.0; }

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Largest h with h2 k + q h c <= 4, where k and c are per mass.
double solve(double k, double c, double q) {
  if (k <= 0.0 && c <= 0.0) return kInfinity;
  const double b = 0.5 * q * c;
  return 4.0 / (b + std::sqrt(b * b + 4.0 * k));
}

}  // namespace

double critical_step_of_pair(const PairLaw& law, double inverse_mass_sum, Integrator integrator) {
  return solve(law.k * inverse_mass_sum, law.c * inverse_mass_sum, dashpot_factor(integrator));
}

StepBounds critical_steps(const State& state, const Materials& materials, bool outlet_open, Integrator integrator) {
  Balls balls(state, materials, !outlet_open);
  const double floor = 1e-3 * balls.mean_diameter;  // no motion is expected: any small skin will do
  NeighbourList list(materials.reach(), {floor, 0.0, 0.0}, 1);
  list.build(balls);
  const std::uint32_t n = balls.content_count();
  std::vector<Eigen::Matrix3d> spring(n, Eigen::Matrix3d::Zero()), dashpot = spring;
  std::vector<std::uint8_t> touches_wall(n, 0);
  for (const bool fixed : {false, true}) {
    const PairList& pairs = fixed ? list.fixed_pairs() : list.ball_pairs();
    const PairLaw& law = fixed ? materials.wall : materials.ball;
    for (std::size_t p = 0; p < pairs.count; ++p) {
      const std::uint32_t i = pairs.i[p], j = pairs.j[p];
      const Vec3 d = position(balls.rows[i]) - position(balls.rows[j]);
      if (balls.rows[i].r + balls.rows[j].r - d.norm() <= 0.0) continue;
      const double inertia = balls.inverse_mass[i] + (fixed ? 0.0 : balls.inverse_mass[j]);
      const Eigen::Matrix3d nn = inertia / d.squaredNorm() * d * d.transpose();
      spring[i] += law.k * nn;
      dashpot[i] += law.c * nn;
      if (fixed) {
        touches_wall[i] = 1;
      } else {
        spring[j] += law.k * nn;
        dashpot[j] += law.c * nn;
      }
    }
  }
  const double q = dashpot_factor(integrator);
  const auto is_safe = [&](std::uint32_t row, double h) {
    const Eigen::Matrix3d m = h * h * spring[row] + q * h * dashpot[row];
    return Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m, Eigen::EigenvaluesOnly).eigenvalues()[2] <= 4.0;
  };
  StepBounds bounds;
  bounds.smallest = bounds.bulk = bounds.wall = kInfinity;
  std::vector<std::uint32_t> order(n);
  std::iota(order.begin(), order.end(), 0U);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) { return balls.id[a] < balls.id[b]; });
  for (const std::uint32_t row : order) {
    double safe = solve(spring[row].trace(), dashpot[row].trace(), q);
    if (std::isfinite(safe) && touches_wall[row] == 0 && materials.ball.k > 0.0) {
      // One kind of contact: dashpots are in proportion to springs, and one eigenvalue is enough.
      const double stiffest = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(spring[row], Eigen::EigenvaluesOnly).eigenvalues()[2];
      safe = solve(stiffest, stiffest * (materials.ball.c / materials.ball.k), q);
    } else if (std::isfinite(safe)) {
      // The trace bounds the eigenvalue from above, a third of it from below.
      double unsafe = std::max(solve(spring[row].trace() / 3.0, dashpot[row].trace() / 3.0, q), safe) * (1.0 + 1e-12);
      while (unsafe - safe > 1e-9 * safe) {
        const double middle = 0.5 * (safe + unsafe);
        (is_safe(row, middle) ? safe : unsafe) = middle;
      }
    }
    bounds.per_ball.push_back(safe);
    if (safe < bounds.smallest) {
      bounds.smallest = safe;
      bounds.at = balls.id[row];
    }
    double& group = touches_wall[row] != 0 ? bounds.wall : bounds.bulk;
    group = std::min(group, safe);
  }
  return bounds;
}

namespace {

/// Of the springs' largest step, how much a treatment of dashpots leaves.
double share_of_springs(Dashpot dashpot) { return dashpot == Dashpot::relaxed ? 0.5 : 1.0; }

}  // namespace

StepBounds critical_steps(const State& state, const Materials& materials, bool outlet_open, const Stepping& stepping) {
  if (stepping.dashpot == Dashpot::explicit_) return critical_steps(state, materials, outlet_open, stepping.integrator);
  Materials springs = materials;
  springs.ball.c = springs.wall.c = 0.0;
  StepBounds bounds = critical_steps(state, springs, outlet_open, stepping.integrator);
  const double share = share_of_springs(stepping.dashpot);
  for (double* bound : {&bounds.smallest, &bounds.bulk, &bounds.wall}) *bound *= share;
  for (double& bound : bounds.per_ball) bound *= share;
  return bounds;
}

double critical_step_of_pair(const PairLaw& law, double inverse_mass_sum, const Stepping& stepping) {
  if (stepping.dashpot == Dashpot::explicit_) return critical_step_of_pair(law, inverse_mass_sum, stepping.integrator);
  return share_of_springs(stepping.dashpot) * critical_step_of_pair({law.k, 0.0}, inverse_mass_sum, stepping.integrator);
}

}  // namespace grainclock::core
