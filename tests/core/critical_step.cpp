// The stability bound against what the schemes do.
#include "core/critical_step.hpp"

#include "core/check.hpp"
#include "core/stepper.hpp"
#include "tests/support/balls.hpp"
#include "tests/support/closed_forms.hpp"
#include "tests/support/scratch.hpp"

#include <gtest/gtest.h>
#include <Eigen/Dense>

#include <cmath>
#include <string>

namespace grainclock::core {
namespace {

using tests::Random;

constexpr double kRatios[] = {0.0, 0.02, 0.3, 0.6, 1.0, 3.0};  // of damping

TEST(CriticalStep, OfAPairIsTheRootOfTheBound) {
  for (const Integrator integrator : {Integrator::lagged, Integrator::predicted, Integrator::pece}) {
    const double q = integrator == Integrator::predicted ? 4.0 : 2.0;
    EXPECT_EQ(dashpot_factor(integrator), q);
    for (const PairLaw& law : {PairLaw{1e7, 0.0}, PairLaw{1e7, 2e4}, PairLaw{1e7, 1e8}, PairLaw{0.0, 2e4}}) {
      const double inverse_mass = 1.0 / 27.9, h = critical_step_of_pair(law, inverse_mass, integrator);
      EXPECT_NEAR((h * h * law.k + q * h * law.c) * inverse_mass / 4.0, 1.0, 1e-14);  // rounding
    }
    EXPECT_TRUE(std::isinf(critical_step_of_pair({0.0, 0.0}, 1.0, integrator)));
  }
  EXPECT_NEAR(critical_step_of_pair({1e7, 0.0}, 1e-2, Integrator::predicted), 2.0 / std::sqrt(1e5), 1e-16);
}

// ---- measured on the steppers ----

/// Two unequal balls pressed together between two walls a thousand times softer, or one ball on one wall ball, at
/// rest but for a small kick; the kick over the overlap stays small unless the step is unstable.
struct Pressed {
  static constexpr double kKick = 1e-8;  // m/s; at the overlap's 1e-5 m times 500 / s the contact would open
  Materials materials;
  State state;
  Vec3 gravity = Vec3::Zero();
  double inverse_mass;
  PairLaw law;

  Pressed(bool two, double ratio) {
    const double r0 = 0.2, r1 = 0.25, m0 = materials.mass(r0), m1 = materials.mass(r1);
    inverse_mass = two ? 1.0 / m0 + 1.0 / m1 : 1.0 / m0;
    law = {1e7, tests::dashpot(1e7, 1.0 / inverse_mass, ratio)};
    materials.tension = true;  // linear throughout
    const double overlap = 1e-5;
    if (two) {
      materials.ball = law;
      materials.wall = {1e4, 0.0};
      const double reach = overlap * 1e3;
      state.add(0, Kind::content, {0.0, 0.0, 0.0}, {kKick, 0.0, 0.0}, r0);
      state.add(1, Kind::content, {r0 + r1 - overlap, 0.0, 0.0}, {-kKick, 0.0, 0.0}, r1);
      state.add(2, Kind::wall, {-2.0 * r0 + reach, 0.0, 0.0}, Vec3::Zero(), r0);
      state.add(3, Kind::wall, {r0 + 3.0 * r1 - overlap - reach, 0.0, 0.0}, Vec3::Zero(), r1);
    } else {
      materials.wall = law;
      gravity = {0.0, 0.0, -law.k * overlap / m0};
      state.add(0, Kind::content, {0.0, 0.0, r0 + r1 - overlap}, {0.0, 0.0, kKick}, r0);
      state.add(1, Kind::wall, {0.0, 0.0, 0.0}, Vec3::Zero(), r1);
    }
  }

