// Steps of the ladder, and which level a wanted step belongs to, down to the last bit at the limits.
#include "multirate/ladder.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace grainclock::multirate {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Ladders with awkward ticks.
std::vector<Ladder> ladders() {
  std::vector<Ladder> out{Ladder(1e-4, 1), Ladder(1e-4, 8), Ladder(0.1 / 3.0, 12), Ladder(0x1p-13, 7), Ladder(3.2e-4, 5)};
  tests::Random random(7);
  for (int k = 0; k < 200; ++k) out.emplace_back(random.between(1e-6, 1e-3), 1 + static_cast<int>(random.below(12)));
  return out;
}

TEST(Ladder, StepsAreExactPowersOfTwoBelowTheCoarsest) {
  const double coarsest = 1e-4 / 3.0;
  const Ladder ladder(coarsest, 8);
  EXPECT_EQ(ladder.levels(), 8);
  EXPECT_EQ(ladder.coarsest(), 7);
  double step = coarsest;
  for (int level = 7; level >= 0; --level, step /= 2.0) EXPECT_EQ(ladder.step(static_cast<Level>(level)), step);
  EXPECT_EQ(ladder.tick(), ladder.step(0));
}

TEST(Ladder, AStepOfALevelBelongsToIt) {
  for (const Ladder& ladder : ladders())
    for (Level level = 0; level <= ladder.coarsest(); ++level) {
      EXPECT_EQ(ladder.level_of(ladder.step(level)), level);
      EXPECT_EQ(ladder.level_of(std::nextafter(ladder.step(level), kInfinity)), level);
    }
}

TEST(Ladder, LevelJustBelowBoundaryIsFiner) {
  for (const Ladder& ladder : ladders())
    for (Level level = 1; level <= ladder.coarsest(); ++level)
      EXPECT_EQ(ladder.level_of(std::nextafter(ladder.step(level), 0.0)), level - 1) << "tick " << ladder.tick();
}

TEST(Ladder, LevelsAreBoundedAtBothEnds) {
  const Ladder ladder(1e-4, 6);
  EXPECT_EQ(ladder.level_of(kInfinity), 5);
  EXPECT_EQ(ladder.level_of(std::numeric_limits<double>::max()), 5);
  EXPECT_EQ(ladder.level_of(1.0), 5);
  EXPECT_EQ(ladder.level_of(std::nextafter(ladder.tick(), 0.0)), 0);
  EXPECT_EQ(ladder.level_of(std::numeric_limits<double>::denorm_min()), 0);
}

TEST(Ladder, WhatIsNoStepGetsTheFinestLevel) {
  const Ladder ladder(1e-4, 6);
  EXPECT_EQ(ladder.level_of(std::numeric_limits<double>::quiet_NaN()), 0);
  EXPECT_EQ(ladder.level_of(0.0), 0);
  EXPECT_EQ(ladder.level_of(-1.0), 0);
  EXPECT_EQ(ladder.level_of(-kInfinity), 0);
}

}  // namespace
}  // namespace grainclock::multirate
