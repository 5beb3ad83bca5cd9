#include "silo/run_file.hpp"

#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "tests/support/scratch.hpp"

#include <cmath>
#include <cstdlib>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;
using core::Vec3;
using tests::message_of;
using tests::Scratch;

/// Content 1, 3, 4 between walls 0 and 2 and plug 5.
State start() {
  State state;
  state.add(0, Kind::wall, Vec3(0, 0, -1), Vec3::Zero(), 0.5);
  state.add(1, Kind::content, Vec3(1, 0, 0), Vec3(0, 0, 1), 0.1);
  state.add(2, Kind::wall, Vec3(0, 0, -2), Vec3::Zero(), 0.5);
  state.add(3, Kind::content, Vec3(3, 0, 0), Vec3(0, 0, 3), 0.3);
  state.add(4, Kind::content, Vec3(4, 0, 0), Vec3(0, 0, 4), 0.4);
  state.add(5, Kind::plug, Vec3(0, 0, -3), Vec3::Zero(), 0.5);
  return state;
}

/// The balls at frame k: moved by k, each at its own level; ball 3 leaves at frame 5.
Frame frame(std::int64_t k) {
  Frame frame{0.1 * static_cast<double>(k), 10 * k, {}, {}};
  const State from = start();
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (from.id[i] == 3 && k >= 5) continue;
    const Vec3 shift = from.kind[i] == Kind::content ? Vec3(0, static_cast<double>(k), 0) : Vec3::Zero();
    frame.state.add(from.id[i], from.kind[i], from.position[i] + shift, from.velocity[i], from.radius[i]);
    frame.state.level.push_back(from.kind[i] == Kind::content ? static_cast<std::uint8_t>(from.id[i]) : std::uint8_t{0});
  }
  frame.state.time = frame.time;
  frame.observables = {{"kinetic_energy", "J", {}, {1.5 * static_cast<double>(k)}},
                       {"momentum", "kg m s-1", {3}, {1.0, 2.0, static_cast<double>(k)}}};
  return frame;
}

/// Three records for each frame, the last of them with it.
Record record(std::int64_t k) {
  const double time = 0.1 * static_cast<double>(k) / 3.0;
  return {time, k, {{"discharged", "", {}, {static_cast<double>(k * k)}}, {"lateral_force_by_layer", "N", {2, 2}, {1.0, 2.0, time, -time}}}};
}

void expect_records(const std::filesystem::path& directory, std::int64_t n) {
  const RunReader run(directory);
  const auto discharged = run.series("discharged"), lateral = run.series("lateral_force_by_layer");
  ASSERT_EQ(discharged.has_value(), n > 0);
  if (n == 0) return;
  ASSERT_EQ(discharged->time.size(), static_cast<std::size_t>(n));
  EXPECT_EQ(discharged->width, 1u);
  EXPECT_EQ(lateral->width, 4u);
  for (std::int64_t k = 0; k < n; ++k) {
    const auto at = static_cast<std::size_t>(k);
    const Record wanted = record(k);
    EXPECT_EQ(discharged->time[at], wanted.time);
    EXPECT_EQ(discharged->values[at], wanted.observables[0].values[0]);
    EXPECT_EQ(std::vector<double>(lateral->values.begin() + 4 * k, lateral->values.begin() + 4 * (k + 1)), wanted.observables[1].values);
  }
}

core::Scene scene() {
  core::Scene scene;
  scene.seed = 7;
  scene.text = "seed = 7\n";
  return scene;
}

void expect_frames(const std::filesystem::path& directory, std::int64_t n) {
  const RunReader run(directory);
  ASSERT_EQ(run.frames(), n);
  for (std::int64_t k = 0; k < n; ++k) {
    const Frame wanted = frame(k);
    const State state = run.state(k);
    EXPECT_EQ(run.times()[static_cast<std::size_t>(k)], wanted.time);
    EXPECT_EQ(run.step(k), wanted.step);
    EXPECT_EQ(state.id, wanted.state.id);
    EXPECT_EQ(state.kind, wanted.state.kind);
    EXPECT_EQ(state.position, wanted.state.position);
    EXPECT_EQ(state.velocity, wanted.state.velocity);
    EXPECT_EQ(state.radius, wanted.state.radius);
    EXPECT_EQ(state.level, wanted.state.level);
    EXPECT_EQ(run.observable("kinetic_energy", k), wanted.observables[0].values);
    EXPECT_EQ(run.observable("momentum", k), wanted.observables[1].values);
  }
}

