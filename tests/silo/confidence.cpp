#include "silo/confidence.hpp"

#include "core/check.hpp"
#include "silo/random.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace grainclock::silo {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
// A few roundings of numbers of order one to ten.
constexpr double kRounding = 1e-13;

TEST(StudentT, QuantilesArePublishedOnes) {
  struct Known {
    double freedom, p95, p975, p995;
  };
  // Tables of the t-distribution, as in the NIST handbook of statistical methods, 1.3.6.7.2, with more digits.
  const Known table[] = {
      {1, 6.313752, 12.706205, 63.656741}, {2, 2.919986, 4.302653, 9.924843},  {3, 2.353363, 3.182446, 5.840909},
      {4, 2.131847, 2.776445, 4.604095},   {5, 2.015048, 2.570582, 4.032143},  {9, 1.833113, 2.262157, 3.249836},
      {10, 1.812461, 2.228139, 3.169273},  {20, 1.724718, 2.085963, 2.845340}, {30, 1.697261, 2.042272, 2.749996},
      {60, 1.670649, 2.000298, 2.660283},  {120, 1.657651, 1.979930, 2.617421}};
  for (const Known& known : table) {
    // Half a unit of the table's last digit.
    EXPECT_NEAR(student_t(0.95, known.freedom), known.p95, 6e-7) << known.freedom;
    EXPECT_NEAR(student_t(0.975, known.freedom), known.p975, 6e-7) << known.freedom;
    EXPECT_NEAR(student_t(0.995, known.freedom), known.p995, 6e-7) << known.freedom;
  }
}

TEST(StudentT, ClosedFormsAtOneAndTwoDegreesAndTheNormalLimit) {
  for (const double p : {0.501, 0.6, 0.9, 0.975, 0.999}) {
    const double a = 4.0 * p * (1.0 - p);
    // Simpson's rule: nine digits are promised.
    EXPECT_NEAR(student_t(p, 1.0) / std::tan(std::numbers::pi * (p - 0.5)), 1.0, 1e-9) << p;
    EXPECT_NEAR(student_t(p, 2.0) / (2.0 * (p - 0.5) * std::sqrt(2.0 / a)), 1.0, 1e-9) << p;
  }
  const double z = 1.959963984540054;  // of the normal distribution; the next term of its expansion in 1/freedom follows
  EXPECT_NEAR(student_t(0.975, 1e6), z + (z * z * z + z) / 4e6,
              1e-8);  // lgamma of a million has nine digits in a difference
}

TEST(StudentT, IsOddAndFallsWithFreedomBetweenWholeNumbersToo) {
  EXPECT_EQ(student_t(0.025, 7.0), -student_t(0.975, 7.0));
  EXPECT_EQ(student_t(0.5, 3.0), 0.0);
  double before = student_t(0.975, 1.0);
  for (double freedom = 1.1; freedom < 12.0; freedom += 0.1) {
    const double now = student_t(0.975, freedom);
    EXPECT_LT(now, before) << freedom;
    before = now;
  }
  EXPECT_THROW(student_t(1.0, 3.0), core::InputError);
  EXPECT_THROW(student_t(0.975, 0.5), core::InputError);
  EXPECT_THROW(student_t(0.975, kNan), core::InputError);
}

TEST(Confidence, IntervalOfThreeValuesByHand) {
  const Interval interval = mean_interval({1.0, 2.0, 6.0});
  EXPECT_EQ(interval.n, 3u);
  EXPECT_NEAR(interval.mean, 3.0, kRounding);
  // Variance (4 + 1 + 9)/2 = 7, standard error sqrt(7/3), t(2) = 4.302653 to half its last digit.
  EXPECT_NEAR(interval.high - 3.0, 4.302653 * std::sqrt(7.0 / 3.0), 1e-6);
  EXPECT_NEAR(3.0 - interval.low, interval.high - 3.0, kRounding);
}

TEST(Confidence, OneValueHasAMeanButNoInterval) {
  const Interval one = mean_interval({5.0});
  EXPECT_EQ(one.n, 1u);
  EXPECT_EQ(one.mean, 5.0);
  EXPECT_TRUE(std::isnan(one.low) && std::isnan(one.high));
  EXPECT_FALSE(one.contains(5.0));
  EXPECT_TRUE(std::isnan(mean_interval({}).mean));
}

TEST(Confidence, UnknownValuesAreLeftOut) {
  const Interval with = mean_interval({1.0, kNan, 2.0, 6.0}), without = mean_interval({1.0, 2.0, 6.0});
  EXPECT_EQ(with.n, 3u);
  EXPECT_EQ(with.low, without.low);
  EXPECT_EQ(mean({kNan, 4.0}), 4.0);
  EXPECT_TRUE(std::isnan(mean({kNan})));
}

/// A normal number (Box and Muller).
double normal(Random& random) {
  return std::sqrt(-2.0 * std::log(1.0 - random.between(0.0, 1.0))) *
         std::cos(2.0 * std::numbers::pi * random.between(0.0, 1.0));
}

std::vector<double> sample(Random& random, int n, double centre, double spread) {
  std::vector<double> values;
  for (int i = 0; i < n; ++i) values.push_back(centre + spread * normal(random));
  return values;
}

TEST(Confidence, IntervalsCoverTheTruthInNineteenOfTwentyCases) {
  constexpr int kTrials = 2000;
  for (const int n : {2, 3, 5, 12}) {
    Random random(1, static_cast<std::uint32_t>(n));
    int covered = 0;
    for (int trial = 0; trial < kTrials; ++trial)
      covered += mean_interval(sample(random, n, 7.0, 2.0)).contains(7.0) ? 1 : 0;
    // Four standard deviations of a binomial share: 4 sqrt(0.95 * 0.05 / 2000).
    EXPECT_NEAR(covered / double(kTrials), 0.95, 0.0195) << n;
  }
}

}  // namespace
}  // namespace grainclock::silo
