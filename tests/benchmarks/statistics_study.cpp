#include "benchmarks/statistics_study.hpp"

#include "benchmarks/statistics_run.hpp"
#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "tests/support/scratch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace grainclock::benchmarks {
namespace {

using core::Kind;
using core::State;
using core::Vec3;
using tests::replaced;
using Numbers = std::vector<double>;
using Texts = std::vector<std::string>;

// A few roundings of numbers of order one.
constexpr double kRounding = 1e-14;

// ---------------------------------------------------------------- measures of a series

/// Eleven samples of 0.1 s over two layers 0.5 m high, from z = -0.5 m on: four balls leave at once, then one in each
/// interval from 0.5 s on; forces of 10 and 30 N, and ten times that in the first three samples.
LongRun series() {
  LongRun run;
  run.layer_edges = {-0.5, 0.0, 0.5};
  run.wall_area = {4.0, 2.0};
  for (int k = 0; k <= 10; ++k) {
    run.time.push_back(0.1 * k);
    run.discharged.push_back(k == 0 ? 0.0 : 4.0 + std::max(0, k - 5));
    run.kinetic_energy.push_back(k);
    for (const double force : {10.0, 30.0}) run.wall_force.push_back(k < 3 ? 10.0 * force : force);
  }
  return run;
}

TEST(LongRunMeasures, AreThoseOfTheWindowAfterSettling) {
  const Measures found = measures(series(), 0.3, 0.2);  // samples 3 to 10: 0.7 s
  EXPECT_NEAR(found.at({Quantity::discharge_rate, {}}), 5.0 / 0.7, kRounding * 10);
  EXPECT_EQ(found.at({Quantity::stoppages, {}}), 1.0);
  EXPECT_NEAR(found.at({Quantity::stoppage_length, {}}), 0.2, kRounding);
  EXPECT_NEAR(found.at({Quantity::stoppage_share, {}}), 0.2 / 0.7, kRounding);
  EXPECT_NEAR(found.at({Quantity::kinetic_energy, {}}), 6.5, kRounding);
  EXPECT_NEAR(found.at({Quantity::wall_force, {}}), 40.0, kRounding * 100);
  EXPECT_NEAR(found.at({Quantity::wall_pressure, -1}), 10.0 / 4.0, kRounding);
  EXPECT_NEAR(found.at({Quantity::wall_pressure, 0}), 30.0 / 2.0, kRounding * 10);
  EXPECT_EQ(found.size(), 8u);
  const double rounded = std::nextafter(0.1 * 3, 1.0);  // 0.3 s on another way
  EXPECT_EQ(measures(series(), rounded, 0.2), found);
}

TEST(LongRunMeasures, WithoutSettlingTheBeginningCounts) {
  const Measures found = measures(series(), 0.0, 0.2);
  EXPECT_NEAR(found.at({Quantity::discharge_rate, {}}), 9.0, kRounding * 10);
  EXPECT_NEAR(found.at({Quantity::stoppage_length, {}}), 0.4, kRounding);
  EXPECT_NEAR(found.at({Quantity::wall_force, {}}), (3 * 400.0 + 8 * 40.0) / 11.0, 1e-12);  // rounding of hundreds
}

TEST(LongRunMeasures, LayersWithoutWallHaveNoPressureAndScenesWithoutWallNoForce) {
  LongRun run = series();
  run.wall_area[1] = 0.0;
  EXPECT_TRUE(std::isnan(measures(run, 0.0, 0.2).at({Quantity::wall_pressure, 0})));
  run.wall_area.clear();
  run.layer_edges.clear();
  run.wall_force.clear();
  EXPECT_EQ(measures(run, 0.0, 0.2).count({Quantity::wall_force, {}}), 0u);
  EXPECT_THROW(measures(run, 1.0, 0.2), core::InputError) << "one sample has no rate";
}

// ---------------------------------------------------------------- runs

constexpr double kGravity = 9.81;  // m/s2, of scenes that do not say

/// The height from which a ball falls to the outlet plane in t [s].
double height(double t) { return 0.5 * kGravity * t * t; }

/// A scene of balls in free fall, of which ball i leaves at 0.1 i + `late` [s], and of one that a wall ball pushes by 100 N.
class StatisticsFiles : public testing::Test {
 protected:
  StatisticsFiles() {
    scene_ = scratch_.file("scene.toml", R"([initial]
state = "a.csv"
[contact]
k_wall = 1e6
c_wall = 0.0
c_ball = 0.0
[domain]
outlet_z = 0.0
lower = [-20.0, -20.0, -20.0]
upper = [20.0, 20.0, 20.0]
[[phase]]
name = "flow"
duration = 0.5
outlet = "open"
)");
    for (const auto& [name, late] : {std::pair{"a.csv", 0.015}, {"b.csv", 0.045}, {"c.csv", 0.065}})
      core::write_state(scratch_ / name, falling(late));
  }

