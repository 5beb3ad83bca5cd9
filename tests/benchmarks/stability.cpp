// Limits of stability: the steppers, theory and the program's bound against each other; the growth of selective steps.
#include "benchmarks/stability.hpp"

#include "core/check.hpp"
#include "core/critical_step.hpp"
#include "multirate/stepper.hpp"
#include "tests/support/balls.hpp"
#include "tests/support/order.hpp"
#include "tests/support/scratch.hpp"

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

#include <cmath>

namespace grainclock::benchmarks {
namespace {

using core::Integrator;
using core::Kind;
using core::State;
using core::Vec3;

constexpr Integrator kIntegrators[] = {Integrator::lagged, Integrator::predicted, Integrator::pece};
constexpr double kDampingRatios[] = {0.0, 0.1, 0.3, 0.6, 1.0};
constexpr int kSteps = 2000;

const State& packing() {
  static const State state = small_packing();
  return state;
}

PressedSystem small(SystemKind kind, double damping_ratio) {
  return kind == SystemKind::pair   ? pressed_pair(damping_ratio)
         : kind == SystemKind::wall ? pressed_wall(damping_ratio)
                                    : pressed_chain(damping_ratio);
}

double bound_of(const PressedSystem& system, Integrator integrator) {
  return core::critical_steps(system.state, system.materials, false, integrator).smallest;
}

/// Largest eigenvalue of h2 K + q h C, per mass.
double largest_of_form(const LinearSystem& system, double step, double q) {
  const Eigen::MatrixXd form = step * step * system.spring + q * step * system.dashpot;
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(form, Eigen::EigenvaluesOnly).eigenvalues().maxCoeff();
}

TEST(StabilityLimits, MeasuredAndTheoreticalAgree) {
  for (const SystemKind kind : {SystemKind::pair, SystemKind::wall, SystemKind::chain})
    for (const Integrator integrator : kIntegrators)
      for (const double ratio : kDampingRatios) {
        const PressedSystem system = small(kind, ratio);
        const double theory = stability_limit(linearised(system), integrator);
        const double measured = measured_limit(system, integrator, kSteps);
        // Asked for are 5 %. The bisection's 0.2 %, and what grows too slowly to be seen within the steps: 0.35 %.
        EXPECT_NEAR(measured / theory, 1.0, 0.01) << name(kind) << " " << core::name(integrator) << " " << ratio;
      }
}

TEST(StabilityLimits, OfASingleContactAreTheClosedForms) {
  for (const Integrator integrator : kIntegrators)
    for (const double ratio : kDampingRatios) {
      for (const SystemKind kind : {SystemKind::pair, SystemKind::wall}) {
        const LinearSystem linear = linearised(small(kind, ratio));
        const double limit = stability_limit(linear, integrator) / undamped_critical_step(linear);
        // The pair's walls add a thousandth of its stiffness, but 3 % of its dashpot, to both balls: 3 % at most.
        EXPECT_NEAR(limit / mode_limit(ratio, integrator), 1.0, kind == SystemKind::pair ? 0.03 : 2.0 * kLimitResolution)
            << name(kind) << " " << core::name(integrator) << " " << ratio;
      }
    }
}

TEST(StabilityLimits, GrowthBeyondThemIsTheSpectralRadius) {
  for (const Integrator integrator : kIntegrators)
    for (const double ratio : kDampingRatios) {
      const PressedSystem system = pressed_chain(ratio);
      const LinearSystem linear = linearised(system);
      const double limit = stability_limit(linear, integrator);
      // Of 12 modes the fastest does not stand alone by the time the run ends, less so the faster it grows.
      const double theory = spectral_radius(amplification_matrix(linear, 1.1 * limit, integrator));
      EXPECT_NEAR(measured_growth(system, integrator, 1.1 * limit, kSteps).per_step / theory, 1.0, 0.03)
          << core::name(integrator) << ratio;
      const Growth below = measured_growth(system, integrator, 0.95 * limit, kSteps);
      // Without dashpots the energy of a swing oscillates by 1 / (1 - 0.95^2), a factor of 3 in its root.
      EXPECT_LT(below.total, 4.0) << core::name(integrator) << ratio;
      EXPECT_LT(below.per_step, 1.0 + 2.0 * std::log(4.0) / kSteps)
          << core::name(integrator) << ratio;  // the same over half the run
    }
}

TEST(StabilityLimits, GrowthIsSeenWhereStepsComeThroughRest) {
  // A lagged step with h2 k = m and h c = 2 m: w' = -w - x, x' = x + w' goes through x = 0, v = 0 and grows by 1.618.
  const PressedSystem wall = pressed_wall(1.0);
  const double step = 0.5 * undamped_critical_step(linearised(wall));
  // The other solution alternates with it, less and less: a part 0.38^(n/2) after n steps.
  EXPECT_NEAR(measured_growth(wall, Integrator::lagged, step, kSteps).per_step, 0.5 * (1.0 + std::sqrt(5.0)), 0.02);
}

TEST(StabilityLimits, StepsDoWhatTheMatricesSay) {
  for (const Integrator integrator : kIntegrators) {
    const PressedSystem system = pressed_chain(0.3);
    const LinearSystem linear = linearised(system);
    const double h = 0.5 * stability_limit(linear, integrator);
    const Eigen::Index n = linear.spring.rows();
    Eigen::VectorXd root(n), v(n);
    State start = system.state;
    for (Eigen::Index i = 0; i < n; ++i) {
      const auto ball = static_cast<std::size_t>(i);
      root[i] = std::sqrt(system.materials.mass(start.radius[ball]));
      v[i] = std::cos(7.0 * static_cast<double>(i));
      start.velocity[ball].x() = 1e-3 * v[i] / root[i];  // m/s: displacements below a hundredth of the overlaps
    }
    const auto stepper = core::make_uniform_stepper(start, tests::weightless(system.materials, h, integrator));
    const auto moved = [&]() -> Eigen::VectorXd {
      const State now = stepper->state();
      Eigen::VectorXd x(n);
      for (Eigen::Index i = 0; i < n; ++i) {
        const auto ball = static_cast<std::size_t>(i);
        x[i] = root[i] * (now.position[ball].x() - start.position[ball].x()) / 1e-3;
      }
      return x;
    };
    const Eigen::MatrixXd matrix = amplification_matrix(linear, h, integrator);
    Eigen::VectorXd expected(matrix.rows());
    if (integrator == Integrator::lagged) {
      stepper->advance(1);  // known from here on: the half-step velocity is the displacement
      expected << moved(), moved();
    } else if (integrator == Integrator::predicted) {
      expected << Eigen::VectorXd::Zero(n), h * v, -h * h * linear.dashpot * v;
    } else {
      expected << Eigen::VectorXd::Zero(n), h * v;
    }
    double largest = 0.0;
    for (int step = 0; step < 20; ++step) {
      stepper->advance(1);
      expected = matrix * expected;
      largest = std::max(largest, expected.head(n).norm());
      // Positions of 5 m are rounded to 1e-15 m, displacements are 1e-7 m.
      EXPECT_LT((moved() - expected.head(n)).norm(), 1e-6 * largest) << core::name(integrator) << " step " << step;
    }
  }
}

TEST(StabilityLimits, TheBoundIsSafeInAPackingAndAtMostTwiceTooCautious) {
  for (const double ratio : kDampingRatios) {
    const PressedSystem system = pressed_packing(ratio, packing());
    const LinearSystem linear = linearised(system);
    ASSERT_GT(linear.spring.rows(), 90);
    const double limit = stability_limit(linear, Integrator::pece), bound_of_pece = bound_of(system, Integrator::pece);
    EXPECT_LE(bound_of_pece, (1.0 + 2.0 * kLimitResolution) * limit) << ratio;
    EXPECT_GE(bound_of_pece, 0.5 * limit) << ratio;
    for (const Integrator integrator : {Integrator::lagged, Integrator::predicted}) {
      const double bound = bound_of(system, integrator), q = core::dashpot_factor(integrator);
      EXPECT_LE(largest_of_form(linear, bound, q), 4.0 * (1.0 + 1e-6))
          << core::name(integrator) << ratio;  // the bound's rounding
      EXPECT_GT(largest_of_form(linear, 2.0 * bound, q), 4.0) << core::name(integrator) << ratio;
      // Here the stiff wall decides, where a ball's own contacts are nearly all that counts.
      EXPECT_GT(largest_of_form(linear, 1.1 * bound, q), 4.0) << core::name(integrator) << ratio;
    }
  }
}

TEST(StabilityLimits, TheBoundIsSafeAndCloseForPairAndChain) {
  for (const SystemKind kind : {SystemKind::pair, SystemKind::wall, SystemKind::chain})
    for (const Integrator integrator : kIntegrators)
      for (const double ratio : kDampingRatios) {
        const PressedSystem system = small(kind, ratio);
        const double limit = stability_limit(linearised(system), integrator), bound = bound_of(system, integrator);
        EXPECT_LE(bound, (1.0 + 2.0 * kLimitResolution) * limit) << name(kind) << core::name(integrator) << ratio;
        // pece has the bound of lagged steps but goes further: 1.6 times at a ratio of one half.
        EXPECT_GE(bound, limit / (integrator == Integrator::pece ? 1.65 : 1.05))
            << name(kind) << core::name(integrator) << ratio;
      }
}

TEST(StabilityLimits, PackingsSettleWithAllContactsPressed) {
  const State& state = packing();
  EXPECT_EQ(state.count(Kind::content), 32u);
  const PressedSystem system = pressed_packing(0.0, state);
  const auto stepper = core::make_uniform_stepper(state, [&] {
    core::StepperSetup setup = tests::weightless(system.materials, 1e-5);
    setup.gravity = system.gravity;
    return setup;
  }());
  // Forces balance.
  std::vector<Vec3> force(state.size(), Vec3::Zero());
  for (const core::Contact& c : stepper->contacts()) {
    EXPECT_GT(c.overlap, 0.0);
    force[static_cast<std::size_t>(c.i)] += c.force;
    if (c.other == Kind::content) force[static_cast<std::size_t>(c.j)] -= c.force;
  }
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] != Kind::content) continue;
    const double mass = system.materials.mass(state.radius[i]);
    // Kinetic energy 1e-16 m g r: speeds of 2e-8 m/s, turned within 1e-3 s or more.
    EXPECT_LT((force[i] + mass * system.gravity).norm(), 1e-5 * mass * 9.81) << "ball " << i;
  }
}

