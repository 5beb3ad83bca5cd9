#include "silo/discharge.hpp"

#include "core/check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace grainclock::silo {
namespace {

// A few roundings of numbers of order one to ten.
constexpr double kRounding = 1e-13;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Samples every 0.1 s from 2 s on.
std::vector<double> times(std::size_t n) {
  std::vector<double> time;
  for (std::size_t i = 0; i < n; ++i) time.push_back(2.0 + 0.1 * static_cast<double>(i));
  return time;
}

TEST(DischargeRate, CountsTheBallsOfTheWindow) {
  const std::vector<double> count{10, 10, 17, 20, 21, 43};
  EXPECT_NEAR(discharge_rate(times(6), count, 0.0, 9.0), 33.0 / 0.5, 100.0 * kRounding);
  EXPECT_NEAR(discharge_rate(times(6), count, 2.1, 2.4), 11.0 / 0.3, 1e-11);  // times carry 2 roundings of 2, over 0.3 s
  EXPECT_NEAR(discharge_rate(times(6), count, 2.15, 2.35), 3.0 / 0.1, 1e-11);
  EXPECT_THROW(discharge_rate(times(6), count, 2.15, 2.25), core::InputError);
  EXPECT_THROW(discharge_rate(times(6), count, 3.0, 4.0), core::InputError);
  EXPECT_THROW(discharge_rate(times(5), count, 0.0, 9.0), core::InputError);
  EXPECT_THROW(discharge_rate({1.0, 1.0}, {0.0, 1.0}, 0.0, 9.0), core::InputError);
  EXPECT_THROW(discharge_rate({1.0, std::numeric_limits<double>::quiet_NaN()}, {0.0, 1.0}, 0.0, 9.0), core::InputError);
}

TEST(DischargeRate, SlidesOverTheSeries) {
  const std::vector<double> count{0, 4, 4, 10, 12};
  const auto rates = sliding_discharge_rate(times(5), count, 0.2);
  const double expected[] = {40.0, 20.0, 30.0, 40.0, 20.0};  // 4 / 0.1, 4 / 0.2, 6 / 0.2, 8 / 0.2, 2 / 0.1
  for (std::size_t i = 0; i < 5; ++i) EXPECT_NEAR(rates[i], expected[i], 1e-11) << i;  // as above
  EXPECT_TRUE(std::isnan(sliding_discharge_rate(times(5), count, 0.1)[2])) << "one sample tells no rate";
  EXPECT_THROW(sliding_discharge_rate(times(5), count, 0.0), core::InputError);
}

TEST(EnergyPerBall, IsThatOfTheBallsStillThere) {
  const auto energies = energy_per_ball({600.0, 300.0, 7.0}, {0.0, 5.0, 10.0}, {10.0, 120.0});
  EXPECT_EQ(energies, (std::vector<double>{0.5, 0.5, 0.0}));
  EXPECT_THROW(energy_per_ball({1.0}, {11.0}, {10.0, 120.0}), core::InputError);
  EXPECT_THROW(energy_per_ball({1.0}, {1.0}, {10.0, 0.0}), core::InputError);
  EXPECT_THROW(energy_per_ball({1.0}, {1.0, 2.0}, {10.0, 1.0}), core::InputError);
}

TEST(Stoppages, AreRunsOfOneCountAsInTheStatistics) {
  // The case of benchmarks' own test: 0.2 s, 0.1 s, 0.4 s, and 0.2 s at the end.
  const std::vector<double> count{3, 3, 3, 5, 6, 6, 9, 12, 12, 12, 12, 12, 15, 20, 20, 20};
  const std::vector<double> energies(count.size(), 1.0);
  const auto found = stoppages(times(count.size()), count, energies, {0.2, kInfinity});
  ASSERT_EQ(found.size(), 3u);
  const double from[] = {2.0, 2.7, 3.3}, length[] = {0.2, 0.4, 0.2};
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(found[i].from, from[i], kRounding);
    EXPECT_NEAR(found[i].length(), length[i], kRounding);
  }
  EXPECT_EQ(stoppages(times(count.size()), count, energies, {0.1, kInfinity}).size(), 4u);
  EXPECT_EQ(stoppages(times(count.size()), count, energies, {0.21, kInfinity}).size(), 1u);
  EXPECT_TRUE(stoppages(times(count.size()), count, energies, {0.2, 1.0}).empty()) << "the energy must be below";
}

TEST(Stoppages, BeginWhenTheContentHasCalmedDownAndEndWhenItStirs) {
  const std::vector<double> count{1, 2, 2, 2, 2, 2, 2, 2, 3};
  const std::vector<double> energies{9, 9, 8, 1, 1, 1, 1, 8, 9};
  const auto found = stoppages(times(9), count, energies, {0.2, 5.0});
  ASSERT_EQ(found.size(), 1u);
  EXPECT_NEAR(found[0].from, 2.3, kRounding);
  EXPECT_NEAR(found[0].to, 2.6, kRounding);
}

TEST(Stoppages, ABallThatLeavesEndsOneHoweverCalmTheContent) {
  const std::vector<double> calm(7, 0.0);
  const auto found = stoppages(times(7), {1, 1, 1, 2, 2, 2, 2}, calm, {0.2, 5e-3});
  ASSERT_EQ(found.size(), 2u);
  EXPECT_NEAR(found[0].to, 2.2, kRounding);
  EXPECT_NEAR(found[1].from, 2.3, kRounding);
  EXPECT_TRUE(stoppages(times(7), {1, 2, 3, 4, 5, 6, 7}, calm, {0.1}).empty());
  EXPECT_THROW(stoppages(times(7), calm, calm, {0.0}), core::InputError);
  EXPECT_THROW(stoppages(times(7), calm, {1.0}, {0.1}), core::InputError);
}