  static State falling(double late) {
    State state;
    for (int ball = 0; ball < 4; ++ball)
      state.add(ball, Kind::content, Vec3(2.0 + ball, 0, height(0.1 * ball + late)), Vec3::Zero(), 0.2);
    state.add(4, Kind::content, Vec3(0.4 - 1e-4, 0, 3.5), Vec3::Zero(), 0.2);  // on its way for 0.845 s
    state.add(5, Kind::wall, Vec3(0, 0, 3.5), Vec3::Zero(), 0.2);
    return state;
  }

  std::string study(const std::string& text) const { return scratch_.file("study.toml", text); }
  std::unique_ptr<StudyKind> read(const std::string& text) const { return read_statistics_study(study(text), 1); }

  /// The study's jobs' files; `make` makes what is not run.
  std::map<std::string, std::filesystem::path> run(const StudyKind& kind) const {
    std::map<std::string, std::filesystem::path> files;
    for (const Job& job : kind.jobs()) {
      files[job.id] = scratch_ / (job.id + ".h5");
      kind.run(job, files[job.id]);
    }
    return files;
  }

  tests::Scratch scratch_;
  std::string scene_;
};

core::Stepping uniform(double step) {
  core::Stepping stepping;
  stepping.method = core::Method::uniform;
  stepping.step = step;
  return stepping;
}

TEST_F(StatisticsFiles, ARunCountsBallsAndFeelsTheWallAtItsSamples) {
  const LongRun run = run_long(core::read_scene(scene_), falling(0.015), uniform(1e-3), {0.4, 0.05, 0.5}, 1);
  EXPECT_EQ(run.status, "ok");
  EXPECT_EQ(run.method_used, "uniform");
  EXPECT_EQ(run.step, 1e-3);
  // Balls leave at 0.015, 0.115, 0.215 and 0.315 s.
  EXPECT_EQ(run.discharged, (Numbers{0, 1, 1, 2, 2, 3, 3, 4, 4}));
  ASSERT_EQ(run.time.size(), 9u);
  EXPECT_NEAR(run.time[8], 0.4, kRounding);
  // Layers 0.5 m high: the one wall ball stands in that from 3.5 m on. It pushes in the first sample only.
  EXPECT_EQ(run.layer_edges, (Numbers{3.5, 4.0}));
  EXPECT_EQ(run.wall_area.at(0), 4.0 * 0.2 * 0.2);
  EXPECT_NEAR(run.wall_force.at(0), 100.0, 1e-6);  // overlap 1e-4 m from coordinates of order one, times 1e6 N/m
  EXPECT_EQ(*std::max_element(run.wall_force.begin() + 1, run.wall_force.end()), 0.0);
  EXPECT_GT(run.costs.ball_updates, 0u);
}

TEST_F(StatisticsFiles, KineticEnergyIsThatOfTheBallsStillThere) {
  State one;
  one.add(0, Kind::content, Vec3(0, 0, 5), Vec3::Zero(), 0.2);
  const LongRun run = run_long(core::read_scene(scene_), one, uniform(0.01), {0.4, 0.1, 1.0}, 1);
  const double mass = 1250.0 * 4.0 / 3.0 * 3.14159265358979 * 0.008;
  for (std::size_t k = 0; k < run.time.size(); ++k) {
    const double speed = kGravity * run.time[k];
    EXPECT_NEAR(run.kinetic_energy[k], 0.5 * mass * speed * speed, 1e-10);  // rounding over 40 steps of some hundred joules
  }
  EXPECT_TRUE(run.wall_area.empty()) << "there is no wall";
}

TEST_F(StatisticsFiles, AnEmptySiloIsRefused) {
  State state = falling(0.015);
  State few;
  for (std::size_t i = 0; i < 4; ++i)
    few.add(state.id[i], state.kind[i], state.position[i], state.velocity[i], state.radius[i]);
  const auto message = tests::message_of<core::InputError>([&] {
    run_long(core::read_scene(scene_), few, uniform(1e-3), {0.4, 0.05, 1.0}, 1);
  });
  EXPECT_NE(message.find("of 4 balls is empty 0.35"), std::string::npos) << message;
}

TEST_F(StatisticsFiles, NumericsThatFailAreTold) {
  State fast = falling(0.015);
  fast.velocity[4] = Vec3(100.0, 0, 0);  // leaves the scene after 0.2 s
  const LongRun run = run_long(core::read_scene(scene_), fast, uniform(5e-4), {0.4, 0.05, 1.0}, 1);
  EXPECT_EQ(run.status.substr(0, 7), "failed:") << run.status;
  EXPECT_FALSE(run.is_ok());
  EXPECT_EQ(run.discharged.size(), 4u) << "samples until then are kept";
  EXPECT_TRUE(std::isnan(run.energy_residual));
  EXPECT_GT(run.costs.ball_updates, 0u);
}

TEST_F(StatisticsFiles, FilesKeepARun) {
  LongRun run = series();
  run.status = "failed: for a reason";
  run.method_used = "multirate";
  run.step = 0.1;
  run.costs = {1, 2, 3, 4, 5};
  run.momentum_residual = 1e-15;
  run.wall_s = 2.5;
  write_long_run(scratch_ / "run.h5", run, {core::read_scene(scene_), 1});
  const LongRun read = read_long_run(scratch_ / "run.h5");
  EXPECT_EQ(read.status, run.status);
  EXPECT_EQ(read.method_used, run.method_used);
  EXPECT_EQ(read.step, run.step);
  EXPECT_EQ(read.costs.contact_evaluations, 1u);
  EXPECT_EQ(read.costs.missed_contacts, 5u);
  EXPECT_EQ(read.momentum_residual, run.momentum_residual);
  EXPECT_EQ(read.wall_s, run.wall_s);
  EXPECT_EQ(read.time, run.time);
  EXPECT_EQ(read.discharged, run.discharged);
  EXPECT_EQ(read.kinetic_energy, run.kinetic_energy);
  EXPECT_EQ(read.wall_force, run.wall_force);
  EXPECT_EQ(read.layer_edges, run.layer_edges);
  EXPECT_EQ(read.wall_area, run.wall_area);
  EXPECT_FALSE(read.made_by.host.empty());
  EXPECT_THROW(read_long_run(scratch_ / "none.h5"), core::FileError);
}

// ---------------------------------------------------------------- studies

const std::string kHead = R"(kind = "statistics"
scene = "scene.toml"
start = ["a.csv", "b.csv", "c.csv"]
duration = 0.4
every = 0.05
stop = 0.1
layer = 0.5
baseline = "fine"
)";
const std::string kMethods = R"([[method]]
name = "fine"
method = "uniform"
step = 1e-3
[[method]]
name = "ours"
step = 5e-3
)";

