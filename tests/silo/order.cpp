#include "silo/order.hpp"

#include "core/check.hpp"
#include "tests/support/balls.hpp"
#include "tests/support/lattices.hpp"

#include <Eigen/Geometry>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;
using core::Vec3;
using tests::Lattice;

/// Whether ball i of a block of n^3 boxes lies at least two boxes within.
bool is_within(const Lattice& lattice, const State& state, int n, std::size_t i) {
  const Vec3 box = state.position[i].cwiseQuotient(lattice.edges) / (2.0 * state.radius[i]);
  return box.minCoeff() > 1.99 && box.maxCoeff() < n - 2.0;
}

TEST(Order, LatticesHaveTheirKnownBondOrderInAnyOrientation) {
  const Eigen::AngleAxisd turn(0.7, tests::oblique());
  for (const Lattice& lattice : {tests::simple_cubic(), tests::body_centred(), tests::face_centred(), tests::hexagonal()}) {
    const int n = 7;
    const State upright = tests::block(lattice, n, 0, 0.22);
    State turned = upright;
    for (Vec3& x : turned.position) x = turn * x;
    for (const State& state : {upright, turned}) {
      const BondOrder order = bond_order(state);
      int within = 0;
      for (std::size_t i = 0; i < state.size(); ++i) {
        if (!is_within(lattice, upright, n, i)) continue;
        EXPECT_NEAR(order.q6[i], lattice.q6, 1e-7) << i;  // digits of the known values
        ++within;
      }
      EXPECT_GE(within, 27);
    }
  }
}

TEST(Order, BallsWithinACrystalAreCrystalline) {
  for (const Lattice& lattice : {tests::body_centred(), tests::face_centred(), tests::hexagonal()}) {
    const int n = 7;
    const State state = tests::block(lattice, n, 0, 0.22);
    const BondOrder order = bond_order(state);
    for (std::size_t i = 0; i < state.size(); ++i) {
      if (is_within(lattice, state, n, i)) {
        EXPECT_TRUE(order.crystalline[i]) << i;
      }
    }
    const auto count = std::count(order.crystalline.begin(), order.crystalline.end(), 1);
    EXPECT_EQ(order.crystalline_share, static_cast<double>(count) / static_cast<double>(state.size()));
    EXPECT_LT(order.crystalline_share, 1.0);  // corners have too few bonds
  }
}

TEST(Order, SimpleCubicBallsHaveOnlySixBonds) {
  const State state = tests::block(tests::simple_cubic(), 7, 0, 0.22);
  EXPECT_EQ(bond_order(state).crystalline_share, 0.0);
  BondRule six;
  six.solid_bonds = 6;
  EXPECT_NEAR(bond_order(state, six).crystalline_share, std::pow(5.0 / 7.0, 3), 1e-15);  // rounding
}

TEST(Order, AllBondsOfASingleCrystalAddUp) {
  // As many bonds along each axis, so the bonds of the whole block are those of a ball within.
  const State state = tests::block(tests::simple_cubic(), 5, 0, 0.22);
  EXPECT_NEAR(bond_order(state).global_q6, std::sqrt(2.0) / 4.0, 1e-14);  // rounding
}

double p6(double c) { return std::legendre(6U, std::clamp(c, -1.0, 1.0)); }

/// Sum of P6 over the angles between bonds: by the addition theorem the product of sums of harmonics.
double product(const std::vector<Vec3>& bonds, const std::vector<Vec3>& others) {
  double sum = 0.0;
  for (const Vec3& u : bonds)
    for (const Vec3& v : others) sum += p6(u.dot(v));
  return sum;
}

TEST(Order, AgreesWithSumsOverPairsOfBonds) {
  tests::Random random(6);
  State state;
  // A disturbed crystal: some balls on either side of the criterion.
  const State crystal = tests::block(tests::face_centred(), 4, 0, 0.22);
  for (std::size_t i = 0; i < crystal.size(); ++i)
    state.add(crystal.id[i], i % 17 == 3 ? Kind::wall : Kind::content, crystal.position[i] + random.in_cube(0.06), Vec3::Zero(),
              0.22);
  std::vector<std::vector<Vec3>> bonds(state.size());
  std::vector<Vec3> all;
  const auto is_bonded = [&](std::size_t i, std::size_t j) {
    return i != j && state.kind[i] == Kind::content && state.kind[j] == Kind::content &&
           (state.position[i] - state.position[j]).norm() <= 1.3 * 0.44;
  };
  for (std::size_t i = 0; i < state.size(); ++i) {
    for (std::size_t j = 0; j < state.size(); ++j)
      if (is_bonded(i, j)) bonds[i].push_back((state.position[j] - state.position[i]).normalized());
    all.insert(all.end(), bonds[i].begin(), bonds[i].end());
  }
  const BondOrder order = bond_order(state);
  std::size_t crystalline = 0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (bonds[i].empty()) {
      EXPECT_TRUE(std::isnan(order.q6[i]));
      continue;
    }
    const double own = product(bonds[i], bonds[i]), n = static_cast<double>(bonds[i].size());
    EXPECT_NEAR(order.q6[i], std::sqrt(own) / n, 1e-13) << i;  // rounding of some hundred terms
    int solid = 0;
    for (std::size_t j = 0; j < state.size(); ++j)
      if (is_bonded(i, j) && product(bonds[i], bonds[j]) > 0.7 * std::sqrt(own * product(bonds[j], bonds[j]))) ++solid;
    EXPECT_EQ(order.crystalline[i], solid >= 7) << i;
    if (solid >= 7) ++crystalline;
  }
  EXPECT_GT(crystalline, 10U);
  EXPECT_LT(crystalline, state.size() - 30U);
  EXPECT_EQ(order.crystalline_share, static_cast<double>(crystalline) / static_cast<double>(state.count(Kind::content)));
  EXPECT_NEAR(order.global_q6, std::sqrt(product(all, all)) / static_cast<double>(all.size()), 1e-13);  // rounding
}