TEST(Stoppages, AndWindowsAreNotDecidedByARounding) {
  std::vector<double> time, count;
  for (int i = 0; i <= 10; ++i) {
    time.push_back(0.1 * i);
    count.push_back(std::min(i, 7));
  }
  ASSERT_LT(time[10] - time[7], 0.3);
  EXPECT_EQ(stoppages(time, count, count, {0.3, kInfinity}).size(), 1u);
  ASSERT_GT(time[3], 0.3);
  EXPECT_NEAR(discharge_rate(time, count, 0.2, 0.3), 10.0, 1e-11);  // roundings of the times over 0.1 s
}

TEST(Beats, AreMaximaOfTheStatedProminence) {
  //                               5 over 2     7 over 0 (end)    6 over 4, flat
  const std::vector<double> energy{1, 3, 5, 2, 3, 2, 7, 4, 4.5, 4, 6, 6, 4.2, 0};
  const auto all = beats(times(energy.size()), energy, 0.4);
  ASSERT_EQ(all.size(), 5u);
  const double time[] = {2.2, 2.4, 2.6, 2.8, 3.05}, prominence[] = {3.0, 1.0, 6.0, 0.5, 2.0};
  // 5: lowest 1 to the left, 2 up to the 7: 3. 3: between 2 and 2. 7: 1 and 0. 4.5: 4 and 4. 6: 4 up to the 7, and 0.
  for (std::size_t i = 0; i < all.size(); ++i) {
    EXPECT_NEAR(all[i].time, time[i], kRounding) << i;
    EXPECT_NEAR(all[i].prominence, prominence[i], kRounding) << i;
  }
  EXPECT_EQ(all[4].energy, 6.0);
  const auto intervals = beat_intervals(beats(times(energy.size()), energy, 2.0));
  ASSERT_EQ(intervals.size(), 2u);
  EXPECT_NEAR(intervals[0], 0.4, kRounding);
  EXPECT_NEAR(intervals[1], 0.45, kRounding);
  EXPECT_TRUE(beat_intervals({}).empty());
  EXPECT_THROW(beats(times(3), {1, 2, 1}, 0.0), core::InputError);
}

TEST(Beats, TheEndsOfASeriesAreNone) {
  EXPECT_TRUE(beats(times(4), {4, 3, 2, 1}, 0.1).empty());
  EXPECT_TRUE(beats(times(4), {1, 2, 3, 3}, 0.1).empty());
  EXPECT_TRUE(beats(times(4), {3, 3, 1, 2}, 0.1).empty());
  EXPECT_TRUE(beats(times(4), {1, 1, 1, 1}, 0.1).empty());
}

TEST(Beats, OfAPulsatingFlowComeWithItsPeriod) {
  const double period = 1.7;
  std::vector<double> time, energy;
  for (int i = 0; i < 2000; ++i) {
    const double t = 0.01 * i;
    time.push_back(t);
    energy.push_back(2.0 + std::sin(2.0 * std::numbers::pi * t / period) +
                     0.01 * std::sin(2.0 * std::numbers::pi * t / 0.037));
  }
  const auto found = beats(time, energy, 0.5);
  EXPECT_EQ(found.size(), 12u);  // 20 s hold eleven periods and their next maximum
  // Where the beat is steeper than the ripple, from asin(...) off its maximum on, no maximum can be; and one ripple.
  const double ripple = std::asin(0.01 / 0.037 * period) * period / (2.0 * std::numbers::pi) + 0.037;
  for (std::size_t i = 0; i < found.size(); ++i)
    EXPECT_NEAR(found[i].time, period * (0.25 + static_cast<double>(i)), ripple) << i;
}

TEST(DischargeDuration, IsTheTimeOfTheLastBallOrExtrapolated) {
  const std::vector<double> count{4, 9, 20, 24, 24};
  const Duration whole = discharge_duration(times(5), count, 20.0);
  EXPECT_FALSE(whole.is_extrapolated);
  EXPECT_NEAR(whole.seconds, 0.3, kRounding);
  const Duration part = discharge_duration(times(5), count, 100.0);
  EXPECT_TRUE(part.is_extrapolated);
  EXPECT_NEAR(part.seconds, 100.0 / 50.0, kRounding * 10.0);  // 20 balls in 0.4 s
  EXPECT_EQ(discharge_duration(times(2), {3, 3}, 10.0).seconds, kInfinity);
  EXPECT_THROW(discharge_duration(times(2), {3, 3}, 0.0), core::InputError);
}

TEST(BeverloosLaw, ByHand) {
  // Free width 1.4 - 1 = 0.4 m, to the power 5/2 by two roots of 0.16 and 4/10: 0.4^2.5 = 0.16 * sqrt(0.4).
  const Beverloo law{
      .outlet = 1.4, .ball = 0.5, .bulk_density = 700.0, .gravity = 9.0, .coefficient = 0.6, .empty_annulus = 2.0};
  EXPECT_NEAR(law.mass_rate(), 0.6 * 700.0 * 3.0 * 0.16 * std::sqrt(0.4), 1e-12 * 1000.0);  // rounding
  EXPECT_EQ((Beverloo{.outlet = 0.6, .ball = 0.5, .bulk_density = 700.0}).mass_rate(), 0.0);
  // Wide outlets: the rate grows as the outlet's width to 5/2.
  const Beverloo narrow{.outlet = 1e3, .ball = 1e-6, .bulk_density = 700.0},
      wide{.outlet = 4e3, .ball = 1e-6, .bulk_density = 700.0};
  EXPECT_NEAR(wide.mass_rate() / narrow.mass_rate(), 32.0, 1e-6);  // 2.5 k d / D = 3.5e-9 of 32
}

}  // namespace
}  // namespace grainclock::silo
