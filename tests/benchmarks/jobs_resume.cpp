// Studies that are called again: what is done stays done, whatever ended the call before.
#include "core/hdf5.hpp"
#include "tests/benchmarks/study_files.hpp"

#include <chrono>
#include <set>
#include <thread>

namespace grainclock::benchmarks {
namespace {

namespace fs = std::filesystem;
using tests::replaced;
using namespace std::chrono_literals;

/// A job that takes minutes, for tests that end it.
const std::string kEndless = "[[method]]\nmethod = \"uniform\"\nstep = 1e-10\n";
const std::string kEndlessPart = "1e-10";  // of its id
const std::string kMethods =
    "[[method]]\nmethod = \"uniform\"\nevents = false\nstep = [4e-5, 2e-5]\n[[method]]\nname = \"ours\"\ntolerance = 1e-4\n";

class StudyResume : public StudyFiles {
 protected:
  /// Name and time of writing of every job's file.
  std::map<std::string, fs::file_time_type> done() const {
    std::map<std::string, fs::file_time_type> files;
    if (!fs::exists(out_ / "jobs")) return files;
    for (const auto& entry : fs::directory_iterator(out_ / "jobs")) {
      const std::string name = entry.path().filename().string();
      if (entry.path().extension() == ".h5" && !name.starts_with(".")) files[name] = entry.last_write_time();
    }
    return files;
  }
  /// How many of the files are not as they were before.
  static std::size_t renewed(const std::map<std::string, fs::file_time_type>& before,
                             const std::map<std::string, fs::file_time_type>& now) {
    return static_cast<std::size_t>(std::count_if(now.begin(), now.end(), [&](const auto& file) {
      const auto old = before.find(file.first);
      return old == before.end() || old->second != file.second;
    }));
  }
  /// Waits up to a minute until so many jobs are done and one runs whose id contains `part`; gives its process.
  pid_t running_child(const Program& study, std::size_t after, const std::string& part = "-") const {
    for (int k = 0; k < 12000; ++k, std::this_thread::sleep_for(5ms)) {
      const std::string text = tests::text_of(fmt::format("/proc/{0}/task/{0}/children", study.process()));
      if (done().size() < after || text.empty()) continue;
      const pid_t child = std::stoi(text);
      const std::string command = tests::text_of(fmt::format("/proc/{}/cmdline", child));
      if (command.substr(std::min(command.size(), command.find("--job"))).find(part) != std::string::npos) return child;
    }
    ADD_FAILURE() << "no such job runs";
    return 0;
  }
  static bool ends(pid_t process) {
    for (int k = 0; k < 2000; ++k, std::this_thread::sleep_for(5ms)) {
      const std::string status = tests::text_of(fmt::format("/proc/{}/stat", process));
      if (status.empty() || status.find(") Z ") != std::string::npos) return true;
    }
    return false;
  }
};

TEST_F(StudyResume, JobsThatAreDoneAreNotRunAgain) {
  const auto first = run(kHead + kMethods);
  const auto before = done();
  EXPECT_EQ(before.size(), 5u);
  const Result again = grainclock();
  EXPECT_EQ(again.code, 0) << again.err;
  EXPECT_NE(again.out.find("5 of 5 done before"), std::string::npos) << again.out;
  EXPECT_EQ(renewed(before, done()), 0u);
  EXPECT_EQ(csv_rows(out_ / "study.csv"), first);  // the clock too: it is read from the jobs
}

TEST_F(StudyResume, EditingOneMethodRunsOnlyThat) {
  run(kHead + kMethods);
  const auto before = done();
  const auto rows = run(kHead + replaced(kMethods, "1e-4", "2e-4"));
  EXPECT_EQ(renewed(before, done()), 1u);
  EXPECT_EQ(done().size(), 6u);  // the old one may be wanted again
  ASSERT_EQ(rows.size(), 5u);
  EXPECT_EQ(rows[2].at("tolerance"), "0.0002");
  run(kHead + kMethods);
  EXPECT_EQ(renewed(before, done()), 1u);
}

TEST_F(StudyResume, ANameOrACommentRunsNothing) {
  run(kHead + kMethods);
  const auto before = done();
  const auto rows = run("# once more\n" + kHead + replaced(kMethods, "ours", "mine"));
  EXPECT_EQ(renewed(before, done()), 0u);
  EXPECT_EQ(rows.at(2).at("name"), "mine");
  EXPECT_NE(core::read_text(out_ / "study.toml").find("# once more"), std::string::npos);
}

TEST_F(StudyResume, SceneStartAndHorizonRunEverything) {
  run(kHead + kMethods);
  auto before = done();
  core::write_text(dir_ / "scene.toml", core::read_text(dir_ / "scene.toml") + "[contact]\nk_ball = 1.1e7\n");
  run(kHead + kMethods);
  EXPECT_EQ(renewed(before, done()), 5u);
  before = done();
  core::State state = core::read_state((dir_ / "start.csv").string());
  state.velocity[0].x() += 1e-9;
  core::write_state((dir_ / "start.csv").string(), state);
  run(kHead + kMethods);
  EXPECT_EQ(renewed(before, done()), 5u);
  before = done();
  run(replaced(kHead, "0.02", "0.01") + kMethods);
  EXPECT_EQ(renewed(before, done()), 5u);
}

TEST_F(StudyResume, MoreRepetitionsAddJobs) {
  run(kHead + kMethods);
  const auto before = done();
  run(replaced(kHead, "repeat = 1", "repeat = 3") + kMethods);
  EXPECT_EQ(renewed(before, done()), 6u);  // two more of each of three points
}

TEST_F(StudyResume, MethodsThatSayTheSameShareAJob) {
  const auto rows = run(kHead +
                        "[[method]]\nname = \"a\"\nmethod = \"uniform\"\nstep = 1e-5\n[[method]]\nname = \"b\"\nmethod = "
                        "\"uniform\"\nstep = 1e-5\n");
  EXPECT_EQ(done().size(), 3u);
  ASSERT_EQ(rows.size(), 4u);
  EXPECT_EQ(rows[0].at("error_rms"), rows[1].at("error_rms"));
}

TEST_F(StudyResume, AfterAKillTheStudyGoesOnToTheSameTables) {
  const auto whole = without_clock(run(kHead + kMethods));
  fs::remove_all(out_);
  for (std::size_t kills = 0; kills < 3; ++kills) {
    Program study(dir_, words());
    (void)running_child(study, kills + 1);
    study.send(SIGKILL);
    EXPECT_EQ(study.wait().code, 128 + SIGKILL);
    EXPECT_FALSE(fs::exists(out_ / "study.csv"));
  }
  const auto before = done();
  EXPECT_GE(before.size(), 1u);
  const Result rest = grainclock();
  EXPECT_EQ(rest.code, 0) << rest.err;
  EXPECT_EQ(without_clock(csv_rows(out_ / "study.csv")), whole);
  EXPECT_EQ(renewed(before, done()), 5u - before.size());
}

TEST_F(StudyResume, AKilledStudyTakesItsJobWithIt) {
  write(kHead + kMethods + kEndless);
  for (const auto later : {0ms, 300ms}) {  // while the job begins, and well within it
    Program study(dir_, words());
    const pid_t child = running_child(study, 5, kEndlessPart);
    std::this_thread::sleep_for(later);
    study.send(SIGKILL);
    (void)study.wait();
    EXPECT_TRUE(ends(child));
  }
}

TEST_F(StudyResume, ASignalStopsTheJobAndTheStudyGoesOnLater) {
  for (const int signal : {SIGTERM, SIGINT}) {
    write(kHead + kMethods + kEndless);
    Program study(dir_, words());
    const pid_t child = running_child(study, 5, kEndlessPart);
    study.send(signal);
    const Result stopped = study.wait();
    EXPECT_EQ(stopped.code, 5);
    EXPECT_NE(stopped.err.find(signal == SIGTERM ? "SIGTERM" : "SIGINT"), std::string::npos) << stopped.err;
    EXPECT_NE(stopped.err.find("goes on"), std::string::npos) << stopped.err;
    EXPECT_TRUE(ends(child));
    EXPECT_EQ(done().size(), 5u);
  }
  const auto before = done();
  EXPECT_EQ(run(kHead + kMethods).size(), 5u);
  EXPECT_EQ(renewed(before, done()), 0u);
}

TEST_F(StudyResume, AJobThatDiesEndsTheStudyWithItsMessage) {
  write(kHead + kMethods + kEndless);
  Program study(dir_, words());
  const pid_t child = running_child(study, 5, kEndlessPart);
  ::kill(child, SIGKILL);
  const Result ended = study.wait();
  EXPECT_EQ(ended.code, 3);
  EXPECT_NE(ended.err.find("signal 9"), std::string::npos) << ended.err;
  EXPECT_NE(ended.err.find("1e-10"), std::string::npos) << ended.err;
  EXPECT_EQ(done().size(), 5u);
}

TEST_F(StudyResume, AReferenceThatFailsEndsTheStudyWithItsCode) {
  write(replaced(kHead, "step = 1e-6", "step = 2e-3") + kMethods);
  const Result ended = grainclock();
  EXPECT_EQ(ended.code, 3);
  EXPECT_NE(ended.err.find("reference from start"), std::string::npos) << ended.err;
  EXPECT_FALSE(fs::exists(out_ / "study.csv"));
}

TEST_F(StudyResume, SeveralJobsAtOnceGiveTheSameTables) {
  const auto whole = without_clock(run(kHead + kMethods));
  fs::remove_all(out_);
  EXPECT_EQ(grainclock({"--jobs", "3"}).code, 0);
  EXPECT_EQ(without_clock(csv_rows(out_ / "study.csv")), whole);
}

TEST_F(StudyResume, JobsOneByOneAndCollectGiveTheSameTables) {
  const auto whole = without_clock(run(kHead + kMethods));
  fs::remove_all(out_);
  std::istringstream ids(grainclock({"--list"}).out);
  EXPECT_FALSE(fs::exists(out_)) << "--list writes nothing";
  std::set<std::string> seen;
  for (std::string id; std::getline(ids, id);) {
    const Result early = grainclock({"--collect"});
    EXPECT_EQ(early.code, 2);
    EXPECT_NE(early.err.find(fmt::format("{} of 5 jobs are not done", 5 - seen.size())), std::string::npos) << early.err;
    EXPECT_NE(early.err.find("grainclock study " + study_), std::string::npos) << early.err;
    const Result one = grainclock({"--job", id});
    EXPECT_EQ(one.code, 0) << one.err;
    EXPECT_TRUE(seen.insert(id).second) << id;
    EXPECT_TRUE(fs::exists(out_ / "jobs" / (id + ".h5"))) << id;
  }
  EXPECT_EQ(seen.size(), 5u);
  EXPECT_NE(grainclock({"--job", *seen.begin()}).out.find("done before"), std::string::npos);
  EXPECT_EQ(grainclock({"--collect"}).code, 0);
  EXPECT_EQ(without_clock(csv_rows(out_ / "study.csv")), whole);
}

TEST_F(StudyResume, JobsMayAllBeginAtOnceInANewDirectory) {
  write(kHead + kMethods);
  std::istringstream ids(grainclock({"--list"}).out);
  std::vector<std::unique_ptr<Program>> jobs;
  for (std::string id; std::getline(ids, id);) {
    fs::create_directories(dir_ / id);  // of its standard output and error
    jobs.push_back(std::make_unique<Program>(dir_ / id, words({"--job", id})));
  }
  for (const auto& job : jobs) {
    const Result ended = job->wait();
    EXPECT_EQ(ended.code, 0) << ended.err;
  }
  EXPECT_EQ(grainclock({"--collect"}).code, 0);
}

TEST_F(StudyResume, WrongCallsSayWhatIsRight) {
  write(kHead + kMethods);
  const struct {
    Words words;
    std::string says;
  } cases[] = {
      {{GRAINCLOCK_PROGRAM, "study", study_}, "--out is missing"},
      {words({"--job", "nothing-0123456789abcdef"}), "--list"},
      {words({"--list", "--collect"}), "--list"},
      {words({"--jobs", "0"}), "--jobs"},
      {{GRAINCLOCK_PROGRAM, "study", study_, "--collect"}, "--out"},
  };
  for (const auto& wrong : cases) {
    const Result ended = Program(dir_, wrong.words).wait();
    EXPECT_EQ(ended.code, 2);
    EXPECT_NE((ended.err + ended.out).find(wrong.says), std::string::npos) << ended.err;
  }
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(StudyResume, ADirectoryOfAnybodyElseIsLeftAlone) {
  write(kHead + kMethods);
  fs::create_directories(out_);
  core::write_text(out_ / "study.toml", "# my own study\n");
  for (const Words& more : {Words{}, Words{"--collect"}, Words{"--job", "x"}}) {
    const Result ended = grainclock(more);
    EXPECT_EQ(ended.code, 2);
  }
  EXPECT_NE(grainclock().err.find("holds no study"), std::string::npos);
  EXPECT_EQ(core::read_text(out_ / "study.toml"), "# my own study\n");
  EXPECT_EQ(std::distance(fs::directory_iterator(out_), fs::directory_iterator()), 1);
  fs::remove_all(out_);
  core::write_text(out_, "a file");
  EXPECT_EQ(grainclock().code, 2);
}

TEST_F(StudyResume, TwoStudiesDoNotShareADirectoryAtOnce) {
  write(kHead + kMethods + kEndless);
  Program study(dir_, words());
  (void)running_child(study, 1);
  fs::create_directories(dir_ / "second");
  const Result second = Program(dir_ / "second", words()).wait();
  EXPECT_EQ(second.code, 2);
  EXPECT_NE(second.err.find("another study"), std::string::npos) << second.err;
}

TEST_F(StudyResume, ADamagedJobIsNamed) {
  run(kHead + kMethods);
  const fs::path damaged = out_ / "jobs" / done().begin()->first;
  core::write_text(damaged, "nonsense");
  const Result ended = grainclock();
  EXPECT_EQ(ended.code, 4);
  EXPECT_NE(ended.err.find(damaged.filename().string()), std::string::npos) << ended.err;
}

TEST_F(StudyResume, JobsFromElsewhereLeaveMeasuredGainsOut) {
  const auto before = run(kHead + kMethods);
  EXPECT_NE(before[0].at("measured_gain"), "");
  // The same job by two threads is another clock.
  fs::remove(out_ / "jobs" / done().rbegin()->first);
  const Result ended = grainclock({"--threads", "2"});
  EXPECT_EQ(ended.code, 0);
  EXPECT_NE(ended.out.find("gains by wall clock are left out"), std::string::npos) << ended.out;
  const auto rows = csv_rows(out_ / "study.csv");
  for (const auto& row : rows) EXPECT_EQ(row.at("measured_gain"), "");
  EXPECT_EQ(rows[0].at("counted_gain"), before[0].at("counted_gain"));
}

TEST_F(StudyResume, ChartsThatCannotBeDrawnCostNothingElse) {
  write(kHead + kMethods);
  ASSERT_EQ(grainclock().code, 0);
  const Result drawn = Program(dir_, {GRAINCLOCK_PROGRAM, "study", study_, "--out", out_.string(), "--collect"}).wait();
  EXPECT_EQ(drawn.code, 0) << drawn.err;  // with or without Python's packages and the script
  EXPECT_NE(drawn.out.find("charts: "), std::string::npos) << drawn.out;
  EXPECT_EQ(grainclock({"--collect"}).out.find("charts: "), std::string::npos);
}

class SlowStudy : public StudyFiles {};

TEST_F(SlowStudy, SnakemakeGivesTheSameTables) {
  if (std::system("command -v snakemake >/dev/null 2>&1") != 0)
    GTEST_SKIP() << "snakemake is not installed: apt-get install snakemake";
  const auto whole = without_clock(run(kHead + kMethods));
  fs::remove_all(out_);
  const fs::path log = dir_ / "snakemake.log";
  const std::string call =
      fmt::format("cd {} && snakemake -s {}/benchmarks/Snakefile --cores 2 --config study={} out={} program={} >{} 2>&1",
                  dir_.string(), GRAINCLOCK_SOURCE, study_, out_.string(), GRAINCLOCK_PROGRAM, log.string());
  ASSERT_EQ(std::system(call.c_str()), 0) << tests::text_of(log);
  EXPECT_EQ(without_clock(csv_rows(out_ / "study.csv")), whole);
  // And the program goes on where Snakemake ended.
  EXPECT_NE(grainclock().out.find("5 of 5 done before"), std::string::npos);
}

}  // namespace
}  // namespace grainclock::benchmarks