TEST(StabilityLimits, APackingThatNeverRestsIsNamed) {
  State state;
  state.add(0, Kind::content, Vec3::Zero(), Vec3::Zero(), 0.22);
  const std::string message = tests::message_of<core::NumericsError>([&] { settled(state, "lonely.h5"); });
  EXPECT_NE(message.find("lonely.h5: still moving"), std::string::npos) << message;
  EXPECT_NE(message.find("rest on others"), std::string::npos) << message;
}

// ---- selective steps ----

constexpr double kSmallSteps[] = {0.15, 0.2, 0.3};

TEST(MultirateGrowth, OfAnUndampedChainGoesWithTheThirdPowerOfTheStep) {
  for (const int ratio : {2, 4, 8}) {
    std::vector<double> steps, rates;
    for (const double step_ratio : kSmallSteps) {
      const LevelledChain chain = levelled_chain(ratio, step_ratio, 0.0);
      steps.push_back(chain.step);
      rates.push_back(multirate_growth_rate(chain));
      EXPECT_GT(rates.back() * chain.step, 100.0 * kRateResolution * step_ratio) << ratio;
    }
    EXPECT_NEAR(tests::fitted_order(steps, rates), 3.0, 0.1) << ratio;  // C h3 + O(h4), h omega up to 0.6
  }
}

