#include "core/force_field.hpp"

#include "core/check.hpp"
#include "tests/support/balls.hpp"
#include "tests/support/runge_kutta.hpp"

#include <gtest/gtest.h>

namespace grainclock::core {
namespace {

const Vec3 kGravity(0.0, 0.3, -9.81);

std::vector<double> flat(const State& state, const std::vector<Vec3>& values) {
  std::vector<double> out;
  for (std::size_t i = 0; i < state.size(); ++i)
    if (state.kind[i] == Kind::content) out.insert(out.end(), values[i].data(), values[i].data() + 3);
  return out;
}

TEST(ForceField, IsTheLawOverAllPairsWhereverTheBallsGo) {
  State state = tests::tray(5, 3, 1);
  for (Vec3& x : state.position) x.z() *= 0.985;  // touching from layer to layer
  tests::Random random(2);
  for (const double cohesion : {0.0, 1e4}) {
    Materials materials;
    materials.cohesion = cohesion;
    ForceField field(state, materials, kGravity, false, 2);
    State moved = state;
    std::vector<double> a(3 * field.size());
    for (int trial = 0; trial < 5; ++trial) {
      const auto expected = flat(moved, tests::accelerations(moved, materials, kGravity));
      field.acceleration(flat(moved, moved.position), flat(moved, moved.velocity), a);
      // Rounding of overlaps: k / m times some 1e-16 m, and of forces up to 1e7 N.
      for (std::size_t k = 0; k < a.size(); ++k) EXPECT_NEAR(a[k], expected[k], 1e-7);
      for (std::size_t i = 0; i < moved.size(); ++i) {
        if (moved.kind[i] != Kind::content) continue;
        moved.position[i] += random.in_cube(trial < 2 ? 1e-3 : 1e-2);  // within the skins, then beyond
        moved.velocity[i] += random.in_cube(0.1);
      }
    }
  }
}

TEST(ForceField, PartsAddUpToTheWhole) {
  State state = tests::tray(5, 3, 3);
  for (Vec3& x : state.position) x.z() *= 0.985;  // touching from layer to layer, some of it clamped
  const auto x = flat(state, state.position), v = flat(state, state.velocity);
  for (const double cohesion : {0.0, 1e4}) {
    for (const bool tension : {false, true}) {
      Materials materials;
      materials.cohesion = cohesion;
      materials.tension = tension;
      ForceField field(state, materials, kGravity, false, 1);
      const auto part = [&](Part which) {
        std::vector<double> a(3 * field.size());
        field.acceleration(x, v, a, which);
        return a;
      };
      const auto all = part(Part::all), springs = part(Part::springs), dashpots = part(Part::dashpots);
      const auto ball_pairs = part(Part::ball_pairs), fixed_pairs = part(Part::fixed_pairs);
      double largest = 0.0;
      for (std::size_t k = 0; k < all.size(); ++k)
        largest = std::max({largest, std::abs(springs[k]), std::abs(dashpots[k])});
      for (std::size_t k = 0; k < all.size(); ++k) {
        // Sums are exact in integers; each part is rounded once or twice as it becomes a double.
        EXPECT_NEAR(springs[k] + dashpots[k], all[k], 1e-15 * largest);
        EXPECT_NEAR(ball_pairs[k] + fixed_pairs[k], all[k], 1e-15 * largest);
      }
      // The springs are the law without dashpots; the content's own contacts the law without fixed balls.
      Materials undamped = materials;
      undamped.ball.c = undamped.wall.c = 0.0;
      State alone;
      for (std::size_t i = 0; i < state.size(); ++i) {
        if (state.kind[i] == Kind::content)
          alone.add(state.id[i], state.kind[i], state.position[i], state.velocity[i], state.radius[i]);
      }
      const auto expected_springs = flat(state, tests::accelerations(state, undamped, kGravity));
      const auto expected_balls = flat(alone, tests::accelerations(alone, materials, kGravity));
      int fixed_contacts = 0, damped = 0;
      for (std::size_t k = 0; k < all.size(); ++k) {
        // As in IsTheLawOverAllPairsWhereverTheBallsGo.
        EXPECT_NEAR(springs[k], expected_springs[k], 1e-7);
        EXPECT_NEAR(ball_pairs[k], expected_balls[k], 1e-7);
        fixed_contacts += fixed_pairs[k] != 0.0 ? 1 : 0;
        damped += dashpots[k] != 0.0 ? 1 : 0;
      }
      EXPECT_GT(fixed_contacts, 5);
      EXPECT_GT(damped, 20);
    }
  }
}

TEST(ForceField, RefusesWhatIsBeyondTheLimit) {
  const Materials materials;
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 0.0}, Vec3::Zero(), 0.22);
  state.add(1, Kind::wall, {0.0, 0.0, -0.5}, Vec3::Zero(), 0.22);
  ForceField field(state, materials, kGravity, false, 1);
  std::vector<double> a(3);
  field.acceleration(std::vector<double>{0.0, 0.0, 0.0}, std::vector<double>{0.0, 0.0, 0.0}, a);
  EXPECT_EQ(a[2], -9.81);
  EXPECT_THROW(field.acceleration(std::vector<double>{0.0, 0.0, -0.2}, std::vector<double>{0.0, 0.0, 0.0}, a),
               NumericsError);
}

}  // namespace
}  // namespace grainclock::core
