#include "benchmarks/jobs.hpp"

#include "tests/support/scratch.hpp"

#include <unistd.h>

#include <chrono>
#include <thread>

namespace grainclock::benchmarks {
namespace {

namespace fs = std::filesystem;
using core::ExitCode;

TEST(JobId, IsFitForAFileName) {
  const std::string id = job_id("mini flow: a/b \"c\" step 1e-05", "x");
  EXPECT_EQ(id.find("mini-flow-a-b-c-step-1e-05-"), 0u) << id;
  EXPECT_EQ(id.size(), std::string("mini-flow-a-b-c-step-1e-05-").size() + 16);
  EXPECT_LT(job_id(std::string(1000, 'a'), "x").size(), 200u);
}

TEST(JobId, ChangesWithAllThatTheResultDependsOnAndNothingElse) {
  EXPECT_EQ(job_id("a", "text"), job_id("a", "text"));
  EXPECT_NE(job_id("a", "text"), job_id("a", "texu"));
  EXPECT_EQ(job_id("a", ""), "a-cbf29ce484222325");   // FNV-1a's published start value
  EXPECT_EQ(job_id("a", "a"), "a-af63dc4c8601ec8c");  // and its published sum of "a"
}

class Children : public testing::Test {
 protected:
  void start(JobProcesses& children, const std::string& id, const std::string& script) const {
    children.start(id, "/bin/sh", {"-c", script}, log(id));
  }
  Ended run(const std::string& script) const {
    JobProcesses children(1);
    start(children, "one", script);
    return children.next();
  }
  fs::path log(const std::string& id) const { return scratch_.path() / (id + ".log"); }

  tests::Scratch scratch_;
};

TEST_F(Children, ThatEndWellLeaveNoLog) {
  const Ended ended = run("exit 0");
  EXPECT_EQ(ended.id, "one");
  EXPECT_EQ(ended.code, ExitCode::done);
  EXPECT_EQ(ended.message, "");
  EXPECT_FALSE(fs::exists(log("one")));
}

TEST_F(Children, ThatComplainKeepTheirLog) {
  const Ended ended = run("echo 'grainclock: the step is bad' >&2; exit 2");
  EXPECT_EQ(ended.code, ExitCode::bad_input);
  EXPECT_EQ(ended.message, "the step is bad");
  EXPECT_EQ(tests::text_of(log("one")), "grainclock: the step is bad\n");
}

TEST_F(Children, EndWithTheProgramsCodes) {
  EXPECT_EQ(run("exit 3").code, ExitCode::numerics_failed);
  EXPECT_EQ(run("exit 4").code, ExitCode::file_trouble);
  EXPECT_EQ(run("exit 5").code, ExitCode::stopped);
  EXPECT_EQ(run("exit 77").code, ExitCode::numerics_failed);
  EXPECT_EQ(run("exit 77").message, "ended with exit code 77");
}

TEST_F(Children, ThatAreKilledSaySo) {
  const Ended killed = run("kill -9 $$");
  EXPECT_EQ(killed.code, ExitCode::numerics_failed);
  EXPECT_NE(killed.message.find("signal 9"), std::string::npos) << killed.message;
  EXPECT_EQ(run("kill $$").code, ExitCode::stopped);
}

TEST_F(Children, RunAtOnceAndComeBackAsTheyEnd) {
  JobProcesses children(2);
  start(children, "slow", "sleep 0.3");
  EXPECT_FALSE(children.is_full());
  start(children, "fast", "true");
  EXPECT_TRUE(children.is_full());
  EXPECT_EQ(children.next().id, "fast");
  EXPECT_EQ(children.next().id, "slow");
  EXPECT_TRUE(children.is_idle());
}

TEST_F(Children, OfAMissingProgramAreFileErrors) {
  JobProcesses children(1);
  EXPECT_THROW(children.start("one", "/nowhere/program", {}, log("one")), core::FileError);
  EXPECT_THROW(children.start("one", "/bin/true", {}, "/nowhere/one.log"), core::FileError);
}

TEST_F(Children, AreStoppedWithTheirParentsSignal) {
  const fs::path note = scratch_.path() / "process";
  {
    JobProcesses children(1);
    start(children, "one",
          "echo $$ > " + note.string() + ".part; mv " + note.string() + ".part " + note.string() + "; exec sleep 60");
    while (!fs::exists(note)) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    ::kill(::getpid(), SIGTERM);  // blocked here, taken by next()
    EXPECT_THROW(children.next(), core::Stopped);
  }
  EXPECT_NE(::kill(std::stoi(tests::text_of(note)), 0), 0);  // no such process any more
}

}  // namespace
}  // namespace grainclock::benchmarks
