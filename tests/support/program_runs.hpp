// The program as a child process, and what its runs leave.
#pragma once

#include "core/snapshot.hpp"
#include "silo/checkpoint.hpp"
#include "silo/run_file.hpp"
#include "tests/support/balls.hpp"
#include "tests/support/scratch.hpp"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <thread>

namespace grainclock::tests {

using Words = std::vector<std::string>;
inline Words operator+(Words a, const Words& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

struct Result {
  int code;
  std::string out, err;
};

/// A running program; its output goes to files.
class Process {
 public:
  /// `kernels`: the instruction set; empty for the best.
  Process(const Scratch& scratch, const Words& arguments, const std::string& kernels = {}) : out_(scratch / "stdout"), err_(scratch / "stderr") {
    child_ = ::fork();
    if (child_ != 0) return;
    ::setenv("OMP_WAIT_POLICY", "passive", 0);  // threads share the cores with other tests
    if (!kernels.empty()) ::setenv("GRAINCLOCK_KERNELS", kernels.c_str(), 1);
    ::dup2(::open(out_.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0644), STDOUT_FILENO);
    ::dup2(::open(err_.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0644), STDERR_FILENO);
    std::vector<char*> raw{const_cast<char*>(GRAINCLOCK_PROGRAM)};
    for (const std::string& argument : arguments) raw.push_back(const_cast<char*>(argument.c_str()));
    raw.push_back(nullptr);
    ::execv(GRAINCLOCK_PROGRAM, raw.data());
    ::_exit(127);
  }
  void send(int signal) const { ::kill(child_, signal); }
  Result wait() const {
    int status = 0;
    ::waitpid(child_, &status, 0);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), text_of(out_), text_of(err_)};
  }

 private:
  std::string out_, err_;
  pid_t child_;
};

inline Result grainclock(const Scratch& scratch, const Words& arguments, const std::string& kernels = {}) {
  return Process(scratch, arguments, kernels).wait();
}

/// Waits until a run has written this checkpoint; false if it ends before, or does not come to it within a minute.
inline bool reaches(const std::filesystem::path& run, int checkpoint) {
  for (int k = 0; k < 60000 && !std::filesystem::exists(run / "final.h5"); ++k) {
    const auto written = silo::checkpoints_in(run / "checkpoints");
    if (!written.empty() && std::stoi(written.front().stem().string()) >= checkpoint) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  return false;
}

/// Expects two runs to have left the same bits: final states, frames and observables.
inline void expect_same_runs(const std::filesystem::path& a, const std::filesystem::path& b) {
  EXPECT_EQ(core::checksum(core::read_state((a / "final.h5").string())), core::checksum(core::read_state((b / "final.h5").string())));
  const silo::RunReader one(a), other(b);
  ASSERT_EQ(one.times(), other.times());
  for (std::int64_t frame = 0; frame < one.frames(); ++frame) {
    const core::State x = one.state(frame), y = other.state(frame);
    ASSERT_EQ(x.id, y.id) << frame;
    ASSERT_TRUE(same_bits(x.position, y.position) && same_bits(x.velocity, y.velocity)) << frame;
    ASSERT_EQ(x.level, y.level) << frame;
    ASSERT_EQ(one.step(frame), other.step(frame));
    for (const std::string& name : one.observables()) {
      if (name == "contact_evaluations") continue;  // lists are built at other times, and so are of another length
      ASSERT_EQ(one.observable(name, frame), other.observable(name, frame)) << name << " in frame " << frame;
    }
  }
  for (const std::string& name : one.observables()) {
    if (name == "contact_evaluations") continue;
    ASSERT_EQ(one.series(name)->time, other.series(name)->time) << name;
    ASSERT_EQ(one.series(name)->values, other.series(name)->values) << name;
  }
}

}  // namespace grainclock::tests