// n bonds in independent directions: the mean square of their common Q6 is 1/n, a chi-square sum of 13 squares each 1/(13
// n).
TEST(Order, RandomPointsAreDisordered) {
  tests::Random random(3);
  State state;
  for (int i = 0; i < 3000; ++i) state.add(i, Kind::content, random.in_cube(3.0), Vec3::Zero(), 0.22);
  const BondOrder order = bond_order(state);
  const double points_per_volume = 3000.0 / 216.0, reach = 1.3 * 0.44;
  const double bonds = 0.5 * 3000.0 * points_per_volume * 4.0 / 3.0 * std::numbers::pi * reach * reach * reach;
  EXPECT_LT(order.global_q6, 2.0 / std::sqrt(bonds));  // 4 times the mean square: a chance of 1e-6
  EXPECT_LT(order.crystalline_share, 0.003);           // seven bonds alike by chance
}

TEST(Order, BallsWithoutBondsHaveNone) {
  State state;
  EXPECT_TRUE(std::isnan(bond_order(state).global_q6));
  EXPECT_TRUE(std::isnan(bond_order(state).crystalline_share));
  state.add(0, Kind::content, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.2);
  state.add(1, Kind::wall, {0.0, 0.0, 0.4}, Vec3::Zero(), 0.2);
  state.add(2, Kind::content, {0.0, 0.0, 0.9}, Vec3::Zero(), 0.2);
  const BondOrder order = bond_order(state);
  EXPECT_TRUE(std::isnan(order.q6[0]) && std::isnan(order.q6[1]) && std::isnan(order.global_q6));
  EXPECT_EQ(order.crystalline_share, 0.0);
  BondRule rule;
  rule.reach = 0.0;
  EXPECT_THROW(bond_order(state, rule), core::InputError);
}

TEST(Layers, ABallCountsInTheShellOfItsDepth) {
  SiloShape shape;  // round, 5 m wide, hopper to 5 m
  State state;
  state.add(0, Kind::content, {0.0, 4.7, 10.0}, Vec3::Zero(), 0.22);   // 0.3 m deep
  state.add(1, Kind::content, {-4.5, 0.0, 10.0}, Vec3::Zero(), 0.22);  // 0.5 m: opens the second shell
  state.add(2, Kind::content, {0.0, 0.0, 10.0}, Vec3::Zero(), 0.22);   // deeper than asked
  state.add(3, Kind::content, {0.0, 4.7, 12.5}, Vec3::Zero(), 0.22);   // too high
  state.add(4, Kind::wall, {0.0, 4.8, 10.0}, Vec3::Zero(), 0.22);
  const auto density = centres_by_depth(state, shape, 8.0, 12.0, 1.0, 2);
  const double pi = std::numbers::pi;
  EXPECT_NEAR(density[0], 1.0 / (4.0 * pi * (25.0 - 4.5 * 4.5)), 1e-14);  // rounding
  EXPECT_NEAR(density[1], 1.0 / (4.0 * pi * (4.5 * 4.5 - 16.0)), 1e-14);
  shape.section = Section::square;
  EXPECT_NEAR(centres_by_depth(state, shape, 8.0, 12.0, 1.0, 2)[0], 1.0 / (4.0 * (100.0 - 81.0)), 1e-14);
}

// Points that fill the silo evenly, hopper included, give the same density at every depth.
TEST(Layers, EvenPointsHaveNoLayers) {
  tests::Random random(9);
  for (const Section section : {Section::round, Section::square}) {
    SiloShape shape;
    shape.section = section;
    State state;
    constexpr int kPoints = 40000;
    for (int i = 0; i < kPoints; ++i)
      state.add(i, Kind::content, Vec3(0.0, 0.0, 5.0) + random.in_cube(5.0), Vec3::Zero(), 0.1);
    const double expected = kPoints / 1000.0;  // 1/m3
    for (const double z0 : {0.0, 1.0, 6.0}) {
      const auto density = centres_by_depth(state, shape, z0, 10.0, 3.0, 6);
      const Meridian wall = meridian(shape);
      std::vector<int> count(6, 0);
      for (const Vec3& x : state.position) {
        const double depth = depth_inside(section, wall, x);
        if (x[2] >= z0 && depth >= 0.0 && depth < 3.0) ++count[static_cast<std::size_t>(depth / 0.5)];
      }
      for (std::size_t shell = 0; shell < 6; ++shell) {
        // Statistics: 5 standard deviations.
        EXPECT_NEAR(density[shell], expected, 5.0 * expected / std::sqrt(count[shell])) << shell;
      }
    }
  }
}

TEST(Layers, ImpossibleShellsAreRejected) {
  const SiloShape shape;
  EXPECT_THROW(centres_by_depth({}, shape, 2.0, 2.0, 1.0, 3), core::InputError);
  EXPECT_THROW(centres_by_depth({}, shape, -1.0, 2.0, 1.0, 3), core::InputError);
  EXPECT_THROW(centres_by_depth({}, shape, 1.0, 2.0, 0.0, 3), core::InputError);
  EXPECT_THROW(centres_by_depth({}, shape, 1.0, 2.0, 5.0, 3), core::InputError);
  EXPECT_THROW(centres_by_depth({}, shape, 1.0, 2.0, 1.0, 0), core::InputError);
}

}  // namespace
}  // namespace grainclock::silo
