// Two balls, and a ball on a wall ball, against closed forms.
#include "tests/support/balls.hpp"
#include "tests/support/closed_forms.hpp"

#include <gtest/gtest.h>

#include <ostream>
#include <string>

namespace grainclock::core {
namespace {

using tests::approach;
using tests::FreeCollision;

constexpr double kStiffness = 1e7;                  // N/m
constexpr double kRadius0 = 0.19, kRadius1 = 0.26;  // m, masses differ by a factor of 2.6
constexpr double kSpeed = 0.7;                      // m/s
constexpr double kStep = 0.01;                      // in units of sqrt(m / k)

struct Case {
  std::string name;
  Integrator integrator;
  bool tension;
  double damping_ratio;
  Kind other;
};
void PrintTo(const Case& tested, std::ostream* out) { *out << tested.name; }

/// Every combination of scheme, ending, damping and partner.
std::vector<Case> cases() {
  std::vector<Case> all;
  for (const Integrator integrator : {Integrator::predicted, Integrator::pece, Integrator::lagged})
    for (const bool tension : {false, true})
      for (const double ratio : {0.0, 0.02, 0.3, 0.6, 0.95, 1.5, 5.0})
        for (const Kind other : {Kind::content, Kind::wall}) {
          std::string name = std::string(core::name(integrator)) + (tension ? "_tension_" : "_clamp_") +
                             std::to_string(static_cast<int>(100.0 * ratio + 0.5)) + "_" + std::string(core::name(other));
          all.push_back({name, integrator, tension, ratio, other});
        }
  return all;
}

/// A collision about to happen: the balls touch 2.3 steps after the start.
struct Setting {
  Materials materials;
  FreeCollision collision;
  double step, touch;
  State start;
  std::unique_ptr<Stepper> stepper;

  explicit Setting(const Case& tested) {
    const double m = tests::effective_mass(materials, kRadius0, kRadius1, tested.other);
    PairLaw& law = tested.other == Kind::content ? materials.ball : materials.wall;
    law = {kStiffness, tests::dashpot(kStiffness, m, tested.damping_ratio)};
    materials.tension = tested.tension;
    collision = {law, m, tested.tension, kSpeed};
    step = kStep * std::sqrt(m / kStiffness);
    touch = 2.3 * step;
    start = tests::two_balls(materials, kRadius0, kRadius1, kSpeed * touch, kSpeed, tested.other);
    stepper = make_uniform_stepper(start, tests::weightless(materials, step, tested.integrator));
  }
};

/// Error allowed, relative to the depth of an undamped collision and to the speed of approach. Without event
/// correction (pece, lagged) a step may misjudge the impulse of the dashpot's jump by h c v / 2, and lagged dashpots are
/// of first order: C w h times twice the damping ratio. Otherwise C (w h)^2, with the powers that strong damping adds.
double allowed(const Case& tested) {
  const double z = tested.damping_ratio, second = kStep * kStep * (1.0 + 4.0 * z * z);
  return tested.integrator == Integrator::predicted ? second : second + 2.0 * z * kStep;
}

class CollisionOf : public testing::TestWithParam<Case> {};

TEST_P(CollisionOf, FollowsTheDampedOscillator) {
  Setting s(GetParam());
  const double contact = std::min(s.collision.duration(), 10.0 * s.step / kStep);
  const auto steps = static_cast<std::int64_t>((s.touch + 1.2 * contact) / s.step);
  double worst = 0.0;
  for (std::int64_t n = 1; n <= steps; ++n) {
    s.stepper->advance(1);
    const Approach found = approach(s.stepper->state());
    const Approach exact = s.collision.at(static_cast<double>(n) * s.step - s.touch);
    worst = std::max({worst, std::abs(found.overlap - exact.overlap) / s.collision.depth()});
    worst = std::max({worst, std::abs(found.rate - exact.rate) / kSpeed});
  }
  EXPECT_LT(worst, 0.8 * allowed(GetParam()));
}

TEST_P(CollisionOf, PartsWithTheRestitutionOfTheClosedForm) {
  Setting s(GetParam());
  const double duration = s.collision.duration();
  if (!std::isfinite(duration)) {  // tension and strong damping: they creep apart for ever
    s.stepper->advance(5000);
    EXPECT_GT(approach(s.stepper->state()).overlap, 0.0);
    return;
  }
  // Clamped contacts part while they still overlap: on until the spring is slack and its energy booked.
  const Approach end_of_force = s.collision.at(duration);
  const double parting = duration + std::max(0.0, -end_of_force.overlap / end_of_force.rate);
  s.stepper->advance(static_cast<std::int64_t>((s.touch + parting) / s.step) + 3);
  const double e = restitution(s.collision.law, s.collision.m_eff, s.collision.tension);
  const State end = s.stepper->state();
  double worst = 0.0;
  for (const std::size_t ball : {0U, 1U}) {
    worst = std::max(worst, (end.velocity[ball] + e * s.start.velocity[ball]).norm() / kSpeed);
  }
  EXPECT_LT(worst, 0.25 * allowed(GetParam()));
  // What the dashpot took: (1 - e^2) of the relative kinetic energy.
  const double energy = 0.5 * s.collision.m_eff * kSpeed * kSpeed;
  EXPECT_NEAR(s.stepper->ledger().dissipated / energy, 1.0 - e * e, allowed(GetParam()));
}

INSTANTIATE_TEST_SUITE_P(All, CollisionOf, testing::ValuesIn(cases()), [](const auto& tested) { return tested.param.name; });

TEST(Collision, MovesNothingButAlongTheNormal) {
  // Seen from a moving frame, with the balls flying past each other.
  const Case tested{"", Integrator::predicted, false, 0.3, Kind::content};
  Setting s(tested);
  const Vec3 drift(3.0, -1.0, 2.0), across = Vec3(2.0, -1.0, 0.0) / std::sqrt(5.0);  // across oblique()
  s.start.velocity[0] += drift + 1e-3 * across;
  s.start.velocity[1] += drift - 1e-3 * across;
  s.stepper = make_uniform_stepper(s.start, tests::weightless(s.materials, s.step));
  s.stepper->advance(600);
  const State end = s.stepper->state();
  const double e = restitution(s.collision.law, s.collision.m_eff, false);
  for (const std::size_t ball : {0U, 1U}) {
    const Vec3 before = s.start.velocity[ball] - drift, after = end.velocity[ball] - drift;
    // While they touch, the normal turns by 2 mm/s * 5 ms / 0.45 m = 2e-5 and takes as much of the speed along.
    EXPECT_NEAR(after.dot(across), before.dot(across), 5e-5 * kSpeed);
    EXPECT_NEAR(after.dot(tests::oblique()), -e * before.dot(tests::oblique()), 1e-4 * kSpeed);  // (w h)^2
  }
}

// ---- cohesion ----

/// Two balls whose approach carries `speed`; the pull is 2e4 N at most, within 2 mm, and takes 20 J to overcome.
struct Cohesive {
  static constexpr double kPull = 2e4, kReach = kPull / kStiffness, kWork = 0.5 * kPull * kReach;
  Materials materials;
  double m_eff, step;
  State start;
  std::unique_ptr<Stepper> stepper;

