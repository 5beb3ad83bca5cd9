#include "benchmarks/scale/resident.hpp"

#include "core/check.hpp"

#include <malloc.h>

#include <fstream>
#include <string>

namespace grainclock::scale {

namespace {

/// Bytes that a line such as "VmRSS:   1234 kB" of the process's status gives.
std::size_t status_line(const std::string& wanted) {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with(wanted + ":")) return std::stoull(line.substr(wanted.size() + 1)) * 1024;
  }
  throw core::FileError(fmt::format("/proc/self/status has no line {}: memory is measured on Linux only", wanted));
}

}  // namespace

std::size_t resident_now() { return status_line("VmRSS"); }
std::size_t resident_peak() { return status_line("VmHWM"); }

void forget_peak() {
  malloc_trim(0);
  std::ofstream refs("/proc/self/clear_refs");
  refs << "5";  // "reset the peak resident set size", proc(5)
  refs.flush();
  if (!refs) throw core::FileError("/proc/self/clear_refs cannot be written: the peak of the memory cannot be measured here");
}

}  // namespace grainclock::scale
