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

TEST(CostModel, GainsByHand) {
  // 334 evaluations per coarsest step; four uniform steps of 250.
  const Prediction its = price(two_levels(), {48, 334.0}, {2e-5, {100, 250.0}});
  ASSERT_EQ(its.step, (std::vector<double>{4e-5, 8e-5}));  // the empty level is left out
  EXPECT_EQ(its.balls, (std::vector<std::int64_t>{10, 30}));
  EXPECT_EQ(its.contacts, (std::vector<std::int64_t>{40, 200}));
  EXPECT_EQ(its.tried, 48);
  EXPECT_DOUBLE_EQ(its.ideal_gain, 240.0 * 2.0 / 280.0);
  EXPECT_DOUBLE_EQ(its.gain, 4.0 * 250.0 / 334.0);
  // Prices as in cost_model.hpp: three sweeps over levels, half a renewal of 300 pairs and 40 balls.
  const double selective = 2.1 * 280.0 + 1.1 * 50.0 + 10.0 * 3.0 + 0.5 * (4.4 * 300.0 + 9.6 * 40.0 + 1600.0);
  EXPECT_DOUBLE_EQ(its.wall_gain, 4.0 * (250.0 + 1.2 * 40.0 + 15.0) / selective);
  EXPECT_FALSE(pays(its));
  EXPECT_TRUE(pays(price(two_levels(), {48, 334.0}, {2.5e-6, {100, 250.0}})));
}

TEST(CostModel, FewBallsHardlyPayAndManyDo) {
  // The same histogram a thousand times over: sweeps and renewals cost nothing by comparison.
  const auto scaled = [](double by) {
    core::LevelStatistics levels = two_levels();
    for (auto* counts : {&levels.balls, &levels.contacts}) {
      for (double& count : *counts) count *= by;
    }
    levels.listed *= by;
    return price(levels, {48, 334.0 * by}, {5e-6, {100, 250.0 * by}});
  };
  EXPECT_FALSE(pays(scaled(0.1)));
  EXPECT_TRUE(pays(scaled(1000.0)));
  EXPECT_DOUBLE_EQ(scaled(0.1).gain, scaled(1.0).gain);
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
  its.start = later(its.start, its.setup, 2e-5, 6000);
  return its;
}

