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