/// Row of this method and measure; without a bin.
std::size_t row_of(const Table& table, const std::string& method, const std::string& measure) {
  for (std::size_t row = 0; row < texts(table, "method").size(); ++row) {
    if (texts(table, "method")[row] == method && texts(table, "measure")[row] == measure) return row;
  }
  throw std::out_of_range(method + " " + measure);
}

TEST_F(StatisticsFiles, AStudyOfFallingBallsHasTheRatesThatGravityGives) {
  const auto kind = read(kHead + kMethods);
  const auto jobs = kind->jobs();
  ASSERT_EQ(jobs.size(), 6u);
  const auto tables = kind->tables(run(*kind));
  ASSERT_EQ(tables.size(), 3u);
  const Table &values = tables[0], &summary = tables[1], &runs = tables[2];
  EXPECT_EQ(values.name, "statistics");
  EXPECT_EQ(summary.name, "statistics_summary");
  EXPECT_EQ(runs.name, "statistics_runs");
  // From each start four balls in 0.4 s.
  for (const std::string method : {"fine", "ours"}) {
    const std::size_t row = row_of(summary, method, "discharge_rate");
    EXPECT_EQ(numbers(summary, "n")[row], 3.0);
    EXPECT_NEAR(numbers(summary, "mean")[row], 10.0, kRounding * 10);
    EXPECT_TRUE(std::isnan(numbers(summary, "bin")[row]));
  }
  EXPECT_TRUE(std::isnan(numbers(summary, "agrees")[row_of(summary, "fine", "discharge_rate")])) << "with itself";
  EXPECT_EQ(numbers(summary, "agrees")[row_of(summary, "ours", "discharge_rate")], 1.0);
  const std::size_t pressure = row_of(summary, "fine", "wall_pressure");
  EXPECT_EQ(numbers(summary, "bin")[pressure], 7.0);
  EXPECT_EQ(numbers(summary, "z_low")[pressure], 3.5);
  EXPECT_EQ(numbers(summary, "z_high")[pressure], 4.0);
  EXPECT_NEAR(numbers(summary, "mean")[pressure], 100.0 / 9.0 / 0.16, 1e-6);  // one sample of nine; see the run above
  EXPECT_EQ(texts(summary, "unit")[pressure], "Pa");
  EXPECT_EQ(texts(values, "start")[row_of(values, "ours", "wall_force")], "a");
  EXPECT_EQ(texts(runs, "method_used"), (Texts{"uniform", "uniform", "uniform", "multirate", "multirate", "multirate"}));
  EXPECT_GT(numbers(runs, "ball_updates")[0], numbers(runs, "ball_updates")[3]);
  EXPECT_TRUE(kind->warnings(tables).empty()) << kind->warnings(tables).front();
}

