// What single contacts and closed chains do is known exactly: every scheme against that, with every kind of branch change.
#include "benchmarks/reference.hpp"

#include "tests/support/closed_forms.hpp"
#include "tests/support/order.hpp"
#include "tests/support/reference_runs.hpp"

#include <gtest/gtest.h>
#include <Eigen/Eigenvalues>

namespace grainclock::benchmarks {
namespace {

using core::Approach;
using core::Kind;
using core::Materials;
using core::State;
using core::StepperSetup;
using tests::expect_changes;
using tests::judged;
using tests::time_of;

/// What a scheme is asked for, and the global error relative to the motion's own scale that it then has.
struct Reach {
  double rtol, error;
};
/// A few hundred steps, each with an error up to rtol: 100 rtol. BDF and the diagonally implicit scheme, of order 5 at most,
/// err to one side and need a smaller rtol. What limits mristep is its fixed slow step h: (h w)^3 for contacts of frequency
/// w among content.
Reach reach_of(Scheme scheme) {
  switch (scheme) {
    case Scheme::cvode_bdf:
    case Scheme::arkstep_implicit:
      return {1e-13, 1e-10};
    case Scheme::mristep:
      return {1e-12, 1e-9};
    default:
      return {1e-12, 1e-10};
  }
}

StepperSetup setup_of(const Materials& materials, const core::Vec3& gravity = core::Vec3::Zero()) {
  StepperSetup setup = tests::weightless(materials, 1e-3);
  setup.gravity = gravity;
  return setup;
}

class ReferenceClosedForm : public testing::TestWithParam<Scheme> {
 protected:
  /// Slow step of mristep at which its error of order 3 is below what the test allows, where contacts with content are slow.
  static constexpr double kSlow = 2e-6;

