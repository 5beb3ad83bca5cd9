// Momentum, accumulators included, is exact to rounding: a property of any set of balls, levels and level changes.
#include "multirate/stepper.hpp"

#include "tests/support/silo_runs.hpp"

#include <gtest/gtest.h>

#include <set>

namespace grainclock::multirate {
namespace {

using core::Kind;
using core::State;
using core::Vec3;

/// A cloud of balls of all sizes that falls together around some fixed ones, speeds over three decades.
State random_cloud(tests::Random& random) {
  const double smallest = random.between(0.05, 0.2), largest = smallest * random.between(1.0, 3.0);
  const double spacing = 0.85 * (smallest + largest);
  const Vec3 centre = spacing * Vec3(1.5, 1.5, 1.5);
  State state;
  core::BallId id = 0;
  for (int x = 0; x < 4; ++x)
    for (int y = 0; y < 4; ++y)
      for (int z = 0; z < 4; ++z) {
        const Vec3 at = spacing * Vec3(x, y, z) + random.in_cube(0.15 * spacing);
        double r = random.between(smallest, largest);
        for (std::size_t i = 0; i < state.size(); ++i)  // overlaps of at most a hundredth
          r = std::min(r, 1.01 * (at - state.position[i]).norm() - state.radius[i]);
        if (r < 0.5 * smallest) continue;
        const bool fixed = random.below(8) == 0;
        const double speed = std::pow(10.0, random.between(-3.0, 0.7));
        const Vec3 v = speed * random.direction() - random.between(0.0, 0.5) * (at - centre) / spacing;
        state.add(id++, fixed ? Kind::wall : Kind::content, at, fixed ? Vec3(0.0, 0.0, 0.0) : v, r);
      }
  return state;
}

std::uint8_t level_of(const State& state, core::BallId ball) {
  return state.level[static_cast<std::size_t>(std::lower_bound(state.id.begin(), state.id.end(), ball) - state.id.begin())];
}

struct Terms {
  bool events, tension, cohesion;
};

class MomentumOf : public testing::TestWithParam<Terms> {};

TEST_P(MomentumOf, RandomCloudsIsExactToRounding) {
  constexpr int kClouds = 20;
  const Terms terms = GetParam();
  tests::Random random(11);
  double worst = 0.0;
  std::size_t most_levels = 0;
  int changes = 0, ahead_of_renewal = 0, mixed = 0;  // mixed: contacts between levels, summed over the steps
  for (int cloud = 0; cloud < kClouds; ++cloud) {
    SCOPED_TRACE(testing::Message() << "cloud " << cloud);
    const State start = random_cloud(random);
    core::StepperSetup setup;
    setup.gravity = random.between(0.0, 20.0) * random.direction();
    setup.materials.density = std::pow(10.0, random.between(2.5, 4.0));
    setup.materials.ball = {1e6, random.between(0.0, 1e3)};
    setup.materials.wall = {std::pow(10.0, random.between(6.0, 8.0)), random.between(0.0, 1e3)};
    setup.materials.tension = terms.tension;
    setup.materials.cohesion = terms.cohesion ? 500.0 : 0.0;
    setup.stepping.events = terms.events;
    setup.stepping.tolerance = std::pow(10.0, random.between(-5.0, -4.0));
    setup.stepping.levels = 4 + static_cast<int>(random.below(6));
    setup.stepping.limiter = 1 + static_cast<int>(random.below(3));
    setup.stepping.step = random.between(2e-4, 8e-4);
    const auto stepper = make_multirate_stepper(start, setup);
    const core::Energies before = stepper->energies();

    std::set<std::uint8_t> populated;
    std::vector<std::uint8_t> last = stepper->state().level;
    for (int step = 0; step < 40; ++step) {
      stepper->advance(1);
      // Rounding: of each velocity at each of its kicks, 1e-16 of m v, against impulses of the same size.
      const double residual = core::momentum_residual(before, stepper->energies(), stepper->ledger());
      EXPECT_LE(residual, 1e-12) << "after coarse step " << step;
      worst = std::max(worst, residual);
      ahead_of_renewal += !stepper->is_checkpointable();
      const State now = stepper->state();
      for (std::size_t i = 0; i < now.size(); ++i) {
        if (now.kind[i] != Kind::content) continue;
        populated.insert(now.level[i]);
        changes += now.level[i] != last[i];
      }
      last = now.level;
      for (const core::Contact& c : stepper->contacts())
        mixed += c.other == Kind::content && level_of(now, c.i) != level_of(now, c.j);
    }
    most_levels = std::max(most_levels, populated.size());
    EXPECT_GT(stepper->ledger().wall_impulse.norm(), 0.0);
    EXPECT_EQ(stepper->costs().events > 0, terms.events);
  }
  // The clouds test what they are meant to test.
  EXPECT_GE(most_levels, 5U);
  EXPECT_GE(changes, 100 * kClouds);
  EXPECT_GE(ahead_of_renewal, kClouds);
  EXPECT_GE(mixed, 100 * kClouds);
  RecordProperty("changes", changes);
  RecordProperty("ahead_of_renewal", ahead_of_renewal);
  RecordProperty("mixed", mixed);
  RecordProperty("worst_residual", std::to_string(worst));
}

INSTANTIATE_TEST_SUITE_P(AllTerms, MomentumOf,
                         testing::Values(Terms{false, false, false}, Terms{true, false, false}, Terms{false, true, false},
                                         Terms{true, true, false}, Terms{false, false, true}, Terms{true, false, true},
                                         Terms{true, true, true}),
                         [](const testing::TestParamInfo<Terms>& its) {
                           return std::string(its.param.events ? "Events" : "NoEvents") +
                                  (its.param.tension ? "Tension" : "") + (its.param.cohesion ? "Cohesion" : "");
                         });

TEST(Momentum, OfAFlowingSiloIsExactWhileBallsLeave) {
  for (const bool events : {false, true}) {
    core::StepperSetup setup = tests::silo_setup(core::Method::multirate, 3.2e-4, true);
    setup.stepping.events = events;
    const auto stepper = make_multirate_stepper(tests::flowing_silo(), setup);
    tests::expect_exact_momentum(*stepper, 300);
  }
}

TEST(Momentum, OfTwoBallsAloneDoesNotChange) {
  // One pair without gravity or walls: what one ball gets the other pays, in whole units of force.
  State state;
  state.add(0, Kind::content, Vec3(0.0, 0.0, 0.0), Vec3(3.0, 0.1, 0.0), 0.1);
  state.add(1, Kind::content, Vec3(0.3, 0.02, 0.0), Vec3(-1.0, 0.0, 0.2), 0.2);
  core::StepperSetup setup;
  setup.gravity = Vec3::Zero();
  setup.stepping.step = 3e-4;
  const auto stepper = make_multirate_stepper(state, setup);
  const Vec3 before = stepper->energies().momentum;
  const double size = stepper->energies().kinetic;
  stepper->advance(200);
  EXPECT_LT(stepper->energies().kinetic, 0.9 * size);  // they have met
  // Two roundings of velocity per kick, some hundred kicks: 1e-14 of the momentum.
  EXPECT_LE((stepper->energies().momentum - before).norm(), 1e-13 * before.norm());
}

}  // namespace
}  // namespace grainclock::multirate