/// A run of which this many balls leave in the second half.
LongRun made(double balls) {
  LongRun run = series();
  for (std::size_t k = 0; k < run.time.size(); ++k) run.discharged[k] = balls * std::max(0.0, run.time[k] - 0.5) / 0.5;
  return run;
}

TEST_F(StatisticsFiles, AMethodThatDischargesATenthFasterIsToldApart) {
  const auto kind = read(kHead + kMethods);
  std::map<std::string, std::filesystem::path> files;
  const Numbers balls{100, 110, 101, 112, 102, 111};  // fine and ours from start to start
  for (std::size_t job = 0; job < 6; ++job) {
    const std::string id = kind->jobs()[job].id;
    files[id] = scratch_ / (id + ".h5");
    write_long_run(files[id], made(balls[job]), {core::read_scene(scene_), 1});
  }
  const auto tables = kind->tables(files);
  const std::size_t row = row_of(tables[1], "ours", "discharge_rate");
  EXPECT_EQ(numbers(tables[1], "agrees")[row], 0.0);
  EXPECT_LT(numbers(tables[1], "difference_low")[row], 10.0);
  EXPECT_GT(numbers(tables[1], "difference_low")[row], 0.0);
  EXPECT_EQ(numbers(tables[1], "agrees")[row_of(tables[1], "ours", "wall_force")], 1.0);
  const auto said = kind->warnings(tables);
  ASSERT_EQ(said.size(), 1u);
  EXPECT_NE(said[0].find("ours: 1 of"), std::string::npos) << said[0];
}

TEST_F(StatisticsFiles, AFailedRunIsLeftOutAndNamed) {
  const auto kind = read(kHead + kMethods);
  std::map<std::string, std::filesystem::path> files;
  for (std::size_t job = 0; job < 6; ++job) {
    LongRun run = made(100.0 + static_cast<double>(job / 2));
    if (job == 3) {
      run = {};
      run.status = "failed: it blew up";
      run.time = run.discharged = run.kinetic_energy = {0.0};
    }
    const std::string id = kind->jobs()[job].id;
    files[id] = scratch_ / (id + ".h5");
    write_long_run(files[id], run, {core::read_scene(scene_), 1});
  }
  const auto tables = kind->tables(files);
  EXPECT_EQ(numbers(tables[1], "n")[row_of(tables[1], "ours", "discharge_rate")], 2.0);
  EXPECT_EQ(numbers(tables[1], "n")[row_of(tables[1], "fine", "discharge_rate")], 3.0);
  const auto said = kind->warnings(tables);
  ASSERT_EQ(said.size(), 1u);
  EXPECT_NE(said[0].find("b: ours failed: it blew up"), std::string::npos) << said[0];
}

TEST_F(StatisticsFiles, OneStartHasMeansAndAWarning) {
  const auto kind = read(replaced(kHead, "[\"a.csv\", \"b.csv\", \"c.csv\"]", "\"a.csv\"") + kMethods);
  const auto tables = kind->tables(run(*kind));
  const std::size_t row = row_of(tables[1], "ours", "discharge_rate");
  EXPECT_NEAR(numbers(tables[1], "mean")[row], 10.0, kRounding * 10);
  EXPECT_TRUE(std::isnan(numbers(tables[1], "ci_low")[row]) && std::isnan(numbers(tables[1], "agrees")[row]));
  EXPECT_EQ(kind->warnings(tables).size(), 1u);
}

Texts ids(const StudyKind& kind) {
  Texts found;
  for (const Job& job : kind.jobs()) found.push_back(job.id);
  return found;
}

