// The scenes that come with the program are readable and can be built.
#include "core/scene.hpp"
#include "silo/filling.hpp"

#include <gtest/gtest.h>

#include <string>

namespace grainclock::silo {
namespace {

class ShippedScene : public testing::TestWithParam<const char*> {};

TEST_P(ShippedScene, BuildsASiloInsideItsDomain) {
  const core::Scene scene = core::read_scene(std::string(GRAINCLOCK_SOURCE "/silo/scenes/") + GetParam());
  const SiloShape shape = read_silo(scene);
  const Silo silo = build_silo(shape, scene.seed);
  EXPECT_EQ(static_cast<std::int64_t>(silo.state.count(core::Kind::content)), shape.balls);
  ASSERT_TRUE(scene.domain.lower && scene.domain.upper && scene.domain.outlet_z);
  // Content that touches the lowest ring is still in the silo.
  EXPECT_LE(*scene.domain.outlet_z, -2.0 * shape.r_max);
  for (const Vec3& at : silo.state.position)
    ASSERT_TRUE((at.array() > scene.domain.lower->array()).all() && (at.array() < scene.domain.upper->array()).all());
  EXPECT_FALSE(scene.phases.empty());
}

INSTANTIATE_TEST_SUITE_P(Scenes, ShippedScene, testing::Values("table1.toml", "table1-printed.toml", "mini.toml"));

}  // namespace
}  // namespace grainclock::silo
