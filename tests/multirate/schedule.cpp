// The order of work within a coarse step against lists written by hand.
#include "multirate/schedule.hpp"

#include <gtest/gtest.h>

#include <map>

namespace grainclock::multirate {

/// For messages of failed expectations.
void PrintTo(const Action& action, std::ostream* out) { *out << describe({action}); }

namespace {

Action drift(std::int64_t tick, Level level) { return {Action::Kind::drift, Tick{tick}, level}; }
Action evaluate(std::int64_t tick, Level level) { return {Action::Kind::evaluate, Tick{tick}, level}; }
Action kick(std::int64_t tick, Level level) { return {Action::Kind::kick, Tick{tick}, level}; }
using Actions = std::vector<Action>;

TEST(Schedule, ThreeLevelsFollowTheHandWrittenList) {
  EXPECT_EQ(dry_run(0, 2),
            (Actions{drift(1, 0), evaluate(1, 0), kick(1, 0),                               //
                     drift(2, 0), drift(2, 1), evaluate(2, 0), evaluate(2, 1), kick(2, 1),  //
                     drift(3, 0), evaluate(3, 0), kick(3, 0),                               //
                     drift(4, 0), drift(4, 1), drift(4, 2), evaluate(4, 0), evaluate(4, 1), evaluate(4, 2), kick(4, 2)}));
}

TEST(Schedule, TicksAtWhichNothingHappensArePassedOver) {
  EXPECT_EQ(dry_run(1, 3),
            (Actions{drift(2, 1), evaluate(2, 1), kick(2, 1),                               //
                     drift(4, 1), drift(4, 2), evaluate(4, 1), evaluate(4, 2), kick(4, 2),  //
                     drift(6, 1), evaluate(6, 1), kick(6, 1),                               //
                     drift(8, 1), drift(8, 2), drift(8, 3), evaluate(8, 1), evaluate(8, 2), evaluate(8, 3), kick(8, 3)}));
  EXPECT_EQ(dry_run(3, 3), (Actions{drift(8, 3), evaluate(8, 3), kick(8, 3)}));
}

TEST(Schedule, OneLevelIsOneStep) { EXPECT_EQ(dry_run(0, 0), (Actions{drift(1, 0), evaluate(1, 0), kick(1, 0)})); }

TEST(Schedule, EveryLevelActsOncePerStepOfItsOwn) {
  for (Level coarsest = 0; coarsest < kMostLevels; ++coarsest)
    for (Level finest = 0; finest <= coarsest; ++finest) {
      std::map<Level, std::int64_t> drifts, evaluations;
      std::int64_t kicks = 0;
      for (const Action& a : dry_run(finest, coarsest)) {
        EXPECT_TRUE(is_active_at(a.level, a.tick));
        if (a.kind == Action::Kind::drift) ++drifts[a.level];
        if (a.kind == Action::Kind::evaluate) ++evaluations[a.level];
        if (a.kind == Action::Kind::kick) ++kicks;
      }
      for (Level level = finest; level <= coarsest; ++level) {
        EXPECT_EQ(drifts[level], ticks_of(coarsest) / ticks_of(level));
        EXPECT_EQ(evaluations[level], ticks_of(coarsest) / ticks_of(level));
      }
      EXPECT_EQ(drifts.size(), coarsest - finest + 1U);
      EXPECT_EQ(kicks, ticks_of(coarsest) / ticks_of(finest));
    }
}

TEST(Schedule, DescriptionHasOneLinePerAction) {
  EXPECT_EQ(describe(dry_run(0, 1)),
            "tick    1  drift level 0\n"
            "tick    1  evaluate level 0\n"
            "tick    1  kick level 0\n"
            "tick    2  drift level 0\n"
            "tick    2  drift level 1\n"
            "tick    2  evaluate level 0\n"
            "tick    2  evaluate level 1\n"
            "tick    2  kick level 1\n");
}

}  // namespace
}  // namespace grainclock::multirate
