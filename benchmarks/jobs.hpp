// Jobs in processes of their own: names that change with all that a result depends on, and children that end with us.
#pragma once

#include "core/check.hpp"

#include <sys/types.h>
#include <csignal>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace grainclock::benchmarks {

/// The slug made fit for a file name, and a 64-bit FNV-1a sum over all that the job's result depends on:
/// "mini-uniform-step-1e-05-0123456789abcdef".
std::string job_id(std::string_view slug, std::string_view depends_on);

/// How a child ended. A child that was killed has no code of its own: `stopped` for SIGINT and SIGTERM, else
/// `numerics_failed`.
struct Ended {
  std::string id;
  core::ExitCode code = core::ExitCode::done;
  std::string message;  // what it said on standard error, or which signal killed it
  double seconds = 0.0;
};

/// Children of this process, a few at once. SIGINT and SIGTERM stop them; when this process is killed, children that
/// call end_with_parent() end too.
class JobProcesses {
 public:
  /// Takes the signals from here on.
  explicit JobProcesses(int most);
  /// Stops the children that still run, and waits for them.
  ~JobProcesses();
  JobProcesses(const JobProcesses&) = delete;
  JobProcesses& operator=(const JobProcesses&) = delete;

  bool is_full() const { return running_.size() >= most_; }
  bool is_idle() const { return running_.empty(); }
  /// Runs a program. What it says on standard error goes to `log`, which stays if there is anything in it.
  /// Throws FileError if the program cannot be started.
  void start(const std::string& id, const std::string& program, const std::vector<std::string>& arguments,
             const std::filesystem::path& log);
  /// Waits for the next child to end. Throws Stopped at SIGINT or SIGTERM.
  Ended next();

 private:
  struct Child {
    std::string id;
    pid_t process;
    std::filesystem::path log;
    double begin;  // s
  };
  std::size_t most_;
  std::vector<Child> running_;
  sigset_t waited_{}, mask_before_{};
};

/// Lets this process end when the one that started it by JobProcesses does; without effect in others.
void end_with_parent();

}  // namespace grainclock::benchmarks
