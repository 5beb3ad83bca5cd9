#include "silo/paraview.hpp"

#include "core/check.hpp"
#include "silo/export.hpp"
#include "silo/frame_contacts.hpp"
#include "silo/vtp.hpp"
#include "tests/support/gated_run.hpp"

#include <fmt/format.h>

#include <cstring>
#include <limits>
#include <map>
#include <regex>
#include <set>

namespace grainclock::silo {
namespace {

namespace fs = std::filesystem;
using core::Kind;
using core::State;
using core::Vec3;
using tests::message_of;
using tests::Scratch;
using tests::text_of;

/// What a .vtp says, read by its XML alone.
struct Content {
  std::size_t points = 0, vertices = 0, lines = 0;
  std::map<std::string, std::vector<double>> arrays;  // "PointData/radius": its values, vectors one after the other
};

template <class T>
std::vector<double> values_at(const std::string& data, std::size_t offset) {
  std::uint64_t length = 0;
  std::memcpy(&length, data.data() + offset, sizeof length);
  std::vector<T> values(length / sizeof(T));
  if (length > 0) std::memcpy(values.data(), data.data() + offset + sizeof length, length);
  return {values.begin(), values.end()};
}

std::size_t number_of(const std::string& xml, const std::string& attribute) {
  std::smatch found;
  return std::regex_search(xml, found, std::regex(attribute + "=\"(\\d+)\"")) ? std::stoul(found[1]) : 0;
}

Content read(const std::string& text) {
  const std::string begin = "<AppendedData encoding=\"raw\">\n_";
  const std::size_t split = text.find(begin);
  EXPECT_NE(split, std::string::npos);
  const std::string xml = text.substr(0, split), data = text.substr(split + begin.size());
  EXPECT_NE(xml.find("byte_order=\"LittleEndian\" header_type=\"UInt64\""), std::string::npos);
  EXPECT_TRUE(data.ends_with("\n</AppendedData>\n</VTKFile>\n"));
  Content content{number_of(xml, "NumberOfPoints"), number_of(xml, "NumberOfVerts"), number_of(xml, "NumberOfLines"), {}};
  const std::regex tag("<(FieldData|PointData|CellData|Points|Verts|Lines)>|<DataArray type=\"(\\w+)\" Name=\"(\\w+)\" [^>]*offset=\"(\\d+)\"[^>]*/>");
  std::string section;
  for (std::sregex_iterator at(xml.begin(), xml.end(), tag), none; at != none; ++at) {
    if ((*at)[1].matched) {
      section = (*at)[1];
      continue;
    }
    const std::string type = (*at)[2];
    const std::size_t offset = std::stoul((*at)[4]);
    std::vector<double>& values = content.arrays[section + "/" + (*at)[3].str()];
    if (type == "Float64") values = values_at<double>(data, offset);
    else if (type == "Int64") values = values_at<std::int64_t>(data, offset);
    else if (type == "UInt8") values = values_at<std::uint8_t>(data, offset);
    else ADD_FAILURE() << type;
  }
  return content;
}

using Values = std::vector<double>;

/// Content 1, 3 and 4 between walls 0 and 2 and plug 5.
State state() {
  State state;
  state.time = 2.5;
  state.add(0, Kind::wall, Vec3(0, 0, -1), Vec3::Zero(), 0.5);
  state.add(1, Kind::content, Vec3(1, 2, 3), Vec3(0, 3, 4), 0.1);
  state.add(2, Kind::wall, Vec3(0, 0, -2), Vec3::Zero(), 0.6);
  state.add(3, Kind::content, Vec3(1, 2, 7), Vec3(0, 0, -3), 0.3);
  state.add(4, Kind::content, Vec3(4, 0, 0), Vec3(2, 3, 6), 0.4);
  state.add(5, Kind::plug, Vec3(0, 0, -3), Vec3::Zero(), 0.7);
  state.level = {0, 7, 0, 2, 5, 0};
  return state;
}

TEST(Paraview, BallsAreTheContent) {
  const Content content = read(balls_vtp(state()));
  EXPECT_EQ(content.points, 3u);
  EXPECT_EQ(content.vertices, 3u);
  EXPECT_EQ(content.lines, 0u);
  const std::map<std::string, Values> wanted{{"FieldData/TimeValue", {2.5}},
                                             {"PointData/id", {1, 3, 4}},
                                             {"PointData/radius", {0.1, 0.3, 0.4}},
                                             {"PointData/velocity", {0, 3, 4, 0, 0, -3, 2, 3, 6}},
                                             {"PointData/speed", {5, 3, 7}},  // exact squares
                                             {"PointData/level", {7, 2, 5}},
                                             {"PointData/kind", {0, 0, 0}},
                                             {"Points/position", {1, 2, 3, 1, 2, 7, 4, 0, 0}},
                                             {"Verts/connectivity", {0, 1, 2}},
                                             {"Verts/offsets", {1, 2, 3}}};
  EXPECT_EQ(content.arrays, wanted);
}

TEST(Paraview, StatesWithoutLevelsShowLevelZero) {
  State plain = state();
  plain.level.clear();
  EXPECT_EQ(read(balls_vtp(plain)).arrays["PointData/level"], (Values{0, 0, 0}));
}

TEST(Paraview, ContactsAreLinesBetweenCentres) {
  // 3 above 1: pushed apart; 3 drawn to wall 0 (cohesion); 4 at plug 5 along an oblique line of length 5.
  const std::vector<core::Contact> contacts{{1, 3, Kind::content, 0.01, -0.2, Vec3(0, 0, -100)},
                                            {1, 0, Kind::wall, -0.02, 0.1, Vec3(-1, -2, -4) * 10.0},
                                            {4, 5, Kind::plug, 0.03, 0.0, Vec3(4, 0, 3) * 2.0}};
  const Content content = read(contacts_vtp(state(), contacts));
  EXPECT_EQ(content.points, 6u);
  EXPECT_EQ(content.vertices, 0u);
  EXPECT_EQ(content.lines, 3u);
  const auto& force = content.arrays.at("CellData/normal_force");
  ASSERT_EQ(force.size(), 3u);
  // Rounding of a root and a few products.
  EXPECT_NEAR(force[0], 100.0, 1e-13);
  EXPECT_NEAR(force[1], -10.0 * std::sqrt(21.0), 1e-13);
  EXPECT_NEAR(force[2], 10.0, 1e-14);
  std::map<std::string, Values> others = content.arrays;
  others.erase("CellData/normal_force");
  const std::map<std::string, Values> wanted{{"FieldData/TimeValue", {2.5}},
                                             {"CellData/overlap", {0.01, -0.02, 0.03}},
                                             {"CellData/kind", {0, 1, 2}},
                                             {"CellData/first", {1, 1, 4}},
                                             {"CellData/second", {3, 0, 5}},
                                             {"Points/position", {1, 2, 3, 1, 2, 7, 1, 2, 3, 0, 0, -1, 4, 0, 0, 0, 0, -3}},
                                             {"Lines/connectivity", {0, 1, 2, 3, 4, 5}},
                                             {"Lines/offsets", {2, 4, 6}}};
  EXPECT_EQ(others, wanted);
}

TEST(Paraview, WallHasItsPlugAndPressureOnlyIfAsked) {
  const Content plain = read(wall_vtp(state(), true));
  EXPECT_EQ(plain.arrays.at("PointData/id"), (Values{0, 2, 5}));
  EXPECT_EQ(plain.arrays.at("PointData/kind"), (Values{1, 1, 2}));
  EXPECT_EQ(plain.arrays.at("PointData/radius"), (Values{0.5, 0.6, 0.7}));
  EXPECT_EQ(plain.arrays.at("Points/position"), (Values{0, 0, -1, 0, 0, -2, 0, 0, -3}));
  EXPECT_FALSE(plain.arrays.contains("PointData/pressure"));
  const Content pressed = read(wall_vtp(state(), false, {10, 11, 12, 13, 14, 15}));
  EXPECT_EQ(pressed.arrays.at("PointData/id"), (Values{0, 2}));
  EXPECT_EQ(pressed.arrays.at("PointData/pressure"), (Values{10, 12}));
}

TEST(Paraview, WhatDoesNotBelongTogetherIsRejected) {
  EXPECT_THROW(wall_vtp(state(), true, {1.0, 2.0}), core::InputError);
  EXPECT_THROW(contacts_vtp(state(), {{1, 9, Kind::content, 0.0, 0.0, Vec3::Zero()}}), core::InputError);
  EXPECT_THROW(Vtp(Vtp::Cells::lines, 0.0, {Vec3::Zero()}), core::InputError);
  Vtp vtp(Vtp::Cells::vertices, 0.0, {Vec3::Zero()});
  EXPECT_THROW(vtp.add("speed", std::vector<double>{1.0, 2.0}), core::InputError);
  EXPECT_THROW(vtp.add("velocity", std::vector<Vec3>{}), core::InputError);
}

// ---------------------------------------------------------------- whole runs

/// The times and files of a collection.
std::vector<std::pair<double, std::string>> entries(const fs::path& pvd) {
  const std::string text = text_of(pvd);
  std::vector<std::pair<double, std::string>> found;
  const std::regex entry("<DataSet timestep=\"([^\"]+)\" file=\"([^\"]+)\"/>");
  for (std::sregex_iterator at(text.begin(), text.end(), entry), none; at != none; ++at) found.emplace_back(std::stod((*at)[1]), (*at)[2]);
  return found;
}

class ParaviewRun : public testing::Test {
 protected:
  std::size_t frames() const { return run_.times().size(); }
  void export_it(std::optional<double> at = std::nullopt, const WallPressure& pressure = {}) const { export_paraview(run_, out_, at, pressure); }
  Content file(const std::string& name, std::size_t frame) const {
    return read(text_of(fs::path(out_) / fmt::format("frames/{}_{:06}.vtp", name, frame)));
  }
  /// All files, as seen from the directory.
  std::set<std::string> files() const {
    std::set<std::string> found;
    for (const auto& entry : fs::recursive_directory_iterator(out_))
      if (entry.is_regular_file()) found.insert(fs::relative(entry.path(), out_).string());
    return found;
  }
  Scratch scratch_;
  std::string path_ = tests::gated_run(scratch_), out_ = scratch_ / "pv";
  RunReader run_{path_};
};
using SlowParaview = ParaviewRun;

TEST_F(ParaviewRun, EveryFrameIsThereAndNothingElse) {
  export_it();
  std::set<std::string> wanted{"balls.pvd", "contacts.pvd", "wall.pvd"};
  for (const char* name : {"balls", "contacts"}) {
    const auto listed = entries(fs::path(out_) / (std::string(name) + ".pvd"));
    ASSERT_EQ(listed.size(), frames());
    for (std::size_t k = 0; k < frames(); ++k) {
      EXPECT_EQ(listed[k].first, run_.times()[k]);
      wanted.insert(listed[k].second);
    }
  }
  const auto wall = entries(fs::path(out_) / "wall.pvd");
  ASSERT_EQ(wall.size(), 1u);
  wanted.insert(wall[0].second);
  EXPECT_EQ(wanted.size(), 3 + 2 * frames() + 1);
  EXPECT_EQ(files(), wanted);
}

TEST_F(ParaviewRun, FramesHoldWhatTheRunRecorded) {
  export_it();
  for (std::size_t k = 0; k < frames(); ++k) {
    const State at = run_.state(static_cast<std::int64_t>(k));
    Values position, velocity;
    for (std::size_t i = 0; i < at.size(); ++i) {
      if (at.kind[i] != Kind::content) continue;
      position.insert(position.end(), at.position[i].data(), at.position[i].data() + 3);
      velocity.insert(velocity.end(), at.velocity[i].data(), at.velocity[i].data() + 3);
    }
    const Content balls = file("balls", k), contacts = file("contacts", k);
    EXPECT_EQ(balls.arrays.at("Points/position"), position);
    EXPECT_EQ(balls.arrays.at("PointData/velocity"), velocity);
    EXPECT_EQ(static_cast<double>(contacts.lines), run_.observable("contacts", static_cast<std::int64_t>(k))->at(0));
    double deepest = 0.0;
    for (const double overlap : contacts.arrays.at("CellData/overlap")) deepest = std::max(deepest, overlap);
    // Rounding of positions of a few metres.
    EXPECT_NEAR(deepest, run_.observable("largest_overlap", static_cast<std::int64_t>(k))->at(0), 1e-15);
  }
  EXPECT_EQ(file("balls", frames() - 1).points, 0u);  // the run ends empty
}

TEST_F(ParaviewRun, PressureMakesTheWallASeriesWithThePlugWhileTheOutletIsClosed) {
  const WallPressure count = [](const State& at, const std::vector<core::Contact>& contacts) {
    return std::vector<double>(at.size(), static_cast<double>(contacts.size()));
  };
  export_it(std::nullopt, count);
  ASSERT_EQ(entries(fs::path(out_) / "wall.pvd").size(), frames());
  const State start = run_.state(0);
  const std::size_t wall = start.count(Kind::wall), plug = start.count(Kind::plug);
  ASSERT_GT(plug, 0u);
  const ContactFinder finder(run_);
  for (std::size_t k = 0; k < frames(); ++k) {
    const Content fixed = file("wall", k);
    const auto frame = static_cast<std::int64_t>(k);
    EXPECT_EQ(fixed.points, finder.contacts(frame, run_.state(frame)).outlet_open ? wall : wall + plug) << run_.times()[k];
    EXPECT_EQ(fixed.arrays.at("PointData/pressure"), Values(fixed.points, run_.observable("contacts", frame)->at(0)));
  }
}

TEST_F(ParaviewRun, ProgramWritesTheHorizontalForceOverTheSquareAroundEachWallBall) {
  export_file(path_, {Format::paraview, out_, std::nullopt, false});
  for (std::size_t k = 0; k < frames(); ++k) {
    const Content fixed = file("wall", k), contacts = file("contacts", k);
    const auto &id = fixed.arrays.at("PointData/id"), &radius = fixed.arrays.at("PointData/radius"), &pressure = fixed.arrays.at("PointData/pressure"),
               &force = contacts.arrays.at("CellData/normal_force"), &ends = contacts.arrays.at("Points/position"),
               &second = contacts.arrays.at("CellData/second");
    for (std::size_t i = 0; i < id.size(); ++i) {
      if (fixed.arrays.at("PointData/kind")[i] == 2.0) {  // the plug is no part of the wall
        EXPECT_TRUE(std::isnan(pressure[i]));
        continue;
      }
      double x = 0.0, y = 0.0, largest = 0.0;
      for (std::size_t c = 0; c < force.size(); ++c) {
        if (second[c] != id[i]) continue;
        const Vec3 n = (Vec3(&ends[6 * c + 3]) - Vec3(&ends[6 * c])).normalized();
        x += force[c] * n[0], y += force[c] * n[1], largest = std::max(largest, std::abs(force[c]));
      }
      const double area = 4.0 * radius[i] * radius[i];
      EXPECT_NEAR(pressure[i], std::hypot(x, y) / area, 1e-12 * largest / area);  // rounding
    }
  }
}

TEST_F(ParaviewRun, OneFrameIsTheOneAskedFor) {
  export_it(0.2);
  const auto listed = entries(fs::path(out_) / "balls.pvd");
  ASSERT_EQ(listed.size(), 1u);
  EXPECT_EQ(listed[0].second, "frames/balls_000002.vtp");  // every 0.1 s
  EXPECT_THROW(export_paraview(run_, scratch_ / "late", 99.0), core::InputError);
  EXPECT_FALSE(fs::exists(scratch_ / "late"));
}

TEST_F(ParaviewRun, CollectionsComeLast) {
  int calls = 0;
  const WallPressure fails = [&calls](const State& at, const std::vector<core::Contact>&) {
    if (++calls == 3) throw core::FileError("as if the disk were full");
    return std::vector<double>(at.size(), 0.0);
  };
  EXPECT_THROW(export_it(std::nullopt, fails), core::FileError);
  for (const std::string& file : files()) EXPECT_TRUE(file.starts_with("frames/") && file.ends_with(".vtp")) << file;
}

TEST_F(ParaviewRun, ADirectoryInUseAndAFileWithoutLawAreRefused) {
  const ExportOptions options{Format::paraview, out_, std::nullopt, false};
  export_file(path_ + "/run.h5", options);
  EXPECT_NE(message_of<core::InputError>([&] { export_file(path_, options); }).find("not an empty directory"), std::string::npos);
  EXPECT_NE(message_of<core::InputError>([&] { export_file(path_ + "/final.h5", {Format::paraview, scratch_ / "other", {}, false}); }).find("--to vtk"),
            std::string::npos);
  EXPECT_THROW(export_file(path_, {Format::paraview, "/proc/none", {}, false}), core::FileError);
}

TEST_F(ParaviewRun, DumpOfAllFramesIsThatOfEachInTurn) {
  export_file(path_, {Format::lammps_dump, scratch_ / "all.dump", {}, true});
  std::string wanted;
  for (std::int64_t frame = 0; frame < run_.frames(); ++frame) wanted += lammps_dump_text(run_.state(frame), run_.step(frame));
  EXPECT_EQ(text_of(scratch_ / "all.dump"), wanted);
}

// ---------------------------------------------------------------- ParaView itself

constexpr const char* kPvpython = R"py(
import sys
from paraview.simple import PVDReader
from paraview.servermanager import Fetch
for name in ("balls", "contacts", "wall"):
    reader = PVDReader(FileName="%s/%s.pvd" % (sys.argv[1], name))
    times = reader.TimestepValues
    for time in times if hasattr(times, "__len__") else [times]:
        reader.UpdatePipeline(time)
        data = Fetch(reader)
        print(name, repr(time), data.GetNumberOfPoints(), data.GetNumberOfVerts(), data.GetNumberOfLines(), *map(repr, data.GetBounds() if data.GetNumberOfPoints() else ()))
        for part in (data.GetPointData(), data.GetCellData()):
            for k in range(part.GetNumberOfArrays()):
                array = part.GetArray(k)
                if array.GetNumberOfTuples() > 0:
                    print("array", part.GetArrayName(k), array.GetNumberOfComponents(), array.GetNumberOfTuples(), *map(repr, array.GetRange(0)))
print("done")
)py";

struct Range {
  double low = std::numeric_limits<double>::infinity(), high = -low;
  void add(double value) { low = std::min(low, value), high = std::max(high, value); }
};

/// The line that kPvpython prints for a file of a collection, and those of its arrays.
std::string expected(const std::string& name, double time, const Content& content) {
  Range bounds[3];
  const auto& points = content.arrays.at("Points/position");
  for (std::size_t k = 0; k < points.size(); ++k) bounds[k % 3].add(points[k]);
  std::string text = fmt::format("{} {} {} {} {}", name, time, content.points, content.vertices, content.lines);
  for (const Range& axis : bounds)
    if (!points.empty()) text += fmt::format(" {} {}", axis.low, axis.high);
  text += "\n";
  for (const auto& [path, values] : content.arrays) {
    if (values.empty() || !(path.starts_with("PointData/") || path.starts_with("CellData/"))) continue;
    const std::string array = path.substr(path.find('/') + 1);
    const std::size_t components = array == "velocity" ? 3 : 1;
    Range range;
    for (std::size_t k = 0; k < values.size(); k += components) range.add(values[k]);
    text += fmt::format("array {} {} {} {} {}\n", array, components, values.size() / components, range.low, range.high);
  }
  return text;
}

/// Words of each line, numbers as the shortest text of their value; lines of arrays sorted, for their order means nothing.
std::multiset<std::string> normal(const std::string& text) {
  std::multiset<std::string> lines;
  std::istringstream in(text);
  for (std::string line, word; std::getline(in, line);) {
    std::string normal_line;
    for (std::istringstream words(line); words >> word;) {
      char* end = nullptr;
      const double value = std::strtod(word.c_str(), &end);
      normal_line += (*end == '\0' ? fmt::format("{}", value) : word) + " ";
    }
    lines.insert(normal_line);
  }
  return lines;
}

TEST_F(SlowParaview, ItsOwnReaderSeesTheSameCountsRangesAndBounds) {
  if (std::system("command -v pvpython >/dev/null 2>&1") != 0) GTEST_SKIP() << "pvpython is not here: install Debian's python3-paraview";
  export_it();
  std::string wanted = "done\n";
  for (const char* name : {"balls", "contacts", "wall"})
    for (const auto& [time, path] : entries(fs::path(out_) / (std::string(name) + ".pvd")))
      wanted += expected(name, time, read(text_of(fs::path(out_) / path)));
  const std::string script = scratch_.file("read.py", kPvpython), printed = scratch_ / "printed.txt";
  ASSERT_EQ(std::system(fmt::format("pvpython {} {} >{}", script, out_, printed).c_str()), 0);
  const auto found = normal(text_of(printed)), told = normal(wanted);
  std::string differ;
  for (const std::string& line : told)
    if (!found.contains(line)) differ += "missing: " + line + "\n";
  for (const std::string& line : found)
    if (!told.contains(line)) differ += "surplus: " + line + "\n";
  EXPECT_EQ(differ, "");
  EXPECT_EQ(found.size(), told.size());
}

}  // namespace
}  // namespace grainclock::silo
