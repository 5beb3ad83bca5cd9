#include "benchmarks/scale/limits.hpp"

#include "core/kernels.hpp"

#include <algorithm>
#include <chrono>
#include <string_view>

namespace grainclock::scale {

// Counted in core/kernels.cpp, with comparisons, conversions and masks as operations.
//   pair: difference of two rows 8; distance squared and product with the velocity 10; root, division, normal, overlap, rate, law 13;
//         integer force 6; magnitude, power, turnover and their sums 14; limits 5; added to two balls 6
//   ball: velocity closed 13, acceleration 10, path 18, skin 9, domain 7
// Arrays of core/rows.hpp and core/uniform.cpp: rows and opening forces read and written; inverse masses, skins and the
// pair list read. Force sums are kept for the rows in work only, and stay in the cache.
Counts uniform_counts() {
  Counts counts;
  counts.operations_per_pair = 8 + 10 + 13 + 6 + 14 + 5 + 6;
  counts.operations_per_ball = 13 + 10 + 18 + 9 + 7;
  counts.bytes_per_pair = 2 * sizeof(std::uint32_t);
  counts.bytes_per_ball = 2 * (sizeof(core::BallRow) + sizeof(core::IntVec)) + sizeof(double) + sizeof(core::SkinReference);
  return counts;
}

namespace {

constexpr int kVectors = 10;            // independent chains: more than the latency of an addition asks for
constexpr std::int64_t kRounds = 10000000;

struct Two {
  typedef double Vector [[gnu::vector_size(16)]];
};
struct Four {
  typedef double Vector [[gnu::vector_size(32)]];
};
struct Eight {
  typedef double Vector [[gnu::vector_size(64)]];
};

volatile double one = 1.0;  // read at run time, so that nothing is worked out beforehand

/// Each round multiplies and adds once per vector. Values stay near 1.
template <class Lanes>
[[gnu::always_inline]] inline double multiply_and_add(std::int64_t rounds) {
  using Vector = typename Lanes::Vector;
  Vector x[kVectors];
  for (int v = 0; v < kVectors; ++v) x[v] = Vector{} + (one + 0.01 * v);
  for (std::int64_t r = 0; r < rounds; ++r) {
#pragma GCC unroll 10
    for (int v = 0; v < kVectors; ++v) x[v] = x[v] * 0.5 + 0.5;
  }
  Vector sum = {};
  for (int v = 0; v < kVectors; ++v) sum += x[v];
  return sum[0];
}

struct Probe {
  int width;
  double (*work)(std::int64_t rounds);
};
double work_2(std::int64_t rounds) { return multiply_and_add<Two>(rounds); }
#if defined(__x86_64__)
[[gnu::target("avx2")]] double work_4(std::int64_t rounds) { return multiply_and_add<Four>(rounds); }
[[gnu::target("avx512f")]] double work_8(std::int64_t rounds) { return multiply_and_add<Eight>(rounds); }
#endif

/// As wide as the sweeps chosen for this processor.
Probe probe() {
#if defined(__x86_64__)
  const std::string_view set = core::kernels().name;
  if (set == "avx512") return {8, work_8};
  if (set == "avx2") return {4, work_4};
#endif
  return {2, work_2};
}

}  // namespace

double operation_rate(int threads) {
  constexpr int kTries = 5;
  const Probe here = probe();
  double best = 0.0;
  volatile double sink = 0.0;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    double sum = 0.0;
    const auto begin = std::chrono::steady_clock::now();
#pragma omp parallel for num_threads(threads) schedule(static, 1) reduction(+ : sum) if (threads > 1)
    for (int t = 0; t < threads; ++t) sum += here.work(kRounds);
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
    sink = sink + sum;
    best = std::max(best, static_cast<double>(kRounds) * threads / elapsed.count());
  }
  return best * 2 * kVectors * here.width;
}

}  // namespace grainclock::scale