  Cohesive(double speed, Kind other, bool tension) {
    m_eff = tests::effective_mass(materials, kRadius0, kRadius1, other);
    materials.ball = materials.wall = {kStiffness, 0.0};
    materials.cohesion = kPull;
    materials.tension = tension;
    step = kStep * std::sqrt(m_eff / kStiffness);
    start = tests::two_balls(materials, kRadius0, kRadius1, 1.5 * kReach, speed, other);
    stepper = make_uniform_stepper(start, tests::weightless(materials, step));
  }
};

class Cohesion : public testing::TestWithParam<std::tuple<Kind, bool>> {};

TEST_P(Cohesion, PullsOnlyPartingBallsWithinReach) {
  Cohesive s(2.0, std::get<0>(GetParam()), std::get<1>(GetParam()));
  int pulled = 0, approached = 0;
  for (int n = 0; n < 900; ++n) {
    s.stepper->advance(1);
    const Approach now = approach(s.stepper->state());
    const std::vector<Contact> contacts = s.stepper->contacts();
    const double force = contacts.empty() ? 0.0 : contacts[0].force.dot(-tests::oblique());  // pushes ball 0 back
    if (now.overlap > 0.0) continue;
    if (now.rate < 0.0 && now.overlap >= -Cohesive::kReach) {
      EXPECT_NEAR(force, kStiffness * now.overlap, 1e-9 * Cohesive::kPull);  // rounding of the direction
      ++pulled;
    } else {
      EXPECT_EQ(force, 0.0);
      approached += now.rate > 0.0 ? 1 : 0;
    }
    if (now.rate > 0.0) {
      EXPECT_EQ(s.stepper->state().velocity[0], s.start.velocity[0]) << "an approach is free";
    }
  }
  EXPECT_GT(pulled, 50);
  EXPECT_GT(approached, 50);
  EXPECT_LT(approach(s.stepper->state()).overlap, -Cohesive::kReach);
}

TEST_P(Cohesion, TakesItsWorkFromPartingBalls) {
  const double speed = 2.0;
  Cohesive s(speed, std::get<0>(GetParam()), std::get<1>(GetParam()));
  s.stepper->advance(900);
  const Approach end = approach(s.stepper->state());
  ASSERT_LT(end.overlap, -Cohesive::kReach);
  // (w h)^2 = 1e-4 of the speed and of the energy.
  EXPECT_NEAR(-end.rate, std::sqrt(speed * speed - 2.0 * Cohesive::kWork / s.m_eff), 1e-4 * speed);
  EXPECT_NEAR(s.stepper->ledger().dissipated, Cohesive::kWork, 1e-4 * Cohesive::kWork);
}

TEST_P(Cohesion, HoldsBallsThatAreTooSlow) {
  const double speed = 0.5;  // 3 to 5 J
  Cohesive s(speed, std::get<0>(GetParam()), std::get<1>(GetParam()));
  const double energy = 0.5 * s.m_eff * speed * speed;
  double widest = 0.0;
  s.stepper->advance(600);  // in touch
  for (int n = 0; n < 3000; ++n) {
    s.stepper->advance(1);
    widest = std::max(widest, -approach(s.stepper->state()).overlap);
  }
  // They part until the pull has taken everything: k gap^2 / 2 = E. C w h: at the turn the force switches off.
  EXPECT_NEAR(widest, std::sqrt(2.0 * energy / kStiffness), 0.02 * widest);
  EXPECT_LE(s.stepper->ledger().dissipated, energy * (1.0 + 1e-3));
}

INSTANTIATE_TEST_SUITE_P(All, Cohesion, testing::Combine(testing::Values(Kind::content, Kind::wall), testing::Bool()));

}  // namespace
}  // namespace grainclock::core