  ReferenceRun run(const State& start, const StepperSetup& setup, double seconds) const {
    return judged(GetParam(), reach_of(GetParam()).rtol, start, setup, seconds, kSlow);
  }
  /// Allowed error in units of the motion's scale.
  double share() const { return reach_of(GetParam()).error; }
};
INSTANTIATE_TEST_SUITE_P(Schemes, ReferenceClosedForm, testing::ValuesIn(tests::kSchemes), tests::test_name);

TEST_P(ReferenceClosedForm, DampedCollisions) {
  const double speed = 1.0, gap = 0.01, after = 0.002;
  for (const Kind other : {Kind::content, Kind::wall}) {
    for (const bool tension : {false, true}) {
      SCOPED_TRACE(testing::Message() << (other == Kind::wall ? "wall" : "unequal balls") << ", tension " << tension);
      Materials materials;
      materials.tension = tension;
      const State start = tests::two_balls(materials, 0.22, 0.15, gap, speed, other);
      const tests::FreeCollision collision{materials.pair(other), tests::effective_mass(materials, 0.22, 0.15, other),
                                           tension, speed};
      const double duration = collision.duration();
      const Approach end = collision.at(duration);
      const double flight = tension ? 0.0 : -end.overlap / end.rate;  // clamped, the balls part freely

      const ReferenceRun run = this->run(start, setup_of(materials), gap / speed + duration + flight + after);

      BranchChanges expected;
      expected.touched = expected.lost = 1;
      expected.clamped = tension ? 0 : 1;
      expect_changes(run, expected);
      // In units of the collision: the speed it began with, its depth and the way flown since, its duration.
      const double share = this->share();
      EXPECT_NEAR(time_of(run, ChangeKind::touched), gap / speed, share * duration);
      if (!tension) {
        EXPECT_NEAR(time_of(run, ChangeKind::clamped), gap / speed + duration, share * duration);
      }
      EXPECT_NEAR(time_of(run, ChangeKind::lost), gap / speed + duration + flight, share * duration);
      const Approach left = tests::approach(run.end);
      EXPECT_NEAR(left.rate, end.rate, share * speed);
      EXPECT_NEAR(left.overlap, (flight + after) * end.rate + end.overlap, share * (collision.depth() + after * speed));
      // The centre of mass of free balls stays at rest; the wall does.
      const double m0 = materials.mass(0.22), m1 = materials.mass(0.15);
      if (other == Kind::content) {
        EXPECT_NEAR((m0 * run.end.velocity[0] + m1 * run.end.velocity[1]).norm(), 0.0, share * m1 * speed);
      } else {
        EXPECT_EQ(run.end.velocity[1], core::Vec3::Zero());
      }
    }
  }
}

TEST_P(ReferenceClosedForm, ClampAndItsEndUnderLoad) {
  // Pressed into the floor by gravity and moving up fast, the contact is clamped; gravity ends that before it is lost.
  Materials materials;
  materials.wall = {1e7, 2e5};
  const double g = 9.81, m = materials.mass(0.22), ratio = materials.wall.c / materials.wall.k;
  const Approach start{ratio * 0.29, -0.28};  // the clamp comes at a rate between 1 and 2 times -ratio g: -0.196
  const auto pull = [&](const Approach& at) { return at.overlap + ratio * at.rate; };
  double low = 0.0, high = 1e-3;
  while (high - low > 1e-18) {  // halves until the sum no longer moves
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    (pull(tests::oscillator(materials.wall, m, m * g, start, middle)) > 0.0 ? low : high) = middle;
  }
  const double clamped = low;
  const Approach at_clamp = tests::oscillator(materials.wall, m, m * g, start, clamped);
  const double freely = 2.0 * (-at_clamp.rate / g - ratio);
  const Approach at_end{at_clamp.overlap + freely * (at_clamp.rate + 0.5 * g * freely), at_clamp.rate + g * freely};
  const double after = 0.003;
  const Approach expected = tests::oscillator(materials.wall, m, m * g, at_end, after);

  const ReferenceRun run = this->run(tests::ball_on_floor(-start.overlap, -start.rate), setup_of(materials, {0.0, 0.0, -g}),
                                     clamped + freely + after);

  expect_changes(run, {.clamped = 1, .unclamped = 1});
  const double share = this->share();
  EXPECT_NEAR(time_of(run, ChangeKind::clamped), clamped, share * freely);
  EXPECT_NEAR(time_of(run, ChangeKind::unclamped), clamped + freely, share * freely);
  const Approach end = tests::approach(run.end);
  EXPECT_NEAR(end.overlap, expected.overlap, share * start.overlap);
  EXPECT_NEAR(end.rate, expected.rate, share * std::abs(start.rate));
}

TEST_P(ReferenceClosedForm, CohesionPullsUntilItsReachEnds) {
  Materials materials;
  materials.wall = {1e6, 0.0};
  materials.cohesion = 2e3;
  const double reach = materials.cohesion / materials.wall.k, m = materials.mass(0.22), speed = 0.5, gap = 0.01;
  const double w = std::sqrt(materials.wall.k / m);
  // In at `speed`, half a period of the spring, then the pull's arc from zero to the reach.
  const double in = (gap - reach) / speed, touched = gap / speed, lost = touched + std::numbers::pi / w;
  const double out = lost + std::asin(reach * w / speed) / w, after = 0.001;
  const double last = std::sqrt(speed * speed - w * w * reach * reach);

  const ReferenceRun run = this->run(tests::ball_on_floor(gap, -speed), setup_of(materials), out + after);

  expect_changes(run, {.touched = 1, .lost = 1, .out_of_reach = 1, .into_reach = 1});
  const double share = this->share();
  EXPECT_NEAR(time_of(run, ChangeKind::into_reach), in, share / w);
  EXPECT_NEAR(time_of(run, ChangeKind::touched), touched, share / w);
  EXPECT_NEAR(time_of(run, ChangeKind::lost), lost, share / w);
  EXPECT_NEAR(time_of(run, ChangeKind::out_of_reach), out, share / w);
  const Approach end = tests::approach(run.end);
  EXPECT_NEAR(end.rate, -last, share * speed);
  EXPECT_NEAR(end.overlap, -reach - last * after, share * speed / w);
}

TEST_P(ReferenceClosedForm, CohesionStopsABallThatIsTooSlowToLeave) {
  Materials materials;
  materials.wall = {1e6, 0.0};
  materials.cohesion = 5e3;
  const double w = std::sqrt(materials.wall.k / materials.mass(0.22)), speed = 0.3;
  ASSERT_LT(speed / w, materials.reach());

  const ReferenceRun run = this->run(tests::ball_on_floor(0.001, speed), setup_of(materials), 0.01);

  // It starts within the reach, moving out: the arc of the pull from -1 mm on, to rest, where it stays.
  expect_changes(run, {.nearing = 1});
  const double farthest = std::hypot(0.001, speed / w), share = this->share();
  EXPECT_NEAR(time_of(run, ChangeKind::nearing), std::atan2(speed / w, 0.001) / w, share / w);
  EXPECT_NEAR(tests::approach(run.end).overlap, -farthest, share * farthest);
  EXPECT_NEAR(tests::approach(run.end).rate, 0.0, share * speed);
}

TEST_P(ReferenceClosedForm, CohesionTooWeakForTheLoad) {
  // Thrown up below a fixed ball the ball enters the reach, turns before it touches, and is pulled while it falls out.
  Materials materials;
  materials.wall = {1e5, 0.0};
  materials.cohesion = 300.0;  // less than the weight
  const double g = 9.81, m = materials.mass(0.22), reach = materials.reach(), height = 0.4 * reach;
  ASSERT_LT(materials.cohesion, m * g);
  const double gap = reach + 0.002, top = gap - height, speed = std::sqrt(2.0 * g * top);
  const double turn = speed / g, in = (speed - std::sqrt(2.0 * g * (reach - height))) / g;
  // From rest at d = -height: m d'' = -m g - k d, an arc about d = -m g / k.
  const double w = std::sqrt(materials.wall.k / m), rest = m * g / materials.wall.k;
  const double leaves = std::acos((rest - reach) / (rest - height)) / w;
  const double last = w * (rest - height) * std::sin(w * leaves), after = 0.001;

  const ReferenceRun run =
      this->run(tests::ball_under_ceiling(gap, speed), setup_of(materials, {0.0, 0.0, -g}), turn + leaves + after);

  expect_changes(run, {.out_of_reach = 1, .into_reach = 1, .parting = 1});
  const double share = this->share();
  EXPECT_NEAR(time_of(run, ChangeKind::into_reach), in, share * turn);
  EXPECT_NEAR(time_of(run, ChangeKind::parting), turn, share * turn);
  EXPECT_NEAR(time_of(run, ChangeKind::out_of_reach), turn + leaves, share * turn);
  EXPECT_NEAR(tests::approach(run.end).rate, -last - g * after, share * speed);
}

TEST_P(ReferenceClosedForm, ClosedChain) {
  // Balls pressed together between two fixed ones: a chain of springs whose normal modes are known.
  Materials materials;
  materials.ball = materials.wall = {1e7, 0.0};
  const double radius[] = {0.2, 0.15, 0.22, 0.18}, pressed = 0.02, end_radius = 0.2;
  constexpr int kBalls = 4;
  State start;
  double x = 0.0, before = end_radius;
  Eigen::Vector4d mass, u0, v0;
  for (int ball = 0; ball < kBalls; ++ball) {
    x += before + radius[ball] - pressed;
    before = radius[ball];
    mass[ball] = materials.mass(radius[ball]);
    u0[ball] = 4e-3 * (ball == 1 ? 1.0 : -0.5);
    v0[ball] = 2.0 * (ball % 2 == 0 ? 1.0 : -1.0);
    start.add(ball, Kind::content, {x + u0[ball], 0.0, 0.0}, {v0[ball], 0.0, 0.0}, radius[ball]);
  }
  start.add(kBalls, Kind::wall, {0.0, 0.0, 0.0}, core::Vec3::Zero(), end_radius);
  start.add(kBalls + 1, Kind::wall, {x + before + end_radius - pressed, 0.0, 0.0}, core::Vec3::Zero(), end_radius);
  Eigen::Matrix4d stiffness = Eigen::Matrix4d::Zero();
  for (int ball = 0; ball < kBalls; ++ball) {
    stiffness(ball, ball) = 2.0 * materials.ball.k;
    if (ball > 0) stiffness(ball, ball - 1) = stiffness(ball - 1, ball) = -materials.ball.k;
  }
  const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix4d> modes(stiffness, Eigen::Matrix4d(mass.asDiagonal()));
  const Eigen::Matrix4d shape = modes.eigenvectors();
  const Eigen::Vector4d q0 = shape.transpose() * mass.cwiseProduct(u0), p0 = shape.transpose() * mass.cwiseProduct(v0);
  const double seconds = 0.006;  // more than a period of the fastest mode
  Eigen::Vector4d q, p;
  for (int mode = 0; mode < kBalls; ++mode) {
    const double w = std::sqrt(modes.eigenvalues()[mode]), c = std::cos(w * seconds), s = std::sin(w * seconds);
    q[mode] = q0[mode] * c + p0[mode] / w * s;
    p[mode] = p0[mode] * c - q0[mode] * w * s;
  }
  const Eigen::Vector4d u = shape * q, v = shape * p;

  const ReferenceRun run = this->run(start, setup_of(materials), seconds);

  expect_changes(run, {});
  const double length = u0.lpNorm<Eigen::Infinity>(), speed = v0.lpNorm<Eigen::Infinity>(),
               w = std::sqrt(modes.eigenvalues()[kBalls - 1]);
  for (int ball = 0; ball < kBalls; ++ball) {
    EXPECT_NEAR(run.end.position[ball].x() - start.position[ball].x() + u0[ball], u[ball], share() * (length + speed / w));
    EXPECT_NEAR(run.end.velocity[ball].x(), v[ball], share() * (speed + w * length));
  }
}

}  // namespace
}  // namespace grainclock::benchmarks
