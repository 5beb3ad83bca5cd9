#include "silo/measures.hpp"

#include "core/check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <numeric>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;

double ball_volume(double r) { return 4.0 / 3.0 * std::numbers::pi * r * r * r; }

double inside_area(const SiloShape& shape) {
  const double r = shape.half_width - shape.mean_radius();
  return std::numbers::pi * r * r;
}

TEST(Measures, BallWithinOneLayerCountsThere) {
  const SiloShape shape;
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 10.5}, Vec3::Zero(), 0.22);
  state.add(1, Kind::wall, {5.0, 0.0, 10.5}, Vec3::Zero(), 0.22);
  const auto packing = packing_by_layer(state, shape, {10.0, 12.0, 2});
  EXPECT_NEAR(packing[0], ball_volume(0.22) / inside_area(shape), 1e-15);  // rounding
  EXPECT_EQ(packing[1], 0.0);
}

TEST(Measures, BallAcrossLayersIsCutAtTheirEdges) {
  const SiloShape shape;
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 11.0}, Vec3::Zero(), 0.22);   // in halves
  state.add(1, Kind::content, {0.0, 0.0, 10.11}, Vec3::Zero(), 0.22);  // a quarter of its height is below z0
  const auto packing = packing_by_layer(state, shape, {10.0, 12.0, 2});
  const double cap = 5.0 / 32.0;  // share of a ball's volume in a cap of a quarter of its height
  // Rounding.
  EXPECT_NEAR(packing[0] * inside_area(shape), (0.5 + 1.0 - cap) * ball_volume(0.22), 1e-14);
  EXPECT_NEAR(packing[1] * inside_area(shape), 0.5 * ball_volume(0.22), 1e-14);
}

TEST(Measures, PackingKeepsTheVolumeForAnyNumberOfLayers) {
  const SiloShape shape;
  State state;
  for (int i = 0; i < 50; ++i) state.add(i, Kind::content, {0.0, 0.0, 6.0 + 0.37 * i}, Vec3::Zero(), 0.215 + 0.0002 * i);
  double volume = 0.0;
  for (const double r : state.radius) volume += ball_volume(r);
  for (const int n : {1, 2, 7, 40, 500}) {
    const auto packing = packing_by_layer(state, shape, {5.5, 24.9, n});
    const double found = std::accumulate(packing.begin(), packing.end(), 0.0) * inside_area(shape) * 19.4 / n;
    EXPECT_NEAR(found / volume, 1.0, 1e-12) << n;  // rounding of some hundred terms
  }
}

TEST(Measures, WallForceIsTheHorizontalPartOfEachWallBallsTotal) {
  State state;
  state.add(0, Kind::content, {4.6, 0.0, 7.0}, Vec3::Zero(), 0.22);
  state.add(1, Kind::content, {4.6, 0.0, 7.3}, Vec3::Zero(), 0.22);
  state.add(2, Kind::wall, {5.0, 0.0, 7.1}, Vec3::Zero(), 0.22);
  state.add(3, Kind::wall, {-5.0, 0.0, 8.0}, Vec3::Zero(), 0.22);
  state.add(4, Kind::wall, {0.0, 5.0, 9.0}, Vec3::Zero(), 0.22);
  state.add(5, Kind::plug, {0.0, 0.0, 7.0}, Vec3::Zero(), 0.22);
  state.add(6, Kind::wall, {0.0, 5.0, 9.5}, Vec3::Zero(), 0.22);
  const auto contact = [](core::BallId i, core::BallId j, Kind other, const Vec3& force) {
    return core::Contact{i, j, other, 1e-3, 0.0, force};
  };
  const std::vector<core::Contact> contacts{
      contact(0, 2, Kind::wall, {-300.0, 100.0, 50.0}), contact(1, 2, Kind::wall, {0.0, 300.0, -70.0}),
      contact(0, 3, Kind::wall, {0.0, 10.0, 5.0}),      contact(0, 4, Kind::wall, {-1.0, 0.0, 0.0}),
      contact(0, 5, Kind::plug, {900.0, 0.0, 900.0}),   contact(0, 1, Kind::content, {800.0, 0.0, 0.0}),
      contact(0, 6, Kind::wall, {77.0, 0.0, 0.0})};
  const auto force = wall_force_by_layer(state, contacts, {7.0, 9.0, 2});
  EXPECT_DOUBLE_EQ(force[0], 500.0);  // 3-4-5 of the sum, not 316 + 300 of the parts
  EXPECT_DOUBLE_EQ(force[1], 11.0);   // 8.0 opens the second layer, 9.0 closes it; 9.5 is outside
}

