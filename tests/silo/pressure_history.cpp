#include "silo/pressure_history.hpp"

#include "core/check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace grainclock::silo {
namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Rest until 2 s, then a hammer; the third place has no wall, the fourth is above the heap.
PressureSeries hammer() {
  return {{0.0, 1.0, 2.0, 3.0, 4.0, 5.0},
          {{90.0, 40.0, kNaN, 0.0},
           {100.0, 60.0, kNaN, 0.0},
           {110.0, 50.0, kNaN, 0.0},
           {300.0, 20.0, kNaN, 0.0},
           {200.0, 450.0, kNaN, 1.0},
           {50.0, 100.0, kNaN, 0.0}}};
}

TEST(PressureHistory, StaticIsTheMeanOverTheWindowOfRest) {
  const auto mean = static_pressure(hammer(), {0.0, 2.0});
  EXPECT_EQ(mean[0], 100.0);
  EXPECT_EQ(mean[1], 50.0);
  EXPECT_TRUE(std::isnan(mean[2]));
  EXPECT_EQ(mean[3], 0.0);
  EXPECT_EQ(static_pressure(hammer(), {0.9, 1.1})[1], 60.0);
}

TEST(PressureHistory, ExtremesAndTheirRatiosByPlace) {
  const auto extremes = dynamic_extremes(hammer(), {0.0, 2.0}, {2.5, 5.0}, 10.0);
  EXPECT_EQ(extremes[0].at_rest, 100.0);
  EXPECT_EQ(extremes[0].lowest, 50.0);
  EXPECT_EQ(extremes[0].time_of_lowest, 5.0);
  EXPECT_EQ(extremes[0].highest, 300.0);
  EXPECT_EQ(extremes[0].time_of_highest, 3.0);
  EXPECT_EQ(extremes[0].smallest_ratio, 0.5);
  EXPECT_EQ(extremes[0].largest_ratio, 3.0);
  EXPECT_EQ(extremes[1].largest_ratio, 9.0);
  EXPECT_EQ(extremes[1].smallest_ratio, 0.4);
  EXPECT_TRUE(std::isnan(extremes[2].highest));
  EXPECT_TRUE(std::isnan(extremes[2].largest_ratio));
  EXPECT_EQ(extremes[3].highest, 1.0);
  EXPECT_TRUE(std::isnan(extremes[3].largest_ratio));  // nothing pressed at rest
  EXPECT_TRUE(std::isnan(dynamic_extremes(hammer(), {0.0, 2.0}, {2.5, 5.0}, 50.0)[1].largest_ratio));  // not above the floor
}

TEST(PressureHistory, PeakHasItsPlaceAndTime) {
  const auto highest = peak(hammer(), {0.0, 5.0});
  ASSERT_TRUE(highest);
  EXPECT_EQ(highest->pressure, 450.0);
  EXPECT_EQ(highest->time, 4.0);
  EXPECT_EQ(highest->place, 1u);
  EXPECT_EQ(peak(hammer(), {0.0, 3.0})->place, 0u);
  EXPECT_FALSE(peak({{0.0}, {{kNaN, kNaN}}}, {0.0, 1.0}));
  EXPECT_EQ(peak({{0.0, 1.0}, {{7.0}, {7.0}}}, {0.0, 1.0})->time, 0.0);  // the earliest of equals
}

TEST(PressureHistory, PatchIsTheMeanOverItsWallBalls) {
  const auto ball = [](double angle, double z, double area, const Vec3& force) {
    return WallLoad{0, {5.0 * std::cos(angle), 5.0 * std::sin(angle), z}, angle, 0.0, 0.0, area, Vec3::UnitX(), force};
  };
  const double pi = std::numbers::pi;
  const std::vector<WallLoad> loads{ball(pi - 0.05, 5.0, 0.2, {30.0, 40.0, 7.0}), ball(-pi + 0.05, 5.5, 0.3, {0.0, 100.0, 0.0}),
                                    ball(pi - 0.05, 5.6, 0.2, {1e6, 0.0, 0.0}),   ball(pi - 0.2, 5.0, 0.2, {1e6, 0.0, 0.0}),
                                    ball(0.0, 5.0, 0.2, {1e6, 0.0, 0.0})};
  // Across the angle's jump from pi to -pi.
  EXPECT_DOUBLE_EQ(patch_pressure(loads, {pi, 5.0, 0.1, 0.5}), 150.0 / 0.5);
  EXPECT_DOUBLE_EQ(patch_pressure(loads, {-pi, 5.0, 0.1, 0.5}), 150.0 / 0.5);
  EXPECT_DOUBLE_EQ(patch_pressure(loads, {pi - 0.05, 5.0, 0.01, 0.1}), 50.0 / 0.2);
  EXPECT_TRUE(std::isnan(patch_pressure(loads, {1.0, 5.0, 0.1, 0.5})));
}