/// A stream of soft balls that jostle each other upon one stiff body.
Case inclusion(double tolerance) {
  constexpr int kAcross = 7;
  constexpr double kSpacing = 0.46, kRadius = 0.22, kJostle = 0.3;  // m, m, m/s
  Case its{"inclusion", {}, {}};
  std::mt19937 random(1);
  const auto uniform = [&] { return static_cast<double>(random()) / 4294967296.0 - 0.5; };
  for (int site = 0; site < kAcross * kAcross * kAcross; ++site) {
    const core::Vec3 at(site % kAcross, site / kAcross % kAcross, site / kAcross / kAcross);
    const core::Vec3 v = core::Vec3::UnitX() + kJostle * core::Vec3(uniform(), uniform(), uniform());
    its.start.add(site, core::Kind::content, kSpacing * at, v, kRadius);
  }
  its.start.add(1000, core::Kind::wall, core::Vec3(3.7, 3.0 * kSpacing, 3.0 * kSpacing), core::Vec3::Zero(), 3.0 * kRadius);
  its.setup.gravity = core::Vec3::Zero();
  its.setup.materials.ball = {1e6, 6e3};
  its.setup.stepping.step = 2.9e-3;
  its.setup.stepping.tolerance = tolerance;
  its.start = later(its.start, its.setup, 1e-4, 2000);
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

/// Contact evaluations of a stepper's next steps.
double counted(core::Stepper& stepper, std::int64_t steps) {
  const std::uint64_t before = stepper.costs().contact_evaluations;
  stepper.advance(steps);
  return static_cast<double>(stepper.costs().contact_evaluations - before);
}

/// The gain that is counted over so many coarsest steps, against uniform ones of `uniform_step` [s].
double counted_gain(const Case& its, std::int64_t steps, double uniform_step) {
  core::StepperSetup uniform = its.setup;
  uniform.stepping.method = core::Method::uniform;
  uniform.stepping.step = uniform_step;
  const auto selective = make_stepper(its.start, its.setup), other = make_stepper(its.start, uniform);
  const auto as_long = std::llround(static_cast<double>(steps) * selective->step() / uniform_step);
  return counted(*other, as_long) / counted(*selective, steps);
}

TEST(CostModel, PredictsWhatItsTrialCounts) {
  for (const double tolerance : {1e-3, 1e-4}) {
    for (const Case& its : {study("pair", tolerance), study("chain", tolerance), study("pile", tolerance), gas(tolerance),
                            silo_case(false, tolerance), silo_case(true, tolerance), fines(tolerance), inclusion(tolerance)}) {
      SCOPED_TRACE(testing::Message() << its.name << ", tolerance " << tolerance);
      const Prediction prediction = predict(its.start, its.setup);
      EXPECT_GE(prediction.tried, 24);
      const double gain = counted_gain(its, prediction.tried, prediction.uniform_step);
      // The same counts; the uniform trial ends within half of one of its steps.
      const double rounding = 0.5 * prediction.uniform_step / (static_cast<double>(prediction.tried) * *its.setup.stepping.step);
      EXPECT_NEAR(prediction.gain / gain, 1.0, rounding + 1e-12);
    }
  }
}

TEST(CostModel, PredictsTheGainOfASteadyScene) {
  constexpr std::int64_t kTrials = 3;  // two thirds of what is counted come after the trial
  for (const double tolerance : {1e-3, 1e-4}) {
    for (const Case& its : {silo_case(false, tolerance), silo_case(true, tolerance), fines(tolerance), inclusion(tolerance)}) {
      SCOPED_TRACE(testing::Message() << its.name << ", tolerance " << tolerance);
      const Prediction prediction = predict(its.start, its.setup);
      const double gain = counted_gain(its, kTrials * prediction.tried, prediction.uniform_step);
      EXPECT_NEAR(prediction.gain / gain, 1.0, 0.1);  // statistics of few early renewals and new lists, and what moves meanwhile
      RecordProperty(its.name + std::to_string(tolerance), std::to_string(prediction.gain / gain));
    }
  }
}

TEST(CostModel, CannotForeseeWhatIsStillToHappen) {
  // The balls of the pile are in the air: the trial knows nothing of their landing, and says nearly three times too much.
  const Case pile = study("pile", 1e-4);
  const Prediction prediction = predict(pile.start, pile.setup);
  EXPECT_GT(prediction.gain, 2.0 * counted_gain(pile, 3 * prediction.tried, prediction.uniform_step));
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
  // Errors go with the square of the step.
  const Case loose = gas(1e-3), tight = gas(1e-5);
  const double ratio = equally_accurate_step(loose.start, loose.setup) / equally_accurate_step(tight.start, tight.setup);
  EXPECT_NEAR(ratio, 10.0, 1e-12);  // rounding
  // It is where the ladder runs out.
  core::StepperSetup setup = loose.setup;
  const auto levels = [&] { return make_multirate_stepper(loose.start, setup)->level_statistics(); };
  const double of_finest = levels().step.front() / levels().common_step;
  for (const double by : {1.001, 0.999}) {
    setup.stepping.tolerance = by * of_finest * of_finest * loose.setup.stepping.tolerance;
    EXPECT_EQ(levels().ran_out, by < 1.0);
  }
  // A state in which nothing moves takes the coarsest step.
  core::State still;
  still.add(0, core::Kind::content, core::Vec3::Zero(), core::Vec3::Zero(), 0.22);
  EXPECT_EQ(equally_accurate_step(still, gas(1e-4).setup), kCoarsest);
}

}  // namespace
}  // namespace grainclock::multirate
