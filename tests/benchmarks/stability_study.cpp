// Studies of kind "stability": what a file says, jobs that run alone, tables.
#include "benchmarks/stability_study.hpp"

#include "benchmarks/stability.hpp"
#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "tests/support/scratch.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

namespace grainclock::benchmarks {
namespace {

namespace fs = std::filesystem;
using core::Kind;
using core::Vec3;
using tests::replaced;

constexpr const char* kSmall = R"(kind = "stability"
systems = ["wall"]
integrators = ["lagged", "pece"]
dashpots = ["explicit"]
damping_ratios = [0.3, 1]
step_ratios = [0.2, 0.95]
steps = 1000
[growth]
ratios = [1, 4]
damping_ratios = [0.0, 0.02]
step_ratios = [0.2, 0.3, 0.9]
)";

class StabilityStudyFiles : public testing::Test {
 protected:
  std::unique_ptr<StudyKind> read(const std::string& text) const {
    return read_stability_study(scratch_.file("study.toml", text), 1);
  }
  template <class Error = core::InputError>
  std::string complaint(const std::string& text) const {
    return tests::message_of<Error>([&] { read(text); });
  }
  std::map<std::string, fs::path> run_all(const StudyKind& study) const {
    std::map<std::string, fs::path> files;
    for (const Job& job : study.jobs()) {
      files[job.id] = scratch_.path() / (job.id + ".h5");
      study.run(job, files[job.id]);
    }
    return files;
  }
  std::string packing(const core::State& state) const {
    core::write_state(scratch_ / "packing.h5", state);
    return replaced(replaced(kSmall, "[\"wall\"]", "[\"packing\"]\npacking = \"packing.h5\""), "[0.3, 1]", "[0.3]");
  }

  tests::Scratch scratch_;
};

const Table& table(const std::vector<Table>& tables, const std::string& name) {
  const auto found = std::find_if(tables.begin(), tables.end(), [&](const Table& t) { return t.name == name; });
  if (found == tables.end()) throw std::runtime_error("no table " + name);
  return *found;
}

std::string header(const Table& table) {
  const std::string text = csv(table);
  return text.substr(0, text.find('\n'));
}

TEST_F(StabilityStudyFiles, TablesHoldWhatTheJobsFound) {
  const auto study = read(kSmall);
  ASSERT_EQ(study->jobs().size(), 4u + 4u);
  const std::vector<Table> tables = study->tables(run_all(*study));
  ASSERT_EQ(tables.size(), 3u);

  const Table& limits = table(tables, "stability");
  EXPECT_EQ(header(limits),
            "system,integrator,dashpot,damping_ratio,undamped_critical_step,theory_limit,bound,measured_limit,failure");
  EXPECT_EQ(texts(limits, "integrator"), (std::vector<std::string>{"lagged", "lagged", "pece", "pece"}));
  EXPECT_EQ(numbers(limits, "damping_ratio"), (std::vector<double>{0.3, 1.0, 0.3, 1.0}));
  // One contact: 2 sqrt(m / k), and the closed forms.
  const double undamped = 2.0 * std::sqrt(core::Materials{}.mass(0.22) / 1e9);
  const std::vector<double> closed{mode_limit(0.3, core::Integrator::lagged), mode_limit(1.0, core::Integrator::lagged),
                                   mode_limit(0.3, core::Integrator::pece), mode_limit(1.0, core::Integrator::pece)};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(numbers(limits, "undamped_critical_step")[i] / undamped, 1.0, 1e-9);  // rounding of the overlap
    EXPECT_NEAR(numbers(limits, "theory_limit")[i] / closed[i], 1.0, 2.0 * kLimitResolution);
    EXPECT_NEAR(numbers(limits, "measured_limit")[i] / closed[i], 1.0, 0.012);  // 1000 steps: see measured_limit()
    // pece has the bound of lagged steps.
    const double bound = mode_limit(numbers(limits, "damping_ratio")[i], core::Integrator::lagged);
    EXPECT_NEAR(numbers(limits, "bound")[i] / bound, 1.0, 1e-7);  // the bound's own search stops at 1e-9
  }