TEST(PressureHistory, OverpressureLastsBetweenItsCrossings) {
  // Level 110: up through it at 1.1, down at 2.8, again from 4.5 to 4.75 by straight lines.
  const std::vector<double> time{0.0, 1.0, 2.0, 3.0, 4.0, 5.0}, pressure{100.0, 100.0, 200.0, 87.5, 90.0, 130.0};
  const Overpressure found = overpressure(time, pressure, 100.0, 0.1, {0.0, 5.0});
  // Rounding.
  EXPECT_NEAR(found.level, 110.0, 1e-12);
  EXPECT_EQ(found.highest, 2.0);
  EXPECT_EQ(found.time_of_highest, 2.0);
  EXPECT_NEAR(found.begin, 1.1, 1e-12);
  EXPECT_EQ(found.end, 5.0);  // still above at the end
  EXPECT_NEAR(found.longest, 1.7, 1e-12);
  EXPECT_NEAR(found.total, 1.7 + 0.5, 1e-12);
  const Overpressure part = overpressure(time, pressure, 100.0, 0.1, {1.5, 4.2});
  EXPECT_EQ(part.begin, 2.0);  // from the first sample
  EXPECT_NEAR(part.end, 2.8, 1e-12);
}

TEST(PressureHistory, OneSampleBelowTheLevelBreaksTheOverpressure) {
  const std::vector<double> time{0.0, 1.0, 2.0, 3.0, 4.0}, pressure{130.0, 130.0, 90.0, 130.0, 130.0};
  const Overpressure found = overpressure(time, pressure, 100.0, 0.1, {0.0, 4.0});
  EXPECT_NEAR(found.longest, 1.5, 1e-12);  // rounding of the level
  EXPECT_NEAR(found.total, 3.0, 1e-12);
}

TEST(PressureHistory, TriangularPulseLastsAsItsWidthAtTheLevel) {
  std::vector<double> time, pressure;
  for (int i = 0; i <= 1000; ++i) {
    time.push_back(0.001 * i);
    pressure.push_back(100.0 + std::max(0.0, 80.0 * (1.0 - std::abs(time.back() - 0.4) / 0.2)));
  }
  const Overpressure found = overpressure(time, pressure, 100.0, 0.2, {0.0, 1.0});
  // A quarter of the height: three quarters of the base of 0.4 s. Rounding.
  EXPECT_NEAR(found.total, 0.3, 1e-12);
  EXPECT_NEAR(found.longest, 0.3, 1e-12);
  EXPECT_NEAR(found.begin, 0.25, 1e-12);
  EXPECT_NEAR(found.end, 0.55, 1e-12);
  EXPECT_NEAR(found.highest, 1.8, 1e-12);
}

TEST(PressureHistory, WithoutOverpressureNothingLasts) {
  const std::vector<double> time{0.0, 1.0, 2.0}, pressure{100.0, 110.0, 100.0};
  const Overpressure found = overpressure(time, pressure, 100.0, 0.1 + 1e-12, {0.0, 2.0});
  EXPECT_EQ(found.total, 0.0);
  EXPECT_EQ(found.longest, 0.0);
  EXPECT_TRUE(std::isnan(found.begin));
  EXPECT_TRUE(std::isnan(found.end));
  EXPECT_DOUBLE_EQ(found.highest, 1.1);
}

TEST(PressureHistory, ImpossibleSeriesAreRejected) {
  EXPECT_THROW(static_pressure(hammer(), {2.1, 2.9}), core::InputError);
  EXPECT_THROW(static_pressure({}, {0.0, 1.0}), core::InputError);
  EXPECT_THROW(static_pressure({{0.0, 1.0}, {{1.0}}}, {0.0, 1.0}), core::InputError);
  EXPECT_THROW(static_pressure({{0.0, 1.0}, {{1.0}, {1.0, 2.0}}}, {0.0, 1.0}), core::InputError);
  EXPECT_THROW(peak({{1.0, 1.0}, {{1.0}, {1.0}}}, {0.0, 1.0}), core::InputError);
  EXPECT_THROW(dynamic_extremes(hammer(), {0.0, 2.0}, {2.5, 5.0}, -1.0), core::InputError);
  const std::vector<double> time{0.0, 1.0}, pressure{100.0, kNaN}, good{1.0, 2.0};
  EXPECT_THROW(overpressure(time, pressure, 100.0, 0.1, {0.0, 1.0}), core::InputError);
  EXPECT_THROW(overpressure(time, good, 0.0, 0.1, {0.0, 1.0}), core::InputError);
  EXPECT_THROW(overpressure(time, good, 1.0, -0.1, {0.0, 1.0}), core::InputError);
  EXPECT_THROW(overpressure(time, good, 1.0, 0.1, {0.0, 0.5}), core::InputError);
  EXPECT_THROW(overpressure(time, std::vector<double>{1.0}, 1.0, 0.1, {0.0, 1.0}), core::InputError);
}

}  // namespace
}  // namespace grainclock::silo
