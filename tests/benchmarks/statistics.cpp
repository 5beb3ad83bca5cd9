#include "benchmarks/statistics.hpp"

#include "core/check.hpp"
#include "silo/random.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace grainclock::benchmarks {
namespace {

// A few roundings of numbers of order one to ten.
constexpr double kRounding = 1e-13;

TEST(Statistics, WelchsIntervalByHand) {
  // Variances 1 and 16 of three and four values: errors 1/3 and 4, freedom (13/3)^2 / (1/18 + 16/3) = 3.484536.
  const std::vector<double> a{1.0, 2.0, 3.0}, b{10.0, 10.0, 10.0 + std::sqrt(24.0), 10.0 - std::sqrt(24.0)};
  const Interval difference = difference_interval(a, b);
  EXPECT_EQ(difference.n, 3u);
  EXPECT_NEAR(difference.mean, -8.0, kRounding);
  EXPECT_NEAR(difference.high + 8.0, silo::student_t(0.975, 3.484536) * std::sqrt(13.0 / 3.0),
              1e-6);  // digits of the freedom
  EXPECT_FALSE(difference.contains(0.0));
  EXPECT_TRUE(difference.contains(-8.0));
}

TEST(Statistics, GroupsWithoutSpreadAgreeOnlyIfEqual) {
  EXPECT_TRUE(difference_interval({0, 0, 0}, {0, 0}).contains(0.0));
  EXPECT_FALSE(difference_interval({1, 1, 1}, {0, 0}).contains(0.0));
  EXPECT_FALSE(difference_interval({1}, {1, 1}).contains(0.0)) << "one value tells nothing";
}

/// A normal number (Box and Muller).
double normal(silo::Random& random) {
  return std::sqrt(-2.0 * std::log(1.0 - random.between(0.0, 1.0))) *
         std::cos(2.0 * std::numbers::pi * random.between(0.0, 1.0));
}

std::vector<double> sample(silo::Random& random, int n, double centre, double spread) {
  std::vector<double> values;
  for (int i = 0; i < n; ++i) values.push_back(centre + spread * normal(random));
  return values;
}

TEST(Statistics, EqualGroupsAgreeInNineteenOfTwentyCases) {
  constexpr int kTrials = 2000;
  for (const int n : {2, 3, 5, 12}) {
    silo::Random random(1, static_cast<std::uint32_t>(n));
    int agreed = 0;
    for (int trial = 0; trial < kTrials; ++trial)
      agreed += difference_interval(sample(random, n, 7.0, 2.0), sample(random, n, 7.0, 2.0)).contains(0.0) ? 1 : 0;
    // Welch's freedom is an approximation, on the safe side for few equal groups; four standard deviations of a binomial
    // share: 4 sqrt(0.95 * 0.05 / 2000).
    EXPECT_GT(agreed / double(kTrials), 0.95 - 0.0195) << n;
    EXPECT_LT(agreed / double(kTrials), 0.99) << n;
  }
}

TEST(Statistics, GroupsThatDifferByTenErrorsAreToldApart) {
  silo::Random random(2, 0);
  int agreed = 0;
  for (int trial = 0; trial < 300; ++trial) {
    // Ten standard errors of the difference of five seeds each.
    const double apart = 10.0 * std::sqrt(2.0 / 5.0);
    agreed += difference_interval(sample(random, 5, 0.0, 1.0), sample(random, 5, apart, 1.0)).contains(0.0) ? 1 : 0;
  }
  EXPECT_EQ(agreed, 0);
}

/// Samples every 0.1 s.
std::vector<double> times(std::size_t n) {
  std::vector<double> time;
  for (std::size_t i = 0; i < n; ++i) time.push_back(2.0 + 0.1 * static_cast<double>(i));
  return time;
}

TEST(Statistics, RateIsTheCountOverTheWindow) {
  EXPECT_NEAR(discharge_rate(times(6), {10, 10, 17, 20, 21, 43}), 33.0 / 0.5, kRounding * 100);
  EXPECT_EQ(discharge_rate(times(3), {4, 4, 4}), 0.0);
  EXPECT_THROW(discharge_rate(times(1), {4}), core::InputError);
  EXPECT_THROW(discharge_rate(times(3), {4, 5}), core::InputError);
}

TEST(Statistics, StoppagesAreRunsOfOneCountThatLastLongEnough) {
  //                               0.2 s        0.1 s    0.4 s              the end: 0.2 s
  const std::vector<double> count{3, 3, 3, 5, 6, 6, 9, 12, 12, 12, 12, 12, 15, 20, 20, 20};
  const Stoppages found = stoppages(times(count.size()), count, 0.2);
  EXPECT_EQ(found.count, 3u);
  EXPECT_NEAR(found.mean_length, 0.8 / 3.0, kRounding);
  EXPECT_NEAR(found.share, 0.8 / 1.5, kRounding);
  EXPECT_EQ(stoppages(times(count.size()), count, 0.1).count, 4u);
  EXPECT_EQ(stoppages(times(count.size()), count, 0.21).count, 1u);
  EXPECT_EQ(stoppages(times(count.size()), count, 0.5).count, 0u);
  EXPECT_THROW(stoppages(times(count.size()), count, 0.0), core::InputError);
}

TEST(Statistics, SteadyFlowHasNoStoppageAndAnArchIsOneOnly) {
  const Stoppages none = stoppages(times(5), {0, 3, 5, 8, 9}, 0.05);
  EXPECT_EQ(none.count, 0u);
  EXPECT_EQ(none.share, 0.0);
  EXPECT_TRUE(std::isnan(none.mean_length));
  const Stoppages arch = stoppages(times(5), {7, 7, 7, 7, 7}, 0.2);
  EXPECT_EQ(arch.count, 1u);
  EXPECT_NEAR(arch.mean_length, 0.4, kRounding);
  EXPECT_NEAR(arch.share, 1.0, kRounding);
}

}  // namespace
}  // namespace grainclock::benchmarks