  const Table& map = table(tables, "stability_map");
  EXPECT_EQ(header(map), "system,integrator,dashpot,damping_ratio,step_ratio,growth_per_step,theory_growth");
  ASSERT_EQ(numbers(map, "step_ratio").size(), 8u);
  for (std::size_t i = 0; i < 8; ++i) {
    const bool grows = numbers(map, "step_ratio")[i] > closed[i / 2];
    EXPECT_EQ(numbers(map, "growth_per_step")[i] > 1.0, grows) << i;
    EXPECT_EQ(numbers(map, "theory_growth")[i] > 1.0, grows) << i;
    const double ratio = numbers(map, "growth_per_step")[i] / numbers(map, "theory_growth")[i];
    EXPECT_NEAR(ratio, 1.0, grows ? 0.02 : 1.0) << i;  // few steps; what fades does so in beats
  }

  const Table& growth = table(tables, "growth");
  EXPECT_EQ(header(growth), "system,ratio,damping_ratio,step_ratio,step,growth_rate,exponent,failure");
  EXPECT_EQ(numbers(growth, "ratio"), (std::vector<double>{1, 1, 1, 1, 1, 1, 4, 4, 4, 4, 4, 4}));
  for (std::size_t i = 0; i < 12; ++i) {
    const double rate = numbers(growth, "growth_rate")[i];
    const bool undamped_levels = i >= 6 && i < 9;
    EXPECT_EQ(rate > 1e-3, undamped_levels) << i << " " << rate;  // 1/s; sqrt(k / m) is 423
    if (undamped_levels) {
      EXPECT_NEAR(numbers(growth, "exponent")[i], 3.0, 0.1);  // C h3 + O(h4) over the two small steps
    } else {
      EXPECT_TRUE(std::isnan(numbers(growth, "exponent")[i])) << i;
    }
  }
  EXPECT_TRUE(study->warnings(tables).empty());
}

TEST_F(StabilityStudyFiles, JobsNamesChangeWithWhatTheyDependOn) {
  const auto ids = [&](const std::string& text) {
    std::set<std::string> out;
    for (const Job& job : read(text)->jobs()) {
      EXPECT_TRUE(out.insert(job.id).second) << job.id;
      EXPECT_EQ(job.id.find_first_not_of("abcdefghijklmnopqrstuvwxyz0123456789.-"), std::string::npos) << job.id;
    }
    return out;
  };
  const auto common = [](const std::set<std::string>& a, const std::set<std::string>& b) {
    return std::count_if(a.begin(), a.end(), [&](const std::string& id) { return b.count(id) > 0; });
  };
  const std::set<std::string> before = ids(kSmall);
  EXPECT_EQ(common(before, ids(replaced(kSmall, "[0.3, 1]", "[0.3, 0.5, 1]"))), 8);  // more jobs, the old ones stay
  EXPECT_EQ(common(before, ids(replaced(kSmall, "steps = 1000", "steps = 1001"))), 4);
  EXPECT_EQ(common(before, ids(replaced(kSmall, "0.95]", "0.94]"))), 4);
  EXPECT_EQ(common(before, ids(replaced(kSmall, "0.9]", "0.8]"))), 4);

  core::State state;
  state.add(0, Kind::content, Vec3(0.0, 0.0, 0.4), Vec3::Zero(), 0.22);
  state.add(1, Kind::wall, Vec3::Zero(), Vec3::Zero(), 0.22);
  const std::set<std::string> one = ids(packing(state));
  state.position[0].z() = 0.41;
  EXPECT_EQ(common(one, ids(packing(state))), 4);  // the growth's jobs
}

