#include "silo/energy_watch.hpp"

#include <gtest/gtest.h>

namespace grainclock::silo {
namespace {

core::Energies energies(double kinetic, double elastic) {
  core::Energies e;
  e.kinetic = kinetic;
  e.elastic = elastic;
  return e;
}
core::Ledger dissipated(double joules) {
  core::Ledger ledger;
  ledger.dissipated = joules;
  return ledger;
}

// At the start 10 J of motion and 100 J in springs. With d dissipated and the same energies as then, d came from nowhere.
// Rounding is below 1e-6, and what spoils a run above 5e-3 of 1000 J.
const core::Energies kStart = energies(10.0, 100.0);
EnergyWatch watch() { return {kStart, kStart, core::Ledger{}, 1000.0}; }

TEST(EnergyWatch, LetsPassWhatMotionAndDashpotsAccountFor) {
  EnergyWatch quiet = watch();
  EXPECT_FALSE(quiet.look(energies(5.0, 80.0), dissipated(25.0)));  // closed to the last joule
  EnergyWatch swinging = watch();
  EXPECT_FALSE(swinging.look(energies(20.0, 109.9), core::Ledger{}));  // 19.9 J created, 20 J of motion
  EnergyWatch losing = watch();
  EXPECT_FALSE(losing.look(energies(0.0, 0.0), core::Ledger{}));  // energy that vanished heats nothing
}

TEST(EnergyWatch, NoticesRattlingThatDashpotsBalance) {
  // All that is dissipated comes from nowhere: d - 0.25 d against 10 J of motion.
  EnergyWatch still = watch();
  EXPECT_FALSE(still.look(kStart, dissipated(13.33)));
  EnergyWatch rattling = watch();
  const auto found = rattling.look(kStart, dissipated(13.34));
  ASSERT_TRUE(found);
  EXPECT_FALSE(found->spoils);
  EXPECT_NE(found->text.find("13.3 J came from nowhere while dashpots took away 13.3 J"), std::string::npos) << found->text;
}

TEST(EnergyWatch, TellsAFewBallsFromASpoiltRun) {
  // Unaccounted for are 0.75 d - 10 J; a run is spoilt above 5 J, d = 20 J.
  EnergyWatch few = watch(), spoilt = watch();
  ASSERT_TRUE(few.look(kStart, dissipated(19.99)));
  EXPECT_FALSE(watch().look(kStart, dissipated(19.99))->spoils);
  EXPECT_TRUE(spoilt.look(kStart, dissipated(20.01))->spoils);
}

TEST(EnergyWatch, LooksAtEachIntervalApart) {
  // A long honest past, 1 MJ dissipated that motion paid for, hides nothing that comes after it.
  const core::Energies rich = energies(1e6, 100.0);
  EnergyWatch late{rich, rich, core::Ledger{}, 1000.0};
  ASSERT_FALSE(late.look(energies(10.0, 100.0), dissipated(1e6 - 10.0)));
  EXPECT_TRUE(late.look(energies(10.0, 100.0), dissipated(1e6 + 5.0)));
}

TEST(EnergyWatch, AddsUpWhatCreepsIn) {
  // 4 J at a time without dashpots: less than what moves, until the sum since the beginning is more.
  EnergyWatch creeping = watch();
  double elastic = 100.0;
  int looks = 0;
  while (!creeping.look(energies(10.0, elastic), core::Ledger{})) {
    elastic += 4.0;
    ASSERT_LT(++looks, 10);
  }
  EXPECT_EQ(looks, 3);  // 12 J
}

TEST(EnergyWatch, AddsUpWhatSpoilsARunLittleByLittle) {
  // Each look finds 12 J more than at the last one, against 10 J of motion: noticed, and 5 J would spoil. The second look
  // finds 14 J unaccounted for in all.
  EnergyWatch creeping = watch();
  const auto first = creeping.look(energies(10.0, 112.0), core::Ledger{});
  const auto second = creeping.look(energies(10.0, 124.0), core::Ledger{});
  ASSERT_TRUE(first && second);
  EXPECT_FALSE(first->spoils);
  EXPECT_TRUE(second->spoils);
}

TEST(EnergyWatch, StiffContentIsMeasuredByItsSprings) {
  // Springs that hold 2000 J where the weights would give 1000 J: a run is spoilt above 10 J, not 5 J.
  const core::Energies pressed = energies(0.0, 2000.0);
  const auto look = [&](double created) {
    return EnergyWatch{pressed, pressed, core::Ledger{}, 1000.0}.look(energies(0.0, 2000.0 + created), core::Ledger{});
  };
  ASSERT_TRUE(look(9.9) && look(10.1));
  EXPECT_FALSE(look(9.9)->spoils);
  EXPECT_TRUE(look(10.1)->spoils);
}

TEST(EnergyWatch, FirstImpactsCountAsTakenAway) {
  // As with dashpots: d - 0.25 d against 10 J of motion.
  core::Ledger stopped;
  stopped.first_impact = 13.33;
  EXPECT_FALSE(watch().look(kStart, stopped));
  stopped.first_impact = 13.34;
  EXPECT_TRUE(watch().look(kStart, stopped));
}

TEST(EnergyWatch, TakesRoundingForNothing) {
  const core::Energies rest = energies(0.0, 100.0);
  EnergyWatch resting{rest, rest, core::Ledger{}, 1000.0}, heated = resting;
  EXPECT_FALSE(resting.look(energies(0.0, 100.0 + 0.99e-3), core::Ledger{}));  // 1e-6 of 1000 J
  EXPECT_TRUE(heated.look(energies(0.0, 100.0 + 1.01e-3), core::Ledger{}));
}

}  // namespace
}  // namespace grainclock::silo
