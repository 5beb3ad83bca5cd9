// Theory of the integrators' stability on linear systems M x'' = -K x - C x', from their definitions and Eigen alone:
// nothing here is shared with the steppers.
//
//   lagged     w' = w + h a(x, w), x' = x + h w', with w the velocity at half steps
//   predicted  x' = x + h v + h2/2 a, v_p = v + h a, a' = a(x', v_p), v' = v + h/2 (a + a')
//   pece       the same, then a'' = a(x', v'), which opens the next step
//
// In one mode of mass m, with s = h2 k / m and y = h c / m, a step is stable while
//   lagged     s + 2 y < 4
//   predicted  s + 4 y < 4
//   pece       s + 2 y - y2 < 4 and y < 2
// For lagged and predicted steps the same holds of any system with the largest eigenvalue of M^-1 (h2 K + q h C): an
// eigenvector's quotients u*K u / u*M u and u*C u / u*M u satisfy the mode's equation, and where the form passes 4 an
// eigenvalue passes -1. The second evaluation of pece brings products of C with C and K: no such form.
#pragma once

#include "core/scene.hpp"

#include <Eigen/Core>

namespace grainclock::benchmarks {

/// A linear system in coordinates M^(1/2) x.
struct LinearSystem {
  Eigen::MatrixXd spring;   // M^-1/2 K M^-1/2 [1/s2], symmetric
  Eigen::MatrixXd dashpot;  // M^-1/2 C M^-1/2 [1/s], symmetric
};

/// Square frequencies [1/s2] in increasing order, and the modes in columns.
struct Modes {
  Eigen::VectorXd square_frequency;
  Eigen::MatrixXd shape;
};
Modes modes(const LinearSystem& system);

/// 2 / omega_max [s]: every integrator's limit without dashpots.
double undamped_critical_step(const LinearSystem& system);

/// What one step of `step` [s] does to (x, h w) of lagged, (x, h v, h2 a) of predicted, (x, h v) of pece steps.
Eigen::MatrixXd amplification_matrix(const LinearSystem& system, double step, core::Integrator integrator);
/// Largest modulus of its eigenvalues: growth of the fastest growing solution per step.
double spectral_radius(const Eigen::MatrixXd& matrix);

/// Relative resolution of stability_limit().
constexpr double kLimitResolution = 1e-4;
/// The largest step [s] up to which nothing grows, by bisection on the spectral radius.
double stability_limit(const LinearSystem& system, core::Integrator integrator);

/// The limit of one mode of this damping ratio over its undamped limit 2 / omega, in closed form.
double mode_limit(double damping_ratio, core::Integrator integrator);

}  // namespace grainclock::benchmarks