std::size_t files_in(const std::filesystem::path& directory) {
  std::size_t n = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(directory)) ++n;
  return n;
}

TEST(RunFile, EveryFlushedFrameReadsBack) {
  const Scratch scratch;
  const core::Scene its_scene = scene();
  RunFile file(scratch.path(), start(), {its_scene, 2, {}});
  expect_frames(scratch.path(), 0);
  for (std::int64_t k = 0; k < 7; ++k) {
    file.add(frame(k));
    if (k % 3 != 2) continue;
    file.flush();
    expect_frames(scratch.path(), k + 1);  // as it is while the run goes on
  }
  file.flush();
  expect_frames(scratch.path(), 7);
}

TEST(RunFile, ManySmallSegmentsBecomeFew) {
  const Scratch scratch;
  const core::Scene its_scene = scene();
  RunFile file(scratch.path(), start(), {its_scene, 1, {}});
  for (std::int64_t k = 0; k < 200; ++k) {
    file.add(frame(k));
    file.flush();
    // At most 7 segments of each of the ranks 0 (1 to 7 frames), 1 (to 63) and 2 (to 511), and start.h5.
    EXPECT_LE(files_in(scratch.path() / "segments"), 22u);
  }
  expect_frames(scratch.path(), 200);
}

TEST(RunFile, ResumedRunDropsLaterFramesAndGoesOn) {
  for (const std::int64_t kept : {0, 3, 8, 9, 20}) {
    const Scratch scratch;
    const core::Scene its_scene = scene();
    {
      RunFile file(scratch.path(), start(), {its_scene, 1, {}});
      for (std::int64_t k = 0; k < 20; ++k) {
        file.add(frame(k));
        file.flush();  // frames 0 to 7 and 8 to 15 are merged: 3 and 9 lie within a segment
      }
    }
    RunFile file = RunFile::resumed(scratch.path(), {its_scene, 1, {}}, kept, 0);
    expect_frames(scratch.path(), kept);
    for (std::int64_t k = kept; k < 23; ++k) file.add(frame(k));
    file.flush();
    expect_frames(scratch.path(), 23);
  }
}

TEST(RunFile, ResumingNeedsTheFramesOfTheCheckpoint) {
  const Scratch scratch;
  const core::Scene its_scene = scene();
  RunFile(scratch.path(), start(), {its_scene, 1, {}}).add(frame(0));
  const auto text = message_of<core::FileError>([&] { RunFile::resumed(scratch.path(), {its_scene, 1, {}}, 5, 0); });
  EXPECT_NE(text.find("frames 0 to 4, which a checkpoint needs, are missing or damaged"), std::string::npos) << text;
}

TEST(RunFile, LostFramesAreNotMergedAndEndNoRun) {
  const Scratch scratch;
  const core::Scene its_scene = scene();
  RunFile file(scratch.path(), start(), {its_scene, 1, {}});
  for (std::int64_t k = 0; k < 20; ++k) {  // 0 to 7 would become one, and 8 to 15
    if (k == 3) std::filesystem::remove(scratch / "segments/frames-00000001-00000002.h5");
    file.add(frame(k));
    file.flush();
  }
  EXPECT_EQ(files_in(scratch.path() / "segments"), 1u + 7u + 1u + 4u);  // the start, seven of eight, a merged one, the last
  EXPECT_THROW(RunReader(scratch.path()), core::FileError);
  const auto text = message_of<core::FileError>([&] { RunFile::resumed(scratch.path(), {its_scene, 1, {}}, 5, 0); });
  EXPECT_NE(text.find("frames 1 to 4, which"), std::string::npos) << text;
  RunFile::resumed(scratch.path(), {its_scene, 1, {}}, 1, 0);
  expect_frames(scratch.path(), 1);
}

