#include "silo/wall_pressure.hpp"

#include "core/check.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace grainclock::silo {
namespace {

using core::Contact;
using core::Kind;
using core::State;

constexpr double kPi = std::numbers::pi;
using Pressure = std::function<double(double)>;

/// A load on the shaft of radius 5 m that shows a pressure [Pa] at an angle [rad].
WallLoad load_at(double angle, double z, double area, double pressure) {
  const Vec3 away(std::cos(angle), std::sin(angle), 0.0);
  return {0, 5.0 * away + Vec3(0.0, 0.0, z), angle, 5.0 * angle, 0.0, area, away, pressure * area * away};
}

/// A ring of n balls of uneven size at uneven angles.
std::vector<WallLoad> uneven_ring(int n, const Pressure& pressure, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  std::vector<WallLoad> loads;
  for (int i = 0; i < n; ++i) {
    const double angle = std::remainder(2.0 * kPi * (i + 0.8 * share(random)) / n, 2.0 * kPi);
    loads.push_back(load_at(angle, 10.5, 0.1 + 0.1 * share(random), pressure(angle)));
  }
  return loads;
}

/// The wall of a silo alone.
State wall_of(const SiloShape& shape) {
  State state;
  for (const FixedBall& ball : build_walls(shape, 1).wall)
    state.add(std::ssize(state.id), Kind::wall, ball.at, Vec3::Zero(), ball.radius);
  return state;
}

LayerModes modes_of(const std::vector<WallLoad>& loads, int highest) {
  return azimuthal_modes(loads, {10.0, 11.0, 1}, highest).at(0);
}

TEST(WallPressure, IsTheHorizontalForceOverTheCircumscribedSquare) {
  State state;
  state.add(0, Kind::content, {4.6, 0.0, 7.0}, Vec3::Zero(), 0.22);
  state.add(3, Kind::wall, {5.0, 0.0, 7.1}, Vec3::Zero(), 0.25);
  state.add(4, Kind::plug, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.25);
  state.add(5, Kind::wall, {0.0, 5.0, 8.0}, Vec3::Zero(), 0.2);
  const std::vector<Contact> contacts{{0, 3, Kind::wall, 0.0, 0.0, {-300.0, 100.0, 50.0}},
                                      {0, 3, Kind::wall, 0.0, 0.0, {0.0, 300.0, 900.0}},
                                      {0, 4, Kind::plug, 0.0, 0.0, {900.0, 0.0, 900.0}}};
  const auto loads = wall_loads(state, contacts, {});
  ASSERT_EQ(loads.size(), 2u);
  EXPECT_EQ(loads[0].id, 3);
  EXPECT_EQ(loads[0].force, Vec3(300.0, -400.0, -950.0));  // on the wall, not on the content
  EXPECT_DOUBLE_EQ(loads[0].pressure(), 500.0 / 0.25);     // 3-4-5 over (2 * 0.25)^2
  EXPECT_EQ(loads[1].id, 5);
  EXPECT_EQ(loads[1].pressure(), 0.0);
  EXPECT_THROW(wall_loads(state, {{0, 7, Kind::wall, 0.0, 0.0, Vec3::Zero()}}, {}), core::InputError);
}

TEST(WallPressure, PlacesOnTheUnfoldedRoundWall) {
  const SiloShape shape;  // hopper from (1, 0) to (5, 5), shaft to 25 m
  State state;
  state.add(0, Kind::wall, {0.0, 5.0, 12.0}, Vec3::Zero(), 0.22);
  state.add(1, Kind::wall, {-3.0, 0.0, 2.5}, Vec3::Zero(), 0.22);                      // the middle of the hopper
  state.add(2, Kind::wall, {0.0, -1.0, 0.0}, Vec3::Zero(), 0.22);                      // the outlet's edge
  state.add(3, Kind::wall, Vec3(3.0 + 0.5, 0.0, 2.5 - 0.4), Vec3::Zero(), 0.22);  // moved along the normal (5, -4)
  const auto loads = wall_loads(state, {}, shape);
  const double slant = std::sqrt(41.0), cosine = 5.0 / slant, sine = 4.0 / slant;
  // Rounding.
  EXPECT_NEAR(loads[0].angle, 0.5 * kPi, 1e-14);
  EXPECT_NEAR(loads[0].around, 2.5 * kPi, 1e-14);
  EXPECT_NEAR(loads[0].along, slant + 7.0, 1e-14);
  EXPECT_NEAR((loads[0].normal - Vec3(0.0, 1.0, 0.0)).norm(), 0.0, 1e-14);
  EXPECT_NEAR(std::abs(loads[1].around), 3.0 * kPi, 1e-14);
  EXPECT_NEAR(loads[1].along, 0.5 * slant, 1e-14);
  EXPECT_NEAR((loads[1].normal - Vec3(-cosine, 0.0, -sine)).norm(), 0.0, 1e-14);
  EXPECT_NEAR(loads[2].along, 0.0, 1e-14);
  EXPECT_NEAR(loads[2].around, -0.5 * kPi, 1e-14);
  EXPECT_NEAR(loads[3].along, 0.5 * slant, 1e-14);
}

TEST(WallPressure, BuiltWallsStandInEvenRowsAlongTheMeridian) {
  for (const Section section : {Section::round, Section::square}) {
    for (const Surface surface : {Surface::centres, Surface::inner}) {
      SiloShape shape;
      shape.section = section;
      shape.surface = surface;
      const double length = meridian(shape).length();
      double previous = 0.0;
      int rows = 1;
      for (const WallLoad& load : wall_loads(wall_of(shape), {}, shape)) {
        if (load.along > previous + 0.5 * shape.mean_radius()) ++rows;
        EXPECT_GE(load.along, previous - 2.0 * shape.mean_radius());  // of the same ring, or of the next
        previous = load.along;
      }
      EXPECT_NEAR(previous, length, 2.0 * shape.mean_radius());  // the ends of an inner surface's balls are up to a radius away
      // Coverage 0.98, spacing in a ring at most 0.99 balls: rings 1/(0.98 * 0.99) balls apart, and more by a ring that stands on
      // the edge with half of its balls beyond, and by one that no longer fits.
      EXPECT_NEAR(length / (rows - 1) / (2.0 * shape.mean_radius()), 1.031, 2.0 * 1.031 / rows);
    }
  }
}

TEST(WallPressure, SquareWallUnfoldsAlongItsPerimeter) {
  SiloShape shape;
  shape.section = Section::square;
  shape.half_width = 4.0;
  // Once around from -x to -x, in steps of 0.1 m and off the corners.
  const auto corner_path = [](double s) -> Vec3 {  // s from -16 to 16 m, 0 at +x
    if (s < -12.0) return {-4.0, -(s + 16.0), 12.0};
    if (s < -4.0) return {s + 8.0, -4.0, 12.0};
    if (s < 4.0) return {4.0, s, 12.0};
    if (s < 12.0) return {8.0 - s, 4.0, 12.0};
    return {-4.0, 16.0 - s, 12.0};
  };
  State state;
  std::vector<double> expected;
  for (double s = -15.95; s < 16.0; s += 0.1) {
    expected.push_back(s);
    state.add(std::ssize(state.id), Kind::wall, corner_path(s), Vec3::Zero(), 0.2);
  }
  const auto loads = wall_loads(state, {}, shape);
  for (std::size_t i = 0; i < loads.size(); ++i) {
    EXPECT_NEAR(loads[i].around, expected[i], 1e-12);  // rounding
    EXPECT_NEAR(loads[i].normal.head<2>().dot(loads[i].position.head<2>()), 4.0, 1e-12);
  }
}

TEST(WallPressure, MeanByLayerIsTheForceOverTheArea) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  State state;
  std::vector<Contact> contacts;
  state.add(0, Kind::content, Vec3::Zero(), Vec3::Zero(), 0.2);
  for (int i = 1; i <= 500; ++i) {
    const double angle = kPi * number(random);
    const Vec3 at(5.0 * std::cos(angle), 5.0 * std::sin(angle), 10.0 + 6.0 * number(random));
    state.add(i, Kind::wall, at, Vec3::Zero(), 0.2 + 0.05 * number(random));
    for (int k = 0; k < 3; ++k)
      contacts.push_back({0, i, Kind::wall, 0.0, 0.0, 1e4 * Vec3(number(random), number(random), number(random))});
  }
  const Layers layers{5.0, 15.0, 7};
  const auto pressure = pressure_by_layer(wall_loads(state, contacts, {}), layers);
  const auto force = wall_force_by_layer(state, contacts, layers), area = wall_area_by_layer(state, layers);
  for (std::size_t k = 0; k < pressure.size(); ++k)
    EXPECT_NEAR(pressure[k] * area[k] / force[k], 1.0, 1e-13);  // rounding of some hundred terms
}

