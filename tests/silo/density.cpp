#include "silo/density.hpp"

#include "core/check.hpp"
#include "tests/support/balls.hpp"
#include "tests/support/lattices.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;
using core::Vec3;
using tests::Lattice;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
// voro++ joins corners within about 1e-11 of the cell's size, so a cell's volume is exact to a few times that.
constexpr double kCellRounding = 1e-9;

double ball_volume(double r) { return 4.0 / 3.0 * std::numbers::pi * r * r * r; }

std::size_t with_cell(const std::vector<double>& cells) {
  return static_cast<std::size_t>(std::count_if(cells.begin(), cells.end(), [](double cell) { return !std::isnan(cell); }));
}

TEST(Density, LatticesBetweenFixedBallsHaveTheirPackingFractions) {
  for (const Lattice& lattice : {tests::simple_cubic(), tests::body_centred(), tests::face_centred(), tests::hexagonal()}) {
    const State state = tests::block(lattice, 6, 1, 0.22);
    const std::vector<double> cells = cell_volumes(state);
    EXPECT_EQ(with_cell(cells), state.count(Kind::content));
    for (std::size_t i = 0; i < state.size(); ++i) {
      EXPECT_EQ(std::isnan(cells[i]), state.kind[i] != Kind::content) << i;
      if (state.kind[i] == Kind::content) {
        EXPECT_NEAR(ball_volume(0.22) / cells[i], lattice.density, kCellRounding) << i;
      }
    }
    EXPECT_NEAR(mean_density(state, cells), lattice.density, kCellRounding);
    for (const std::size_t neighbours : {0, 1, 12, 100000}) {
      const auto peak = densest(state, local_density(state, cells, neighbours), lattice.density);
      ASSERT_TRUE(peak);
      EXPECT_NEAR(peak->density, lattice.density, kCellRounding) << neighbours;
      EXPECT_NEAR(peak->excess, 0.0, 2.0 * kCellRounding) << neighbours;
    }
  }
}

TEST(Density, CellsOpenToTheOutsideDoNotCount) {
  const State state = tests::block(tests::simple_cubic(), 6, 0, 0.22);  // all content
  const std::vector<double> cells = cell_volumes(state);
  EXPECT_EQ(with_cell(cells), 64U);  // 4 x 4 x 4 within
  EXPECT_NEAR(mean_density(state, cells), std::numbers::pi / 6.0, kCellRounding);
}

TEST(Density, FreeSurfaceAndBallsInFlightDoNotCount) {
  State state = tests::block(tests::simple_cubic(), 6, 1, 0.22);
  const double d = 0.44;
  for (std::size_t i = 0; i < state.size(); ++i)  // no lid: its balls are far up
    if (state.position[i][2] > 4.5 * d) state.position[i][2] += 100.0;
  state.add(1000, Kind::content, {2.5 * d, 2.5 * d, 50.0}, Vec3::Zero(), 0.22);
  const std::vector<double> cells = cell_volumes(state);
  for (std::size_t i = 0; i < state.size(); ++i) {
    const bool covered = state.kind[i] == Kind::content && state.position[i][2] < 3.5 * d;
    EXPECT_EQ(std::isnan(cells[i]), !covered) << i;
  }
}

TEST(Density, PlugBallsOwnNoCells) {
  State state = tests::block(tests::simple_cubic(), 6, 1, 0.22);
  const std::vector<double> without = cell_volumes(state);
  state.add(1000, Kind::plug, state.position[100] + Vec3(0.1, 0.0, 0.0), Vec3::Zero(), 0.22);
  std::vector<double> with = cell_volumes(state);
  EXPECT_TRUE(std::isnan(with.back()));
  with.pop_back();
  EXPECT_TRUE(tests::same_bits(with, without));
}

