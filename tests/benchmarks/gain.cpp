#include "benchmarks/gain.hpp"

#include <gtest/gtest.h>

namespace grainclock::benchmarks {
namespace {

// A few roundings through log and pow.
constexpr double kRounding = 1e-12;

TEST(Gain, CostIsInterpolatedOnALogLogLine) {
  const std::vector<ErrorAtCost> line = {{1e-2, 100}, {1e-4, 10000}};  // cost = 1 / error
  EXPECT_NEAR(*cost_at(1e-3, line) / 1000.0, 1.0, kRounding);
  EXPECT_NEAR(*cost_at(1e-4, line) / 10000.0, 1.0, kRounding);
  EXPECT_NEAR(*gain({1e-3, 50}, line) / 20.0, 1.0, kRounding);
}

TEST(Gain, BeatenPointsOfTheBaselineDoNotCount) {
  const std::vector<ErrorAtCost> line = {{1e-4, 10000}, {5e-3, 2000}, {1e-2, 100}, {1e-3, 1000}};
  EXPECT_NEAR(*cost_at(5e-3, line) / *cost_at(5e-3, {{1e-2, 100}, {1e-3, 1000}}), 1.0, kRounding);
}

TEST(Gain, CoarserThanTheBaselineItCostsItsCheapestPoint) { EXPECT_EQ(*cost_at(0.5, {{1e-2, 100}, {1e-4, 10000}}), 100.0); }

TEST(Gain, FinerThanTheBaselineItIsUnknown) {
  EXPECT_FALSE(cost_at(9e-5, {{1e-2, 100}, {1e-4, 10000}}));
  EXPECT_FALSE(cost_at(1e-3, {}));
  EXPECT_FALSE(gain({1e-3, 0.0}, {{1e-3, 1}}));
}

}  // namespace
}  // namespace grainclock::benchmarks
