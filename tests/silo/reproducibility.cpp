// The same bits from the program whatever the threads, the instruction set, the repetition, a stop and resume; and a run
// made again from its own file alone. Every method of stepping goes through all of it.
#include "core/kernels.hpp"
#include "core/scene.hpp"
#include "tests/support/crowd.hpp"
#include "tests/support/program_runs.hpp"

#include <fmt/format.h>

#include <set>

namespace grainclock::silo {
namespace {

namespace fs = std::filesystem;
using core::Kind;
using core::State;
using core::Vec3;
using tests::expect_same_runs;
using tests::Result;
using tests::operator+;
using tests::Words;

// Balls of the lowest layer leave while it runs. The step of uniform cases is the dashpots' bound, about.
constexpr const char* kScene = R"(
[initial]
state = "crowd.h5"
[domain]
outlet_z = 0.437
[stepping]
levels = 6
[output]
every = 0.0016
[[phase]]
name = "closed"
duration = 0.0032
[[phase]]
name = "open"
duration = 0.0032
outlet = "open"
)";

struct Case {
  const char* name;
  bool multirate;
  Words keys;  // of the scene
};

const Case kCases[] = {
    {"UniformLagged", false, {"integrator='lagged'", "events=false"}},
    {"UniformPredicted", false, {"integrator='predicted'", "events=false"}},
    {"UniformPece", false, {"integrator='pece'", "events=false"}},
    {"UniformEvents", false, {"events=true"}},
    {"UniformRelaxed", false, {"dashpot='relaxed'", "events=false"}},
    {"UniformPairwise", false, {"dashpot='pairwise'", "events=false"}},
    {"UniformSolve", false, {"dashpot='solve'", "events=false"}},
    {"Accumulate", true, {"interface='accumulate'", "events=true"}},
    {"AccumulateWithoutEvents", true, {"interface='accumulate'", "events=false"}},
    {"Extrapolate", true, {"interface='extrapolate'", "events=true"}},
    {"ExtrapolateWithoutEvents", true, {"interface='extrapolate'", "events=false"}},
    {"Impulse", true, {"interface='impulse'", "events=false"}},
    {"Frozen", true, {"interface='frozen'", "events=false"}},
};

class Reproducibility : public ::testing::TestWithParam<Case> {
 protected:
  Reproducibility() {
    core::write_state(scratch_ / "crowd.h5", tests::crowd());
    scene_ = scratch_.file("scene.toml", kScene);
    keys_ = {"--set", GetParam().multirate ? "stepping.method='multirate'" : "stepping.method='uniform'", "--set",
             GetParam().multirate ? "stepping.step=3.2e-4" : "stepping.step=8e-5"};
    for (const std::string& key : GetParam().keys) keys_ = keys_ + Words{"--set", "stepping." + key};
  }
  /// Runs the case and gives its directory.
  std::string run(const std::string& name, int threads, const std::string& kernels = {}) {
    const std::string out = scratch_ / name;
    const Result result = tests::grainclock(scratch_, arguments(out, threads), kernels);
    EXPECT_EQ(result.code, 0) << result.err;
    return out;
  }
  Words arguments(const std::string& out, int threads) const {
    return Words{"run", scene_, "--out", out, "--threads", std::to_string(threads)} + keys_;
  }
  tests::Scratch scratch_;
  std::string scene_;
  Words keys_;
};

TEST_P(Reproducibility, SameBitsWithAnyThreadsAnyKernelsAndEachTime) {
  const std::string first = run("first", 1);
  const RunReader reader(first);
  ASSERT_EQ(reader.frames(), 5);
  EXPECT_GT(reader.observable("discharged", 4)->at(0), 10.0);
  const State last = reader.state(4);
  const std::set<int> levels(last.level.begin(), last.level.end());
  EXPECT_GE(levels.size(), GetParam().multirate ? 3U : 1U);  // else there would be no interface to try

  expect_same_runs(first, run("again", 1));
  for (const int threads : {2, 3, 4}) {
    SCOPED_TRACE(testing::Message() << threads << " threads");
    expect_same_runs(first, run(fmt::format("threads-{}", threads), threads));
  }
  for (const core::Kernels* kernels : core::runnable_kernels()) {
    SCOPED_TRACE(kernels->name);
    const std::string out = run(fmt::format("kernels-{}", kernels->name), 2, kernels->name);
    EXPECT_EQ(core::Hdf5File::open(out + "/run.h5").read_text("provenance/kernels"), kernels->name);
    expect_same_runs(first, out);
  }
}

TEST_P(Reproducibility, ResumeWithOtherThreadsAndKernelsIsTheSameRun) {
  const std::string whole = run("whole", 1), stopped = scratch_ / "stopped";
  const tests::Process process(scratch_, arguments(stopped, 1) + Words{"--checkpoint-every", "0"});
  ASSERT_TRUE(tests::reaches(stopped, 3));
  process.send(SIGTERM);
  ASSERT_EQ(process.wait().code, 5);
  const Result result = tests::grainclock(scratch_, {"resume", stopped, "--threads", "3"}, "portable");
  ASSERT_EQ(result.code, 0) << result.err;
  expect_same_runs(whole, stopped);
}

TEST_P(Reproducibility, ARunIsMadeAgainFromItsOwnFileAlone) {
  const std::string original = run("original", 1), copy = scratch_ / "copy";
  fs::create_directory(copy);
  fs::copy_file(original + "/run.h5", copy + "/run.h5");
  fs::copy(original + "/segments", copy + "/segments", fs::copy_options::recursive);
  fs::remove(copy + "/segments/start.h5");  // what a resume needs, but no reader of frames
  for (const char* gone : {"crowd.h5", "scene.toml"}) fs::remove(scratch_ / gone);

  const Result exported = tests::grainclock(scratch_, {"export", copy + "/run.h5", "--to", "scene", "--output", scratch_ / "scene"});
  ASSERT_EQ(exported.code, 0) << exported.err;
  const Result result = tests::grainclock(scratch_, {"run", scratch_ / "scene/scene.toml", "--out", scratch_ / "again"});
  ASSERT_EQ(result.code, 0) << result.err;
  expect_same_runs(original, scratch_ / "again");
}

INSTANTIATE_TEST_SUITE_P(Program, Reproducibility, ::testing::ValuesIn(kCases),
                         [](const auto& tested) { return std::string(tested.param.name); });

TEST(Rebuilt, RunThatBuiltItsSiloIsMadeAgain) {
  const tests::Scratch scratch;
  const auto program = [&](const Words& words) {
    const Result result = tests::grainclock(scratch, words);
    EXPECT_EQ(result.code, 0) << result.err;
  };
  scratch.file("fill.toml", R"(
seed = 11
[silo]
radius = 1.3
height = 4.0
hopper_height = 0.8
outlet = 1.6
balls = 60
r_min = 0.215
r_max = 0.225
surface = "inner"
collar = 3.0
[contact]
k_ball = 1e6
k_wall = 1e7
restitution_ball = 0.3
restitution_wall = 0.3
[domain]
outlet_z = -0.5
[output]
every = 0.1
[[phase]]
duration = 0.6
first_impact = true
method = "uniform"
[[phase]]
duration = 0.1
outlet = "open"
)");
  program({"run", scratch / "fill.toml", "--out", scratch / "fill"});
  program({"export", scratch / "fill", "--to", "scene", "--output", scratch / "scene"});
  EXPECT_FALSE(fs::exists(scratch / "scene/start.h5"));  // the scene builds it
  program({"run", scratch / "scene/scene.toml", "--out", scratch / "again"});
  expect_same_runs(scratch / "fill", scratch / "again");
  // Neither does a second export write over a first.
  EXPECT_EQ(tests::grainclock(scratch, {"export", scratch / "fill", "--to", "scene", "--output", scratch / "scene"}).code, 2);
}

}  // namespace
}  // namespace grainclock::silo
