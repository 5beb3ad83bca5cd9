#include "benchmarks/study_plan.hpp"
#include "benchmarks/study_table.hpp"
#include "core/hdf5.hpp"
#include "tests/benchmarks/study_files.hpp"

namespace grainclock::benchmarks {
namespace {

namespace fs = std::filesystem;
using tests::replaced;

class StudyPlan : public StudyFiles {
 protected:
  Study read(const std::string& text) const { return read_study(write(text)); }
  std::string complaint(const std::string& text) const {
    try {
      read(text);
    } catch (const core::Error& error) {
      return error.what();
    }
    return "none";
  }
};
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
  EXPECT_EQ(method_name(study.points[1]), "cvode");
  ASSERT_TRUE(study.points[1].sundials.has_value());
  EXPECT_EQ(study.points[1].sundials->rtol, 1e-6);
}

TEST_F(StudyPlan, SundialsVariantsAreSchemes) {
  const struct {
    const char *method, *variant;
    Scheme scheme;
  } cases[] = {{"cvode", "", Scheme::cvode_adams},       {"cvode", "adams", Scheme::cvode_adams},
               {"cvode", "bdf", Scheme::cvode_bdf},      {"arkode", "", Scheme::erkstep},
               {"arkode", "erk", Scheme::erkstep},       {"arkode", "implicit", Scheme::arkstep_implicit},
               {"arkode", "imex", Scheme::arkstep_imex}, {"arkode", "mri", Scheme::mristep}};
  for (const auto& one : cases) {
    std::string text = kHead + fmt::format("[[method]]\nmethod = \"{}\"\nrtol = 1e-6\nroots = true\n", one.method);
    if (*one.variant) text += fmt::format("variant = \"{}\"\n", one.variant);
    if (one.scheme == Scheme::mristep) text += "step = 1e-4\n";
    const Point point = read(text).points.at(0);
    ASSERT_TRUE(point.sundials.has_value());
    EXPECT_EQ(point.sundials->scheme, one.scheme);
    EXPECT_TRUE(point.sundials->roots);
    EXPECT_EQ(method_name(point), one.method);
    EXPECT_EQ(point.sundials->slow_step, one.scheme == Scheme::mristep ? 1e-4 : 0.0);
  }
  EXPECT_FALSE(read(kHead + "[[method]]\nmethod = \"cvode\"\nrtol = 1e-6\n").points.at(0).sundials->roots);
}

TEST_F(StudyPlan, AMethodMayRepeatMoreOrLessThanTheStudy) {
  const Study study = read(kHead + "[[method]]\nrepeat = 7\n[[method]]\n");
  EXPECT_EQ(study.points.at(0).repeat, 7);
  EXPECT_EQ(study.points.at(1).repeat, 1);
}

TEST_F(StudyPlan, AReferenceIsCheckedByACoarserOne) {
  const Study fine = read(kHead + "[[method]]\n");
  EXPECT_EQ(coarser(fine.reference).stepping.step, 2e-6);
  const std::string text = replaced(kHead, "step = 1e-6", "method = \"cvode\"\nrtol = 1e-9\nroots = true");
  const Point reference = read(text + "[[method]]\n").reference, check = coarser(reference);
  EXPECT_EQ(reference.sundials->rtol, 1e-9);
  EXPECT_DOUBLE_EQ(check.sundials->rtol, 1e-8);
  EXPECT_TRUE(check.sundials->roots);
  EXPECT_EQ(check.name, "reference_check");
}

TEST_F(StudyPlan, DivergenceHasItsOwnHorizon) {
  EXPECT_FALSE(read(kHead + "[[method]]\n").divergence.has_value());
  const auto divergence = read(kHead + "[[method]]\n[divergence]\nstep = 1e-5\n").divergence;
  ASSERT_TRUE(divergence.has_value());
  EXPECT_EQ(divergence->horizon, 0.02);
  EXPECT_EQ(divergence->perturbation, 1e-12);
  EXPECT_EQ(divergence->samples, 64);
  EXPECT_EQ(read(kHead + "[[method]]\n[divergence]\nstep = 1e-5\nhorizon = 0.5\n").divergence->horizon, 0.5);
}

TEST_F(StudyPlan, KeysTextTellsWhatChangesResultsAndNothingElse) {
  const auto text_of = [this](const std::string& method) {
    return keys_text(read(kHead + "[[method]]\n" + method).points.at(0));
  };
  const std::string plain = text_of("tolerance = 1e-4\n");
  EXPECT_EQ(text_of("name = \"ours\"\nrepeat = 5\n"), plain);  // 1e-4 is the default
  EXPECT_NE(text_of("tolerance = 2e-4\n"), plain);
  EXPECT_NE(text_of("levels = 7\n"), plain);
  EXPECT_NE(text_of("step = 1e-4\n"), plain);
  const std::string adams = text_of("method = \"cvode\"\nrtol = 1e-6\n");
  EXPECT_EQ(text_of("method = \"cvode\"\nvariant = \"adams\"\nrtol = 1e-6\n"), adams);
  EXPECT_NE(text_of("method = \"cvode\"\nvariant = \"bdf\"\nrtol = 1e-6\n"), adams);
  EXPECT_NE(text_of("method = \"cvode\"\nroots = true\nrtol = 1e-6\n"), adams);
}

TEST_F(StudyPlan, PathsAreLookedForBesideTheStudy) {
  EXPECT_EQ(read(kHead + "[[method]]\n").starts.front(), (dir_ / "start.csv").string());
}

TEST_F(StudyPlan, SeveralStartStatesMayBeGiven) {
  const std::string text = replaced(kHead, "\"start.csv\"", "[\"start.csv\", \"start.csv\"]");
  EXPECT_EQ(read(text + "[[method]]\n").starts.size(), 2u);
}

TEST_F(StudyPlan, ErrorsNameFileLineValueAndRemedy) {
  const auto line = [this](int n) { return fmt::format("my.toml:{}: ", n); };
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
      {kHead + "[[method]]\nmethod = \"cvode\"\nrtol = 1e-6\nvariant = \"erk\"\n", line(10), "bdf"},
      {kHead + "[[method]]\nmethod = \"arkode\"\nrtol = 1e-6\nvariant = \"mri\"\n", line(7), "slow step"},
      {kHead + "[[method]]\nmethod = \"arkode\"\nrtol = 1e-6\nstep = 1e-4\n", line(10), "mri"},
      {kHead + "[[method]]\nmethod = \"cvode\"\nrtol = 1e-6\ntolerance = 1e-4\n", line(10), "tolerance"},
      {kHead + "[[method]]\nrepeat = 0\n", line(8), "1 to 1000"},
      {kHead + "repeat = 3\n[[method]]\n", line(7), "repeat"},
      {kHead + "[[method]]\n[divergence]\nsamples = 64\n", line(8), "step is missing"},
      {kHead + "[[method]]\n[divergence]\nstep = 1e-5\nsamples = 3\n", line(10), "4 to 100000"},
      {kHead + "[[method]]\ninterface = \"glue\"\n", line(8), "accumulate"},
      {kHead + "steps = 3\n[[method]]\n", line(7), "steps"},
      {"horizon = \"long\"\n" + kHead + "[[method]]\n", "my.toml:", ""},
      {kHead, "my.toml", "[[method]]"},
      {"scene = \n", "my.toml:1:9: ", "TOML"},
  };
  for (const auto& wrong : cases) {
    const std::string said = complaint(wrong.text);
    EXPECT_NE(said.find(wrong.place), std::string::npos) << said;
    EXPECT_NE(said.find(wrong.says), std::string::npos) << said;
  }
}