TEST(WallPressure, CloserBallsShareTheWall) {
  for (const auto& [coverage, share] : {std::pair{0.98, 0.98}, std::pair{4.0, 1.0}}) {
    SiloShape shape;
    shape.coverage = coverage;
    double sum = 0.0;
    for (const WallLoad& load : wall_loads(wall_of(shape), {}, shape)) sum += load.area;
    // Squares differ by 2.6 %, so their sum over thousands by less than 0.05 %; numbers of balls are whole.
    EXPECT_NEAR(sum / area(shape.section, meridian(shape)), share, 1e-3);
  }
}

TEST(WallPressure, LayersWithoutWallBallsAreUnknown) {
  const std::vector<WallLoad> loads{load_at(0.0, 10.0, 0.2, 700.0), load_at(1.0, 13.0, 0.2, 0.0), load_at(1.0, 13.1, 0.2, 5.0)};
  const auto pressure = pressure_by_layer(loads, {10.0, 13.0, 3});
  EXPECT_DOUBLE_EQ(pressure[0], 700.0);
  EXPECT_TRUE(std::isnan(pressure[1]));
  EXPECT_EQ(pressure[2], 0.0);  // holds the last edge, not what is above; nothing presses
  EXPECT_TRUE(std::isnan(pressure_by_layer({}, {10.0, 13.0, 1})[0]));
  EXPECT_THROW(pressure_by_layer(loads, {13.0, 13.0, 1}), core::InputError);
  EXPECT_THROW(pressure_by_layer(loads, {10.0, 13.0, 0}), core::InputError);
  EXPECT_THROW(mean_by_layer(loads, std::vector<double>{1.0}, {10.0, 13.0, 1}), core::InputError);
}

