#include "core/toml_keys.hpp"

#include "core/check.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <string>

namespace grainclock::core {
namespace {

using namespace std::string_view_literals;

toml::table parsed(std::string_view text) { return toml::parse(text, "scene.toml"sv); }

std::string complaint(const std::function<void()>& act) {
  try {
    act();
  } catch (const InputError& error) {
    return error.what();
  }
  return "no complaint";
}

TEST(TomlKeys, ReadsEachType) {
  const auto table = parsed("a = 1\nb = 2.5\nc = true\nd = \"text\"\ne = [1, 2.0, 3]\n[t]\nx = 1\n[[p]]\ny = 2\n[[p]]\n");
  TomlKeys keys(table, "", "scene.toml");
  EXPECT_EQ(keys.integer("a"), 1);
  EXPECT_EQ(keys.number("a"), 1.0);
  EXPECT_EQ(keys.number("b"), 2.5);
  EXPECT_EQ(keys.boolean("c"), true);
  EXPECT_EQ(keys.string("d"), "text");
  EXPECT_EQ(keys.vec3("e"), Vec3(1.0, 2.0, 3.0));
  EXPECT_EQ(keys.table("t")->integer("x"), 1);
  EXPECT_EQ(keys.tables("p").size(), 2u);
  EXPECT_EQ(keys.tables("p")[0].integer("y"), 2);
  EXPECT_FALSE(keys.number("absent"));
  EXPECT_FALSE(keys.table("absent"));
  EXPECT_TRUE(keys.tables("absent").empty());
  keys.finish();
}

TEST(TomlKeys, ComplaintNamesFileLineTableValueAndRemedy) {
  const auto table = parsed("[silo]\nballs = 5\nradius = -5.0\n");
  TomlKeys root(table, "", "scene.toml");
  auto silo = *root.table("silo");
  EXPECT_EQ(complaint([&] { silo.positive("radius", "m"); }), "scene.toml:3: [silo] radius = -5.0: must be above 0 m");
  EXPECT_EQ(complaint([&] { silo.fail("width", "give one"); }), "scene.toml:1: [silo] width is missing: give one");
}

TEST(TomlKeys, WrongTypesAreRejected) {
  const auto table = parsed("a = \"1\"\nb = 1.5\nc = 1\nd = [1, 2]\ne = nan\nf = [1, 2, inf]\n");
  TomlKeys keys(table, "", "scene.toml");
  EXPECT_THROW(keys.number("a"), InputError);
  EXPECT_THROW(keys.integer("b"), InputError);
  EXPECT_THROW(keys.boolean("c"), InputError);
  EXPECT_THROW(keys.string("c"), InputError);
  EXPECT_THROW(keys.table("c"), InputError);
  EXPECT_THROW(keys.tables("c"), InputError);
  EXPECT_THROW(keys.tables("d"), InputError);
  EXPECT_THROW(keys.vec3("d"), InputError);
  EXPECT_THROW(keys.number("e"), InputError);
  EXPECT_THROW(keys.vec3("f"), InputError);
}

TEST(TomlKeys, ChoiceListsWhatIsAllowed) {
  const auto table = parsed("shape = \"oval\"\n");
  TomlKeys keys(table, "[silo]", "scene.toml");
  EXPECT_EQ(complaint([&] { keys.choice("shape", {"round", "square"}); }),
            "scene.toml:1: [silo] shape = 'oval': must be \"round\" or \"square\"");
}

TEST(TomlKeys, KeyNobodyAskedForIsAnErrorWithItsLine) {
  const auto table = parsed("step = 1\nsteps = 2\n");
  TomlKeys keys(table, "[stepping]", "scene.toml");
  keys.number("step");
  const std::string text = complaint([&] { keys.finish(); });
  EXPECT_EQ(text.rfind("scene.toml:2: ", 0), 0u) << text;
  EXPECT_NE(text.find("steps"), std::string::npos) << text;
  EXPECT_NE(text.find("[stepping]"), std::string::npos) << text;
  keys.allow("steps");
  keys.finish();
}

TEST(TomlKeys, LinesComeFromTheUsersFileAndOverridesAreNamed) {
  const auto original = parsed("# a comment\n[silo]\nradius = 5.0\nballs = 7\n");
  const auto resolved = parsed("[silo]\nballs = 7\nradius = -1.0\nheight = -2.0\n");
  TomlKeys root(resolved, "", "scene.toml", &original);
  auto silo = *root.table("silo");
  EXPECT_EQ(silo.where("balls"), "scene.toml:4");
  EXPECT_EQ(silo.where("radius"), "scene.toml with --set");
  EXPECT_EQ(silo.where("height"), "scene.toml with --set");
}

}  // namespace
}  // namespace grainclock::core
