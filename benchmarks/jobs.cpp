#include "benchmarks/jobs.hpp"

#include "core/files.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <cstring>

extern char** environ;

namespace grainclock::benchmarks {
namespace {

constexpr const char* kParent = "GRAINCLOCK_STUDY_PROCESS";  // in a child's environment: whose it is
constexpr std::size_t kLongestSlug = 120;                    // file names have at most 255 bytes

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

std::uint64_t sum_of(std::string_view text) {
  std::uint64_t sum = 14695981039346656037u;
  for (const char c : text) sum = (sum ^ static_cast<unsigned char>(c)) * 1099511628211u;
  return sum;
}

/// The attributes of a child: signals as a program expects them, and a group of its own, since a Ctrl-C at the
/// terminal is for the parent alone, who passes it on.
class SpawnSettings {
 public:
  SpawnSettings(const sigset_t& mask, const std::filesystem::path& log) {
    ::posix_spawnattr_init(&attributes_);
    ::posix_spawn_file_actions_init(&files_);
    sigset_t defaults;
    ::sigemptyset(&defaults);
    for (const int signal : {SIGINT, SIGTERM, SIGCHLD}) ::sigaddset(&defaults, signal);
    ::posix_spawnattr_setsigdefault(&attributes_, &defaults);
    ::posix_spawnattr_setsigmask(&attributes_, &mask);
    ::posix_spawnattr_setpgroup(&attributes_, 0);
    ::posix_spawnattr_setflags(&attributes_, POSIX_SPAWN_SETSIGDEF | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETPGROUP);
    ::posix_spawn_file_actions_addopen(&files_, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    ::posix_spawn_file_actions_addopen(&files_, STDERR_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  }
  ~SpawnSettings() {
    ::posix_spawnattr_destroy(&attributes_);
    ::posix_spawn_file_actions_destroy(&files_);
  }
  SpawnSettings(const SpawnSettings&) = delete;
  SpawnSettings& operator=(const SpawnSettings&) = delete;
  const posix_spawnattr_t* attributes() const { return &attributes_; }
  const posix_spawn_file_actions_t* files() const { return &files_; }

 private:
  posix_spawnattr_t attributes_{};
  posix_spawn_file_actions_t files_{};
};

/// What the child said, without the program's name before it; an empty log is removed.
std::string message_in(const std::filesystem::path& log) {
  std::error_code ignored;
  if (std::filesystem::file_size(log, ignored) == 0 || ignored) {
    std::filesystem::remove(log, ignored);
    return {};
  }
  std::string text = core::read_text(log);
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back()))) text.pop_back();
  constexpr std::string_view kProgram = "grainclock: ";
  const std::size_t at = text.rfind(kProgram);
  return at == std::string::npos ? text : text.substr(at + kProgram.size());
}

core::ExitCode code_of(int status) {
  using core::ExitCode;
  if (WIFSIGNALED(status)) {
    return WTERMSIG(status) == SIGTERM || WTERMSIG(status) == SIGINT ? ExitCode::stopped : ExitCode::numerics_failed;
  }
  for (const ExitCode code : {ExitCode::done, ExitCode::bad_input, ExitCode::file_trouble, ExitCode::stopped}) {
    if (WEXITSTATUS(status) == static_cast<int>(code)) return code;
  }
  return ExitCode::numerics_failed;
}

}  // namespace

std::string job_id(std::string_view slug, std::string_view depends_on) {
  std::string id;
  for (const char c : slug.substr(0, kLongestSlug)) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) || c == '.' || c == '_';
    if (is_plain) {
      id += c;
    } else if (!id.empty() && id.back() != '-') {
      id += '-';
    }
  }
  return fmt::format("{}-{:016x}", id, sum_of(depends_on));
}

JobProcesses::JobProcesses(int most) : most_(static_cast<std::size_t>(most)) {
  // Blocked signals wait until next() takes them: none is lost between two calls.
  ::sigemptyset(&waited_);
  for (const int signal : {SIGINT, SIGTERM, SIGCHLD}) ::sigaddset(&waited_, signal);
  ::sigprocmask(SIG_BLOCK, &waited_, &mask_before_);
}

JobProcesses::~JobProcesses() {
  for (const Child& child : running_) ::kill(child.process, SIGTERM);
  for (const Child& child : running_) {
    ::waitpid(child.process, nullptr, 0);
    (void)message_in(child.log);
  }
  ::sigprocmask(SIG_SETMASK, &mask_before_, nullptr);
}

void JobProcesses::start(const std::string& id, const std::string& program, const std::vector<std::string>& arguments,
                         const std::filesystem::path& log) {
  std::vector<char*> words{const_cast<char*>("grainclock")};
  for (const std::string& argument : arguments) words.push_back(const_cast<char*>(argument.c_str()));
  words.push_back(nullptr);
  std::string parent = fmt::format("{}={}", kParent, ::getpid());
  std::vector<char*> surroundings{parent.data()};  // the first of equal names counts
  for (char** one = environ; *one; ++one) surroundings.push_back(*one);
  surroundings.push_back(nullptr);
  const SpawnSettings settings(mask_before_, log);
  pid_t process = 0;
  const int trouble =
      ::posix_spawn(&process, program.c_str(), settings.files(), settings.attributes(), words.data(), surroundings.data());
  if (trouble != 0) {
    throw core::FileError(fmt::format("{}: cannot be started for job {} (its messages go to {}): {}", program, id,
                                      log.string(), std::strerror(trouble)));
  }
  running_.push_back({id, process, log, now()});
}

Ended JobProcesses::next() {
  while (!running_.empty()) {
    for (auto child = running_.begin(); child != running_.end(); ++child) {
      int status = 0;
      if (::waitpid(child->process, &status, WNOHANG) != child->process) continue;
      Ended ended{child->id, code_of(status), message_in(child->log), now() - child->begin};
      if (WIFSIGNALED(status)) {
        ended.message += fmt::format("{}killed by signal {} ({})", ended.message.empty() ? "" : "; ", WTERMSIG(status),
                                     ::strsignal(WTERMSIG(status)));
      } else if (status != 0 && ended.message.empty()) {
        ended.message = fmt::format("ended with exit code {}", WEXITSTATUS(status));
      }
      running_.erase(child);
      return ended;
    }
    const int signal = ::sigwaitinfo(&waited_, nullptr);
    if (signal == SIGINT || signal == SIGTERM)
      throw core::Stopped(signal == SIGINT ? "stopped by SIGINT" : "stopped by SIGTERM");
  }
  return {};
}

void end_with_parent() {
  const char* const parent = std::getenv(kParent);
  if (!parent) return;
  ::prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (fmt::format("{}", ::getppid()) != parent) ::raise(SIGTERM);  // it ended before we asked
}

}  // namespace grainclock::benchmarks
