// What every fuzz target shares: a file to read from, and which exceptions are answers rather than findings.
//
// A target's source defines fuzz(bytes); libFuzzer calls it through LLVMFuzzerTestOneInput, or replay.cpp does. A reader may
// refuse an input with a core::Error that carries a message; anything else that leaves it is a finding.
#pragma once

#include "core/check.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace grainclock::fuzz {

/// A directory of this process in memory (or /tmp), removed at exit.
class Place {
 public:
  Place() {
    const char* parent = std::filesystem::is_directory("/dev/shm") ? "/dev/shm" : "/tmp";
    path_ = fmt::format("{}/grainclock-fuzz-{}", parent, ::getpid());
    std::filesystem::create_directories(path_);
  }
  ~Place() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  /// Writes a file there and gives its path.
  std::string file(const std::string& name, std::string_view bytes) const {
    const std::string path = *this / name;
    std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    return path;
  }
  std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

inline const Place& place() {
  static const Place its;
  return its;
}

[[noreturn]] inline void found(const std::string& what) {
  std::fprintf(stderr, "finding: %s\n", what.c_str());
  std::abort();
}

inline void require(bool condition, const char* what) {
  if (!condition) found(what);
}

/// Calls read(); a refusal must say something, on lines that a terminal can show.
template <class Read>
void expect_answer(Read read) {
  try {
    read();
  } catch (const core::Error& error) {
    const std::string_view text = error.what();
    require(!text.empty() && text.size() < 20000, "a message without text, or without end");
    for (const char letter : text) require(letter == '\n' || static_cast<unsigned char>(letter) >= 32, "a control character in a message");
  }
}

/// The target: one input.
void fuzz(std::string_view bytes);

}  // namespace grainclock::fuzz

/// What libFuzzer and replay.cpp call.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  grainclock::fuzz::fuzz({reinterpret_cast<const char*>(data), size});
  return 0;
}