TEST_F(StatisticsFiles, JobsAreRunAnewOnlyWhereTheirSeriesWouldChange) {
  const auto with = [&](const std::string& before, const std::string& after) {
    return ids(*read(replaced(kHead + kMethods, before, after)));
  };
  const Texts before = ids(*read(kHead + kMethods));
  EXPECT_EQ(with("stop = 0.1", "stop = 0.2\nsettle = 0.1"), before);
  EXPECT_EQ(with("baseline = \"fine\"", "baseline = \"ours\""), before);
  EXPECT_EQ(with("name = \"ours\"", "name = \"theirs\""), before);
  EXPECT_EQ(with("\"a.csv\", \"b.csv\"", "\"b.csv\", \"a.csv\"")[0], before[2]);
  for (const auto& [old, changed] :
       {std::pair{"duration = 0.4", "duration = 0.45"}, {"every = 0.05", "every = 0.025"}, {"layer = 0.5", "layer = 1.0"}}) {
    EXPECT_NE(with(old, changed)[0], before[0]) << changed;
    EXPECT_NE(with(old, changed)[5], before[5]) << changed;
  }
  const Texts finer = with("step = 1e-3", "step = 5e-4");
  EXPECT_NE(finer[0], before[0]);
  EXPECT_EQ(finer[1], before[1]);
  scratch_.file("scene.toml", replaced(tests::text_of(scene_), "k_wall = 1e6", "k_wall = 2e6"));
  EXPECT_NE(ids(*read(kHead + kMethods))[0], before[0]);
}

TEST_F(StatisticsFiles, AnotherStateUnderTheSameNameIsRunAnew) {
  const Texts before = ids(*read(kHead + kMethods));
  core::write_state(scratch_ / "b.csv", falling(0.035));
  const Texts after = ids(*read(kHead + kMethods));
  EXPECT_EQ(after[0], before[0]);
  EXPECT_NE(after[2], before[2]);
  EXPECT_NE(after[3], before[3]);
}

TEST_F(StatisticsFiles, SweptMethodsAreToldApartByWhatIsSwept) {
  const auto kind = read(kHead + kMethods + "tolerance = [1e-3, 1e-4]\n");
  ASSERT_EQ(kind->jobs().size(), 9u);
  EXPECT_EQ(kind->jobs()[1].label, "a: ours, tolerance 0.001");
  EXPECT_EQ(kind->jobs()[2].label, "a: ours, tolerance 0.0001");
}

TEST_F(StatisticsFiles, MistakesAreToldWithPlaceAndRemedy) {
  struct Case {
    std::string before, after, expected;
  };
  const Case cases[] = {
      {"duration = 0.4\n", "", "duration is missing: give the length"},
      {"duration = 0.4", "duration = 0.42",
       "study.toml:4: duration = 0.42: must be a whole multiple of every = 0.05 s; nearest: 0.4 s"},
      {"every = 0.05", "every = -1", "study.toml:5: every = -1"},
      {"stop = 0.1", "stop = 0.01", "study.toml:6: stop = 0.01: must not be below every"},
      {"stop = 0.1\n", "", "stop is missing: say from which length"},
      {"stop = 0.1", "stop = 0.1\nsettle = 0.4", "settle = 0.4: must be from 0 to 0.35"},
      {"stop = 0.1", "stop = 0.1\nhorizon = 0.4", "horizon"},
      {"baseline = \"fine\"", "baseline = \"finest\"", "there are \"fine\", \"ours\""},
      {"baseline = \"fine\"\n", "", "baseline is missing: name the method"},
      {"name = \"ours\"", "name = \"fine\"\nmethod = \"uniform\"\nevents = false\nstep = 1e-3\n[[method]]",
       "give each a [[method]] with a name of its own"},
      {"name = \"ours\"", "name = \"ours\"\nrepeat = 3", "repeat = 3"},
      {"name = \"ours\"\nstep = 5e-3", "method = \"cvode\"\nrtol = 1e-6", "our own steppers"},
      {"name = \"ours\"\nstep = 5e-3", "name = \"again\"\nmethod = \"uniform\"\nstep = 1e-3",
       "steps exactly as another one"},
      {"\"b.csv\"", "\"none.csv\"", "none.csv"},
      {"\"b.csv\"", "\"a.csv\"", "the same state"},
  };
  for (const Case& one : cases) {
    const std::string text = replaced(kHead + kMethods, one.before, one.after);
    try {
      read(text);
      ADD_FAILURE() << "accepted: " << one.after;
    } catch (const core::Error& error) {
      EXPECT_NE(std::string(error.what()).find(one.expected), std::string::npos) << error.what();
    }
  }
}

TEST_F(StatisticsFiles, AnOpenOutletNeedsAPlaneToCountAt) {
  scratch_.file("scene.toml", replaced(tests::text_of(scene_), "outlet_z = 0.0", ""));
  const auto message = tests::message_of<core::InputError>([&] { read(kHead + kMethods); });
  EXPECT_NE(message.find("outlet_z"), std::string::npos) << message;
}

}  // namespace
}  // namespace grainclock::benchmarks
