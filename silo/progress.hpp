// How far a phase has come: one line rewritten on a terminal, plain lines now and then in a pipe.
#pragma once

#include <fmt/format.h>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <string>
#include <utility>

namespace grainclock::silo {

/// Prints to standard output. A run is worth more than its log: main() tells at the end if that could not be written.
template <class... T>
void say(fmt::format_string<T...> text, T&&... values) {
  const std::string line = fmt::format(text, std::forward<T>(values)...);
  std::fwrite(line.data(), 1, line.size(), stdout);
}

class Progress {
 public:
  /// `duration` of the phase [s]; `done` of it already, when a run is resumed.
  Progress(std::string phase, double duration, double done);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// Notes the simulated seconds done and the balls that have left; prints if it is time to.
  void note(double done, std::int64_t discharged);
  /// Ends the line on a terminal, so that other text can follow.
  void end_line();

 private:
  using Clock = std::chrono::steady_clock;
  std::string phase_;
  double duration_, first_;
  bool is_terminal_;
  bool line_open_ = false;
  Clock::time_point begin_ = Clock::now(), last_ = begin_;
};

}  // namespace grainclock::silo
