#include "silo/progress.hpp"

#include <unistd.h>

namespace grainclock::silo {
namespace {

std::string clock_text(double seconds) {
  if (seconds < 90.0) return fmt::format("{:.0f} s", seconds);
  if (seconds < 5400.0) return fmt::format("{:.0f} min", seconds / 60.0);
  return fmt::format("{:.1f} h", seconds / 3600.0);
}

}  // namespace

Progress::Progress(std::string phase, double duration, double done)
    : phase_(std::move(phase)), duration_(duration), first_(done), is_terminal_(::isatty(STDOUT_FILENO) == 1) {}

Progress::~Progress() { end_line(); }

void Progress::end_line() {
  if (line_open_) say("\n");
  line_open_ = false;
  std::fflush(stdout);
}

void Progress::note(double done, std::int64_t discharged) {
  const auto now = Clock::now();
  const std::chrono::duration<double> between(is_terminal_ ? 0.5 : 10.0);
  if (now - last_ < between) return;
  last_ = now;
  const double rate = (done - first_) / std::chrono::duration<double>(now - begin_).count();  // simulated s per s
  const std::string left = rate > 0.0 ? clock_text((duration_ - done) / rate) : "?";
  say("{}{}: {:.4f} of {:g} s, {:.3g} s/s, {} left{}{}", is_terminal_ ? "\r" : "", phase_, done, duration_, rate, left,
      discharged > 0 ? fmt::format(", {} balls out", discharged) : "", is_terminal_ ? "\033[K" : "\n");
  line_open_ = is_terminal_;
  std::fflush(stdout);
}

}  // namespace grainclock::silo
