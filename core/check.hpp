// Errors with an exit code, and the one macro that raises them.
//
// Every error says where, which value, and what would be right; the program's
// main() turns the class into the exit code of the command line contract.
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace grainclock::core {

/// Exit codes of the program.
enum class ExitCode { done = 0, bad_input = 2, numerics_failed = 3, file_trouble = 4, stopped = 5 };

class Error : public std::runtime_error {
 public:
  /// Control characters that a message quotes from a file show as `?`: they could do anything to a terminal.
  Error(ExitCode code, std::string text) : std::runtime_error(without_controls(std::move(text))), code_(code) {}
  ExitCode code() const { return code_; }

 private:
  static std::string without_controls(std::string text) {
    for (char& letter : text)
      if (letter != '\n' && (static_cast<unsigned char>(letter) < 32 || letter == 127)) letter = '?';
    return text;
  }
  ExitCode code_;
};

/// Bad usage or bad content of a scene, study or state (exit code 2).
struct InputError : Error {
  explicit InputError(const std::string& text) : Error(ExitCode::bad_input, text) {}
};
/// Blow-up, overlap beyond a limit, lost ball (exit code 3).
class NumericsError : public Error {
 public:
  /// `balls`: ids of those it was seen at, the worst first, if any can be named.
  explicit NumericsError(const std::string& text, std::vector<std::int64_t> balls = {})
      : Error(ExitCode::numerics_failed, text), balls_(std::move(balls)) {}
  const std::vector<std::int64_t>& balls() const { return balls_; }

 private:
  std::vector<std::int64_t> balls_;
};
/// A missing, unreadable or unwritable file (exit code 4).
struct FileError : Error {
  explicit FileError(const std::string& text) : Error(ExitCode::file_trouble, text) {}
};
/// Stopped by a signal after a checkpoint (exit code 5).
struct Stopped : Error {
  explicit Stopped(const std::string& text) : Error(ExitCode::stopped, text) {}
};

/// What a message quotes of a file: its beginning, if it is long.
inline std::string excerpt(std::string_view text) {
  constexpr std::size_t kLongest = 80;
  return text.size() > kLongest ? std::string(text.substr(0, kLongest)) + "..." : std::string(text);
}

}  // namespace grainclock::core

/// Throws InputError with a formatted text (fmt syntax) unless `condition` holds.
#define GC_REQUIRE(condition, ...)                                       \
  do {                                                                   \
    if (!(condition)) throw ::grainclock::core::InputError(fmt::format(__VA_ARGS__)); \
  } while (false)