TEST_F(StabilityStudyFiles, APackingFromAFileSettlesFirst) {
  core::State pile;  // a ball in the hollow of three
  pile.add(0, Kind::content, Vec3(0.001, 0.0, 0.36), Vec3(0.1, 0.0, 0.0), 0.22);
  for (int k = 0; k < 3; ++k) {
    const double angle = 2.0 * std::numbers::pi * k / 3.0;
    pile.add(k + 1, Kind::wall, 0.254 * Vec3(std::cos(angle), std::sin(angle), 0.0), Vec3::Zero(), 0.22);
  }
  const auto study = read(packing(pile));
  const std::vector<Table> tables = study->tables(run_all(*study));
  const Table& limits = table(tables, "stability");
  ASSERT_EQ(numbers(limits, "measured_limit").size(), 2u);
  // A single ball: the bound of lagged steps is exact, but for the bisection.
  EXPECT_NEAR(numbers(limits, "theory_limit")[0] / numbers(limits, "bound")[0], 1.0, 2.0 * kLimitResolution);
  for (std::size_t i = 0; i < 2; ++i)
    EXPECT_NEAR(numbers(limits, "measured_limit")[i] / numbers(limits, "theory_limit")[i], 1.0, 0.012);
}

TEST_F(StabilityStudyFiles, AJobWhoseNumericsFailSaysSo) {
  core::State lonely;
  lonely.add(0, Kind::content, Vec3::Zero(), Vec3::Zero(), 0.22);
  const auto study = read(replaced(packing(lonely), ", \"pece\"", ""));
  const std::vector<Table> tables = study->tables(run_all(*study));
  const Table& limits = table(tables, "stability");
  ASSERT_EQ(numbers(limits, "measured_limit").size(), 1u);
  EXPECT_TRUE(std::isnan(numbers(limits, "measured_limit")[0]));
  EXPECT_NE(texts(limits, "failure")[0].find("still moving"), std::string::npos);
  EXPECT_EQ(numbers(table(tables, "stability_map"), "step_ratio").size(), 2u);
  const std::vector<std::string> warnings = study->warnings(tables);
  ASSERT_EQ(warnings.size(), 1u);
  EXPECT_NE(warnings[0].find("packing.h5: still moving"), std::string::npos) << warnings[0];
}

TEST_F(StabilityStudyFiles, WarnsOfAnUnsafeBoundAndOfDisagreement) {
  const auto study = read(kSmall);
  Table limits{"stability",
               {{"system", "", std::vector<std::string>{"wall", "wall", "wall"}},
                {"integrator", "", std::vector<std::string>{"lagged", "predicted", "pece"}},
                {"damping_ratio", "", std::vector<double>{0.1, 0.2, 0.3}},
                {"theory_limit", "", std::vector<double>{0.5, 0.5, 0.5}},
                {"bound", "", std::vector<double>{0.51, 0.5, 0.4}},
                {"measured_limit", "", std::vector<double>{0.51, 0.53, 0.48}},
                {"failure", "", std::vector<std::string>{"", "", ""}}}};
  const std::vector<std::string> warnings = study->warnings({limits});
  ASSERT_EQ(warnings.size(), 2u);
  EXPECT_NE(warnings[0].find("wall, lagged, damping ratio 0.1: the bound 0.51 is above the limit 0.5"), std::string::npos)
      << warnings[0];
  EXPECT_NE(warnings[1].find("wall, predicted, damping ratio 0.2: the measured limit 0.53"), std::string::npos)
      << warnings[1];
}

