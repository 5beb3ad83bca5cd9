#include "benchmarks/progress.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace grainclock::benchmarks {

Progress::Progress(double work) : whole_(work), begin_(std::chrono::steady_clock::now()) {}

void Progress::done(double work, const std::string& text) {
  done_ += work;
  const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  const double share = std::min(1.0, done_ / whole_);
  note(fmt::format("[{:3.0f} %, {} left] {}", 100.0 * share, duration_text(elapsed * (1.0 - share) / share), text));
}

void Progress::note(const std::string& text) const {
  fmt::print("{}\n", text);
  std::fflush(stdout);
}

std::string duration_text(double seconds) {
  const auto whole = static_cast<long>(std::lround(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{} min {} s", whole / 60, whole % 60);
  return fmt::format("{} h {} min", whole / 3600, whole / 60 % 60);
}

}  // namespace grainclock::benchmarks
