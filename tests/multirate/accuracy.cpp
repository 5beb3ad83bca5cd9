// Selective stepping of a small flow against fine uniform steps.
#include "multirate/stepper.hpp"

#include "tests/support/packing.hpp"

#include <gtest/gtest.h>

namespace grainclock::multirate {
namespace {

using core::Method;
using core::State;
using tests::silo_setup;

constexpr double kCoarsest = 3.2e-4;  // s, the bulk's stability bound
constexpr int kSteps = 100;           // a horizon of 0.032 s, on which trajectories can be compared

/// Position error of the balls above the outlet, rms over rms displacement.
double position_error(const State& start, const State& truth, const State& state) {
  double error = 0.0, displacement = 0.0;
  EXPECT_EQ(truth.id, state.id);
  for (std::size_t i = 0, s = 0; i < truth.size(); ++i) {
    while (start.id[s] < truth.id[i]) ++s;
    if (truth.kind[i] != core::Kind::content || truth.position[i].z() < 0.0) continue;
    error += (state.position[i] - truth.position[i]).squaredNorm();
    displacement += (truth.position[i] - start.position[s]).squaredNorm();
  }
  return std::sqrt(error / displacement);
}

struct Outcome {
  double error, energy_residual;
  core::Costs costs;
  core::LevelStatistics levels;
};

Outcome run(const State& truth, double tolerance, int levels, bool events = true) {
  core::StepperSetup setup = silo_setup(Method::multirate, kCoarsest, true);
  setup.stepping.tolerance = tolerance;
  setup.stepping.levels = levels;
  setup.stepping.events = events;
  const auto stepper = make_multirate_stepper(tests::flowing_silo(), setup);
  const core::Energies before = stepper->energies();
  stepper->advance(kSteps);
  EXPECT_LE(core::momentum_residual(before, stepper->energies(), stepper->ledger()), 1e-12);
  EXPECT_EQ(stepper->costs().missed_contacts, 0U);
  return {position_error(tests::flowing_silo(), truth, stepper->state()),
          core::energy_residual(before, stepper->energies(), stepper->ledger()), stepper->costs(),
          stepper->level_statistics()};
}

const State& truth() {
  static const State state = [] {
    constexpr int kFiner = 160;  // steps of 2e-6 s: an error of 5e-7, found by steps of 5e-7 s
    const auto fine =
        core::make_uniform_stepper(tests::flowing_silo(), silo_setup(Method::uniform, kCoarsest / kFiner, true));
    fine->advance(kSteps * kFiner);
    return fine->state();
  }();
  return state;
}

TEST(Accuracy, FollowsTheTolerance) {
  double last_error = 1.0, last_energy = 1.0;
  std::uint64_t last_cost = 0;
  for (const double tolerance : {1e-3, 1e-4, 1e-5}) {
    SCOPED_TRACE(testing::Message() << "tolerance " << tolerance);
    const Outcome its = run(truth(), tolerance, 8);
    EXPECT_LT(its.error, 10.0 * tolerance);  // statistics of one flow: measured 0.7, 1.8, 3.8 times
    EXPECT_LT(its.error, 0.5 * last_error);
    EXPECT_LT(its.energy_residual, 0.5 * last_energy);
    EXPECT_GT(its.costs.contact_evaluations, last_cost);
    last_error = its.error;
    last_energy = its.energy_residual;
    last_cost = its.costs.contact_evaluations;
  }
  EXPECT_LT(last_energy, 1e-4);
}

TEST(Accuracy, AtATightToleranceIsThatOfFineUniformSteps) {
  // The finest level, 6e-7 s, is finer than the reference, whose own error of 5e-7 is what remains.
  EXPECT_LT(run(truth(), 1e-6, 10).error, 2e-6);
}

TEST(Accuracy, TimesCostIsHalfThatOfUniformSteps) {
  // What the method is for. Uniform steps of 8e-5 s are at three quarters of their stability bound; measured: a fifth.
  const auto uniform = core::make_uniform_stepper(tests::flowing_silo(), silo_setup(Method::uniform, kCoarsest / 4.0, true));
  uniform->advance(4 * kSteps);
  const Outcome its = run(truth(), 1e-4, 8);
  const double uniform_error = position_error(tests::flowing_silo(), truth(), uniform->state());
  EXPECT_LT(its.error, uniform_error);
  EXPECT_LT(its.error * static_cast<double>(its.costs.contact_evaluations),
            0.5 * uniform_error * static_cast<double>(uniform->costs().contact_evaluations));
}

TEST(Accuracy, StatisticsCountEveryBallOncePerCoarseStep) {
  const Outcome its = run(truth(), 1e-4, 8);
  double balls = 0.0, updates = 0.0, contacts = 0.0;
  int populated = 0;
  for (std::size_t l = 0; l < 8; ++l) {
    EXPECT_EQ(its.levels.step[l], std::ldexp(kCoarsest, static_cast<int>(l) - 7));
    const double per_coarse_step = std::ldexp(1.0, 7 - static_cast<int>(l));
    balls += its.levels.balls[l];
    updates += its.levels.balls[l] * per_coarse_step;
    contacts += its.levels.contacts[l] * per_coarse_step;
    populated += its.levels.balls[l] > 0.0;
  }
  const double content = static_cast<double>(tests::flowing_silo().count(core::Kind::content));
  EXPECT_LE(balls, content);
  EXPECT_GT(balls, 0.98 * content);  // some leave
  EXPECT_GE(populated, 5);
  // Mean counts times steps are sums of integers, rounded once.
  EXPECT_NEAR(updates * kSteps, static_cast<double>(its.costs.ball_updates), 1e-6 * updates * kSteps);
  EXPECT_LT(contacts * kSteps, static_cast<double>(its.costs.contact_evaluations));  // renewals come on top
  EXPECT_GT(1.3 * contacts * kSteps, static_cast<double>(its.costs.contact_evaluations));
}

TEST(MissedContacts, AreNoneInSmallFlows) {
  for (const bool open : {false, true})
    for (const double step : {1e-4, 3.2e-4, 6.4e-4}) {
      SCOPED_TRACE(testing::Message() << (open ? "open" : "closed") << ", coarsest step " << step << " s");
      const auto stepper = make_multirate_stepper(open ? tests::flowing_silo() : tests::resting_silo(),
                                                  silo_setup(Method::multirate, step, open));
      stepper->advance(std::llround(0.4 / step));
      EXPECT_EQ(stepper->costs().missed_contacts, 0U);
      // The work that could have missed some: pairs are listed, but only a part of them is evaluated in a step.
      double evaluated = 0.0;
      for (const double contacts : stepper->level_statistics().contacts) evaluated += contacts;
      EXPECT_LT(evaluated, stepper->level_statistics().listed);
    }
}

}  // namespace
}  // namespace grainclock::multirate
