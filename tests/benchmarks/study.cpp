#include "benchmarks/study.hpp"

#include "benchmarks/study_plan.hpp"
#include "benchmarks/study_table.hpp"
#include "core/check.hpp"
#include "core/files.hpp"
#include "core/hdf5.hpp"
#include "core/snapshot.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <map>
#include <sstream>

namespace grainclock::benchmarks {
namespace {

namespace fs = std::filesystem;
using core::Kind;
using core::Vec3;

/// A directory of its own for each test, with a scene of eight balls that fall onto a floor of fixed balls.
class StudyFiles : public testing::Test {
 protected:
  void SetUp() override {
    const auto* info = testing::UnitTest::GetInstance()->current_test_info();
    dir_ = fs::temp_directory_path() / fmt::format("grainclock-{}-{}-{}", info->test_suite_name(), info->name(), ::getpid());
    fs::create_directories(dir_);
    core::State state;
    core::BallId ball = 0;
    for (const double x : {0.0, 0.41}) {
      for (const double y : {0.0, 0.42}) {
        for (const double z : {0.45, 0.88}) {  // neighbours overlap, the floor does not yet
          state.add(ball, Kind::content, Vec3(x, y, z + 0.003 * static_cast<double>(ball)), Vec3(0.1 * x, 0.2, -0.5), 0.22);
          ++ball;
        }
      }
    }
    for (const double x : {-0.4, 0.0, 0.4, 0.8}) {
      for (const double y : {-0.4, 0.0, 0.4, 0.8}) state.add(ball++, Kind::wall, Vec3(x, y, 0.05 * x), Vec3::Zero(), 0.22);
    }
    core::write_state((dir_ / "start.csv").string(), state);
    core::write_text(dir_ / "scene.toml", R"([initial]
state = "start.csv"
[[phase]]
name = "fall"
duration = 0.02
outlet = "open"
)");
  }
  void TearDown() override { fs::remove_all(dir_); }

  std::string write(const std::string& text) const {
    core::write_text(dir_ / "study.toml", text);
    return (dir_ / "study.toml").string();
  }
  Study read(const std::string& text) const { return read_study(write(text)); }
  std::string complaint(const std::string& text) const {
    try {
      read(text);
    } catch (const core::Error& error) {
      return error.what();
    }
    return "none";
  }
  /// Runs the study; its rows as column -> text.
  std::vector<std::map<std::string, std::string>> run(const std::string& text) const {
    run_study(write(text), (dir_ / "out").string(), 1);
    std::istringstream lines(core::read_text(dir_ / "out" / "study.csv"));
    std::string line;
    std::getline(lines, line);
    std::vector<std::map<std::string, std::string>> rows;
    while (std::getline(lines, line)) {
      auto& row = rows.emplace_back();
      std::istringstream cells(line);
      for (const Column& column : columns()) {
        std::string cell;
        if (cells.peek() == '"') {  // quoted: up to the closing quote; these tests have no quotes inside
          cells.get();
          std::getline(cells, cell, '"');
          cells.get();
        } else {
          std::getline(cells, cell, ',');
        }
        row[std::string(column.name)] = cell;
      }
    }
    return rows;
  }