  /// Largest speed after `steps` over the one before; infinity after a failure.
  double growth(double step, Integrator integrator, std::int64_t steps) const {
    StepperSetup setup = tests::weightless(materials, step, integrator);
    setup.gravity = gravity;
    setup.stepping.events = false;
    const auto stepper = make_uniform_stepper(state, setup);
    try {
      stepper->advance(steps);
    } catch (const NumericsError&) {
      return std::numeric_limits<double>::infinity();
    }
    double speed = 0.0;
    const State end = stepper->state();
    for (const Vec3& v : end.velocity) speed = std::max(speed, v.norm());
    return speed / kKick;
  }
};

TEST(CriticalStep, IsWhereAPairBlowsUp) {
  for (const bool two : {false, true}) {
    for (const Integrator integrator : {Integrator::lagged, Integrator::predicted}) {
      for (const double ratio : kRatios) {
        const Pressed pressed(two, ratio);
        const double critical = critical_step_of_pair(pressed.law, pressed.inverse_mass, integrator);
        // Within 5 %: below nothing grows, beyond everything does. An undamped swing may look 1 / sqrt(1 - 0.95^2) = 3.2
        // times larger from step to step; the soft walls let the pair drift as a whole, slowly.
        EXPECT_LT(pressed.growth(0.95 * critical, integrator, 2000), 5.0) << two << name(integrator) << ratio;
        EXPECT_GT(pressed.growth(1.05 * critical, integrator, 2000), 1e3) << two << name(integrator) << ratio;
      }
    }
  }
}

TEST(CriticalStep, IsSafeForPece) {
  for (const double ratio : kRatios) {
    const Pressed pressed(true, ratio);
    const double critical = critical_step_of_pair(pressed.law, pressed.inverse_mass, Integrator::pece);
    for (const double part : {0.2, 0.5, 0.9, 0.99}) {
      EXPECT_LT(pressed.growth(part * critical, Integrator::pece, 2000), 15.0) << ratio << " " << part;
    }
  }
}

// ---- against the spectrum of whole packings ----

/// Touching balls on a jittered dense lattice or scattered at random, some of them fixed.
State packing(bool dense, bool walls, std::uint32_t seed) {
  Random random(seed);
  State state;
  const int n = 24;
  std::vector<Vec3> at;
  while (static_cast<int>(at.size()) < n) {
    if (dense) {
      const int k = static_cast<int>(at.size()), cell = k / 4;
      const Vec3 basis[] = {{0.0, 0.0, 0.0}, {0.5, 0.5, 0.0}, {0.5, 0.0, 0.5}, {0.0, 0.5, 0.5}};
      at.push_back(0.6 * (Vec3(cell % 2, cell / 2 % 2, cell / 4) + basis[k % 4]) + random.in_cube(0.004));
    } else {
      at.push_back(random.in_cube(0.6));
    }
  }
  for (int k = 0; k < n; ++k)
    state.add(k, walls && k % 3 == 2 ? Kind::wall : Kind::content, at[k], Vec3::Zero(), random.between(0.215, 0.225));
  return state;
}

struct System {
  Eigen::MatrixXd spring, dashpot;  // per mass
};

/// M^-1 K and M^-1 C of all content at once.
System system_of(const State& state, const Materials& materials) {
  std::vector<int> number(state.size(), -1);
  int n = 0;
  for (std::size_t i = 0; i < state.size(); ++i)
    if (state.kind[i] == Kind::content) number[i] = n++;
  System system{Eigen::MatrixXd::Zero(3 * n, 3 * n), Eigen::MatrixXd::Zero(3 * n, 3 * n)};
  for (std::size_t i = 0; i < state.size(); ++i) {
    for (std::size_t j = 0; j < state.size(); ++j) {
      if (i == j || number[i] < 0) continue;
      const Vec3 x = state.position[i] - state.position[j];
      if (x.norm() >= state.radius[i] + state.radius[j]) continue;
      const Eigen::Matrix3d nn = x.normalized() * x.normalized().transpose() / materials.mass(state.radius[i]);
      const PairLaw& law = materials.pair(state.kind[j]);
      system.spring.block<3, 3>(3 * number[i], 3 * number[i]) += law.k * nn;
      system.dashpot.block<3, 3>(3 * number[i], 3 * number[i]) += law.c * nn;
      if (number[j] < 0) continue;
      system.spring.block<3, 3>(3 * number[i], 3 * number[j]) -= law.k * nn;
      system.dashpot.block<3, 3>(3 * number[i], 3 * number[j]) -= law.c * nn;
    }
  }
  return system;
}

/// Spectral radius of one step's matrix for (x, h v, h^2 a), written from the schemes' definitions.
double spectral_radius(const System& s, double h, Integrator integrator) {
  const Eigen::Index n = s.spring.rows();
  const Eigen::MatrixXd one = Eigen::MatrixXd::Identity(n, n), k = h * h * s.spring, c = h * s.dashpot;
  Eigen::MatrixXd x(n, 3 * n), v(n, 3 * n), a(n, 3 * n);
  x << one, one, 0.5 * one;
  const double part = integrator == Integrator::lagged ? 0.5 : 1.0;
  Eigen::MatrixXd seen(n, 3 * n);  // the velocity that dashpots see
  seen << Eigen::MatrixXd::Zero(n, n), one, part * one;
  a = -k * x - c * seen;
  v << Eigen::MatrixXd::Zero(n, n), one, 0.5 * one;
  v += 0.5 * a;
  Eigen::MatrixXd step(3 * n, 3 * n);
  step << x, v, a;
  return step.eigenvalues().cwiseAbs().maxCoeff();
}

/// Largest stable step, to 2 %.
double stable_step(const System& s, Integrator integrator, double guess) {
  // A ball without contacts has a double eigenvalue of 1, which rounding splits by the root of 1e-16.
  const auto is_stable = [&](double h) { return spectral_radius(s, h, integrator) <= 1.0 + 1e-6; };
  double low = guess, high = guess;
  while (!is_stable(low)) low *= 0.9;
  while (is_stable(high)) high *= 1.1;
  while (high > 1.02 * low) {
    const double middle = 0.5 * (low + high);
    (is_stable(middle) ? low : high) = middle;
  }
  return low;
}

TEST(CriticalStep, IsNeitherUnsafeNorTwiceTooCautiousInAPacking) {
  for (const bool dense : {true, false}) {
    for (const bool walls : {true, false}) {
      for (const double c : {0.0, 1.0}) {
        const State state = packing(dense, walls, walls ? 1 : 2);
        Materials materials;
        materials.ball.c *= c;
        materials.wall = {1e8, 1e5 * c};
        const System system = system_of(state, materials);
        for (const Integrator integrator : {Integrator::lagged, Integrator::predicted}) {
          if (c == 0.0 && integrator == Integrator::lagged) continue;  // the same scheme
          const StepBounds bounds = critical_steps(state, materials, false, integrator);
          const double stable = stable_step(system, integrator, bounds.smallest);
          EXPECT_GE(1.02 * stable, bounds.smallest) << dense << walls << c;  // the bisection's 2 %
          EXPECT_LE(stable, 2.0 * bounds.smallest) << dense << walls << c;
        }
      }
    }
  }
}

TEST(CriticalStep, NamesItsBallAndTellsBulkFromWall) {
  // A chain: ball 5 on wall 9, ball 3 on ball 5, ball 2 alone, plug 11 over ball 3.
  Materials materials;
  State state;
  const double r = 0.22, d = 0.439;
  state.add(2, Kind::content, {5.0, 0.0, 0.0}, Vec3::Zero(), r);
  state.add(3, Kind::content, {0.0, 0.0, 2.0 * d}, Vec3::Zero(), r);
  state.add(5, Kind::content, {0.0, 0.0, d}, Vec3::Zero(), r);
  state.add(9, Kind::wall, {0.0, 0.0, 0.0}, Vec3::Zero(), r);
  state.add(11, Kind::plug, {0.0, 0.0, 3.0 * d}, Vec3::Zero(), r);
  const double per_mass = 1.0 / materials.mass(r);
  const auto chain = [&](bool wall) {  // one contact among balls, and one with a wall or none
    return critical_step_of_pair(
        {2.0 * materials.ball.k + (wall ? materials.wall.k : 0.0), 2.0 * materials.ball.c + (wall ? materials.wall.c : 0.0)},
        per_mass, Integrator::predicted);
  };
  const StepBounds open = critical_steps(state, materials, true, Integrator::predicted);
  ASSERT_EQ(open.per_ball.size(), 3u);
  EXPECT_TRUE(std::isinf(open.per_ball[0]));
  // All on one line: a single eigenvalue, in closed form; the search stops at 1e-9.
  EXPECT_NEAR(open.per_ball[1] / chain(false), 1.0, 1e-8);
  EXPECT_NEAR(open.per_ball[2] / chain(true), 1.0, 1e-8);
  EXPECT_EQ(open.at, 5);
  EXPECT_EQ(open.smallest, open.per_ball[2]);
  EXPECT_EQ(open.wall, open.per_ball[2]);
  EXPECT_EQ(open.bulk, open.per_ball[1]);
  const StepBounds closed = critical_steps(state, materials, false, Integrator::predicted);
  EXPECT_NEAR(closed.per_ball[1] / chain(true), 1.0, 1e-8);
  EXPECT_TRUE(std::isinf(closed.bulk));
}

TEST(CriticalStep, OfPerpendicularContactsIsThatOfEachAlone) {
  Materials materials;
  State state;
  const double d = 0.439;
  state.add(0, Kind::content, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.22);
  state.add(1, Kind::wall, {d, 0.0, 0.0}, Vec3::Zero(), 0.22);
  const double alone = critical_steps(state, materials, false, Integrator::lagged).smallest;
  state.add(2, Kind::wall, {0.0, d, 0.0}, Vec3::Zero(), 0.22);
  state.add(3, Kind::wall, {0.0, 0.0, d}, Vec3::Zero(), 0.22);
  EXPECT_NEAR(critical_steps(state, materials, false, Integrator::lagged).smallest / alone, 1.0, 1e-8);
  EXPECT_NEAR(alone / critical_step_of_pair(materials.wall, 1.0 / materials.mass(0.22), Integrator::lagged), 1.0, 1e-8);
}

TEST(CriticalStep, BeyondItARunEndsNamingBallStepAndWhatIsWrong) {
  const State start = tests::tray(6, 2, 1);
  for (const Integrator integrator : {Integrator::predicted, Integrator::lagged}) {
    const double critical = critical_step_of_pair(Materials{}.wall, 1.0 / Materials{}.mass(0.22), integrator);
    const double step = 3.0 * critical;
    StepperSetup setup = tests::weightless(Materials{}, step, integrator);
    setup.gravity = {0.0, 0.0, -9.81};
    const auto stepper = make_uniform_stepper(start, setup);
    const std::string message = tests::message_of<NumericsError>([&] { stepper->advance(10000); });
    EXPECT_NE(message.find("ball "), std::string::npos) << message;
    const bool names_force = message.find("against ") != std::string::npos && message.find(" N (limit") != std::string::npos;
    EXPECT_TRUE(names_force || message.find("more than half its radius") != std::string::npos) << message;
    EXPECT_NE(message.find(fmt::format("step {:.3g} s", step)), std::string::npos) << message;
    EXPECT_NE(message.find("use a smaller step"), std::string::npos) << message;
  }
}

}  // namespace
}  // namespace grainclock::core
