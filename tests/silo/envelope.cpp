#include "silo/envelope.hpp"

#include "core/check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace grainclock::silo {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// A few roundings of numbers of order one to ten.
constexpr double kRounding = 1e-13;

TEST(Envelope, OfThreeRunsByHand) {
  const auto found = envelope({{1.0, 5.0}, {2.0, 5.0}, {6.0, 5.0}});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_EQ(found[0].min, 1.0);
  EXPECT_EQ(found[0].max, 6.0);
  EXPECT_NEAR(found[0].mean.mean, 3.0, kRounding);
  // Variance (4 + 1 + 9)/2 = 7, standard error sqrt(7/3), Student's t(2) = 4.302653 to half its last digit.
  EXPECT_NEAR(found[0].mean.high - 3.0, 4.302653 * std::sqrt(7.0 / 3.0), 1e-6);
  EXPECT_NEAR(found[0].mean.low + found[0].mean.high, 6.0, 10.0 * kRounding);
  EXPECT_EQ(found[1].min, 5.0);
  EXPECT_EQ(found[1].mean.low, 5.0);
  EXPECT_EQ(found[1].mean.high, 5.0);
}

TEST(Envelope, ARunThatIsOverCountsNoMore) {
  const auto found = envelope({{1.0, kNan, kNan}, {3.0, 4.0, kNan}});
  EXPECT_EQ(found[0].mean.n, 2u);
  EXPECT_EQ(found[1].mean.n, 1u);
  EXPECT_EQ(found[1].min, 4.0);
  EXPECT_EQ(found[1].max, 4.0);
  EXPECT_EQ(found[1].mean.mean, 4.0);
  EXPECT_TRUE(std::isnan(found[1].mean.low)) << "one run tells nothing of the spread";
  EXPECT_TRUE(std::isnan(found[2].min) && std::isnan(found[2].max) && std::isnan(found[2].mean.mean));
}

TEST(Envelope, NoRunsOrUnequalOnesAreRejected) {
  EXPECT_THROW(envelope({}), core::InputError);
  EXPECT_THROW(envelope({{1.0, 2.0}, {1.0}}), core::InputError);
  EXPECT_TRUE(envelope({{}, {}}).empty());
}

}  // namespace
}  // namespace grainclock::silo
