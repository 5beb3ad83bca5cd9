// The predicted gain against the one counted.
#include "multirate/cost_model.hpp"

#include "multirate/stepper.hpp"
#include "tests/support/packing.hpp"

#include <gtest/gtest.h>

#include <numeric>

namespace grainclock::multirate {
namespace {

constexpr double kCoarsest = 3.2e-4;  // s

struct Gains {
  double predicted, counted;
};

/// Both against uniform steps of the finest step that the prediction has in use, over `steps` coarse steps or, if none
/// are given, two regular renewals.
Gains gains(const core::State& start, bool open, double tolerance, int steps = 0) {
  core::StepperSetup setup = tests::silo_setup(core::Method::multirate, kCoarsest, open);
  setup.stepping.tolerance = tolerance;
  const Prediction prediction = predict(start, setup);
  const auto stepper = make_multirate_stepper(start, setup);
  if (steps == 0) steps = 2 * tests::renew_every(*stepper);
  const double uniform = stepper->level_statistics().listed * kCoarsest / prediction.step.front() * steps;
  stepper->advance(steps);
  return {prediction.gain, uniform / static_cast<double>(stepper->costs().contact_evaluations)};
}

TEST(CostModel, PredictsWhatIsCountedAtOnce) {
  for (const double tolerance : {1e-3, 1e-4, 1e-5})
    for (const bool open : {false, true}) {
      SCOPED_TRACE(testing::Message() << (open ? "flowing" : "closed") << ", tolerance " << tolerance);
      const Gains its = gains(open ? tests::flowing_silo() : tests::resting_silo(), open, tolerance);
      EXPECT_NEAR(its.predicted / its.counted, 1.0, 0.15);
    }
}

TEST(CostModel, PredictsARunWithinAFactorOfTwo) {
  // Levels change as the flow goes on: one state against many.
  for (const double tolerance : {1e-3, 1e-4, 1e-5})
    for (const bool open : {false, true}) {
      SCOPED_TRACE(testing::Message() << (open ? "flowing" : "closed") << ", tolerance " << tolerance);
      const Gains its = gains(open ? tests::flowing_silo() : tests::resting_silo(), open, tolerance, 100);
      EXPECT_LT(its.predicted / its.counted, 2.0);  // measured 0.9 to 1.6
      EXPECT_GT(its.predicted / its.counted, 0.5);
    }
}

TEST(CostModel, CountsEveryBallAndWeighsContactsByTheirSteps) {
  core::StepperSetup setup = tests::silo_setup(core::Method::multirate, kCoarsest, true);
  const Prediction its = predict(tests::flowing_silo(), setup);
  ASSERT_EQ(its.balls.size(), its.step.size());
  ASSERT_EQ(its.contacts.size(), its.step.size());
  ASSERT_GE(its.step.size(), 3U);
  EXPECT_EQ(std::accumulate(its.balls.begin(), its.balls.end(), std::int64_t{0}),
            static_cast<std::int64_t>(tests::flowing_silo().count(core::Kind::content)));
  EXPECT_GT(its.balls.front(), 0);
  EXPECT_EQ(its.step.back(), kCoarsest);
  double contacts = 0.0, weighted = 0.0;
  for (std::size_t l = 0; l < its.step.size(); ++l) {
    EXPECT_EQ(its.step[l], std::ldexp(its.step[0], static_cast<int>(l)));
    contacts += static_cast<double>(its.contacts[l]);
    weighted += static_cast<double>(its.contacts[l]) * its.step[0] / its.step[l];
  }
  EXPECT_DOUBLE_EQ(its.ideal_gain, contacts / weighted);
  EXPECT_GT(its.ideal_gain, 2.0);
}

TEST(CostModel, OneLevelGainsWhatItSkipsAndPaysForRenewals) {
  core::StepperSetup setup = tests::silo_setup(core::Method::multirate, 1e-4, true);
  setup.stepping.levels = 1;
  const Prediction its = predict(tests::flowing_silo(), setup);
  EXPECT_EQ(its.ideal_gain, 1.0);
  EXPECT_GT(its.gain, 1.1);
  const auto stepper = make_multirate_stepper(tests::flowing_silo(), setup);
  const double listed = stepper->level_statistics().listed;
  const int interval = tests::renew_every(*stepper);
  stepper->advance(interval);
  // A single regular renewal: the prediction is the count itself, but for sums in floating point.
  EXPECT_NEAR(its.gain, listed * interval / static_cast<double>(stepper->costs().contact_evaluations), 1e-12);
}

}  // namespace
}  // namespace grainclock::multirate
