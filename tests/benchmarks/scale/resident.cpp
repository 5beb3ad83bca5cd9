#include "benchmarks/scale/resident.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace grainclock::scale {
namespace {

constexpr std::size_t kMiB = std::size_t{1} << 20;
// Pages in use by the test's own bookkeeping; the kernel also counts in batches of some hundred pages.
constexpr std::size_t kSlack = 4 * kMiB;

/// Uses this much memory for a moment; the compiler must not see that it is for nothing.
void touch(std::size_t bytes) {
  std::vector<char> touched(bytes, 1);
  const char* volatile seen = touched.data();
  touched.back() = *seen;
}

TEST(Resident, PeakKeepsWhatWasFreed) {
  forget_peak();
  const std::size_t before = resident_now();
  touch(64 * kMiB);
  EXPECT_GE(resident_peak() + kSlack, before + 64 * kMiB);
  EXPECT_LE(resident_now(), before + kSlack);
}

TEST(Resident, ForgottenPeakIsGone) {
  touch(64 * kMiB);
  forget_peak();
  EXPECT_LE(resident_peak(), resident_now() + kSlack);
}

}  // namespace
}  // namespace grainclock::scale
