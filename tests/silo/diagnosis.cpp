// Numerics that fail, each seen to fire through a whole run: what the error names, and what diagnosis.h5 holds.
#include "silo/diagnosis.hpp"

#include "core/hdf5.hpp"
#include "core/scene.hpp"
#include "core/snapshot.hpp"
#include "silo/run.hpp"
#include "tests/support/packing.hpp"
#include "tests/support/scratch.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::NumericsError;
using core::State;
using core::Vec3;
using tests::Scratch;

constexpr double kRadius = 0.22;

/// A ball that presses into the corner of three fixed balls, and one far away.
State corner() {
  State state;
  state.add(0, Kind::content, Vec3(0.0, 0.0, 0.3589), Vec3::Zero(), kRadius);
  state.add(1, Kind::content, Vec3(0.0, 0.0, 9.0), Vec3::Zero(), kRadius);
  for (int k = 0; k < 3; ++k) {
    const double angle = 2.0 * M_PI * k / 3.0;
    state.add(2 + k, Kind::wall, 0.254 * Vec3(std::cos(angle), std::sin(angle), 0.0), Vec3::Zero(), kRadius);
  }
  return state;
}

/// Runs a scene of this state for a second and gives the error's text.
std::string failure(const Scratch& scratch, const State& state, const std::string& keys) {
  core::write_state(scratch / "start.h5", state);
  const std::string scene = scratch.file("scene.toml", "[initial]\nstate = \"start.h5\"\n" + keys +
                                                           "\n[[phase]]\nname = \"test\"\nduration = 1.0\n");
  return tests::message_of<NumericsError>([&] { run_scene(core::read_scene(scene), scratch / "run", {}); });
}

void expect_says(const std::string& text, std::initializer_list<const char*> words) {
  for (const char* word : words) EXPECT_NE(text.find(word), std::string::npos) << word << " is not in\n" << text;
}

/// What a diagnosis file must hold, whatever failed: the worst ball among those around it, and the ledger.
core::Hdf5File expect_file(const Scratch& scratch) {
  core::Hdf5File file = core::Hdf5File::open(scratch / "run/diagnosis.h5");
  const auto worst = file.attribute<std::int64_t>(".", "balls").front();
  EXPECT_FALSE(file.text_attribute(".", "what").empty());
  const auto ids = file.read<std::int64_t>("balls/id");
  EXPECT_NE(std::find(ids.begin(), ids.end(), worst), ids.end());
  EXPECT_EQ(file.read<double>("balls/critical_step").size(), ids.size());
  EXPECT_TRUE(file.has("ledger/created"));
  EXPECT_FALSE(std::filesystem::exists(scratch / "run/final.h5"));
  return file;
}

constexpr const char* kStiff = "[contact]\nk_wall = 1e9\nc_wall = 2e5\n[stepping]\nmethod = \"uniform\"\nevents = false\nstep = ";

TEST(Diagnosis, NamesABallThatRattles) {
  // A silo at rest, beyond the bound of the balls at its wall: they rattle and never fly.
  const Scratch scratch;
  const std::string text = failure(scratch, tests::resting_silo(), std::string(kStiff) + "2e-4");
  expect_says(text, {"the steps heat the content", "came from nowhere", "dt/dt_crit 1.", "(wall)", "checkpoints/000000.h5",
                     "take a smaller step", "diagnosis.h5"});
  const core::Hdf5File file = expect_file(scratch);
  const auto worst = file.attribute<std::int64_t>(".", "balls").front();
  expect_says(text, {("ball " + std::to_string(worst) + " at").c_str()});
  EXPECT_GT(file.read<double>("ledger/created")[0], 0.25 * file.read<double>("ledger/dissipated")[0]);
  // Three mean diameters around the worst ball, whatever their kind.
  const auto position = file.read_vectors("balls/position");
  const auto ids = file.read<std::int64_t>("balls/id");
  const auto at = static_cast<std::size_t>(std::find(ids.begin(), ids.end(), worst) - ids.begin());
  const Vec3 center = position[at];
  for (const Vec3& x : position) EXPECT_LE((x - center).norm(), 3.0 * 2.0 * 0.225);
  EXPECT_GT(ids.size(), 20U);
  // Its own bound, and not that of another.
  const auto critical = file.read<double>("balls/critical_step");
  ASSERT_NE(critical[at], critical[0]);
  expect_says(text, {fmt::format("step 0.0002 s, dt/dt_crit {:.3g}\n", 2e-4 / critical[at]).c_str()});
}

TEST(Diagnosis, IsSilentBelowTheBound) {
  const Scratch scratch;
  core::write_state(scratch / "start.h5", tests::resting_silo());
  const std::string scene = scratch.file("scene.toml", "[initial]\nstate = \"start.h5\"\n" + std::string(kStiff) +
                                                           "1e-4\n[[phase]]\nname = \"test\"\nduration = 1.0\n");
  EXPECT_NO_THROW(run_scene(core::read_scene(scene), scratch / "run", {}));
  EXPECT_FALSE(std::filesystem::exists(scratch / "run/diagnosis.h5"));
}

TEST(Diagnosis, NamesBothBallsOfABlowUp) {
  // Between two fixed balls it never parts from, 1.6 times the bound: each step makes the swing larger.
  const Scratch scratch;
  State state;
  state.add(0, Kind::content, Vec3(0.0, 0.0, 1e-5), Vec3::Zero(), kRadius);
  state.add(1, Kind::content, Vec3(0.0, 0.0, 9.0), Vec3::Zero(), kRadius);
  state.add(2, Kind::wall, Vec3(0.0, 0.0, -0.43), Vec3::Zero(), kRadius);
  state.add(3, Kind::wall, Vec3(0.0, 0.0, 0.43), Vec3::Zero(), kRadius);
  const std::string text = failure(scratch, state, std::string(kStiff) + "2e-4");
  expect_says(text, {"blow-up", "ball 0 at", "use a smaller step", "contact 0 - ", "(wall)", "dt/dt_crit 1.65 at the phase's start"});
  const core::Hdf5File file = expect_file(scratch);
  EXPECT_EQ(file.read<std::int64_t>("balls/id"), (std::vector<std::int64_t>{0, 2, 3}));  // not the far one
  EXPECT_EQ(file.attribute<std::int64_t>(".", "balls").size(), 2U);
  EXPECT_FALSE(file.read<std::int64_t>("contacts/i").empty());
}

TEST(Diagnosis, NamesABallThatMayPassThroughOthers) {
  // 0.12 m in a step of 1e-4 s, and the radius is 0.22 m.
  const Scratch scratch;
  State state = corner();
  state.velocity[1].z() = -1200.0;
  const std::string text = failure(scratch, state, std::string(kStiff) + "1e-4");
  expect_says(text, {"ball 1 at", "moves by 0.12 m in a step 0.0001 s long", "more than half its radius of 0.22 m", "pass through"});
}

TEST(Diagnosis, NamesALostBall) {
  // The far ball falls beside the corner and leaves the domain at z = 5 m.
  const Scratch scratch;
  const std::string text = failure(scratch, corner(), "[domain]\nlower = [-1.0, -1.0, 5.0]\n" + std::string(kStiff) + "1e-4");
  expect_says(text, {"left the domain", "not through the outlet", "velocity"});
  expect_file(scratch);  // ball 0 is below that from the beginning
}

}  // namespace
}  // namespace grainclock::silo