TEST(RunFile, DamagedMergedSegmentGivesWayToItsParts) {
  const Scratch scratch;
  const core::Scene its_scene = scene();
  {
    RunFile file(scratch.path(), start(), {its_scene, 1, {}});
    for (std::int64_t k = 0; k < 3; ++k) {
      file.add(frame(k));
      file.flush();
    }
  }
  scratch.file("segments/frames-00000000-00000003.h5", "cut off");
  RunFile::resumed(scratch.path(), {its_scene, 1, {}}, 3, 0);
  expect_frames(scratch.path(), 3);
}

TEST(RunFile, RecordsBetweenFramesReadBackAndFramesFindTheirs) {
  const Scratch scratch;
  const core::Scene its_scene = scene();
  RunFile file(scratch.path(), start(), {its_scene, 1, {0.0, 1.0, 2.0}});
  for (std::int64_t k = 0; k < 60; ++k) {
    file.add(record(k));
    if (k % 10 == 0) file.add(frame(k / 10));  // of the same step
    if (k % 4 == 0) file.flush();
  }
  file.flush();
  EXPECT_EQ(file.frames(), 6);
  EXPECT_EQ(file.records(), 60);
  expect_frames(scratch.path(), 6);
  expect_records(scratch.path(), 60);
  const RunReader run(scratch.path());
  for (std::int64_t k = 0; k < 6; ++k) EXPECT_EQ(run.observable("discharged", k)->at(0), 100.0 * static_cast<double>(k * k));
  EXPECT_FALSE(run.series("nothing"));
}

TEST(RunFile, FrameWithoutItsRecordIsAnError) {
  const Scratch scratch;
  const core::Scene its_scene = scene();
  RunFile file(scratch.path(), start(), {its_scene, 1, {}});
  file.add(frame(0));
  file.add(frame(1));
  file.add(record(0));
  file.flush();
  const RunReader run(scratch.path());
  EXPECT_EQ(run.observable("discharged", 0)->at(0), 0.0);
  EXPECT_NE(message_of<core::FileError>([&] { run.observable("discharged", 1); }).find("frame 1"), std::string::npos);
}

TEST(RunFile, ResumedRunDropsLaterRecordsAndGoesOn) {
  for (const std::int64_t kept : {0, 3, 8, 9, 20}) {
    const Scratch scratch;
    const core::Scene its_scene = scene();
    {
      RunFile file(scratch.path(), start(), {its_scene, 1, {}});
      for (std::int64_t k = 0; k < 20; ++k) {
        file.add(record(k));
        file.flush();
      }
    }
    RunFile file = RunFile::resumed(scratch.path(), {its_scene, 1, {}}, 0, kept);
    expect_records(scratch.path(), kept);
    for (std::int64_t k = kept; k < 23; ++k) file.add(record(k));
    file.flush();
    expect_records(scratch.path(), 23);
  }
}

TEST(RunFile, FrameNearestInTimeIsFound) {
  const Scratch scratch;
  const core::Scene its_scene = scene();
  RunFile file(scratch.path(), start(), {its_scene, 1, {}});
  for (std::int64_t k = 0; k < 5; ++k) file.add(frame(k));
  file.flush();
  const RunReader run(scratch.path());
  EXPECT_EQ(run.frame_at(0.31), 3);
  EXPECT_EQ(run.frame_at(0.4), 4);
  EXPECT_THROW(run.frame_at(0.5), core::InputError);
  EXPECT_EQ(read_moment(scratch / "run.h5", 0.2).position[1], Vec3(1, 2, 0));
  EXPECT_EQ(read_moment(scratch / "run.h5").position[1], Vec3(1, 4, 0));
}