TEST_F(StudyPlan, MissingFilesAreFileErrors) {
  EXPECT_THROW(read_study((dir_ / "none.toml").string()), core::FileError);
  EXPECT_THROW(read(replaced(kHead, "start.csv", "other.csv") + "[[method]]\n"), core::FileError);
}

TEST(StudyTable, ColumnsBeginAsTheContractSays) {
  const std::string header = csv(study_table({}));
  EXPECT_EQ(header.find("name,method,method_used,integrator,events,dashpot,interface,step,tolerance,levels,error_rms,"
                        "error_median,error_p99,error_wall_force,momentum_residual,energy_residual,contact_evaluations,"
                        "ball_updates,wall_s,ideal_gain,counted_gain,measured_gain"),
            0u);
}

TEST_F(StudyRun, ErrorsFallWithTheStepAndEveryPointHasARow) {
  const std::string head = replaced(kHead, "0.02", "0.011");  // balls touch the wall then
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
  EXPECT_EQ(std::distance(fs::directory_iterator(dir_ / "out"), fs::directory_iterator()),
            4);  // and study.csv, study.toml, jobs
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
  const auto rows = run(replaced(kHead, "1e-6", "2e-5") + "[[method]]\nmethod = \"uniform\"\nstep = 1e-5\n");
  EXPECT_EQ(rows[1].at("status").find("too coarse"), 0u) << rows[1].at("status");
}