TEST(Measures, ContactOfAnUnknownWallBallIsRejected) {
  State state;
  state.add(0, Kind::wall, Vec3::Zero(), Vec3::Zero(), 0.2);
  const std::vector<core::Contact> contacts{{7, 5, Kind::wall, 0.0, 0.0, Vec3::Zero()}};
  EXPECT_THROW(wall_force_by_layer(state, contacts, {0.0, 1.0, 1}), core::InputError);
}

TEST(Measures, WallAreaIsTheSquareAroundEachWallBall) {
  State state;
  state.add(0, Kind::wall, {5.0, 0.0, 7.1}, Vec3::Zero(), 0.5);
  state.add(1, Kind::wall, {5.0, 1.0, 7.9}, Vec3::Zero(), 1.0);
  state.add(2, Kind::wall, {5.0, 0.0, 9.0}, Vec3::Zero(), 0.25);  // closes the last layer
  state.add(3, Kind::wall, {5.0, 0.0, 9.1}, Vec3::Zero(), 3.0);   // outside
  state.add(4, Kind::content, {0.0, 0.0, 7.5}, Vec3::Zero(), 3.0);
  state.add(5, Kind::plug, {0.0, 0.0, 7.5}, Vec3::Zero(), 3.0);
  EXPECT_EQ(wall_area_by_layer(state, {7.0, 9.0, 2}), (std::vector<double>{5.0, 0.25}));
}

TEST(Measures, WholeLayersStandAtMultiplesOfTheirHeight) {
  State state;
  EXPECT_FALSE(whole_layers(state, 1.0));
  state.add(0, Kind::wall, {5.0, 0.0, -0.1}, Vec3::Zero(), 0.2);
  state.add(1, Kind::wall, {5.0, 0.0, 3.5}, Vec3::Zero(), 0.2);
  state.add(2, Kind::content, {0.0, 0.0, 99.0}, Vec3::Zero(), 0.2);
  const auto layers = whole_layers(state, 0.5);
  ASSERT_TRUE(layers);
  EXPECT_EQ(layers->z0, -0.5);
  EXPECT_EQ(layers->z1, 3.5);  // the last layer holds its upper edge
  EXPECT_EQ(layers->n, 8);
  EXPECT_THROW(whole_layers(state, 0.0), core::InputError);
  EXPECT_THROW(whole_layers(state, 1e-9), core::InputError);
}

TEST(Measures, ARingOfWallIsOneLayer) {
  State state;
  state.add(0, Kind::wall, {5.0, 0.0, 2.0}, Vec3::Zero(), 0.2);
  const auto layers = whole_layers(state, 1.0);
  ASSERT_TRUE(layers);
  EXPECT_EQ(layers->n, 1);
  EXPECT_EQ(wall_area_by_layer(state, *layers).size(), 1u);
}

TEST(Measures, ImpossibleLayersAreRejected) {
  EXPECT_THROW(packing_by_layer({}, {}, {0.0, 1.0, 0}), core::InputError);
  EXPECT_THROW(packing_by_layer({}, {}, {1.0, 1.0, 3}), core::InputError);
  EXPECT_THROW(wall_force_by_layer({}, {}, {2.0, 1.0, 3}), core::InputError);
}

TEST(Measures, CountAboveCountsContentOnly) {
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 1.0}, Vec3::Zero(), 0.2);
  state.add(1, Kind::content, {0.0, 0.0, 2.0}, Vec3::Zero(), 0.2);
  state.add(2, Kind::wall, {0.0, 0.0, 3.0}, Vec3::Zero(), 0.2);
  EXPECT_EQ(count_above(state, 0.5), 2);
  EXPECT_EQ(count_above(state, 1.0), 1);
  EXPECT_EQ(count_above(state, 2.0), 0);
}

}  // namespace
}  // namespace grainclock::silo
