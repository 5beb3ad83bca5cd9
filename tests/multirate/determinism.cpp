// The same bits whatever the threads, the skin, the order of the balls, the pieces of a run and its restarts.
#include "multirate/stepper.hpp"

#include "tests/support/crowd.hpp"
#include "tests/support/silo_runs.hpp"

#include <gtest/gtest.h>

#include <map>

namespace grainclock::multirate {
namespace {

using core::State;
using core::StepperSetup;
using tests::expect_same_bits;
using tests::resumed;
using tests::to_checkpoint;

constexpr double kStep = 3.2e-4;  // the bulk's stability bound

StepperSetup flow_setup() { return tests::silo_setup(core::Method::multirate, kStep, true); }

State after(const State& start, const StepperSetup& setup, std::int64_t steps) {
  const auto stepper = make_multirate_stepper(start, setup);
  stepper->advance(steps);
  EXPECT_EQ(stepper->costs().missed_contacts, 0U);
  return stepper->state();
}

/// Copies of a state side by side along x; ids of content first, as in the original.
State copies(const State& one, int n) {
  State all;
  all.length_scale = one.length_scale;
  core::BallId id = 0;
  for (const bool content : {true, false})
    for (int copy = 0; copy < n; ++copy)
      for (std::size_t i = 0; i < one.size(); ++i) {
        if ((one.kind[i] == core::Kind::content) != content) continue;
        all.add(id++, one.kind[i], one.position[i] + core::Vec3(4.0 * copy, 0.0, 0.0), one.velocity[i], one.radius[i]);
      }
  return all;
}

TEST(Determinism, ThreadsDoNotMatter) {
  // Copies enough that the sweeps and the advance of a level, too, are shared among threads.
  const State start = copies(tests::flowing_silo(), 40);
  StepperSetup setup = flow_setup();
  setup.domain.upper->x() = 200.0;
  const auto run = [&](int threads) {
    setup.threads = threads;
    const auto stepper = make_multirate_stepper(start, setup);
    stepper->advance(40);
    const core::LevelStatistics levels = stepper->level_statistics();
    EXPECT_GT(levels.contacts.back(), 2.0 * 1024.0);  // a share is at least 1024 pairs or balls
    EXPECT_GT(levels.balls.back(), 2.0 * 1024.0);
    return std::pair(stepper->state(), stepper->ledger());
  };
  const auto [one, ledger] = run(1);
  for (const int threads : {2, 4}) {
    SCOPED_TRACE(testing::Message() << threads << " threads");
    const auto [many, its_ledger] = run(threads);
    expect_same_bits(one, many);
    EXPECT_EQ(one.level, many.level);
    EXPECT_EQ(ledger.dissipated, its_ledger.dissipated);
    EXPECT_EQ(ledger.total_impulse, its_ledger.total_impulse);
    EXPECT_EQ(ledger.wall_impulse, its_ledger.wall_impulse);
    EXPECT_EQ(ledger.event_work, its_ledger.event_work);
  }
}

TEST(Determinism, TheSkinDoesNotMatter) {
  StepperSetup setup = flow_setup();
  const State expected = after(tests::flowing_silo(), setup, 600);
  for (const double skin : {0.0025, 0.01, 0.05, 0.2}) {
    SCOPED_TRACE(testing::Message() << "skin " << skin << " m");
    setup.skin = skin;
    const State other = after(tests::flowing_silo(), setup, 600);
    expect_same_bits(expected, other);
    EXPECT_EQ(expected.level, other.level);
  }
}

TEST(Determinism, TheOrderOfBallsDoesNotMatter) {
  const State& start = tests::flowing_silo();
  const State expected = after(start, flow_setup(), 600);
  tests::Random random(5);
  std::vector<std::size_t> order(start.size());  // new ball i is old ball order[i]
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  for (std::uint32_t i = 1; i < order.size(); ++i) std::swap(order[i], order[random.below(i + 1)]);
  State shuffled;
  shuffled.length_scale = start.length_scale;  // else the sum of diameters would be rounded in another order
  for (std::size_t i = 0; i < order.size(); ++i)
    shuffled.add(static_cast<core::BallId>(i), start.kind[order[i]], start.position[order[i]], start.velocity[order[i]],
                 start.radius[order[i]]);
  const State got = after(shuffled, flow_setup(), 600);
  ASSERT_EQ(got.size(), expected.size());
  std::map<core::BallId, std::size_t> where;
  for (std::size_t i = 0; i < expected.size(); ++i) where[expected.id[i]] = i;
  for (std::size_t i = 0; i < got.size(); ++i) {
    const auto same = where.find(start.id[order[static_cast<std::size_t>(got.id[i])]]);
    ASSERT_NE(same, where.end());
    ASSERT_EQ(got.position[i], expected.position[same->second]);
    ASSERT_EQ(got.velocity[i], expected.velocity[same->second]);
    ASSERT_EQ(got.level[i], expected.level[same->second]);
  }
}

TEST(Determinism, PiecesOfARunDoNotMatter) {
  const State expected = after(tests::flowing_silo(), flow_setup(), 500);
  const auto stepper = make_multirate_stepper(tests::flowing_silo(), flow_setup());
  for (const int n : {1, 1, 1, 3, 0, 7, 100, 87, 2, 298}) stepper->advance(n);
  ASSERT_EQ(stepper->steps_done(), 500);
  expect_same_bits(expected, stepper->state());
  EXPECT_EQ(expected.level, stepper->state().level);
}

void expect_same_run(const core::Stepper& a, const core::Stepper& b) {
  expect_same_bits(a.state(), b.state());
  EXPECT_EQ(a.state().level, b.state().level);
  EXPECT_EQ(a.steps_done(), b.steps_done());
  EXPECT_EQ(a.is_checkpointable(), b.is_checkpointable());
  const core::Ledger &x = a.ledger(), &y = b.ledger();
  EXPECT_EQ(x.dissipated, y.dissipated);
  EXPECT_EQ(x.event_work, y.event_work);
  EXPECT_EQ(x.removed_energy, y.removed_energy);
  EXPECT_EQ(x.wall_impulse, y.wall_impulse);
  EXPECT_EQ(x.gravity_impulse, y.gravity_impulse);
  EXPECT_EQ(x.removed_momentum, y.removed_momentum);
  EXPECT_EQ(x.total_impulse, y.total_impulse);
  EXPECT_EQ(x.turned_over, y.turned_over);
  EXPECT_EQ(x.discharged, y.discharged);
  EXPECT_EQ(a.costs().events, b.costs().events);
  EXPECT_EQ(a.costs().ball_updates, b.costs().ball_updates);
}

TEST(Restart, ContinuesBitwise) {
  StepperSetup setup = flow_setup();
  const auto straight = make_multirate_stepper(tests::flowing_silo(), setup);
  for (int restart = 0; restart < 12; ++restart) {
    straight->advance(53);
    to_checkpoint(*straight);
    SCOPED_TRACE(testing::Message() << "from step " << straight->steps_done());
    const auto second = resumed(*straight, setup);
    expect_same_run(*straight, *second);
    for (const int n : {1, 2, 1, 4, 50}) {
      straight->advance(n);
      second->advance(n);
      expect_same_run(*straight, *second);
    }
    if (HasFailure()) break;
  }
  EXPECT_GT(straight->ledger().discharged, 0);
}

TEST(Restart, ContinuesBitwiseWithOtherThreadsAndSkin) {
  StepperSetup setup = flow_setup();
  const auto straight = make_multirate_stepper(tests::flowing_silo(), setup);
  straight->advance(100);
  to_checkpoint(*straight);
  setup.threads = 2;
  setup.skin = 0.03;
  const auto second = resumed(*straight, setup);
  straight->advance(200);
  second->advance(200);
  expect_same_run(*straight, *second);
}

TEST(Restart, AChainOfRestartsEqualsOneRun) {
  const StepperSetup setup = flow_setup();
  const auto straight = make_multirate_stepper(tests::flowing_silo(), setup);
  auto chained = make_multirate_stepper(tests::flowing_silo(), setup);
  for (int link = 0; link < 60; ++link) {
    chained->advance(tests::renew_every(*chained));
    to_checkpoint(*chained);
    chained = resumed(*chained, setup);
  }
  straight->advance(chained->steps_done());
  expect_same_run(*straight, *chained);
}

TEST(Restart, EveryCheckpointOfACrowdGoesOnBitwise) {
  // Where all is in uproar hysteresis and the limiter hold back many balls: what was before them no checkpoint knows.
  constexpr int kSteps = 10;
  for (const bool events : {false, true}) {
    StepperSetup setup = flow_setup();
    setup.outlet_open = false;
    setup.domain = {};
    setup.stepping.levels = 6;
    setup.stepping.events = events;
    const State start = tests::crowd();
    const auto whole = make_multirate_stepper(start, setup), stepper = make_multirate_stepper(start, setup);
    whole->advance(kSteps);
    const State end = whole->state();
    int checkpoints = 0;
    for (int k = 1; k < kSteps; ++k) {
      stepper->advance(1);
      if (!stepper->is_checkpointable()) continue;
      ++checkpoints;
      SCOPED_TRACE(testing::Message() << "after " << k << " steps");
      const auto next = resumed(*stepper, setup);
      next->advance(kSteps - k);
      State its = next->state();
      its.time = end.time;  // a run counts time for itself
      expect_same_bits(its, end);
    }
    EXPECT_GE(checkpoints, 5);
  }
}

TEST(Restart, OnlyRenewalsCanBeCheckpointed) {
  const auto stepper =
      make_multirate_stepper(tests::resting_silo(), tests::silo_setup(core::Method::multirate, kStep, false));
  EXPECT_TRUE(stepper->is_checkpointable());
  const int interval = tests::renew_every(*stepper);
  int between = 0;
  for (int k = 0; k < 10 * interval; ++k) {
    stepper->advance(1);
    const State state = stepper->state();
    EXPECT_EQ(state.level.size(), state.size());
    if (stepper->is_checkpointable()) {
      EXPECT_EQ(state.evaluated_position.size(), state.size());
      EXPECT_EQ(state.evaluated_velocity.size(), state.size());
    } else {
      ++between;
      EXPECT_TRUE(state.evaluated_position.empty());
      EXPECT_TRUE(state.evaluated_velocity.empty());
    }
    // Whatever else happens, every so many steps there is a checkpoint.
    EXPECT_TRUE(stepper->is_checkpointable() || stepper->steps_done() % interval != 0);
  }
  EXPECT_GT(between, 0);
}

}  // namespace
}  // namespace grainclock::multirate
