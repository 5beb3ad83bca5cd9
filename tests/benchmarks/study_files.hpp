// A small study in a directory of the test's own, run in this process or by the program as users call it.
#pragma once

#include "benchmarks/study.hpp"
#include "core/check.hpp"
#include "core/files.hpp"
#include "core/snapshot.hpp"
#include "tests/support/scratch.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace grainclock::benchmarks {

using Words = std::vector<std::string>;

struct Result {
  int code = -1;  // 128 + n: killed by signal n
  std::string out, err;
};

/// A running program; its output goes to files.
class Program {
 public:
  Program(const std::filesystem::path& dir, const Words& words)
      : out_(dir / "stdout"), err_(dir / "stderr"), process_(::fork()) {
    if (process_ != 0) return;
    ::dup2(::open(out_.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0644), STDOUT_FILENO);
    ::dup2(::open(err_.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0644), STDERR_FILENO);
    std::vector<char*> raw;
    for (const std::string& word : words) raw.push_back(const_cast<char*>(word.c_str()));
    raw.push_back(nullptr);
    ::execvp(raw.front(), raw.data());
    ::_exit(127);
  }
  ~Program() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
  }
  Program(const Program&) = delete;
  Program& operator=(const Program&) = delete;

  pid_t process() const { return process_; }
  void send(int signal) const { ::kill(process_, signal); }
  Result wait() {
    int status = 0;
    ::waitpid(process_, &status, 0);
    process_ = 0;
    return {WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status), tests::text_of(out_), tests::text_of(err_)};
  }

 private:
  std::string out_, err_;
  pid_t process_;
};

using CsvRows = std::vector<std::map<std::string, std::string>>;

/// Rows of a CSV file as column -> text; no quotes within quotes.
inline CsvRows csv_rows(const std::filesystem::path& path) {
  const auto cells_of = [](const std::string& line) {
    std::vector<std::string> cells;
    std::istringstream in(line);
    while (in.peek() != EOF) {
      std::string& cell = cells.emplace_back();
      if (in.peek() == '"') {
        in.get();
        std::getline(in, cell, '"');
        in.get();
      } else {
        std::getline(in, cell, ',');
      }
    }
    return cells;
  };
  std::istringstream lines(core::read_text(path));
  std::string line;
  std::getline(lines, line);
  const std::vector<std::string> names = cells_of(line);
  CsvRows rows;
  while (std::getline(lines, line)) {
    auto& row = rows.emplace_back();
    const std::vector<std::string> cells = cells_of(line);
    for (std::size_t c = 0; c < names.size(); ++c) row[names[c]] = c < cells.size() ? cells[c] : "";
  }
  return rows;
}

/// Without the columns that a clock fills.
inline CsvRows without_clock(CsvRows rows) {
  for (auto& row : rows) {
    for (const char* column : {"wall_s", "measured_gain", "gain_events_measured"}) row.erase(column);
  }
  return rows;
}

/// A directory of its own for each test, with a scene of eight balls that fall onto a floor of fixed balls.
class StudyFiles : public testing::Test {
 protected:
  StudyFiles() : dir_(scratch_.path()) {
    core::State state;
    core::BallId ball = 0;
    for (const double x : {0.0, 0.41}) {
      for (const double y : {0.0, 0.42}) {
        for (const double z : {0.45, 0.88}) {  // neighbours overlap, the floor does not yet
          state.add(ball, core::Kind::content, core::Vec3(x, y, z + 0.003 * static_cast<double>(ball)),
                    core::Vec3(0.1 * x, 0.2, -0.5), 0.22);
          ++ball;
        }
      }
    }
    for (const double x : {-0.4, 0.0, 0.4, 0.8}) {
      for (const double y : {-0.4, 0.0, 0.4, 0.8})
        state.add(ball++, core::Kind::wall, core::Vec3(x, y, 0.05 * x), core::Vec3::Zero(), 0.22);
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

  /// Writes the study file; gives its path.
  std::string write(const std::string& text) const {
    core::write_text(study_, text);
    return study_;
  }
  /// A call from this process; the jobs are the program's.
  StudyCall call() const {
    return {
        .study = study_, .out = out_.string(), .threads = 1, .processes = 1, .charts = false, .program = GRAINCLOCK_PROGRAM};
  }
  /// Runs the study; its rows as column -> text.
  CsvRows run(const std::string& text) const {
    write(text);
    run_study(call());
    return csv_rows(out_ / "study.csv");
  }
  /// `grainclock study STUDY --out OUT --no-charts` and further words.
  Words words(const Words& more = {}) const {
    Words all{GRAINCLOCK_PROGRAM, "study", study_, "--out", out_.string(), "--no-charts"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  Result grainclock(const Words& more = {}) const { return Program(dir_, words(more)).wait(); }

  tests::Scratch scratch_;
  std::filesystem::path dir_, out_ = dir_ / "out";
  std::string study_ = dir_ / "my.toml";
};

/// The head of a study of these files, up to its first [[method]].
inline const std::string kHead = R"(scene = "scene.toml"
start = "start.csv"
horizon = 0.02
repeat = 1
[reference]
step = 1e-6
)";

}  // namespace grainclock::benchmarks
