#include "benchmarks/amplification.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace grainclock::benchmarks {
namespace {

using Eigen::MatrixXd;

// A free motion has the double eigenvalue 1, which rounding splits by the root of 1e-16, further in large systems.
constexpr double kGrows = 1.0 + 1e-6;

/// The rows of the map from the state to itself, as blocks.
MatrixXd stacked(const MatrixXd& first, const MatrixXd& second) {
  MatrixXd out(first.rows() + second.rows(), first.cols());
  out << first, second;
  return out;
}

}  // namespace

Modes modes(const LinearSystem& system) {
  const Eigen::SelfAdjointEigenSolver<MatrixXd> solver(system.spring);
  return {solver.eigenvalues(), solver.eigenvectors()};
}

double undamped_critical_step(const LinearSystem& system) {
  return 2.0 / std::sqrt(modes(system).square_frequency.maxCoeff());
}

MatrixXd amplification_matrix(const LinearSystem& system, double step, core::Integrator integrator) {
  const Eigen::Index n = system.spring.rows();
  const Eigen::Index parts = integrator == core::Integrator::predicted ? 3 : 2;
  const MatrixXd all = MatrixXd::Identity(parts * n, parts * n);
  const MatrixXd x = all.topRows(n), v = all.middleRows(n, n);  // v is in units of 1/h, acceleration of 1/h2
  const MatrixXd s = step * step * system.spring, y = step * system.dashpot;
  const auto acceleration = [&](const MatrixXd& at, const MatrixXd& velocity) -> MatrixXd { return -s * at - y * velocity; };
  if (integrator == core::Integrator::lagged) {
    const MatrixXd next_v = v + acceleration(x, v);
    return stacked(x + next_v, next_v);
  }
  const MatrixXd a = integrator == core::Integrator::predicted ? MatrixXd(all.bottomRows(n)) : acceleration(x, v);
  const MatrixXd next_x = x + v + 0.5 * a, next_a = acceleration(next_x, v + a), next_v = v + 0.5 * (a + next_a);
  const MatrixXd moved = stacked(next_x, next_v);
  return integrator == core::Integrator::predicted ? stacked(moved, next_a) : moved;
}

double spectral_radius(const MatrixXd& matrix) {
  return Eigen::EigenSolver<MatrixXd>(matrix, false).eigenvalues().cwiseAbs().maxCoeff();
}

double stability_limit(const LinearSystem& system, core::Integrator integrator) {
  const double undamped = undamped_critical_step(system);
  double stable = 0.0, unstable = 1.01 * undamped;  // no dashpot moves any of the limits beyond the undamped one
  while (unstable - stable > kLimitResolution * unstable) {
    const double middle = 0.5 * (stable + unstable);
    const bool grows = spectral_radius(amplification_matrix(system, middle, integrator)) > kGrows;
    (grows ? unstable : stable) = middle;
  }
  return stable;
}

double mode_limit(double damping_ratio, core::Integrator integrator) {
  // With r = h omega / 2: s = 4 r2, y = 4 zeta r.
  const double zeta = damping_ratio;
  const auto root = [](double b) { return std::sqrt(b * b + 1.0) - b; };  // of r2 + 2 b r = 1
  switch (integrator) {
    case core::Integrator::lagged:
      return root(zeta);
    case core::Integrator::predicted:
      return root(2.0 * zeta);
    case core::Integrator::pece:
      // (1 - 4 zeta2) r2 + 2 zeta r = 1, as long as its root keeps y below 2.
      return zeta < 0.5 ? 1.0 / (zeta + std::sqrt(1.0 - 3.0 * zeta * zeta)) : 0.5 / zeta;
  }
  return 0.0;
}

}  // namespace grainclock::benchmarks
