// With one level, selective stepping is the uniform stepper bit for bit, classification and limiter running.
#include "multirate/stepper.hpp"

#include "tests/support/packing.hpp"

#include <gtest/gtest.h>

#include <functional>

namespace grainclock::multirate {
namespace {

using core::Method;
using tests::silo_setup;

constexpr double kStep = 1e-4;  // half the stability bound of the wall

struct Runs {
  std::unique_ptr<core::Stepper> uniform, one_level;
};

Runs runs(const core::State& start, bool open, const std::function<void(core::StepperSetup&)>& change) {
  core::StepperSetup uniform = silo_setup(Method::uniform, kStep, open), one = silo_setup(Method::multirate, kStep, open);
  one.stepping.levels = 1;
  one.stepping.tolerance = 1e-5;  // most pairs would like finer steps
  change(uniform);
  change(one);
  return {core::make_uniform_stepper(start, uniform), make_multirate_stepper(start, one)};
}

/// Goes on with both and expects the same bits after each piece, of so many steps.
void expect_equal_runs(const Runs& both, int pieces, int steps) {
  for (int k = 0; k < pieces && !testing::Test::HasFailure(); ++k) {
    both.uniform->advance(steps);
    both.one_level->advance(steps);
    SCOPED_TRACE(testing::Message() << "after " << both.uniform->steps_done() << " steps");
    tests::expect_same_bits(both.uniform->state(), both.one_level->state());
  }
}

/// The runs do what could tear them apart: lists are rebuilt, contacts open and close, balls leave.
void expect_busy(const Runs& both, bool balls_leave) {
  for (const core::Stepper* stepper : {both.uniform.get(), both.one_level.get()}) {
    EXPECT_GT(stepper->costs().list_builds, 3U);
    EXPECT_GT(stepper->contacts().size(), 100U);
    EXPECT_EQ(stepper->ledger().discharged > 5, balls_leave);
  }
}

TEST(OneLevel, FlowingSiloEqualsUniformBitwise) {
  const Runs both = runs(tests::flowing_silo(), true, [](core::StepperSetup&) {});
  const core::Costs &a = both.uniform->costs(), &b = both.one_level->costs();
  expect_equal_runs(both, 60, 37);  // ends between renewals, too
  expect_busy(both, true);
  EXPECT_EQ(both.one_level->costs().missed_contacts, 0U);
  EXPECT_GT(both.uniform->costs().events, a.events + 100);
  EXPECT_EQ(both.uniform->costs().events - a.events, both.one_level->costs().events - b.events);
}

TEST(OneLevel, WithoutEventsEqualsUniformBitwise) {
  const Runs both = runs(tests::flowing_silo(), true, [](core::StepperSetup& setup) { setup.stepping.events = false; });
  expect_equal_runs(both, 50, 41);
  expect_busy(both, true);
  EXPECT_EQ(both.one_level->costs().events, 0U);
}

TEST(OneLevel, EqualsUniformBitwiseWithEveryTermOfTheLaw) {
  for (const bool tension : {false, true})
    for (const double cohesion : {0.0, 2e4})
      for (const bool events : {false, true}) {
        SCOPED_TRACE(testing::Message() << "tension " << tension << ", cohesion " << cohesion << ", events " << events);
        const Runs both = runs(tests::flowing_silo(), true, [&](core::StepperSetup& setup) {
          setup.materials.tension = tension;
          setup.materials.cohesion = cohesion;
          setup.stepping.events = events;
        });
        expect_equal_runs(both, 15, 21);
        EXPECT_EQ(both.one_level->costs().missed_contacts, 0U);
      }
}

TEST(OneLevel, ColumnAtRestEqualsUniformBitwise) {
  const Runs both = runs(tests::resting_silo(), false, [](core::StepperSetup&) {});
  expect_equal_runs(both, 20, 50);
  EXPECT_EQ(both.one_level->costs().missed_contacts, 0U);
}

TEST(OneLevel, BooksTheSameLedger) {
  const Runs both = runs(tests::flowing_silo(), true, [](core::StepperSetup&) {});
  both.uniform->advance(800);
  both.one_level->advance(800);
  const core::Ledger &a = both.uniform->ledger(), &b = both.one_level->ledger();
  // The same integers, summed in other groups: roundings of 800 sums.
  constexpr double kRounding = 1e-12;
  EXPECT_NEAR(a.dissipated, b.dissipated, kRounding * a.dissipated);
  EXPECT_NEAR(a.turned_over, b.turned_over, kRounding * a.turned_over);
  EXPECT_NEAR(a.total_impulse, b.total_impulse, kRounding * a.total_impulse);
  EXPECT_LE((a.wall_impulse - b.wall_impulse).norm(), kRounding * a.total_impulse);
  EXPECT_EQ(a.gravity_impulse, b.gravity_impulse);
  EXPECT_EQ(a.discharged, b.discharged);
  EXPECT_EQ(a.removed_momentum, b.removed_momentum);
  EXPECT_GT(a.discharged, 0);
}

}  // namespace
}  // namespace grainclock::multirate