// In a simple cubic lattice of which one ball is missing, a ball of the same size just fits.
TEST(Density, AHoleIsSharedOutUnlessItIsTooLarge) {
  State state = tests::block(tests::simple_cubic(), 7, 1, 0.22);
  const auto centre = static_cast<std::size_t>((3 * 7 + 3) * 7 + 3);
  state.kind[centre] = Kind::plug;
  const std::vector<double> closed = cell_volumes(state, 1.01);
  EXPECT_EQ(with_cell(closed), 124U);
  double volume = 0.0;
  for (const double cell : closed) volume += std::isnan(cell) ? 0.0 : cell;
  EXPECT_NEAR(volume / (0.44 * 0.44 * 0.44), 125.0, 125.0 * kCellRounding);
  // The six balls that face the hole reach its middle.
  EXPECT_EQ(with_cell(cell_volumes(state, 0.99)), 118U);
}

// Rock salt: balls of radii r and s in turn on a simple cubic lattice of spacing r + s. The plane of equal tangents is at
// the contact: r^2 - s^2 = (r - s)(r + s). A small ball's cell is the cube of its tangent planes; the large ones share the
// rest.
TEST(Density, CellsOfUnequalBallsMeetAtTheirContacts) {
  const double r = 0.25, s = 0.19, a = r + s;
  State state = tests::block(tests::simple_cubic(), 6, 1, 0.5 * a);
  for (std::size_t i = 0; i < state.size(); ++i) state.radius[i] = std::lround(state.position[i].sum() / a) % 2 == 0 ? r : s;
  const std::vector<double> cells = cell_volumes(state);
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] != Kind::content) continue;
    const double cube = 8.0 * s * s * s;
    EXPECT_NEAR(cells[i], state.radius[i] == s ? cube : 2.0 * a * a * a - cube, kCellRounding) << i;
  }
}

// Points thrown at random belong to the ball whose power, distance squared less radius squared, is least: found by trying
// all.
TEST(Density, CellsOfRandomBallsAgreeWithRandomPoints) {
  tests::Random random(5);
  State state;
  constexpr double kHalf = 1.0;  // m, of a cube
  while (state.size() < 300) {
    const Vec3 x = random.in_cube(kHalf);
    const double r = random.between(0.08, 0.16);
    const bool is_wall = x.cwiseAbs().maxCoeff() > 0.8;
    const auto covers = [&](std::size_t i) { return (state.position[i] - x).norm() < 0.8 * (state.radius[i] + r); };
    bool is_free = true;
    for (std::size_t i = 0; i < state.size(); ++i) is_free = is_free && !covers(i);
    const auto id = static_cast<core::BallId>(state.size());
    if (is_free) state.add(id, is_wall ? Kind::wall : Kind::content, x, Vec3::Zero(), r);
  }
  const std::vector<double> cells = cell_volumes(state, 6.0);
  constexpr int kPoints = 200000;
  std::vector<int> hits(state.size(), 0);
  for (int k = 0; k < kPoints; ++k) {
    const Vec3 x = random.in_cube(kHalf);
    std::size_t nearest = 0;
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < state.size(); ++i) {
      const double power = (state.position[i] - x).squaredNorm() - state.radius[i] * state.radius[i];
      if (power < least) least = power, nearest = i;
    }
    ++hits[nearest];
  }
  const double cube = std::pow(2.0 * kHalf, 3);
  int compared = 0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    // A cell may stick out of the cube; those of balls well within do not.
    if (std::isnan(cells[i]) || state.position[i].cwiseAbs().maxCoeff() > 0.5) continue;
    const double share = cells[i] / cube;
    EXPECT_NEAR(hits[i], kPoints * share, 5.0 * std::sqrt(kPoints * share)) << i;  // statistics: 5 standard deviations
    ++compared;
  }
  EXPECT_GT(compared, 10);
}

TEST(Density, TheRuleForHolesLeavesClosedCellsAlone) {
  const State state = tests::tray(8, 4, 3);
  const std::vector<double> strict = cell_volumes(state, 1.0), loose = cell_volumes(state, 4.0);
  std::size_t same = 0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (std::isnan(strict[i])) continue;
    EXPECT_NEAR(loose[i], strict[i], kCellRounding) << i;
    ++same;
  }
  EXPECT_GT(same, 30U);
  EXPECT_GT(with_cell(loose), same);
}

