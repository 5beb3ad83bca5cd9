// The file of measures of a recorded run.
#include "silo/measure.hpp"

#include "core/check.hpp"
#include "core/hdf5.hpp"
#include "silo/frame_contacts.hpp"
#include "silo/observables.hpp"
#include "tests/support/gated_run.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>

namespace grainclock::silo {
namespace {

constexpr const char* kSmallSilo = R"(
[silo]
shape = "round"
radius = 1.5
height = 3.0
hopper_height = 1.0
outlet = 1.0
balls = 10
r_min = 0.2
r_max = 0.24
[[phase]]
name = "none"
duration = 1.0
)";

/// Equal to the bit, or both unknown.
void expect_same(const std::vector<double>& a, const std::vector<double>& b, const std::string& what) {
  ASSERT_EQ(a.size(), b.size()) << what;
  for (std::size_t k = 0; k < a.size(); ++k) EXPECT_TRUE(a[k] == b[k] || (std::isnan(a[k]) && std::isnan(b[k]))) << what << " " << k;
}

class MeasureRun : public testing::Test {
 protected:
  std::string measure(const std::string& name, std::optional<double> every = {}, int threads = 1) const {
    const std::string output = scratch_ / name;
    testing::internal::CaptureStdout();
    measure_run(run_, {output, silo_, every, threads});
    testing::internal::GetCapturedStdout();
    return output;
  }
  tests::Scratch scratch_;
  std::string run_ = tests::gated_run(scratch_), silo_ = scratch_.file("silo.toml", kSmallSilo);
};

TEST_F(MeasureRun, HoldsTheMeasuresOfEveryFrame) {
  const core::Hdf5File file = core::Hdf5File::open(measure("all.h5"));
  const RunReader run(run_);
  expect_same(file.read<double>("time"), run.times(), "time");
  const MeasuredSilo silo{read_silo(core::read_scene(silo_, {})), *layers_of(run.state(0)), 1250.0};
  const core::Hdf5Group series = file.group("series");
  EXPECT_EQ(series.attribute<double>(".", "layer_edges").size(), 21u);
  EXPECT_EQ(series.attribute<double>(".", "force_edges").size(), series.shape("force_distribution")[1] + 1);
  // These few balls have no large bridges; tests/notebooks/silo_story.py compares those of a silo.
  EXPECT_EQ(file.group("bridges").read<std::int64_t>("begin"), std::vector<std::int64_t>(run.times().size() + 1, 0));
  EXPECT_EQ(file.group("bridges").shape("bonds"), (core::Hdf5Group::Shape{0, 2}));
  const ContactFinder finder(run);
  std::optional<core::State> before;
  for (std::int64_t frame = 0; frame < run.frames(); ++frame) {
    const core::State state = run.state(frame);
    const std::vector<core::Contact> contacts = finder.contacts(frame, state).contacts;
    const Reading reading = moment_of(state, contacts, before ? &*before : nullptr, silo);
    for (const Observable& wanted : reading.series) {
      EXPECT_EQ(series.text_attribute(wanted.name, "unit"), wanted.unit);
      expect_same(series.read_rows<double>(wanted.name, static_cast<std::uint64_t>(frame), 1), wanted.values, wanted.name);
    }
    before = state;
  }
  // Wall pressures: horizontal force over (2 r)^2, here of the last frame.
  const core::Hdf5Group wall = file.group("wall");
  const std::size_t balls = wall.read<double>("area").size();
  const core::State last = run.state(run.frames() - 1);
  EXPECT_EQ(balls, last.count(core::Kind::wall));
  std::vector<double> pressure;
  for (const WallLoad& load : wall_loads(last, finder.contacts(run.frames() - 1, last).contacts, silo.shape)) pressure.push_back(load.pressure());
  expect_same(wall.read_rows<double>("pressure", static_cast<std::uint64_t>(run.frames() - 1), 1), pressure, "pressure");
}

TEST_F(MeasureRun, ThreadsDoNotMatter) {
  const core::Hdf5File one = core::Hdf5File::open(measure("one.h5")), three = core::Hdf5File::open(measure("three.h5", {}, 3));
  for (const std::string& name : one.group("series").names())
    expect_same(one.group("series").read<double>(name), three.group("series").read<double>(name), name);
  expect_same(one.group("wall").read<double>("pressure"), three.group("wall").read<double>("pressure"), "pressure");
}

TEST_F(MeasureRun, TakesFramesNoCloserThanAsked) {
  const std::vector<double> time = core::Hdf5File::open(measure("some.h5", 0.2)).read<double>("time");
  const std::vector<double> all = RunReader(run_).times();
  ASSERT_GT(time.size(), 2u);
  EXPECT_LT(time.size(), all.size());
  EXPECT_EQ(time[0], all[0]);
  for (std::size_t k = 1; k < time.size(); ++k) EXPECT_GE(time[k] - time[k - 1], 0.2 * (1.0 - 1e-9));  // recorded times are rounded
}

TEST_F(MeasureRun, SaysWhatIsMissing) {
  try {
    measure_run(run_, {scratch_ / "x.h5", "", {}, 1});
    FAIL();
  } catch (const core::InputError& error) {
    EXPECT_NE(std::string(error.what()).find("--silo SCENE"), std::string::npos) << error.what();
  }
  EXPECT_THROW(measure_run(scratch_ / "nothing", {scratch_ / "x.h5", silo_, {}, 1}), core::FileError);
  EXPECT_THROW(measure_run(run_, {"/proc/none/x.h5", silo_, {}, 1}), core::FileError);
  EXPECT_FALSE(std::filesystem::exists(scratch_ / "x.h5"));
}

}  // namespace
}  // namespace grainclock::silo
