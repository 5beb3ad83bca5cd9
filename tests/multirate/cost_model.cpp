// What selective steps should cost, against sums by hand and against what is counted.
#include "multirate/cost_model.hpp"

#include "core/snapshot.hpp"
#include "multirate/stepper.hpp"
#include "silo/phases.hpp"
#include "tests/support/packing.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace grainclock::multirate {
namespace {

constexpr double kCoarsest = 3.2e-4;  // s

/// 40 contacts at half the coarsest step and 200 at the coarsest; the finest level is empty.
core::LevelStatistics two_levels() {
  core::LevelStatistics levels;
  levels.step = {2e-5, 4e-5, 8e-5};
  levels.balls = {0.0, 10.0, 30.0};
  levels.contacts = {0.0, 40.0, 200.0};
  levels.listed = 300.0;
  levels.renewals = 0.5;
  return levels;
}

TEST(CostModel, EvaluationsByHand) {
  // Two of 40, one of 200; at every other step those of the 60 other listed pairs and of a fifth of all contacts.
  EXPECT_DOUBLE_EQ(evaluations(two_levels()), 2.0 * 40.0 + 200.0 + 0.5 * (60.0 + 0.2 * 240.0));
}

TEST(CostModel, GainsByHand) {
  const Prediction its = price(two_levels(), {2e-5, 250.0});  // four uniform steps per coarsest step
  ASSERT_EQ(its.step, (std::vector<double>{4e-5, 8e-5}));     // the empty level is left out
  EXPECT_EQ(its.balls, (std::vector<std::int64_t>{10, 30}));
  EXPECT_EQ(its.contacts, (std::vector<std::int64_t>{40, 200}));
  EXPECT_DOUBLE_EQ(its.ideal_gain, 240.0 * 2.0 / 280.0);
  EXPECT_DOUBLE_EQ(its.gain, 4.0 * 250.0 / 334.0);
  // Prices as in cost_model.hpp: three sweeps over levels, half a renewal of 300 pairs and 40 balls.
  const double selective = 2.3 * 280.0 + 1.2 * 50.0 + 10.0 * 3.0 + 0.5 * (5.5 * 300.0 + 12.0 * 40.0 + 1600.0);
  EXPECT_DOUBLE_EQ(its.wall_gain, 4.0 * (250.0 + 1.2 * 40.0 + 15.0) / selective);
  EXPECT_FALSE(pays(its));
  EXPECT_TRUE(pays(price(two_levels(), {2.5e-6, 250.0})));
}

TEST(CostModel, FewBallsHardlyPayAndManyDo) {
  // The same histogram a thousand times over: sweeps and renewals cost nothing by comparison.
  const auto scaled = [](double by) {
    core::LevelStatistics levels = two_levels();
    for (auto* counts : {&levels.balls, &levels.contacts}) {
      for (double& count : *counts) count *= by;
    }
    levels.listed *= by;
    return price(levels, {5e-6, 250.0 * by});
  };
  EXPECT_FALSE(pays(scaled(0.1)));
  EXPECT_TRUE(pays(scaled(1000.0)));
  EXPECT_EQ(scaled(0.1).gain, scaled(1.0).gain);
}

/// A start and what its selective stepper is made from.
struct Case {
  std::string name;
  core::State start;
  core::StepperSetup setup;
};

Case silo_case(bool open, double tolerance) {
  Case its{open ? "flowing" : "closed", open ? tests::flowing_silo() : tests::resting_silo(),
           tests::silo_setup(core::Method::multirate, kCoarsest, open)};
  its.setup.stepping.tolerance = tolerance;
  return its;
}

/// The state after some uniform steps, as a start.
core::State later(const core::State& state, core::StepperSetup setup, double step, int steps) {
  setup.stepping.method = core::Method::uniform;
  setup.stepping.step = step;
  const auto stepper = core::make_uniform_stepper(state, setup);
  stepper->advance(steps);
  return tests::fresh(stepper->state());
}

/// Balls of equal weight that all fly about and collide.
Case gas(double tolerance) {
  constexpr int kAcross = 7;
  constexpr double kSpacing = 0.47, kRadius = 0.22, kSpeed = 2.0;  // m, m, m/s
  Case its{"gas", {}, {}};
  std::mt19937 random(1);
  const auto uniform = [&] { return static_cast<double>(random()) / 4294967296.0 - 0.5; };
  for (int site = 0; site < kAcross * kAcross * kAcross; ++site) {
    const core::Vec3 at(site % kAcross, site / kAcross % kAcross, site / kAcross / kAcross);
    its.start.add(site, core::Kind::content, kSpacing * at, kSpeed * core::Vec3(uniform(), uniform(), uniform()), kRadius);
  }
  its.setup.gravity = core::Vec3::Zero();
  its.setup.stepping.step = kCoarsest;
  its.setup.stepping.tolerance = tolerance;
  its.start = later(its.start, its.setup, 1e-4, 200);
  return its;
}

/// The closed silo with balls of an eighth of the size and some speed in its pores.
Case fines(double tolerance) {
  constexpr double kRadius = 0.22 / 8.0;  // m
  constexpr core::BallId kFirst = 1000000;
  Case its = silo_case(false, tolerance);
  its.name = "fines";
  const core::State packing = its.start;
  core::BallId id = kFirst;
  for (double z = 1.0; z < 3.0; z += 0.3) {
    for (double x = -0.8; x < 0.9; x += 0.2) {
      const core::Vec3 at(x, 0.1, z);
      bool is_free = true;
      for (std::size_t i = 0; i < packing.size(); ++i) {
        is_free = is_free && (packing.position[i] - at).norm() > packing.radius[i] + 1.1 * kRadius;
      }
      if (is_free) its.start.add(id++, core::Kind::content, at, core::Vec3(0.3, 0.2, -0.5), kRadius);
    }
  }
  EXPECT_GE(id - kFirst, 5);
  its.setup.materials.ball.c = its.setup.materials.wall.c = 1e3;
  its.setup.stepping.step = kCoarsest;
  its.setup.stepping.levels = 12;
  its.start = later(its.start, its.setup, 2e-5, 2000);
  return its;
}

/// A small scene of the studies, from the start of its only phase.
Case study(const std::string& name, double tolerance) {
  const std::string path = std::string(GRAINCLOCK_SOURCE) + "/benchmarks/scenes/" + name;
  const core::Scene scene = core::read_scene(path + ".toml");
  core::Phase phase = scene.phases.front();
  phase.stepping.tolerance = tolerance;
  Case its{name, core::read_state(path + ".csv"), {}};
  its.setup = silo::phase_setup(scene, phase, its.start, 1);
  return its;
}

/// Predicted over counted evaluations of `steps` coarsest steps.
struct Ratio {
  double at_start;   // as predicted from the start state
  double levels;     // as priced from the run's own mean levels
};

Ratio ratio(const Case& its, int steps) {
  const Prediction prediction = predict(its.start, its.setup);
  core::StepperSetup uniform = its.setup;
  uniform.stepping.method = core::Method::uniform;
  uniform.stepping.step = prediction.uniform_step;
  const auto selective = make_stepper(its.start, its.setup), other = make_stepper(its.start, uniform);
  selective->advance(steps);
  const auto uniform_steps = std::lround(steps * selective->step() / other->step());
  other->advance(uniform_steps);
  const double counted = static_cast<double>(selective->costs().contact_evaluations);
  const double gain = static_cast<double>(other->costs().contact_evaluations) / counted;
  return {prediction.gain / gain, evaluations(selective->level_statistics()) * steps / counted};
}

TEST(CostModel, PricesTheLevelsOfARunAsCounted) {
  for (const double tolerance : {1e-3, 1e-4}) {
    for (const Case& its : {study("pair", tolerance), study("chain", tolerance), study("pile", tolerance),
                            silo_case(false, tolerance), silo_case(true, tolerance), fines(tolerance)}) {
      SCOPED_TRACE(testing::Message() << its.name << ", tolerance " << tolerance);
      EXPECT_NEAR(ratio(its, 60).levels, 1.0, 0.1);  // the share of contacts that change level is a mean over scenes
    }
  }
}

TEST(CostModel, PredictsTheGainOfASteadyScene) {
  for (const double tolerance : {1e-3, 1e-4}) {
    for (const Case& its : {silo_case(false, tolerance), fines(tolerance)}) {
      SCOPED_TRACE(testing::Message() << its.name << ", tolerance " << tolerance);
      EXPECT_NEAR(ratio(its, 60).at_start, 1.0, 0.1);  // the same sources, and what moves meanwhile
    }
    // A handful of fast balls at the outlet makes up much of so small a flow's cost: statistics of a few tens.
    EXPECT_NEAR(ratio(silo_case(true, tolerance), 60).at_start, 1.0, 0.25);
  }
}

TEST(CostModel, SaysThatSelectiveStepsLoseOnAGas) {
  // Equal balls at equal speeds: clocks say half the speed of uniform steps, benchmarks/gas.toml.
  const Case its = gas(1e-4);
  EXPECT_FALSE(pays(predict(its.start, its.setup)));
}

TEST(CostModel, SamePredictionEachTime) {
  const Case its = silo_case(true, 1e-4);
  EXPECT_EQ(predict(its.start, its.setup).wall_gain, predict(its.start, its.setup).wall_gain);
}

TEST(CostModel, EquallyAccurateStepFollowsTheTolerance) {
  // Errors go with the square of the step; the search is good to the fourth root of two on either side.
  const Case loose = gas(1e-3), tight = gas(1e-5);
  const double ratio = equally_accurate_step(loose.start, loose.setup) / equally_accurate_step(tight.start, tight.setup);
  EXPECT_GT(ratio, 10.0 / 1.2);
  EXPECT_LT(ratio, 10.0 * 1.2);
  // A state in which nothing moves takes the coarsest step.
  core::State still;
  still.add(0, core::Kind::content, core::Vec3::Zero(), core::Vec3::Zero(), 0.22);
  EXPECT_EQ(equally_accurate_step(still, gas(1e-4).setup), kCoarsest);
}

}  // namespace
}  // namespace grainclock::multirate
