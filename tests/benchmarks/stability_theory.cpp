// The theory of stability against closed forms, exact solutions and symmetric eigenvalues.
#include "benchmarks/amplification.hpp"

#include "tests/support/balls.hpp"
#include "tests/support/order.hpp"

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include <cmath>

namespace grainclock::benchmarks {
namespace {

using core::Integrator;
using tests::Random;

constexpr Integrator kIntegrators[] = {Integrator::lagged, Integrator::predicted, Integrator::pece};
constexpr double kDampingRatios[] = {0.0, 0.02, 0.1, 0.3, 0.49, 0.5, 0.52, 0.55, 0.6, 1.0, 3.0};
constexpr double kFrequency = 3.0;  // 1/s

LinearSystem mode(double damping_ratio) {
  return {Eigen::MatrixXd::Constant(1, 1, kFrequency * kFrequency),
          Eigen::MatrixXd::Constant(1, 1, 2.0 * damping_ratio * kFrequency)};
}

double radius(const LinearSystem& system, double step, Integrator integrator) {
  return spectral_radius(amplification_matrix(system, step, integrator));
}

/// A random system whose springs and dashpots share directions or not at all; `damping` scales the dashpots.
LinearSystem random_system(Random& random, bool shared, double damping) {
  const Eigen::Index n = 2 + static_cast<Eigen::Index>(random.below(4));
  LinearSystem system{Eigen::MatrixXd::Zero(n, n), Eigen::MatrixXd::Zero(n, n)};
  const auto direction = [&] {
    Eigen::VectorXd v(n);
    for (Eigen::Index k = 0; k < n; ++k) v[k] = random.between(-1.0, 1.0);
    return v;
  };
  for (Eigen::Index contact = 0; contact < 2 * n; ++contact) {
    const Eigen::VectorXd a = direction(), b = shared ? a : direction();
    system.spring += std::exp(random.between(0.0, 4.0)) * a * a.transpose();
    system.dashpot += damping * std::exp(random.between(0.0, 4.0)) * b * b.transpose();
  }
  return system;
}

/// Where the largest eigenvalue of h2 K + q h C reaches 4, by bisection.
double form_limit(const LinearSystem& system, double q) {
  double low = 0.0, high = undamped_critical_step(system);
  for (int k = 0; k < 60; ++k) {
    const double h = 0.5 * (low + high);
    const Eigen::MatrixXd form = h * h * system.spring + q * h * system.dashpot;
    const double largest =
        Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(form, Eigen::EigenvaluesOnly).eigenvalues().maxCoeff();
    (largest > 4.0 ? high : low) = h;
  }
  return low;
}

TEST(Amplification, OfOneModeChangesAtTheClosedFormsLimit) {
  for (const Integrator integrator : kIntegrators) {
    for (const double ratio : kDampingRatios) {
      SCOPED_TRACE(testing::Message() << core::name(integrator) << " at damping ratio " << ratio);
      const double limit = mode_limit(ratio, integrator) * 2.0 / kFrequency;
      // Past the limit by e the largest modulus grows by e at least; rounding splits a double eigenvalue by 1e-8.
      EXPECT_LE(radius(mode(ratio), 0.999 * limit, integrator), 1.0 + 1e-7);
      EXPECT_GE(radius(mode(ratio), 1.001 * limit, integrator), 1.0 + 5e-4);
      EXPECT_NEAR(stability_limit(mode(ratio), integrator) / limit, 1.0, 2.0 * kLimitResolution);
    }
  }
}

TEST(Amplification, StaysStableAllTheWayToTheLimit) {
  for (const Integrator integrator : kIntegrators)
    for (const double ratio : kDampingRatios)
      for (int part = 1; part < 50; ++part) {
        const double h = part / 50.0 * mode_limit(ratio, integrator) * 2.0 / kFrequency;
        EXPECT_LE(radius(mode(ratio), h, integrator), 1.0 + 1e-7)
            << core::name(integrator) << ratio << " " << part;  // rounding
      }
}

TEST(Amplification, LimitsOfOneModeByHand) {
  // r = h omega / 2: r2 + 2 zeta r = 1 and r2 + 4 zeta r = 1 at zeta = 3/4 and 3/8: r = 1/2.
  EXPECT_NEAR(mode_limit(0.75, Integrator::lagged), 0.5, 1e-15);
  EXPECT_NEAR(mode_limit(0.375, Integrator::predicted), 0.5, 1e-15);
  // pece: (1 - 4 zeta2) r2 + 2 zeta r = 1 at zeta = 1/2: r = 1, as without dashpot; beyond, h c = 2 m: r = 1 / (2 zeta).
  EXPECT_NEAR(mode_limit(0.5, Integrator::pece), 1.0, 1e-15);
  EXPECT_NEAR(mode_limit(2.0, Integrator::pece), 0.25, 1e-15);
  for (const Integrator integrator : kIntegrators) EXPECT_EQ(mode_limit(0.0, integrator), 1.0);
}

TEST(Amplification, FollowsTheOscillatorWithTheSchemesOrder) {
  // Eigenvalues of one step against exp(lambda h): their error is one order higher than the scheme's.
  for (const Integrator integrator : kIntegrators) {
    for (const double ratio : {0.0, 0.3}) {
      std::vector<double> steps, errors;
      for (const double h : {0.02, 0.01, 0.005, 0.0025}) {
        const Eigen::VectorXcd found = amplification_matrix(mode(ratio), h, integrator).eigenvalues();
        const double fade = std::exp(-ratio * kFrequency * h), angle = kFrequency * std::sqrt(1.0 - ratio * ratio) * h;
        const std::complex<double> exact = std::polar(fade, angle);
        steps.push_back(h);
        errors.push_back((found.array() - exact).abs().minCoeff());
      }
      const double order = integrator == Integrator::lagged && ratio > 0.0 ? 1.0 : 2.0;
      EXPECT_NEAR(tests::fitted_order(steps, errors), order + 1.0, 0.1)
          << core::name(integrator) << ratio;  // C h^p + O(h^(p+1))
    }
  }
}

TEST(Amplification, OfAnySystemChangesWhereTheSymmetricFormReachesFour) {
  Random random(1);
  for (int trial = 0; trial < 60; ++trial) {
    const LinearSystem system = random_system(random, trial % 2 == 0, std::exp(random.between(-4.0, 1.0)));
    EXPECT_NEAR(stability_limit(system, Integrator::lagged) / form_limit(system, 2.0), 1.0, 2.0 * kLimitResolution) << trial;
    EXPECT_NEAR(stability_limit(system, Integrator::predicted) / form_limit(system, 4.0), 1.0, 2.0 * kLimitResolution)
        << trial;
  }
}

TEST(Amplification, OfPeceIsStableWhereLaggedStepsAre) {
  // Seen, not proved: 20,000 random systems without a counterexample.
  Random random(2);
  for (int trial = 0; trial < 60; ++trial) {
    const LinearSystem system = random_system(random, trial % 2 == 0, std::exp(random.between(-4.0, 1.0)));
    const double pece = stability_limit(system, Integrator::pece), lagged = stability_limit(system, Integrator::lagged);
    EXPECT_GE(pece, (1.0 - 2.0 * kLimitResolution) * lagged) << trial;
    EXPECT_LE(pece, (1.0 + 1e-9) * undamped_critical_step(system)) << trial;  // rounding of the bisection's ends
  }
}

}  // namespace
}  // namespace grainclock::benchmarks
