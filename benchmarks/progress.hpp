// Lines that say what was done, how much is left and how long that should take.
#pragma once

#include <chrono>
#include <string>

namespace grainclock::benchmarks {

/// Plain lines on standard output, one per finished piece of work, flushed at once.
class Progress {
 public:
  /// `work`: the whole, in the unit of done().
  explicit Progress(double work);
  /// Notes a finished piece and prints it with the share done, the elapsed and the remaining time.
  void done(double work, const std::string& text);
  void note(const std::string& text) const;

 private:
  double whole_;
  double done_ = 0.0;
  std::chrono::steady_clock::time_point begin_;
};

/// "45 s", "3 min 20 s", "2 h 5 min".
std::string duration_text(double seconds);

}  // namespace grainclock::benchmarks
