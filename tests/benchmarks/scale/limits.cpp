#include "benchmarks/scale/limits.hpp"

#include <gtest/gtest.h>

namespace grainclock::scale {
namespace {

TEST(Limits, BytesAreThoseOfTheArrays) {
  const Counts counts = uniform_counts();
  // Row 64, opening force 32: read and written; inverse mass 8 and skin 32: read. A pair is two 32-bit numbers.
  EXPECT_EQ(counts.bytes_per_ball, 2 * (64 + 32) + 8 + 32);
  EXPECT_EQ(counts.bytes_per_pair, 8);
}

TEST(Limits, ProcessorMakesMoreThanOneOperationPerTenNanoseconds) {
  // Any processor of this century does: fails if the work is optimised away to nothing or counted wrong by orders.
  EXPECT_GT(operation_rate(1), 1e8);
  EXPECT_LT(operation_rate(1), 1e12);
}

}  // namespace
}  // namespace grainclock::scale