TEST(MultirateGrowth, IsNoneOnOneLevel) {
  for (const double step_ratio : {0.2, 0.5, 0.9}) {
    const LevelledChain chain = levelled_chain(1, step_ratio, 0.0);
    EXPECT_LT(std::abs(multirate_growth_rate(chain)) * chain.step, kRateResolution * step_ratio);
  }
}

TEST(MultirateGrowth, IsGoneAtADampingRatioOfTwoHundredths) {
  for (const int ratio : {2, 4, 8, 16})
    for (const double step_ratio : {0.15, 0.5, 0.9}) {
      const LevelledChain chain = levelled_chain(ratio, step_ratio, 0.02);
      // The slowest mode fades with half its square frequency times c / k: 3e-4 sqrt(k / m) for pi / 13 of a turn per ball.
      EXPECT_LT(multirate_growth_rate(chain) * chain.step, -3e-4 * step_ratio) << ratio << " " << step_ratio;
    }
  EXPECT_GT(multirate_growth_rate(levelled_chain(4, 0.9, 0.005)), 1.0);  // 1/s: less damping is not enough
}

TEST(MultirateGrowth, IsWhatLongRunsShow) {
  const LevelledChain chain = levelled_chain(4, 0.8, 0.0);
  const PressedSystem& system = chain.system;
  State start = system.state;
  for (std::size_t i = 0; i < start.size(); ++i) {
    if (start.kind[i] == Kind::content) start.velocity[i].x() = 1e-11 * std::cos(7.0 * static_cast<double>(i));
  }
  core::StepperSetup setup = tests::weightless(system.materials, chain.step);
  setup.stepping.method = core::Method::multirate;
  setup.stepping.tolerance = 1e6;
  setup.stepping.levels = 3;
  const auto stepper = multirate::make_stepper(start, setup);
  const auto fastest_within = [&](int steps) {
    double fastest = 0.0;
    for (int k = 0; k < steps; ++k) {
      stepper->advance(1);
      for (const Vec3& v : stepper->state().velocity) fastest = std::max(fastest, v.norm());
    }
    return fastest;
  };
  stepper->advance(300);  // until the fastest growing motion leads
  const double before = fastest_within(50);
  stepper->advance(150);
  const double after = fastest_within(50);
  // A window of 50 steps holds many swings; the growth over 200 steps is a factor of 2000.
  EXPECT_NEAR(std::log(after / before) / (200 * chain.step) / multirate_growth_rate(chain), 1.0, 0.03);
}