TEST_F(StudyRun, WrongInputLeavesNoOutputBehind) {
  EXPECT_THROW(run(kHead + "[[method]]\nlevels = 0\n"), core::InputError);
  EXPECT_FALSE(fs::exists(dir_ / "out"));
}

TEST_F(StudyRun, KeysThatNoStepperOffersTogetherShowBeforeAnythingRuns) {
  EXPECT_THROW(run(kHead + "[[method]]\nmethod = \"uniform\"\nstep = 1e-5\n[[method]]\nintegrator = \"lagged\"\n"),
               core::InputError);
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(StudyRun, AnUnknownKindIsAnError) {
  const std::string said =
      tests::message_of<core::InputError>([this] { run("kind = \"horoscope\"\n" + kHead + "[[method]]\n"); });
  EXPECT_NE(said.find("my.toml:1: "), std::string::npos) << said;
  EXPECT_NE(said.find("trajectories"), std::string::npos) << said;
}

TEST_F(StudyRun, EveryKindHasItsReader) {
  const struct {
    const char *kind, *says;
  } cases[] = {
      {"trajectories", "horizon is missing"}, {"statistics", "duration is missing"}, {"stability", "systems is missing"}};
  for (const auto& one : cases) {
    const std::string path = write(fmt::format("kind = \"{}\"\nscene = \"scene.toml\"\nstart = \"start.csv\"\n", one.kind));
    const std::string said = tests::message_of<core::InputError>([&] { (void)make_study(path, 1); });
    EXPECT_NE(said.find(one.says), std::string::npos) << said;
  }
}

TEST_F(StudyRun, SundialsMayBeTheReference) {
  const std::string text = replaced(kHead, "step = 1e-6", "method = \"cvode\"\nrtol = 1e-10");
  const auto rows = run(text + "[[method]]\nmethod = \"uniform\"\nstep = [2e-5, 1e-5]\n");
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_EQ(rows[2].at("name"), "reference");
  EXPECT_EQ(rows[2].at("variant"), "adams");
  EXPECT_EQ(rows[2].at("status"), "ok") << rows[2].at("status");
  EXPECT_EQ(rows[2].at("rtol"), "1e-10");
  EXPECT_DOUBLE_EQ(std::stod(rows[3].at("rtol")), 1e-9);
  // A uniform step is one sweep over the listed pairs. These are counted at the end; of 8 falling balls they come and go.
  const double sweeps_per_step = std::stod(rows[1].at("sweeps")) / std::stod(rows[1].at("steps"));
  EXPECT_GT(sweeps_per_step, 0.5);
  EXPECT_LT(sweeps_per_step, 2.0);
}

TEST_F(StudyRun, DivergenceIsMeasuredFromEveryStart) {
  const auto rows =
      run(kHead + "[[method]]\nmethod = \"uniform\"\nstep = 1e-5\n[divergence]\nstep = 1e-5\nhorizon = 0.04\nsamples = 8\n");
  ASSERT_EQ(rows.size(), 3u);
  const auto series = csv_rows(out_ / "divergence.csv");
  ASSERT_EQ(series.size(), 9u);
  EXPECT_EQ(series[0].at("start"), "start");
  EXPECT_EQ(series[0].at("time"), "0");
  EXPECT_DOUBLE_EQ(std::stod(series[8].at("time")), 0.04);
  // Each axis is uniform in +-1e-12: the rms of eight balls scatters by about a fifth around it, the largest is below
  // sqrt(3) of it.
  EXPECT_NEAR(std::stod(series[0].at("separation_rms")), 1e-12, 0.6e-12);
  EXPECT_LT(std::stod(series[0].at("separation_max")), 1.74e-12);
  // Eight balls dropped once do not part by orders of magnitude.
  EXPECT_LT(std::stod(series[8].at("separation_rms")), 1e-9);
  EXPECT_EQ(csv_rows(out_ / "horizon.csv").size(), 1u);
  EXPECT_EQ(core::Hdf5File::open(out_ / "study.h5").group("divergence").read<double>("separation_rms").size(), 9u);
}

TEST_F(StudyRun, OutputThatIsNotEmptyIsRefused) {
  fs::create_directories(dir_ / "out");
  core::write_text(dir_ / "out" / "mine.txt", "kept");
  EXPECT_THROW(run(kHead + "[[method]]\n"), core::InputError);
  EXPECT_EQ(core::read_text(dir_ / "out" / "mine.txt"), "kept");
}

}  // namespace
}  // namespace grainclock::benchmarks