State row_of_balls() {
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.5);
  state.add(1, Kind::content, {1.0, 0.0, 1.0}, Vec3::Zero(), 0.5);
  state.add(2, Kind::content, {2.5, 0.0, 2.0}, Vec3::Zero(), 0.5);
  state.add(3, Kind::content, {4.5, 0.0, 3.0}, Vec3::Zero(), 1.0);
  state.add(4, Kind::wall, {1.0, 0.1, 1.0}, Vec3::Zero(), 0.5);
  return state;
}

TEST(Density, LocalDensityIsThatOfSeveralCellsTogether) {
  const State state = row_of_balls();
  const std::vector<double> cells{1.0, 3.0, kNone, 8.0, kNone};
  const double small = ball_volume(0.5), large = ball_volume(1.0);
  const auto alone = local_density(state, cells, 0), pairs = local_density(state, cells, 1);
  const auto all = local_density(state, cells, 9);
  // Rounding.
  EXPECT_NEAR(alone[3], large / 8.0, 1e-15);
  EXPECT_NEAR(pairs[0], 2.0 * small / 4.0, 1e-15);
  EXPECT_NEAR(pairs[3], (small + large) / 11.0, 1e-15);  // with ball 1: ball 2 is nearer but has no cell
  EXPECT_NEAR(all[0], (2.0 * small + large) / 12.0, 1e-15);
  EXPECT_NEAR(mean_density(state, cells), all[0], 1e-15);
  EXPECT_TRUE(std::isnan(alone[2]) && std::isnan(all[4]));
}

TEST(Density, LocalDensityAgreesWithLookingAtAllBalls) {
  tests::Random random(8);
  State state;
  std::vector<double> cells;
  for (int i = 0; i < 200; ++i) {
    state.add(i, Kind::content, random.in_cube(2.0), Vec3::Zero(), random.between(0.1, 0.2));
    cells.push_back(i % 7 == 0 ? kNone : random.between(0.01, 0.1));
  }
  const auto density = local_density(state, cells, 12);
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (std::isnan(cells[i])) continue;
    std::vector<std::size_t> balls(state.size());
    std::iota(balls.begin(), balls.end(), std::size_t{0});
    std::erase_if(balls, [&](std::size_t j) { return std::isnan(cells[j]); });
    std::sort(balls.begin(), balls.end(), [&](std::size_t a, std::size_t b) {
      return (state.position[a] - state.position[i]).norm() < (state.position[b] - state.position[i]).norm();
    });
    double solid = 0.0, volume = 0.0;
    for (std::size_t k = 0; k <= 12; ++k) {
      solid += ball_volume(state.radius[balls[k]]);
      volume += cells[balls[k]];
    }
    EXPECT_NEAR(density[i], solid / volume, 1e-14) << i;  // rounding
  }
}

TEST(Density, ThePeakIsNamedWithItsExcessAndHeight) {
  const State state = row_of_balls();
  const auto peak = densest(state, {0.6, kNone, 0.72, 0.66, kNone}, 0.6);
  ASSERT_TRUE(peak);
  EXPECT_EQ(peak->ball, 2U);
  EXPECT_EQ(peak->density, 0.72);
  EXPECT_NEAR(peak->excess, 0.2, 1e-15);  // rounding
  EXPECT_EQ(peak->z, 2.0);
}

TEST(Density, NothingComesOfNothing) {
  EXPECT_TRUE(cell_volumes({}).empty());
  const State state = row_of_balls();
  const std::vector<double> none(5, kNone);
  EXPECT_TRUE(std::isnan(mean_density(state, none)));
  EXPECT_FALSE(densest(state, local_density(state, none, 3), 0.6));
}

TEST(Density, WrongInputIsRejected) {
  State state = row_of_balls();
  EXPECT_THROW(cell_volumes(state, 0.0), core::InputError);
  EXPECT_THROW(mean_density(state, {1.0}), core::InputError);
  EXPECT_THROW(local_density(state, {1.0}, 2), core::InputError);
  EXPECT_THROW(densest(state, {1.0}, 0.6), core::InputError);
  state.position[1] = state.position[0];
  EXPECT_THROW(cell_volumes(state), core::InputError);
}

}  // namespace
}  // namespace grainclock::silo
