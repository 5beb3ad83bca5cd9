// Order of the schemes, measured from both sides.
#include "tests/support/balls.hpp"
#include "tests/support/closed_forms.hpp"
#include "tests/support/order.hpp"
#include "tests/support/runge_kutta.hpp"

#include <gtest/gtest.h>

#include <ostream>
#include <string>

namespace grainclock::core {
namespace {

using tests::approach;
using tests::dashpot;
using tests::fitted_order;
using tests::FreeCollision;
using tests::Rms;

constexpr double kStiffness = 1e7;                 // N/m
constexpr double kRadius0 = 0.2, kRadius1 = 0.25;  // m, masses differ by a factor of two

/// Order of error(steps) when 1 / steps is the step.
template <class Error>
double order_of(Error error, std::initializer_list<int> steps) {
  std::vector<double> step, its_error;
  for (const int n : steps) {
    step.push_back(1.0 / n);
    its_error.push_back(error(n));
  }
  return fitted_order(step, its_error);
}

// ---- contacts that stay closed ----

struct Swing {
  std::string name;
  Integrator integrator;
  double damping_ratio;
  double order;
};
void PrintTo(const Swing& swing, std::ostream* out) { *out << swing.name; }

/// A ball that swings about its rest on a wall ball, never losing touch: error at the end of the
/// run, over position and velocity, relative to the overlap at rest.
double swing_error(const Swing& swing, int steps) {
  Materials materials;
  const double m = materials.mass(kRadius0);
  materials.wall = {kStiffness, dashpot(kStiffness, m, swing.damping_ratio)};
  const double w = std::sqrt(kStiffness / m), horizon = 10.0 / w, pull = 1e3;  // m/s2, along oblique()
  const double rest = m * pull / kStiffness;
  const Approach start{1.2 * rest, 0.1 * rest * w};
  StepperSetup setup = tests::weightless(materials, horizon / steps, swing.integrator);
  setup.gravity = pull * tests::oblique();
  const auto stepper =
      make_uniform_stepper(tests::two_balls(materials, kRadius0, kRadius1, -start.overlap, start.rate, Kind::wall), setup);
  stepper->advance(steps);
  const Approach found = approach(stepper->state());
  const Approach exact = tests::oscillator(materials.wall, m, m * pull, start, horizon);
  return std::hypot(found.overlap - exact.overlap, (found.rate - exact.rate) / w) / rest;
}

class ClosedContact : public testing::TestWithParam<Swing> {};

TEST_P(ClosedContact, ConvergesWithTheSchemesOrder) {
  const Swing& swing = GetParam();
  // The next term of the error is smaller by w h (1 + damping ratio) <= 0.15: it may bend the slope by about as much.
  EXPECT_NEAR(order_of([&](int steps) { return swing_error(swing, steps); }, {200, 400, 800, 1600}), swing.order, 0.1);
}

INSTANTIATE_TEST_SUITE_P(
    Swing, ClosedContact,
    testing::Values(Swing{"Predicted", Integrator::predicted, 0.1, 2.0},
                    Swing{"PredictedStrong", Integrator::predicted, 2.0, 2.0},
                    Swing{"PredictedUndamped", Integrator::predicted, 0.0, 2.0}, Swing{"Pece", Integrator::pece, 0.1, 2.0},
                    Swing{"PeceStrong", Integrator::pece, 2.0, 2.0}, Swing{"PeceUndamped", Integrator::pece, 0.0, 2.0},
                    Swing{"Lagged", Integrator::lagged, 0.1, 1.0}, Swing{"LaggedStrong", Integrator::lagged, 2.0, 1.0},
                    Swing{"LaggedUndamped", Integrator::lagged, 0.0, 2.0}),
    [](const auto& tested) { return tested.param.name; });

TEST(ClosedContact, FollowsTheSchemesRecurrence) {
  // The schemes as they are defined, on one number: a ball on a wall ball, F = k d + c d'.
  Materials materials;
  const double m = materials.mass(kRadius0), k = kStiffness, c = dashpot(k, m, 0.5), pull = 1e3, h = 2e-4;  // w h = 0.1
  materials.wall = {k, c};
  materials.tension = true;
  const double rest = m * pull / k;
  for (const Integrator integrator : {Integrator::predicted, Integrator::pece, Integrator::lagged}) {
    StepperSetup setup = tests::weightless(materials, h, integrator);
    setup.gravity = pull * tests::oblique();
    const auto stepper =
        make_uniform_stepper(tests::two_balls(materials, kRadius0, kRadius1, -1.5 * rest, 0.0, Kind::wall), setup);
    double d = 1.5 * rest, v = 0.0;
    const auto force = [&](double overlap, double rate) { return pull - (k * overlap + c * rate) / m; };
    double a = force(d, v);
    for (int n = 0; n < 50; ++n) {
      stepper->advance(1);
      if (integrator == Integrator::lagged) {
        const double half = v + 0.5 * h * a;
        d += h * half;
        a = force(d, half);
        v = half + 0.5 * h * a;
      } else {
        d += h * v + 0.5 * h * h * a;
        const double end = force(d, v + h * a);
        v += 0.5 * h * (a + end);
        a = integrator == Integrator::pece ? force(d, v) : end;
      }
      const Approach found = approach(stepper->state());
      EXPECT_NEAR(found.overlap, d, 1e-14);  // rounding of positions, 50 times
      EXPECT_NEAR(found.rate, v, 1e-11);     // and w^2 h of that
    }
  }
}

/// Four unequal balls in a dense bowl, pressed together in three dimensions: all contacts stay closed.
struct Bowl {
  Materials materials;
  Vec3 gravity{300.0, -200.0, -3000.0};
  State state;
  Bowl() {
    materials.ball = {1e6, 4e3};
    materials.wall = {2e6, 6e3};
    materials.tension = true;  // parting contacts would be clamped
    state.add(0, Kind::content, {0.0, 0.0, 0.0}, {0.02, -0.01, 0.01}, 0.20);
    state.add(1, Kind::content, {0.36, 0.02, 0.05}, {-0.02, 0.01, 0.01}, 0.23);
    state.add(2, Kind::content, {0.2, 0.37, 0.03}, {0.01, 0.01, -0.02}, 0.21);
    state.add(3, Kind::content, {0.2, 0.12, 0.37}, {0.0, 0.02, 0.02}, 0.25);
    BallId id = 4;
    for (const Vec3& x : {Vec3(-0.26, -0.15, -0.2), Vec3(0.65, -0.2, -0.2), Vec3(0.2, 0.72, -0.2), Vec3(0.22, 0.12, -0.3),
                          Vec3(0.2, -0.33, 0.0), Vec3(-0.16, 0.33, -0.05), Vec3(0.57, 0.38, -0.05)})
      state.add(id++, Kind::wall, x, Vec3::Zero(), 0.22);
  }
};

double largest_difference(const State& a, const State& b) {
  double most = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) most = std::max(most, (a.position[i] - b.position[i]).norm());
  return most;
}

TEST(ClosedCluster, ConvergesToRungeKuttaWithOrderTwo) {
  const Bowl bowl;
  const double horizon = 0.006;
  const State exact = tests::runge_kutta(bowl.state, bowl.materials, bowl.gravity, horizon, 4000);  // error below 1e-13 m
  for (const Integrator integrator : {Integrator::predicted, Integrator::pece, Integrator::lagged}) {
    std::size_t contacts = 0;
    const auto error = [&](int steps) {
      StepperSetup setup = tests::weightless(bowl.materials, horizon / steps, integrator);
      setup.gravity = bowl.gravity;
      const auto stepper = make_uniform_stepper(bowl.state, setup);
      contacts = stepper->contacts().size();
      stepper->advance(steps);
      EXPECT_EQ(stepper->contacts().size(), contacts) << "the bowl is meant to keep its contacts";
      EXPECT_EQ(stepper->costs().events, 0u);
      return largest_difference(stepper->state(), exact);
    };
    const double order = order_of(error, {100, 200, 400, 800});
    // w h <= 0.05 at the largest step, see above.
    EXPECT_NEAR(order, integrator == Integrator::lagged ? 1.0 : 2.0, 0.1) << name(integrator);
  }
}

// ---- across events ----

struct Impact {
  std::string name;
  bool tension;
  double damping_ratio;
  Kind other;
};
void PrintTo(const Impact& impact, std::ostream* out) { *out << impact.name; }

/// Relative error after a free collision of `steps` steps, rms over phases of the impact within a step.
double impact_error(const Impact& impact, Integrator integrator, bool events, int steps) {
  constexpr int kPhases = 48;
  Materials materials;
  const double m = tests::effective_mass(materials, kRadius0, kRadius1, impact.other);
  PairLaw& law = impact.other == Kind::content ? materials.ball : materials.wall;
  law = {kStiffness, dashpot(kStiffness, m, impact.damping_ratio)};
  materials.tension = impact.tension;
  const FreeCollision collision{law, m, impact.tension, 1.0};
  // The contact opens at another phase than it closed, so that the two errors do not cancel.
  const double step = collision.duration() / (steps + 0.4);
  StepperSetup setup = tests::weightless(materials, step, integrator);
  setup.stepping.events = events;
  const std::int64_t n = 3 * steps / 2;
  Rms error;
  for (int phase = 0; phase < kPhases; ++phase) {
    const double touch = (1.0 + (phase + 0.5) / kPhases) * step;
    const auto stepper = make_uniform_stepper(
        tests::two_balls(materials, kRadius0, kRadius1, collision.speed * touch, collision.speed, impact.other), setup);
    stepper->advance(n);
    const Approach found = approach(stepper->state());
    const Approach exact = collision.at(static_cast<double>(n) * step - touch);
    error.add(std::hypot((found.overlap - exact.overlap) / collision.depth(), (found.rate - exact.rate) / collision.speed));
  }
  return error.value();
}

double impact_order(const Impact& impact, Integrator integrator, bool events) {
  return order_of([&](int steps) { return impact_error(impact, integrator, events, steps); }, {40, 80, 160, 320});
}

class AcrossEvents : public testing::TestWithParam<Impact> {};

// The order is 2 with the correction and 1 without: the force jumps by c times the rate as a contact closes. rms
// over 48 phases of four steps leaves the slope uncertain by some hundredths where all events are alike.
TEST_P(AcrossEvents, CorrectedQuadratureIsOfSecondOrder) {
  const double order = impact_order(GetParam(), Integrator::predicted, true);
  EXPECT_GT(order, 1.85);
  EXPECT_LT(order, 2.15);
}

TEST_P(AcrossEvents, WithoutCorrectionFirstOrderIsLeft) {
  for (const Integrator integrator : {Integrator::predicted, Integrator::pece, Integrator::lagged}) {
    const double order = impact_order(GetParam(), integrator, false);
    EXPECT_GT(order, 0.85) << name(integrator);
    EXPECT_LT(order, 1.15) << name(integrator);
  }
}

TEST_P(AcrossEvents, CorrectionLowersTheErrorAtAUsualStep) {
  // 40 steps per collision; measured 2.1 to 7 times. A factor of 1.5 is well beyond what a phase could do to the rms.
  const double with = impact_error(GetParam(), Integrator::predicted, true, 40);
  const double without = impact_error(GetParam(), Integrator::predicted, false, 40);
  EXPECT_LT(1.5 * with, without);
}

INSTANTIATE_TEST_SUITE_P(Impact, AcrossEvents,
                         testing::Values(Impact{"ClampedBalls", false, 0.6, Kind::content},
                                         Impact{"ClampedBallsLightlyDamped", false, 0.1, Kind::content},
                                         Impact{"ClampedBallsOverdamped", false, 1.5, Kind::content},
                                         Impact{"ClampedWall", false, 0.4, Kind::wall},
                                         Impact{"TensionBalls", true, 0.6, Kind::content},
                                         Impact{"TensionWall", true, 0.4, Kind::wall}),
                         [](const auto& tested) { return tested.param.name; });

TEST(AcrossEvents, UndampedImpactIsOfSecondOrderEitherWay) {
  // Without a dashpot the force has no jump, only a kink.
  const Impact impact{"", false, 0.0, Kind::content};
  for (const bool events : {false, true})
    EXPECT_NEAR(impact_order(impact, Integrator::predicted, events), 2.0, 0.1) << events;
}

}  // namespace
}  // namespace grainclock::core