TEST(WallPressure, UniformPressureIsModeZeroOnlyOnAnUnevenRing) {
  const LayerModes modes = modes_of(uneven_ring(60, [](double) { return 3e4; }), 4);
  // Rounding of 60 terms.
  EXPECT_NEAR(modes.mean, 3e4, 1e-9);
  ASSERT_EQ(modes.mode.size(), 4u);
  for (const Mode& mode : modes.mode) EXPECT_NEAR(mode.amplitude, 0.0, 1e-13);
  EXPECT_NEAR(modes.scatter, 0.0, 1e-13);
}

TEST(WallPressure, CosinesHaveTheirAmplitudeAndCrest) {
  const auto waves = [](double angle) { return 2e4 * (1.0 + 0.3 * std::cos(angle - 2.1) + 0.1 * std::cos(3.0 * (angle + 0.9))); };
  const LayerModes modes = modes_of(uneven_ring(40, waves), 3);
  // Rounding of 40 terms.
  EXPECT_NEAR(modes.mean, 2e4, 1e-9);
  EXPECT_NEAR(modes.mode[0].amplitude, 0.3, 1e-13);
  EXPECT_NEAR(modes.mode[0].crest, 2.1, 1e-12);
  EXPECT_NEAR(modes.mode[1].amplitude, 0.0, 1e-13);
  EXPECT_NEAR(modes.mode[2].amplitude, 0.1, 1e-13);
  EXPECT_NEAR(modes.mode[2].crest, -0.9, 1e-12);
}

TEST(WallPressure, EvenRingsHaveTheModesOfFourierSums) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  const int n = 37;
  std::vector<WallLoad> loads;
  double mean = 0.0, c = 0.0, s = 0.0;
  for (int i = 0; i < n; ++i) {
    const double angle = 2.0 * kPi * i / n, pressure = 1e4 * share(random);
    loads.push_back(load_at(angle, 10.5, 0.2, pressure));
    mean += pressure / n;
    c += 2.0 * pressure * std::cos(2.0 * angle) / n;
    s += 2.0 * pressure * std::sin(2.0 * angle) / n;
  }
  const LayerModes modes = modes_of(loads, 3);
  // Rounding of 37 terms.
  EXPECT_NEAR(modes.mean / mean, 1.0, 1e-13);
  EXPECT_NEAR(modes.mode[1].amplitude, std::hypot(c, s) / mean, 1e-13);
  EXPECT_NEAR(modes.mode[1].crest, 0.5 * std::atan2(s, c), 1e-12);
}