TEST(RunFile, MissingSegmentsAreAnError) {
  const Scratch scratch;
  const core::Scene its_scene = scene();
  RunFile file(scratch.path(), start(), {its_scene, 1, {}});
  file.add(frame(0));
  file.flush();
  std::filesystem::copy_file(scratch / "run.h5", scratch / "alone.h5");
  std::filesystem::remove_all(scratch / "segments");
  EXPECT_NE(message_of<core::FileError>([&] { RunReader(scratch / "run.h5"); }).find("segments"), std::string::npos);
}

TEST(RunFile, OpensInPythonFromAnotherDirectoryAsH5md) {
  const Scratch scratch;
  const core::Scene its_scene = scene();
  std::filesystem::create_directory(scratch.path() / "out");
  RunFile file(scratch.path() / "out", start(), {its_scene, 3, {0.0, 1.0, 2.0}});
  for (std::int64_t k = 0; k < 12; ++k) {
    for (std::int64_t part = std::max<std::int64_t>(0, 10 * k - 9); part <= 10 * k; ++part) file.add(record(part));
    file.add(frame(k));
    if (k % 2 == 1) file.flush();
  }
  const std::string script = scratch.file("read.py", R"(
import sys, h5py, numpy
f = h5py.File(sys.argv[1], "r")
assert list(f["h5md"].attrs["version"]) == [1, 1]
assert f["h5md/author"].attrs["name"] and f["h5md/creator"].attrs["name"] == "grainclock" and f["h5md/creator"].attrs["version"]
c = f["particles/content"]
assert list(c["id"]) == [1, 3, 4] and list(c["radius"]) == [0.1, 0.3, 0.4]
assert c["box"].attrs["dimension"] == 3 and list(c["box"].attrs["boundary"]) == ["none"] * 3
x = c["position/value"]
assert x.shape == (12, 3, 3) and x.attrs["unit"] == "m", x.shape
assert (x[:, 0, 1] == numpy.arange(12)).all()
assert numpy.isfinite(x[:5]).all() and numpy.isnan(x[5:, 1]).all() and numpy.isfinite(x[5:, ::2]).all()
assert c["velocity/value"].attrs["unit"] == "m s-1" and (c["velocity/value"][:, 2, 2] == 4).all()
assert list(c["level/value"][11]) == [1, 255, 4]
for name in ("position", "velocity", "level"):
    assert (c[name + "/step"][:] == 10 * numpy.arange(12)).all() and numpy.allclose(c[name + "/time"][:], 0.1 * numpy.arange(12))
w = f["particles/wall"]
assert list(w["id"]) == [0, 2, 5] and list(w["kind"]) == [1, 1, 2] and w["position"].shape == (3, 3) and len(w["radius"]) == 3
o = f["observables"]
assert (o["kinetic_energy/value"][:] == 1.5 * numpy.arange(12)).all() and o["kinetic_energy/value"].attrs["unit"] == "J"
assert o["momentum/value"].shape == (12, 3) and len(o["momentum/time"]) == 12
d, l = o["discharged"], o["lateral_force_by_layer"]
assert (d["value"][:] == numpy.arange(111) ** 2).all() and (d["step"][:] == numpy.arange(111)).all()
assert d["time"] == l["time"] and d["time"].attrs["unit"] == "s" and numpy.allclose(d["time"][:], numpy.arange(111) / 30)
assert l["value"].shape == (111, 2, 2) and l["value"].attrs["unit"] == "N" and list(l["value"].attrs["layer_edges"]) == [0, 1, 2]
assert o["momentum/time"] == c["position/time"]
p = f["provenance"]
assert p["scene"][()] == b"seed = 7\n" and p["seed"][()] == 7 and p["threads"][()] == 3
for name in ("version", "git_revision", "compiler", "flags", "host", "libraries"):
    assert p[name][()], name
)");
  EXPECT_EQ(std::system(fmt::format("cd / && /usr/bin/python3 {} {}", script, scratch / "out/run.h5").c_str()), 0);
}

}  // namespace
}  // namespace grainclock::silo
