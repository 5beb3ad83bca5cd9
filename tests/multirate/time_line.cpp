// Integer time against counting by hand.
#include "multirate/time_line.hpp"

#include <gtest/gtest.h>

namespace grainclock::multirate {
namespace {

constexpr Level kCoarsest = 5;

TEST(TimeLine, StepsOfALevelEndAtItsMultiples) {
  for (Level level = 0; level <= kCoarsest; ++level) {
    std::int64_t end = 0;
    for (std::int64_t t = 1; t <= 2 * ticks_of(kCoarsest); ++t) {
      if (t > end) end += ticks_of(level);  // the step that t lies in
      EXPECT_EQ(is_active_at(level, Tick{t}), t == end) << "level " << int{level} << ", tick " << t;
      EXPECT_EQ(ticks_to_end(level, Tick{t}), end - t) << "level " << int{level} << ", tick " << t;
    }
  }
}

TEST(TimeLine, CoarsestActiveIsTheLastLevelThatEnds) {
  for (Level coarsest = 0; coarsest <= kCoarsest; ++coarsest) {
    for (std::int64_t t = 1; t <= 2 * ticks_of(kCoarsest); ++t) {
      Level expected = 0;
      for (Level level = 0; level <= coarsest; ++level)
        if (is_active_at(level, Tick{t})) expected = level;
      EXPECT_EQ(coarsest_active(Tick{t}, coarsest), expected) << "coarsest " << int{coarsest} << ", tick " << t;
    }
  }
}

TEST(TimeLine, EachLevelDoublesTheOneBelow) {
  EXPECT_EQ(ticks_of(0), 1);
  for (Level level = 1; level < kMostLevels; ++level)
    EXPECT_EQ(ticks_of(level), 2 * ticks_of(static_cast<Level>(level - 1)));
}

}  // namespace
}  // namespace grainclock::multirate