TEST_F(StabilityStudyFiles, ComplaintsNamePlaceValueAndRemedy) {
  struct Case {
    const char* from;
    const char* to;
    std::vector<std::string> words;
  };
  const Case cases[] = {
      {"\"stability\"", "\"stabilty\"", {"study.toml:1", "kind", "stabilty", "\"stability\""}},
      {"[\"wall\"]", "[\"wal\"]", {"study.toml:2", "systems", "wal", "\"pair\" or \"wall\" or \"chain\" or \"packing\""}},
      {"[\"wall\"]", "\"wall\"", {"study.toml:2", "systems", "give a list"}},
      {"[\"wall\"]", "[\"wall\", \"wall\"]", {"study.toml:2", "once"}},
      {"systems = [\"wall\"]", "", {"systems is missing", "give a list"}},
      {"[\"wall\"]", "[\"wall\"]\npacking = \"nowhere.h5\"", {"study.toml:3", "packing", "add \"packing\" to systems"}},
      {"\"pece\"", "\"euler\"", {"study.toml:3", "integrators", "\"lagged\" or \"predicted\" or \"pece\""}},
      {"[\"explicit\"]", "[\"relaxed\"]", {"study.toml:4", "dashpots", "each must be \"explicit\""}},
      {"[0.3, 1]", "[]", {"study.toml:5", "damping_ratios", "from 0 to 10"}},
      {"[0.3, 1]", "[0.3, -1]", {"study.toml:5", "damping_ratios", "from 0 to 10"}},
      {"[0.3, 1]", "[nan]", {"study.toml:5", "damping_ratios", "from 0 to 10"}},
      {"[0.3, 1]", "[\"0.3\"]", {"study.toml:5", "damping_ratios", "from 0 to 10"}},
      {"[0.2, 0.95]", "[0, 0.95]", {"study.toml:6", "step_ratios", "above 0 and at most 2"}},
      {"[0.2, 0.95]", "[2.1]", {"study.toml:6", "step_ratios", "above 0 and at most 2"}},
      {"steps = 1000", "steps = 10", {"study.toml:7", "steps = 10", "100 to 1000000"}},
      {"steps = 1000", "step = 1000", {"study.toml:7", "step", "steps"}},
      {"[1, 4]", "[1, 3]", {"study.toml:9", "[growth] ratios", "1, 2, 4, 8 or 16"}},
      {"[1, 4]", "[4.0]", {"study.toml:9", "[growth] ratios", "1, 2, 4, 8 or 16"}},
      {"[0.0, 0.02]", "[0.2]", {"study.toml:10", "[growth] damping_ratios", "from 0 to 0.1"}},
      {"[0.2, 0.3, 0.9]", "[0.95]", {"study.toml:11", "[growth] step_ratios", "above 0 and at most 0.9"}},
      {"[0.2, 0.3, 0.9]", "[0.2]\nlevels = 3", {"study.toml:12", "levels", "[growth]"}},
  };
  for (const Case& c : cases) {
    const std::string message = complaint(replaced(kSmall, c.from, c.to));
    for (const std::string& word : c.words)
      EXPECT_NE(message.find(word), std::string::npos) << c.to << ": " << message << " lacks " << word;
  }
  EXPECT_NE(complaint("kind = \n").find("not TOML"), std::string::npos);
}

TEST_F(StabilityStudyFiles, PackingsAreCheckedWhenTheStudyIsRead) {
  const std::string missing = replaced(kSmall, "[\"wall\"]", "[\"packing\"]\npacking = \"nowhere.h5\"");
  EXPECT_NE(complaint<core::FileError>(missing).find("nowhere.h5"), std::string::npos);
  core::State state;
  for (int k = 0; k < 101; ++k) state.add(k, Kind::content, Vec3(0.5 * k, 0.0, 0.0), Vec3::Zero(), 0.22);
  EXPECT_NE(complaint(packing(state)).find("101 content balls, but theory takes 1 to 100"), std::string::npos);
  core::State walls;
  walls.add(0, Kind::wall, Vec3::Zero(), Vec3::Zero(), 0.22);
  EXPECT_NE(complaint(packing(walls)).find("0 content balls"), std::string::npos);
}

TEST(StabilityStudy, ThatOfTheBenchmarksReads) {
  const auto study = read_stability_study(std::string(GRAINCLOCK_SOURCE) + "/benchmarks/stability.toml", 1);
  EXPECT_EQ(study->jobs().size(), 4u * 3u * 8u + 4u * 3u);
}

}  // namespace
}  // namespace grainclock::benchmarks
