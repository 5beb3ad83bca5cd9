// The program as its users meet it: calls, messages, exit codes, files.
#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "silo/checkpoint.hpp"
#include "silo/filling.hpp"
#include "silo/run_file.hpp"
#include "tests/support/program_runs.hpp"

#include <csignal>
#include <cstdlib>
#include <numbers>

namespace grainclock::silo {
namespace {

namespace fs = std::filesystem;
using core::Kind;
using core::State;
using core::Vec3;
using tests::expect_same_runs;
using tests::grainclock;
using tests::operator+;
using tests::Process;
using tests::reaches;
using tests::Result;
using tests::Scratch;
using tests::text_of;
using tests::Words;

/// 48 balls above a floor of fixed balls with a plugged hole in its middle; the floor's edges are open.
State pile() {
  State state;
  core::BallId id = 0;
  for (int layer = 0; layer < 3; ++layer)
    for (int x = 0; x < 4; ++x)
      for (int y = 0; y < 4; ++y, ++id)  // shifted and spread irregularly, so that no ball balances on another
        state.add(id, Kind::content, Vec3(0.47 * x - 0.7 + 0.03 * layer, 0.48 * y - 0.72 - 0.02 * x, 0.5 + 0.46 * layer + 0.01 * y), Vec3(0.01 * y, 0, 0),
                  0.215 + 0.001 * static_cast<double>(id % 10));
  for (int x = -4; x <= 4; ++x)
    for (int y = -4; y <= 4; ++y, ++id)
      state.add(id, std::abs(x) <= 1 && std::abs(y) <= 1 ? Kind::plug : Kind::wall, Vec3(0.3 * x, 0.3 * y, 0.0), Vec3::Zero(), 0.22);
  return state;
}

/// So many steps (multi-rate: on several levels) that a run can be stopped amid them on any machine.
Words many_steps(const std::string& method) {
  if (method == "uniform") return {"--set", "stepping.method=uniform", "--set", "stepping.step=4e-7"};
  return {"--set", "stepping.method=multirate", "--set", "stepping.step=4e-6", "--set", "stepping.tolerance=1e-6"};
}
const Words kManyCheckpoints{"--checkpoint-every", "0.02"};

constexpr const char* kPile = R"(
[initial]
state = "pile.h5"
[domain]
outlet_z = -1.0
[stepping]
method = "uniform"
step = 1e-5
[output]
every = 0.01
observables_every = 0.0025
[[phase]]
name = "settle"
duration = 0.2
[[phase]]
name = "flow"
duration = 0.1
outlet = "open"
[[phase]]
name = "shut"
duration = 0.05
)";

class Program : public ::testing::Test {
 protected:
  Program() {
    core::write_state(scratch_ / "pile.h5", pile());
    core::write_state(scratch_ / "pile.csv", pile());
    scene_ = scratch_.file("scene.toml", kPile);
    out_ = scratch_ / "out";
  }
  Result call(const Words& arguments) { return grainclock(scratch_, arguments); }
  Result run(const Words& more = {}) {
    return call(Words{"run", scene_, "--out", out_} + more);
  }
  /// Whether a Python script accepts the arguments.
  bool python(const std::string& script, const std::string& arguments) {
    return std::system(fmt::format("cd / && /usr/bin/python3 {} {}", scratch_.file("script.py", script), arguments).c_str()) == 0;
  }
  Scratch scratch_;
  std::string scene_, out_;
};

// ---------------------------------------------------------------- usage

TEST_F(Program, EverySubCommandHasHelp) {
  EXPECT_EQ(call({"--help"}).code, 0);
  for (const char* name : {"run", "resume", "check", "study", "compare", "export", "import", "info"}) {
    const Result result = call({name, "--help"});
    EXPECT_EQ(result.code, 0) << name;
    EXPECT_NE(result.out.find(name), std::string::npos);
    EXPECT_NE(call({"--help"}).out.find(name), std::string::npos);
  }
  EXPECT_EQ(call({"--version"}).out.substr(0, 11), "grainclock ");
}

TEST_F(Program, BadUsageIsExitCode2) {
  for (const Words& arguments :
       std::vector<Words>{{}, {"fly"}, {"run"}, {"run", scene_}, {"run", scene_, "--out", out_, "--threads", "0"}, {"info"},
                                             {"export", scratch_ / "pile.h5", "--to", "png", "--output", out_}, {"check", scene_, "--fast"}}) {
    const Result result = call(arguments);
    EXPECT_EQ(result.code, 2);
    EXPECT_FALSE(result.err.empty());
  }
  EXPECT_FALSE(fs::exists(out_));
}

struct Bad {
  const char* text;      // appended to the scene
  const char* expected;  // in the message
};

TEST_F(Program, WrongScenesAreExitCode2AndLeaveNothing) {
  const Bad cases[] = {
      {"colour = 1\n", "scene.toml:22: unknown key `colour` in [[phase]]"},
      {"step = 'small'\n", "scene.toml:22: [[phase]] step = 'small': must be a number"},
      {"step = -1e-5\n", "must be above 0 s"},
      {"every = 0.03\n", "must be a whole multiple of every = 0.03 s; nearest: 0.03 or 0.06 s"},
      {"observables_every = 0.003\n", "must divide every = 0.01 s; nearest: 0.0025 or 0.00333333333333 s"},
      {"name = \n", "scene.toml:22:"},
      {"[contact]\nk_ball = 0\n", "must be above 0 N/m"},
  };
  for (const Bad& bad : cases) {
    scratch_.file("scene.toml", std::string(kPile) + bad.text);
    for (const auto& arguments : {Words{"run", scene_, "--out", out_}, Words{"check", scene_}}) {
      const Result result = call(arguments);
      EXPECT_EQ(result.code, 2) << bad.text;
      EXPECT_NE(result.err.find(bad.expected), std::string::npos) << result.err;
    }
    EXPECT_FALSE(fs::exists(out_));
  }
}

TEST_F(Program, WrongOverridesAreExitCode2AndLeaveNothing) {
  const Result result = run({"--set", "stepping.step=fast"});
  EXPECT_EQ(result.code, 2);
  EXPECT_NE(result.err.find("--set stepping.step=fast"), std::string::npos) << result.err;
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(Program, WrongStatesAreExitCode2AndLeaveNothing) {
  scratch_.file("pile.csv", "id,kind,x,y,z,vx,vy,vz,radius\n0,content,0,0,zero,0,0,0,0.2\n");
  const Result result = run({"--set", "initial.state='pile.csv'"});
  EXPECT_EQ(result.code, 2);
  EXPECT_NE(result.err.find("pile.csv:2:15: `zero`: must be a finite number"), std::string::npos) << result.err;
  scratch_.file("pile.csv", "id,kind,x,y,z,vx,vy,vz,radius\n0,wall,0,0,0,0,0,0,0.2\n");
  EXPECT_EQ(run({"--set", "initial.state='pile.csv'"}).code, 2);  // nothing that could move
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(Program, OutputThatIsNotEmptyIsRefusedAndKept) {
  fs::create_directory(out_);
  scratch_.file("out/mine.txt", "precious");
  const Result result = run();
  EXPECT_EQ(result.code, 2);
  EXPECT_NE(result.err.find("is not empty"), std::string::npos);
  EXPECT_EQ(text_of(out_ + "/mine.txt"), "precious");
  EXPECT_EQ(std::distance(fs::directory_iterator(out_), {}), 1);
}

TEST_F(Program, MissingAndUnwritableFilesAreExitCode4) {
  EXPECT_EQ(call({"run", scratch_ / "none.toml", "--out", out_}).code, 4);
  EXPECT_EQ(call({"check", scratch_ / "none.toml"}).code, 4);
  EXPECT_EQ(run({"--set", "initial.state='none.h5'"}).code, 4);
  EXPECT_EQ(call({"run", scene_, "--out", scratch_ / "pile.h5/out"}).code, 4);  // a file stands where a directory is wanted
  EXPECT_EQ(call({"resume", scratch_.path().string()}).code, 4);
  EXPECT_EQ(call({"info", scratch_ / "none.h5"}).code, 4);
  EXPECT_EQ(call({"info", scene_}).code, 4);
  EXPECT_EQ(call({"compare", scratch_ / "pile.h5", scratch_ / "none.h5"}).code, 4);
  EXPECT_EQ(call({"export", scratch_ / "none.h5", "--to", "csv", "--output", out_ + ".csv"}).code, 4);
  EXPECT_EQ(call({"import", scratch_ / "none.csv", "--output", out_ + ".h5"}).code, 4);
  EXPECT_EQ(call({"study", scratch_ / "none.toml", "--out", out_}).code, 4);
  EXPECT_FALSE(fs::exists(out_) || fs::exists(out_ + ".csv") || fs::exists(out_ + ".h5"));
}

TEST_F(Program, DamagedStateIsExitCode4) {
  const std::string intact = text_of(scratch_ / "pile.h5");
  scratch_.file("pile.h5", intact.substr(0, intact.size() / 2));
  EXPECT_EQ(run().code, 4);
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(Program, StepBeyondTheBoundWarnsAndFailsWithADiagnosis) {
  const Result result = run({"--set", "stepping.step=5e-3"});
  EXPECT_EQ(result.code, 3) << result.out << result.err;
  EXPECT_NE(result.out.find("warning: dt/dt_crit"), std::string::npos) << result.out;
  for (const char* part : {"ball ", "dt/dt_crit", "level 0", "last good checkpoint"})
    EXPECT_NE(result.err.find(part), std::string::npos) << part << " is not in\n" << result.err;
}

TEST_F(Program, BallThatLeavesElsewhereFailsAndIsNamed) {
  const Result result = run({"--set", "domain.upper=[0.9, 10, 10]", "--set", "phase.0.duration=2.0"});
  EXPECT_EQ(result.code, 3) << result.err;
  EXPECT_NE(result.err.find("ball "), std::string::npos) << result.err;
}

// ---------------------------------------------------------------- runs

class Stepped : public Program, public ::testing::WithParamInterface<const char*> {
 protected:
  std::string method() const { return fmt::format("stepping.method='{}'", GetParam()); }
};

TEST_F(Program, RunLeavesSceneFramesFinalStateAndLedger) {
  const Result result = run();
  ASSERT_EQ(result.code, 0) << result.err;
  for (const char* part : {"terms on", "damping ratio", "restitution", "dt/dt_crit", "collision time", "energy residual", "momentum residual"})
    EXPECT_NE(result.out.find(part), std::string::npos) << part;
  const RunReader reader(out_);
  EXPECT_EQ(reader.frames(), 36);  // one at the start and one each 0.01 s of 0.35 s
  EXPECT_EQ(reader.times().front(), 0.0);
  EXPECT_NEAR(reader.times().back(), 0.35, 1e-14);  // rounding of three sums
  const State last = reader.state(reader.frames() - 1), saved = core::read_state(out_ + "/final.h5");
  EXPECT_EQ(last.time, saved.time);
  EXPECT_TRUE(tests::same_bits(last.position, saved.position));
  for (const auto& entry : fs::recursive_directory_iterator(out_)) EXPECT_EQ(entry.path().string().find(".part"), std::string::npos);

  // The echo is a scene that gives the same run.
  EXPECT_EQ(call({"run", out_ + "/scene.toml", "--out", scratch_ / "again"}).code, 0);
  expect_same_runs(out_, scratch_ / "again");
}

TEST_F(Program, ClosingTheOutletCutsOffAndCounts) {
  ASSERT_EQ(run().code, 0);
  const RunReader reader(out_);
  const std::int64_t before = reader.frame_at(0.30), after = reader.frame_at(0.35);
  const auto out = [&](std::int64_t frame) { return reader.observable("discharged", frame)->at(0); };
  const auto count = [&](std::int64_t frame) { return static_cast<double>(reader.state(frame).count(Kind::content)); };
  EXPECT_EQ(count(before) + out(before), 48.0);
  EXPECT_EQ(count(after) + out(after), 48.0);
  // No ball is shut inside the plug: an overlap stays a small part of a radius.
  EXPECT_LT(reader.observable("largest_overlap", after)->at(0), 0.02);
}

TEST_F(Program, GateThatShutsLaterMayHaveBallsInItsWayAtTheStart) {
  ASSERT_EQ(run().code, 0);
  const RunReader reader(out_);
  State flowing = reader.state(reader.frame_at(0.30));
  core::write_state(scratch_ / "flowing.h5", flowing);
  ASSERT_FALSE(clear_gate(flowing).empty());
  const Words from_there{"--set", "initial.state=" + scratch_ / "flowing.h5", "--set", "phase.0.outlet=open"};
  const Result result = call(Words{"run", scene_, "--out", scratch_ / "on"} + from_there);
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(call(Words{"check", scene_} + from_there).out.find("numerics fail"), std::string::npos);
  // Shut from the start it would be the state that is wrong.
  EXPECT_EQ(call({"run", scene_, "--out", scratch_ / "shut", "--set", "initial.state=" + scratch_ / "flowing.h5"}).code, 3);
}

TEST_F(Program, FramesChangeNoResult) {
  ASSERT_EQ(run().code, 0);
  ASSERT_EQ(call({"run", scene_, "--out", scratch_ / "fewer", "--set", "output.every=0.05"}).code, 0);
  EXPECT_EQ(core::checksum(core::read_state(out_ + "/final.h5")), core::checksum(core::read_state(scratch_ / "fewer/final.h5")));
}

TEST_P(Stepped, RecordsBetweenFramesChangeNoResult) {
  // 7e-5 s: steps of 0.01 / 143 s, and 0.0025 s is no multiple of them.
  const Words steps{"--set", method(), "--set", "stepping.step=7e-5"};
  ASSERT_EQ(run(steps).code, 0);
  const std::string sparse = scratch_ / "sparse";
  ASSERT_EQ(call(Words{"run", scene_, "--out", sparse, "--set", "output.observables_every=0.01"} + steps).code, 0);
  EXPECT_EQ(core::checksum(core::read_state(out_ + "/final.h5")), core::checksum(core::read_state(sparse + "/final.h5")));
  const RunReader dense(out_), frames(sparse);
  const double step = 0.01 / 143;
  const Recorded energy = *dense.series("kinetic_energy");
  ASSERT_EQ(energy.time.size(), 141u);
  EXPECT_EQ(frames.series("kinetic_energy")->time, frames.times());
  for (std::size_t k = 0; k < energy.time.size(); ++k) {
    EXPECT_LE(std::abs(energy.time[k] - 0.0025 * static_cast<double>(k)), 0.5 * step * (1.0 + 1e-9));  // rounding
  }
  for (std::size_t frame = 0; frame < frames.times().size(); ++frame)
    EXPECT_EQ(energy.values[4 * frame], frames.series("kinetic_energy")->values[frame]);
  // What the wall gives over any interval is what momentum, weight and loss say: here while nothing leaves and the plug is there.
  const Recorded momentum = *dense.series("momentum"), impulse = *dense.series("wall_impulse");
  double mass = 0.0;
  for (std::size_t i = 0; i < 48; ++i) mass += 1250.0 * 4.0 / 3.0 * std::numbers::pi * std::pow(pile().radius[i], 3);
  for (std::size_t k = 1; k < 80; ++k) {
    const auto change = [&](const Recorded& series, std::size_t axis) { return series.values[3 * k + axis] - series.values[3 * (k - 1) + axis]; };
    const double weight = -9.81 * mass * (energy.time[k] - energy.time[k - 1]);
    // Rounding: 2^-38 of the largest ball's momentum for each of them, 1e-16 of all impulses so far.
    for (std::size_t axis = 0; axis < 3; ++axis)
      EXPECT_NEAR(change(momentum, axis) - (axis == 2 ? weight : 0.0), change(impulse, axis), 1e-8 * -weight) << k;
  }
}

TEST_F(Program, RecordsCloserThanStepsAreOneAStep) {
  ASSERT_EQ(run({"--set", "stepping.step=1e-4", "--set", "output.observables_every=2e-5"}).code, 0);
  const std::vector<double> time = RunReader(out_).series("discharged")->time;
  ASSERT_EQ(time.size(), 3501u);  // 0.35 s of steps of 1e-4 s
  for (std::size_t k = 0; k < time.size(); ++k) EXPECT_NEAR(time[k], 1e-4 * static_cast<double>(k), 1e-12);  // rounding
}

TEST_F(Program, PhaseEndsWhenTheOutletIsEmptyOrEnoughIsOut) {
  ASSERT_EQ(run({"--set", "phase.1={name='flow', until='discharged:0.1', max_duration=5.0, outlet='open'}"}).code, 2);  // not a table's key
  scratch_.file("scene.toml", R"(
[initial]
state = "pile.h5"
[domain]
outlet_z = -1.0
[stepping]
method = "uniform"
step = 1e-4
[[phase]]
until = "discharged:0.5"
max_duration = 5.0
outlet = "open"
[[phase]]
until = "empty"
max_duration = 60.0
outlet = "open"
)");
  const Result result = run();
  ASSERT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.out.find("of the content, have left"), std::string::npos) << result.out;
  const RunReader reader(out_);
  EXPECT_EQ(reader.frames(), 3);
  EXPECT_GE(reader.observable("discharged", 1)->at(0), 24.0);
  EXPECT_LT(reader.times()[1], 5.0);
}

TEST_F(Program, RunEndsInOrderWhenNoBallIsLeftForTheNextPhase) {
  scratch_.file("one.csv", "id,kind,x,y,z,vx,vy,vz,radius\n0,content,0,0,1,0,0,0,0.2\n");
  scratch_.file("scene.toml", R"(
[initial]
state = "one.csv"
[domain]
outlet_z = 0.0
[[phase]]
until = "empty"
max_duration = 5.0
outlet = "open"
[[phase]]
duration = 1.0
)");
  const Result result = run();
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.out.find("no ball is left"), std::string::npos) << result.out;
  const RunReader reader(out_);
  EXPECT_EQ(reader.frames(), 2);
  // A fall of 1 m takes sqrt(2/9.81) s = 0.4515 s; the end is looked for each 0.01 s, and a step is shorter than that.
  EXPECT_GE(reader.times().back(), 0.4515);
  EXPECT_LE(reader.times().back(), 0.4515 + 0.02);
  EXPECT_EQ(call({"resume", out_}).code, 0);
}

TEST_P(Stepped, ThreadsChangeNoResult) {
  ASSERT_EQ(run({"--set", method(), "--set", "stepping.step=1e-4", "--threads", "1"}).code, 0);
  ASSERT_EQ(call({"run", scene_, "--out", scratch_ / "two", "--set", method(), "--set", "stepping.step=1e-4", "--threads", "2"}).code, 0);
  expect_same_runs(out_, scratch_ / "two");
}

TEST_P(Stepped, StoppedBySignalAndResumedIsBitwiseTheSame) {
  ASSERT_EQ(run(many_steps(GetParam())).code, 0);
  const std::string stopped = scratch_ / "stopped";
  for (const int number : {SIGTERM, SIGINT}) {
    fs::remove_all(stopped);
    const Process process(scratch_, Words{"run", scene_, "--out", stopped} + many_steps(GetParam()) + kManyCheckpoints);
    ASSERT_TRUE(reaches(stopped, 4));
    process.send(number);
    const Result result = process.wait();
    ASSERT_EQ(result.code, 5) << result.err;
    EXPECT_NE(result.err.find("grainclock resume"), std::string::npos);
    const Result resumed = call({"resume", stopped});
    ASSERT_EQ(resumed.code, 0) << resumed.err;
    expect_same_runs(out_, stopped);
  }
}

TEST_P(Stepped, KilledAtAnyMomentOpensUnaidedAndResumes) {
  ASSERT_EQ(run(many_steps(GetParam())).code, 0);
  const std::string killed = scratch_ / "killed";
  const Process process(scratch_, Words{"run", scene_, "--out", killed} + many_steps(GetParam()) + kManyCheckpoints);
  ASSERT_TRUE(reaches(killed, 5));
  process.send(SIGKILL);
  process.wait();
  EXPECT_TRUE(python(R"py(
import sys, h5py, numpy
f = h5py.File(sys.argv[1], "r")
x = f["particles/content/position/value"]
assert len(x) == len(f["particles/content/position/time"]) >= 1 and numpy.isfinite(x[0]).all() and numpy.isfinite(f["particles/content/position/time"][:]).all()
)py",
                     killed + "/run.h5"));
  ASSERT_EQ(call({"resume", killed}).code, 0);
  expect_same_runs(out_, killed);
  EXPECT_NE(call({"resume", killed}).out.find("nothing to resume"), std::string::npos);
}

INSTANTIATE_TEST_SUITE_P(Program, Stepped, ::testing::Values("uniform", "multirate"));

TEST_F(Program, DamagedCheckpointIsPassedOver) {
  const Process process(scratch_, Words{"run", scene_, "--out", out_} + many_steps("uniform") + kManyCheckpoints);
  ASSERT_TRUE(reaches(out_, 2));
  process.send(SIGKILL);
  process.wait();
  const auto checkpoints = checkpoints_in(out_ + "/checkpoints");
  ASSERT_GE(checkpoints.size(), 2u);
  fs::resize_file(checkpoints.front(), fs::file_size(checkpoints.front()) / 2);
  const Result result = call({"resume", out_});
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_NE(result.out.find("passing over a checkpoint"), std::string::npos);
  ASSERT_EQ(call(Words{"run", scene_, "--out", scratch_ / "whole"} + many_steps("uniform")).code, 0);
  expect_same_runs(scratch_ / "whole", out_);
}

// ---------------------------------------------------------------- other files

TEST_F(Program, CsvGoesOutAndInWithoutALostBit) {
  ASSERT_EQ(call({"export", scratch_ / "pile.h5", "--to", "csv", "--output", scratch_ / "a.csv"}).code, 0);
  ASSERT_EQ(call({"import", scratch_ / "a.csv", "--output", scratch_ / "a.h5"}).code, 0);
  EXPECT_EQ(core::checksum(core::read_state(scratch_ / "a.h5")), core::checksum(pile()));
}

TEST_F(Program, LammpsFilesGoOutAndInWithoutALostBit) {
  for (const char* format : {"lammps-data", "lammps-dump"}) {
    ASSERT_EQ(call({"export", scratch_ / "pile.h5", "--to", format, "--output", scratch_ / "a.lmp"}).code, 0);
    const Result result = call({"import", scratch_ / "a.lmp", "--output", scratch_ / "a.h5"});
    ASSERT_EQ(result.code, 0) << result.err;
    EXPECT_EQ(core::checksum(core::read_state(scratch_ / "a.h5")), core::checksum(pile())) << format;
  }
}

TEST_F(Program, UnsortedDumpWithDiametersIsImported) {
  const std::string dump = scratch_.file("a.dump", "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS ff ff ff\n0 1\n0 1\n0 1\n"
                                                   "ITEM: ATOMS id type x y z diameter\n1 1 9 9 9 0.5\n"
                                                   "ITEM: TIMESTEP\n1\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS ff ff ff\n0 1\n0 1\n0 1\n"
                                                   "ITEM: ATOMS diameter id z type y x\n0.5 7 3 2 2 1\n0.6 2 6 1 5 4\n");
  ASSERT_EQ(call({"import", dump, "--output", scratch_ / "a.h5"}).code, 0);
  const State state = core::read_state(scratch_ / "a.h5");
  EXPECT_EQ(state.id, (std::vector<core::BallId>{1, 6}));
  EXPECT_EQ(state.kind[1], Kind::wall);
  EXPECT_EQ(state.position[0], Vec3(4, 5, 6));
  EXPECT_EQ(state.radius[0], 0.3);
}

TEST_F(Program, WrongImportsNameTheLine) {
  const std::string head = "ITEM: NUMBER OF ATOMS\n1\nITEM: ATOMS id type x y z radius\n";
  const Bad cases[] = {{"1 9 0 0 0 0.2\n", "a.dump:4: `1 9 0 0 0 0.2`: type 9 is none of ours"},
                       {"1 1 0 0 x 0.2\n", "`x` must be a finite number"},
                       {"1 1 0 0 0 -0.2\n", "radius must be above 0"},
                       {"1 1 0 0\n", "more are wanted"},
                       {"", "the file ends"}};
  for (const Bad& bad : cases) {
    const Result result = call({"import", scratch_.file("a.dump", head + bad.text), "--output", scratch_ / "b.h5"});
    EXPECT_EQ(result.code, 2);
    EXPECT_NE(result.err.find(bad.expected), std::string::npos) << result.err;
  }
  EXPECT_FALSE(fs::exists(scratch_ / "b.h5"));
}

TEST_F(Program, VtkFilesHoldEveryBallAndFrame) {
  ASSERT_EQ(call({"export", scratch_ / "pile.h5", "--to", "vtk", "--output", scratch_ / "a.vtp"}).code, 0);
  EXPECT_TRUE(python(R"py(
import re, struct, sys
raw = open(sys.argv[1], "rb").read()
head, data = raw.split(b'<AppendedData encoding="raw">\n_', 1)
assert b'NumberOfPoints="129"' in head
def array(name, code):
    at = int(re.search(b'Name="%s"[^>]*offset="(\\d+)"' % name, head).group(1))
    (length,) = struct.unpack_from("<Q", data, at)
    return struct.unpack_from("<%d%s" % (length // struct.calcsize(code), code), data, at + 8)
assert array(b"id", "q") == tuple(range(129))
assert len(array(b"position", "d")) == 387 and array(b"position", "d")[:2] == (-0.7, -0.72)
assert array(b"radius", "d")[1] == 0.216 and sorted(set(array(b"kind", "B"))) == [0, 1, 2]
assert data.rstrip().endswith(b"</VTKFile>")
)py",
                     scratch_ / "a.vtp"));
  ASSERT_EQ(run().code, 0);
  ASSERT_EQ(call({"export", out_ + "/run.h5", "--to", "vtk", "--output", scratch_ / "run.pvd", "--all"}).code, 0);
  EXPECT_TRUE(fs::exists(scratch_ / "run_000035.vtp"));
  EXPECT_NE(text_of(scratch_ / "run.pvd").find("file=\"run_000035.vtp\""), std::string::npos);
  EXPECT_EQ(call({"export", scratch_ / "pile.h5", "--to", "vtk", "--output", scratch_ / "a.png"}).code, 2);
  EXPECT_EQ(call({"export", scratch_ / "pile.h5", "--to", "vtk", "--output", scratch_ / "a.pvd", "--all"}).code, 2);
}

TEST_F(Program, ExportTakesTheLastFrameOrTheOneAsked) {
  ASSERT_EQ(run().code, 0);
  const RunReader reader(out_);
  for (const bool asked : {false, true}) {
    Words arguments{"export", out_ + "/run.h5", "--to", "lammps-dump", "--output", scratch_ / "a.dump"};
    if (asked) arguments.insert(arguments.end(), {"--at", "0.1"});
    ASSERT_EQ(call(arguments).code, 0);
    ASSERT_EQ(call({"import", scratch_ / "a.dump", "--output", scratch_ / "a.h5"}).code, 0);
    const State wanted = reader.state(asked ? 10 : reader.frames() - 1), found = core::read_state(scratch_ / "a.h5");
    EXPECT_EQ(found.time, wanted.time);
    EXPECT_TRUE(tests::same_bits(found.position, wanted.position));
  }
  EXPECT_EQ(call({"export", out_ + "/run.h5", "--to", "csv", "--output", scratch_ / "b.csv", "--at", "7"}).code, 2);
}

TEST_F(Program, CheckInfoAndComparePrintJson) {
  ASSERT_EQ(run().code, 0);
  const std::string json = "import json, sys; d = json.load(open(sys.argv[1])); ";
  const auto read_by_python = [&](const Words& arguments, const std::string& assertion) {
    const Result result = call(arguments);
    EXPECT_EQ(result.code, 0) << result.err;
    return python(json + assertion, scratch_.file("report.json", result.out));
  };
  EXPECT_TRUE(read_by_python({"check", scene_, "--json"}, "assert d['content'] == 48 and d['phase_0']['critical_step_pair'] > 1e-4 and d['memory'] > 0"));
  EXPECT_TRUE(read_by_python({"info", out_, "--json"}, "assert d['frames'] == 36 and d['provenance']['seed'] == 1"));
  EXPECT_TRUE(read_by_python({"info", scratch_ / "pile.h5", "--json"}, "assert d['kind'] == 'state' and d['content'] == 48 and len(d['checksum']) == 16"));
  EXPECT_TRUE(read_by_python({"compare", out_, out_ + "/run.h5", "--json"}, "assert d['position']['rms'] == 0 and d['distance_max'] == 0 and d['displacement'] > 0"));
  ASSERT_EQ(call({"run", scene_, "--out", scratch_ / "coarse", "--set", "stepping.step=5e-5"}).code, 0);
  EXPECT_TRUE(read_by_python({"compare", scratch_ / "coarse", out_, "--at", "0.05", "--json"}, "assert 0 < d['position']['rms'] < 0.1"));
}

TEST_F(Program, CheckWritesNothing) {
  const auto before = std::distance(fs::directory_iterator(scratch_.path()), {});
  const Result result = call({"check", scene_});
  EXPECT_EQ(result.code, 0) << result.err;
  EXPECT_EQ(std::distance(fs::directory_iterator(scratch_.path()), {}), before + 2);  // stdout and stderr
}

}  // namespace
}  // namespace grainclock::silo
