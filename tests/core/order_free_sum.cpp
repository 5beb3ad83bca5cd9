// Sums over balls: the same in any order, exact where they can be, and told where they cannot.
#include "core/order_free_sum.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <vector>

namespace grainclock::core {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double sum_of(const std::vector<double>& values) {
  return order_free_sum(static_cast<std::uint32_t>(values.size()), [&](std::uint32_t k) { return values[k]; });
}

Vec3 sum_of(const std::vector<Vec3>& vectors) {
  return order_free_vector_sum(static_cast<std::uint32_t>(vectors.size()), [&](std::uint32_t k) { return vectors[k]; });
}

TEST(OrderFreeSum, IsTheSameInAnyOrder) {
  std::mt19937_64 random(1);
  std::lognormal_distribution<double> sizes(0.0, 5.0);
  std::vector<double> values(1000);
  for (double& value : values) value = sizes(random);
  std::vector<Vec3> vectors;
  for (const double value : values) vectors.emplace_back(value, -value, sizes(random));
  const double sum = sum_of(values);
  const Vec3 vector_sum = sum_of(vectors);
  EXPECT_NEAR(sum, std::accumulate(values.begin(), values.end(), 0.0), 1000 * 0x1p-38 * sum);  // half a unit each, and rounding
  for (int again = 0; again < 10; ++again) {
    std::shuffle(values.begin(), values.end(), random);
    std::shuffle(vectors.begin(), vectors.end(), random);
    EXPECT_EQ(sum_of(values), sum);
    EXPECT_EQ(sum_of(vectors), vector_sum);
  }
}

TEST(OrderFreeSum, IsZeroAtRest) {
  for (const std::size_t n : {1, 2, 3}) {
    EXPECT_EQ(sum_of(std::vector<double>(n, 0.0)), 0.0);
    EXPECT_EQ(sum_of(std::vector<Vec3>(n, Vec3::Zero())), Vec3(Vec3::Zero()));
  }
}

TEST(OrderFreeSum, IsNaNWhereAValueIsNotFinite) {
  for (const double bad : {kNaN, kInfinity}) {
    EXPECT_TRUE(std::isnan(sum_of(std::vector<double>{1.0, bad, 2.0})));
    EXPECT_TRUE(sum_of(std::vector<Vec3>{Vec3::Ones(), Vec3(1.0, -bad, 2.0)}).array().isNaN().all());
  }
}

}  // namespace
}  // namespace grainclock::core
