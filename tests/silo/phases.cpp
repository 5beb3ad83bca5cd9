#include "silo/phases.hpp"

#include "core/check.hpp"
#include "core/critical_step.hpp"
#include "multirate/cost_model.hpp"
#include "silo/check.hpp"
#include "silo/checkpoint.hpp"
#include "tests/support/scratch.hpp"

namespace grainclock::silo {
namespace {

using core::Phase;
using core::StepperSetup;
using core::Until;

constexpr double kGravity = 10.0, kStep = 0.01;  // m/s2, s
constexpr MeanBall kMean{0.5, 2.0};              // m g r = 10 J, so rest is below 1e-5 J per ball
constexpr double kCalm = 0.9e-5, kMoving = 1.1e-5;
constexpr double kCreeping = 4.9e-2, kFlowing = 5.1e-2;  // around 5e-3 m g r

/// A phase of 100 balls that is checked each step.
class PhaseEnd : public ::testing::Test {
 protected:
  PhaseEnd() { watch_ = {-1, -1, 7, 100, 7, 0}; }
  /// `out`: balls that have left in this phase; energy per ball that is left [J].
  std::optional<std::string> check(std::int64_t steps, std::int64_t out, double energy) {
    const double kinetic_energy = energy * static_cast<double>(100 - out);
    return phase_end(phase_, kMean, kGravity, kStep, steps, kinetic_energy, 7 + out, watch_);
  }
  Phase phase_;
  Watch watch_;
};

TEST_F(PhaseEnd, RestIsCalmForATenthOfASecond) {
  phase_.until = Until::rest;
  for (std::int64_t k = 1; k <= 5; ++k) EXPECT_FALSE(check(k, 0, kCalm));
  EXPECT_FALSE(check(6, 0, kMoving));  // begins anew
  for (std::int64_t k = 7; k <= 16; ++k) EXPECT_FALSE(check(k, 0, kCalm)) << k;
  EXPECT_TRUE(check(17, 0, kCalm));
}

TEST_F(PhaseEnd, DischargedCountsThoseOfThePhaseOnly) {
  phase_.until = Until::discharged;
  phase_.fraction = 0.22;
  EXPECT_FALSE(check(1, 21, kMoving));
  EXPECT_TRUE(check(2, 22, kMoving));
}

TEST_F(PhaseEnd, EmptyMeansNoBallLeft) {
  phase_.until = Until::empty;
  EXPECT_FALSE(check(1, 99, kMoving));
  EXPECT_TRUE(check(2, 100, kMoving));
}

TEST_F(PhaseEnd, PermanentArchEndsADischarge) {
  for (const Until until : {Until::empty, Until::discharged}) {
    phase_.until = until;
    phase_.fraction = 0.5;
    watch_ = {-1, -1, 7, 100, 7, 0};
    EXPECT_FALSE(check(100, 3, kFlowing));  // the last ball leaves at 1 s, the content stops right after
    for (std::int64_t k = 101; k < 601; ++k) ASSERT_FALSE(check(k, 3, kCreeping)) << k;
    const auto reason = check(601, 3, kCreeping);
    ASSERT_TRUE(reason);
    EXPECT_NE(reason->find("arch holds 97 balls"), std::string::npos) << *reason;
  }
}

TEST_F(PhaseEnd, StoppageThatStillMovesIsNoArch) {
  phase_.until = Until::empty;
  for (std::int64_t k = 1; k < 2000; ++k) ASSERT_FALSE(check(k, 3, k % 5 == 0 ? kFlowing : kCreeping)) << k;
}

TEST_F(PhaseEnd, DurationIsNotCutShort) {
  for (std::int64_t k = 1; k < 2000; ++k) ASSERT_FALSE(check(k, 0, 0.0)) << k;
}

TEST(PhaseSetup, StepWithoutContactsIsThatOfTheStiffestContactToCome) {
  core::Scene scene;
  Phase phase;
  phase.every = 0.1;
  core::State state;
  state.add(0, core::Kind::wall, core::Vec3(0, 0, 0), core::Vec3::Zero(), 0.2);
  state.add(1, core::Kind::content, core::Vec3(0, 0, 5), core::Vec3::Zero(), 0.22);
  const double bound = core::critical_step_of_pair(phase.materials.wall, 1.0 / phase.materials.mass(0.22), phase.stepping.integrator);
  EXPECT_LT(*phase_setup(scene, phase, state, 1).stepping.step, 0.71 * bound);
  EXPECT_GT(*phase_setup(scene, phase, state, 1).stepping.step, 0.69 * bound);
  phase.stepping.step = 0.03;
  EXPECT_EQ(phase_setup(scene, phase, state, 1).stepping.step, 0.025);  // every over a whole number
}

TEST(PhaseSetup, FallsBackToUniformStepsOnlyWhereSelectiveOnesDoNotPay) {
  core::Scene scene;
  Phase phase;
  phase.every = 0.1;
  phase.stepping.levels = 12;
  core::State pairs;  // all alike: nothing to select
  for (core::BallId k = 0; k < 100; ++k) {
    const double y = 2.0 * static_cast<double>(k);  // m
    pairs.add(2 * k, core::Kind::content, core::Vec3(0, y, 0), core::Vec3::Zero(), 0.22);
    pairs.add(2 * k + 1, core::Kind::content, core::Vec3(0.4399, y, 0), core::Vec3::Zero(), 0.22);
  }
  core::State mixed = pairs;  // a small ball presses on a stiff wall ball: it alone steps finely
  mixed.add(1000, core::Kind::content, core::Vec3(5, 0, 0), core::Vec3::Zero(), 0.0275);
  mixed.add(1001, core::Kind::wall, core::Vec3(5, 0, -0.24749), core::Vec3::Zero(), 0.22);
  for (const bool fallback : {false, true}) {
    phase.stepping.fallback = fallback;
    const StepperSetup setup = phase_setup(scene, phase, pairs, 1);
    EXPECT_EQ(setup.stepping.method, fallback ? core::Method::uniform : core::Method::multirate);
    EXPECT_EQ(phase_setup(scene, phase, mixed, 1).stepping.method, core::Method::multirate);
    const std::string said = phase_report(phase, pairs, setup).text();
    EXPECT_EQ(said.find("multi-rate will not pay") != std::string::npos, !fallback) << said;
    EXPECT_EQ(phase_report(phase, mixed, phase_setup(scene, phase, mixed, 1)).text().find("will not pay"), std::string::npos);
  }
  phase.stepping.fallback = false;
  const StepperSetup selective = phase_setup(scene, phase, pairs, 1);
  phase.stepping.fallback = true;
  EXPECT_EQ(*phase_setup(scene, phase, pairs, 1).stepping.step,
            core::step_for(phase.every, multirate::equally_accurate_step(pairs, selective)).step);
}

Checkpoint some_checkpoint() {
  Checkpoint checkpoint;
  checkpoint.state.time = 1.0 / 3.0;
  checkpoint.state.add(4, core::Kind::content, core::Vec3(0.1, 0.2, 0.3), core::Vec3(1, 2, 3), 0.2);
  Position& at = checkpoint.position;
  at.phase = 2;
  at.steps = 12345;
  at.phase_start = 0.1;
  at.step = 1.0 / 7.0;
  at.watch.rest_since = -1;
  at.ledger.dissipated = 1.0 / 11.0;
  at.ledger.wall_impulse = core::Vec3(0.1, -0.2, 1e300);
  at.costs.contact_evaluations = std::uint64_t{1} << 63;
  return checkpoint;
}

TEST(Checkpoint, ReadsBackBitForBit) {
  const tests::Scratch scratch;
  const Checkpoint written = some_checkpoint(), read = read_checkpoint(write_checkpoint(scratch.path(), written));
  EXPECT_EQ(read.state.time, written.state.time);
  EXPECT_EQ(read.position.phase, 2);
  EXPECT_EQ(read.position.steps, 12345);
  EXPECT_EQ(read.position.step, written.position.step);
  EXPECT_EQ(read.position.watch.rest_since, -1);
  EXPECT_EQ(read.position.ledger.dissipated, written.position.ledger.dissipated);
  EXPECT_EQ(read.position.ledger.wall_impulse, written.position.ledger.wall_impulse);
  EXPECT_EQ(read.position.costs.contact_evaluations, written.position.costs.contact_evaluations);
}

TEST(Checkpoint, NewestThreeAreKept) {
  const tests::Scratch scratch;
  for (int k = 0; k < 12; ++k) write_checkpoint(scratch.path(), some_checkpoint());
  const auto found = checkpoints_in(scratch.path());
  ASSERT_EQ(found.size(), 3u);
  EXPECT_EQ(found[0].filename(), "000011.h5");
  EXPECT_EQ(found[2].filename(), "000009.h5");
}

TEST(Checkpoint, DamagedPositionIsFound) {
  const tests::Scratch scratch;
  const std::string path = write_checkpoint(scratch.path(), some_checkpoint());
  std::string bytes = tests::text_of(path);
  const double step = some_checkpoint().position.step;
  const std::size_t at = bytes.find(std::string(reinterpret_cast<const char*>(&step), sizeof step));
  ASSERT_NE(at, std::string::npos);
  bytes[at] = static_cast<char>(bytes[at] ^ 1);
  EXPECT_THROW(read_checkpoint(scratch.file("000001.h5", bytes)), core::FileError);
}

}  // namespace
}  // namespace grainclock::silo