TEST(MultirateGrowth, NamesTheBallWhoseLevelIsNotTheOneMeant) {
  const std::string message =
      tests::message_of<core::NumericsError>([] { multirate_growth_rate(levelled_chain(2, 1.2, 0.0)); });
  EXPECT_NE(message.find("level"), std::string::npos) << message;
  EXPECT_NE(message.find("smaller steps"), std::string::npos) << message;
}

// ---- what takes longer ----

TEST(SlowStabilityLimits, MeasuredAndTheoreticalAgreeInAPacking) {
  for (const Integrator integrator : kIntegrators)
    for (const double ratio : kDampingRatios) {
      const PressedSystem system = pressed_packing(ratio, packing());
      const double theory = stability_limit(linearised(system), integrator);
      // As for pair and chain.
      EXPECT_NEAR(measured_limit(system, integrator, kSteps) / theory, 1.0, 0.01) << core::name(integrator) << ratio;
      if (integrator != Integrator::pece) {  // the bisection's resolution, in h2
        const double form = largest_of_form(linearised(system), theory, core::dashpot_factor(integrator));
        EXPECT_NEAR(form / 4.0, 1.0, 4.0 * kLimitResolution) << core::name(integrator) << ratio;
      }
      const double bound = bound_of(system, integrator);
      EXPECT_LE(bound, (1.0 + 2.0 * kLimitResolution) * theory) << core::name(integrator) << ratio;
      EXPECT_GE(bound, theory / (integrator == Integrator::pece ? 2.45 : 2.0)) << core::name(integrator) << ratio;
    }
}

}  // namespace
}  // namespace grainclock::benchmarks
