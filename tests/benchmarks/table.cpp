#include "benchmarks/table.hpp"

#include "core/hdf5.hpp"
#include "tests/support/scratch.hpp"

#include <cmath>
#include <limits>

namespace grainclock::benchmarks {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

Table example() {
  return {"example",
          {{"name", "", std::vector<std::string>{"a, \"b\"", "plain", "two\nlines"}},
           {"step", "s", std::vector<double>{0.1, kUnknown, 123456789012.0}}}};
}

TEST(Table, UnknownNumbersAreEmptyAndTextsQuotedWhereNeeded) {
  EXPECT_EQ(csv(example()), "name,step\n\"a, \"\"b\"\"\",0.1\nplain,\n\"two\nlines\",123456789012\n");
}

TEST(Table, NumbersReadBackToTheLastBit) {
  for (const double number : {1.0 / 3.0, 1e-300, 1e300, -0.1}) {
    const std::string text = csv({"t", {{"x", "", std::vector<double>{number}}}});
    EXPECT_EQ(std::stod(text.substr(2)), number) << text;
  }
}

TEST(Table, WithoutRowsOnlyTheHeaderStands) {
  EXPECT_EQ(csv({"t", {{"x", "m", std::vector<double>{}}, {"y", "", std::vector<std::string>{}}}}), "x,y\n");
}

TEST(Table, HdfHasAGroupPerTableWithUnitsAndProvenance) {
  const tests::Scratch scratch;
  const std::string path = scratch / "study.h5";
  write_tables(path, {example(), {"other", {{"x", "m", std::vector<double>{2.0}}}}}, {"study text", "scene text", 7, 3});
  const auto file = core::Hdf5File::open(path);
  const auto step = file.group("example").read<double>("step");
  ASSERT_EQ(step.size(), 3u);
  EXPECT_EQ(step[0], 0.1);
  EXPECT_TRUE(std::isnan(step[1]));
  EXPECT_EQ(file.group("example").text_attribute("step", "unit"), "s");
  EXPECT_EQ(file.group("other").read<double>("x"), std::vector<double>{2.0});
  EXPECT_EQ(file.group("provenance").read_text("study"), "study text");
  EXPECT_EQ(file.group("provenance").read_text("scene"), "scene text");
  EXPECT_EQ(file.group("provenance").read<std::int64_t>("threads").at(0), 3);
}

}  // namespace
}  // namespace grainclock::benchmarks