  fs::path dir_;
};

const std::string kHead = R"(scene = "scene.toml"
start = "start.csv"
horizon = 0.02
repeat = 1
[reference]
step = 1e-6
)";

using StudyPlan = StudyFiles;
using StudyRun = StudyFiles;

TEST_F(StudyPlan, ListsAreSweptAsCartesianProduct) {
  const Study study = read(kHead + R"([[method]]
method = "uniform"
events = [false, true]
step = [4e-5, 2e-5, 1e-5]
[[method]]
name = "ours"
tolerance = [1e-3, 1e-4]
)");
  ASSERT_EQ(study.points.size(), 8u);
  EXPECT_FALSE(study.points[0].stepping.events);
  EXPECT_EQ(study.points[0].stepping.step, 4e-5);
  EXPECT_EQ(study.points[2].stepping.step, 1e-5);
  EXPECT_TRUE(study.points[3].stepping.events);
  EXPECT_EQ(study.points[0].name, "uniform predicted");
  EXPECT_EQ(study.points[3].name, "uniform predicted events");
  EXPECT_EQ(study.points[7].name, "ours");
  EXPECT_EQ(study.points[7].stepping.method, core::Method::multirate);
  EXPECT_EQ(study.points[7].stepping.tolerance, 1e-4);
  EXPECT_FALSE(study.points[7].stepping.step.has_value());
}

TEST_F(StudyPlan, SundialsTakesATolerance) {
  const Study study = read(kHead + "[[method]]\nmethod = \"cvode\"\nrtol = [1e-4, 1e-6]\n");
  ASSERT_EQ(study.points.size(), 2u);
  EXPECT_EQ(study.points[1].solver, Solver::cvode);
  EXPECT_EQ(study.points[1].rtol, 1e-6);
}

TEST_F(StudyPlan, PathsAreLookedForBesideTheStudy) {
  EXPECT_EQ(read(kHead + "[[method]]\n").starts.front(), (dir_ / "start.csv").string());
}

TEST_F(StudyPlan, SeveralStartStatesMayBeGiven) {
  std::string text = kHead;
  text.replace(text.find("\"start.csv\""), 11, "[\"start.csv\", \"start.csv\"]");
  EXPECT_EQ(read(text + "[[method]]\n").starts.size(), 2u);
}

TEST_F(StudyPlan, ErrorsNameFileLineValueAndRemedy) {
  const auto line = [this](int n) { return fmt::format("study.toml:{}: ", n); };
  const struct {
    std::string text, place, says;
  } cases[] = {
      {kHead + "[[method]]\nmethod = \"uniform\"\nstep = [1e-5, -2e-5]\n", line(9), "-2e-05"},
      {kHead + "[[method]]\nmethod = \"uniform\"\nstep = [1e-5,\n \"fast\"]\n", line(10), "must be a number"},
      {kHead + "[[method]]\nmethod = \"uniform\"\nstep = 1e-5\ntolerance = 1e-4\n", line(10), "tolerance"},
      {kHead + "[[method]]\nmethod = \"uniform\"\n", line(7), "step is missing"},
      {kHead + "[[method]]\nmethod = \"euler\"\n", line(8), "euler"},
      {kHead + "[[method]]\nlevels = 13\n", line(8), "13"},
      {kHead + "[[method]]\ntolerance = []\n", line(8), "empty list"},
      {kHead + "[[method]]\nmethod = \"arkode\"\nrtol = 2.0\n", line(9), "between 0 and 1"},
      {kHead + "[[method]]\ninterface = \"glue\"\n", line(8), "accumulate"},
      {kHead + "steps = 3\n[[method]]\n", line(7), "steps"},
      {"horizon = \"long\"\n" + kHead + "[[method]]\n", "study.toml:", ""},
      {kHead, "study.toml", "[[method]]"},
      {"scene = \n", line(1), "TOML"},
  };
  for (const auto& wrong : cases) {
    const std::string said = complaint(wrong.text);
    EXPECT_NE(said.find(wrong.place), std::string::npos) << said;
    EXPECT_NE(said.find(wrong.says), std::string::npos) << said;
  }
}

TEST_F(StudyPlan, MissingFilesAreFileErrors) {
  EXPECT_THROW(read_study((dir_ / "none.toml").string()), core::FileError);
  std::string text = kHead;
  text.replace(text.find("start.csv"), 9, "other.csv");
  EXPECT_THROW(read(text + "[[method]]\n"), core::FileError);
}

TEST(StudyTable, ColumnsBeginAsTheContractSays) {
  const std::string header = csv({});
  EXPECT_EQ(header.find("name,method,method_used,integrator,events,dashpot,interface,step,tolerance,levels,error_rms,"
                        "error_median,error_p99,error_wall_force,momentum_residual,energy_residual,contact_evaluations,"
                        "ball_updates,wall_s,ideal_gain,counted_gain,measured_gain"),
            0u);
}

TEST(StudyTable, UnknownNumbersAreEmptyAndTextsQuotedWhereNeeded) {
  Row row;
  row.name = "a, \"b\"";
  row.step = 0.1;
  row.contact_evaluations = 123456789012.0;
  const std::string text = csv({row});
  const std::string line = text.substr(text.find('\n') + 1);
  EXPECT_EQ(line.find("\"a, \"\"b\"\"\",,,,,,,0.1,,,,,,,,,123456789012,,"), 0u) << line;
}

TEST_F(StudyRun, ErrorsFallWithTheStepAndEveryPointHasARow) {
  std::string head = kHead;
  head.replace(head.find("0.02"), 4, "0.011");  // balls touch the wall then
  const auto rows = run(head + R"([[method]]
name = "plain"
method = "uniform"
events = false
step = [8e-5, 2e-5, 5e-6]
[[method]]
name = "ours"
tolerance = 1e-4
)");
  ASSERT_EQ(rows.size(), 6u);
  const auto number = [&](std::size_t row, const char* column) { return std::stod(rows[row].at(column)); };
  // At least first order: sixteen times finer steps must leave a fourth of the error at most.
  EXPECT_LT(number(2, "error_rms"), 0.25 * number(0, "error_rms"));
  EXPECT_LT(number(2, "error_wall_force"), number(0, "error_wall_force"));
  EXPECT_LT(number(0, "contact_evaluations"), number(2, "contact_evaluations"));
  EXPECT_DOUBLE_EQ(number(2, "step"), 5e-6);
  EXPECT_EQ(rows[3].at("name"), "ours");
  EXPECT_EQ(rows[4].at("name"), "reference");
  EXPECT_EQ(rows[4].at("error_rms"), "");
  EXPECT_EQ(rows[5].at("name"), "reference_check");
  EXPECT_DOUBLE_EQ(number(5, "step"), 2e-6);
  for (const auto& row : rows) {
    EXPECT_EQ(row.at("start"), "start");
    // Round-off of sums over some thousand impulses.
    EXPECT_LT(std::stod(row.at("momentum_residual")), 1e-12);
  }
  // A point of the baseline gains nothing over itself; exact up to the rounding of log and pow.
  EXPECT_NEAR(number(2, "counted_gain"), 1.0, 1e-9);

  const auto file = core::Hdf5File::open(dir_ / "out" / "study.h5");
  EXPECT_EQ(file.group("study").read<double>("error_rms").size(), 6u);
  EXPECT_EQ(file.group("study").read<double>("error_rms")[2], number(2, "error_rms"));
  EXPECT_EQ(std::distance(fs::directory_iterator(dir_ / "out"), fs::directory_iterator()), 2);
}

TEST_F(StudyRun, SundialsConvergesToTheSameTrajectory) {
  const auto rows = run(kHead + R"([[method]]
method = "cvode"
rtol = [1e-4, 1e-9]
[[method]]
method = "arkode"
rtol = 1e-9
)");
  ASSERT_EQ(rows.size(), 5u);
  // Two converged solutions differ by no more than a few times the reference's own change from twice its step.
  const double reference = 5.0 * std::stod(rows[4].at("error_rms"));
  EXPECT_LT(std::stod(rows[1].at("error_rms")), reference);
  EXPECT_LT(std::stod(rows[2].at("error_rms")), reference);
  EXPECT_EQ(rows[0].at("rtol"), "0.0001");
  EXPECT_EQ(rows[0].at("momentum_residual"), "");
}

TEST_F(StudyRun, APointThatBlowsUpIsARowNotTheEnd) {
  const auto rows = run(kHead + R"([[method]]
method = "uniform"
step = [2e-3, 1e-5]
)");
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_EQ(rows[0].at("status").find("failed"), 0u) << rows[0].at("status");
  EXPECT_EQ(rows[0].at("error_rms"), "");
  EXPECT_EQ(rows[1].at("status"), "ok");
}

TEST_F(StudyRun, ACoarseReferenceIsNotAccepted) {
  std::string text = kHead;
  text.replace(text.find("1e-6"), 4, "2e-5");
  const auto rows = run(text + "[[method]]\nmethod = \"uniform\"\nstep = 1e-5\n");
  EXPECT_EQ(rows[1].at("status").find("too coarse"), 0u) << rows[1].at("status");
}

TEST_F(StudyRun, WrongInputLeavesNoOutputBehind) {
  EXPECT_THROW(run(kHead + "[[method]]\nlevels = 0\n"), core::InputError);
  EXPECT_FALSE(fs::exists(dir_ / "out"));
}

TEST_F(StudyRun, OutputThatIsNotEmptyIsRefused) {
  fs::create_directories(dir_ / "out");
  core::write_text(dir_ / "out" / "mine.txt", "kept");
  EXPECT_THROW(run(kHead + "[[method]]\n"), core::InputError);
  EXPECT_EQ(core::read_text(dir_ / "out" / "mine.txt"), "kept");
}

}  // namespace
}  // namespace grainclock::benchmarks