TEST(WallPressure, ScatterIsTheAmplitudeThatIndependentBallsShow) {
  double squares = 0.0, predicted = 0.0;
  std::mt19937 random(5);
  std::exponential_distribution<double> spotty(1.0 / 1e4);
  const int rings = 400;
  for (int ring = 0; ring < rings; ++ring) {
    const LayerModes modes = modes_of(uneven_ring(70, [&](double) { return spotty(random); }, static_cast<unsigned>(ring)), 2);
    for (const Mode& mode : modes.mode) squares += mode.amplitude * mode.amplitude / 2.0;
    predicted += modes.scatter * modes.scatter;
  }
  // Each of 800 squared amplitudes is about exponential: relative error 1/sqrt(800) = 3.5 %; three of these, and 3 % for the
  // uneven angles and the division by each ring's own mean.
  EXPECT_NEAR(squares / predicted, 1.0, 0.14);
}

TEST(WallPressure, ModesAreUnknownWhereTheyCannotBeTold) {
  const LayerModes unloaded = modes_of(uneven_ring(20, [](double) { return 0.0; }), 2);
  EXPECT_EQ(unloaded.mean, 0.0);
  EXPECT_TRUE(std::isnan(unloaded.mode[1].amplitude));
  EXPECT_TRUE(std::isnan(unloaded.mode[1].crest));
  EXPECT_TRUE(std::isnan(unloaded.scatter));
  const LayerModes few = modes_of(uneven_ring(5, [](double) { return 1.0; }), 2);  // five unknowns
  EXPECT_TRUE(std::isnan(few.mean));
  ASSERT_EQ(few.mode.size(), 2u);
  EXPECT_TRUE(std::isnan(few.mode[0].crest));
  std::vector<WallLoad> stacked;
  for (int i = 0; i < 9; ++i) stacked.push_back(load_at(i % 2, 10.1 + 0.1 * i, 0.2, 1.0));  // two angles
  EXPECT_TRUE(std::isnan(modes_of(stacked, 1).mean));
  EXPECT_TRUE(std::isnan(modes_of({}, 1).mean));
  EXPECT_NEAR(modes_of(stacked, 0).mean, 1.0, 1e-14);  // rounding
  EXPECT_THROW(modes_of(stacked, -1), core::InputError);
}

TEST(WallPressure, LateralResultantIsTheSumOfForcesAndTheirMoments) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> number(-1.0, 1.0);
  std::vector<WallLoad> loads;
  Vec3 force = Vec3::Zero(), moment = Vec3::Zero();
  for (int i = 0; i < 50; ++i) {
    WallLoad load = load_at(kPi * number(random), 10.0 * number(random), 0.2, 0.0);
    load.force = 1e3 * Vec3(number(random), number(random), number(random));
    force += load.force;
    moment += load.position.cross(load.force);
    loads.push_back(load);
  }
  const LateralResultant sum = lateral_resultant(loads);
  // Rounding of 50 terms of up to 1e4.
  EXPECT_NEAR((sum.force - force.head<2>()).norm(), 0.0, 1e-9);
  EXPECT_NEAR((sum.moment_of_horizontal + sum.moment_of_vertical - moment.head<2>()).norm(), 0.0, 1e-9);
  WallLoad one = load_at(0.0, 8.0, 0.2, 0.0);
  one.force = {10.0, 2.0, -3.0};
  const LateralResultant single = lateral_resultant(std::vector<WallLoad>{one});
  EXPECT_EQ(single.moment_of_horizontal, Eigen::Vector2d(-16.0, 80.0));
  EXPECT_EQ(single.moment_of_vertical, Eigen::Vector2d(0.0, 15.0));  // about y: -x F_z
}

TEST(WallPressure, CosinePressureGivesTheResultantOfItsFirstMode) {
  std::vector<WallLoad> loads;
  const int n = 64;
  for (int i = 0; i < n; ++i) {
    const double angle = 2.0 * kPi * i / n;
    loads.push_back(load_at(angle, 10.5, 0.2, 2e4 * (1.0 + 0.25 * std::cos(angle - 0.7) + 0.1 * std::cos(2.0 * angle))));
  }
  const LateralResultant sum = lateral_resultant(loads);
  const double expected = 0.5 * 0.25 * 2e4 * n * 0.2;  // half amplitude times mean pressure times area
  EXPECT_NEAR(sum.force.norm() / expected, 1.0, 1e-13);  // rounding of 64 terms
  EXPECT_NEAR(std::atan2(sum.force[1], sum.force[0]), 0.7, 1e-13);
}

}  // namespace
}  // namespace grainclock::silo
