// Compiled once per instruction set (core/kernels.cmake), like core/kernels.cpp: nothing but built-in vector types and
// inlined functions.
#include "multirate/needs.hpp"

namespace grainclock::multirate {
namespace {

typedef double Real4 [[gnu::vector_size(32)]];
typedef double Real8 [[gnu::vector_size(64)]];
typedef std::int64_t Int4 [[gnu::vector_size(32)]];
typedef std::int64_t Int8 [[gnu::vector_size(64)]];
typedef float Single4 [[gnu::vector_size(16)]];
typedef float Single8 [[gnu::vector_size(32), gnu::aligned(4)]];
typedef std::int8_t Char8 [[gnu::vector_size(8), gnu::aligned(1)]];
typedef std::int64_t Eight [[gnu::may_alias]];  // bytes
template <class Real>
struct UnalignedOf;
template <>
struct UnalignedOf<double> { using Type = double; };
template <>
struct UnalignedOf<Real8> { typedef double Type [[gnu::vector_size(64), gnu::aligned(8)]]; };
template <class Real>
using Unaligned = typename UnalignedOf<Real>::Type;
constexpr std::size_t kBlock = 64;  // pairs
constexpr std::int64_t kSign = INT64_MIN;

/// What a block's pairs need of their balls, gathered one by one for the loop over all of them.
struct Gathered {
  double acceleration[kBlock];  // m/s2, towards each other
  double inverse_mass[kBlock];  // 1/kg, of both
  double room[kBlock];          // m, both margins
  double speed[kBlock];         // m/s, relative
};
struct Judged {
  double smooth4[kBlock], impact4[kBlock];  // 1/s4, of each pair
  double scale[kBlock];                     // of its normal matrix
  std::int8_t asks[kBlock];                 // 0 or -1
};

/// x, y, z and the speed.
Real4 wide(const core::PairDirection& d) { return __builtin_convertvector(*reinterpret_cast<const Single4*>(&d), Real4); }

template <bool kBoth>
void gather(const core::PairSpan& pairs, const core::PairRecords& book, const core::Path* paths, const double* margin,
            const Need* needs, std::uint32_t first_row, std::size_t first, std::size_t n, Gathered& out) {
  for (std::size_t q = 0; q < n; ++q) {
    const std::size_t p = first + q;
    if constexpr (kBoth) __builtin_prefetch(needs + (pairs.j[p] - first_row), 1);  // for add_block()
    // Accelerations are subtracted, inverse masses added.
    Real4 path = *reinterpret_cast<const Real4*>(paths + pairs.i[p]);
    out.room[q] = margin[pairs.i[p]];
    if constexpr (kBoth) {
      path -= (Real4)(*reinterpret_cast<const Int4*>(paths + pairs.j[p]) ^ Int4{0, 0, 0, kSign});
      out.room[q] += margin[pairs.j[p]];
    }
    const Real4 direction = wide(book.direction[p]), along = path * direction;
    out.speed[q] = direction[3];
    out.acceleration[q] = along[0] + along[1] + along[2];
    out.inverse_mass[q] = path[3];
  }
}

// One number, or a vector of eight: the same operations.
template <class Real>
[[gnu::always_inline]] inline Real load(const double* from) { return *reinterpret_cast<const Unaligned<Real>*>(from); }
template <class Real>
[[gnu::always_inline]] inline void store(double* to, Real value) { *reinterpret_cast<Unaligned<Real>*>(to) = value; }
template <class Real>
[[gnu::always_inline]] inline Real load(const float* from) {
  if constexpr (sizeof(Real) == sizeof(double)) return *from;
  else return __builtin_convertvector(*reinterpret_cast<const Single8*>(from), Real8);
}
[[gnu::always_inline]] inline void store(std::int8_t* to, bool value) { *to = value ? -1 : 0; }
[[gnu::always_inline]] inline void store(std::int8_t* to, Int8 mask) { *reinterpret_cast<Char8*>(to) = __builtin_convertvector(mask, Char8); }

/// A fixed ball's contact is stiff, and others can push the ball into it before the next renewal: unless it is skipped
/// it counts for stability, near or not.
template <class Real, bool kBoth>
[[gnu::always_inline]] inline void judge(const core::PairRecords& book, const NeedParameters& w, std::size_t p, std::size_t q, const Gathered& in,
                     Level* level, Judged& out) {
  const Real overlap = load<Real>(book.overlap + p), rate = load<Real>(book.rate + p);
  const Real inverse_mass = load<Real>(in.inverse_mass + q);
  const Real gap = -overlap - w.reach;
  const auto is_skipped = cannot_touch(gap, load<Real>(in.speed + q), w.interval, load<Real>(in.room + q));
  const auto is_far = is_out_of_reach(gap, rate, w.interval, w.soon);
  const PairMotion<Real> motion =
      motion_of(overlap, rate, load<Real>(in.acceleration + q), w.k * inverse_mass, w.speed2);
  store(reinterpret_cast<std::int8_t*>(level + p), is_skipped);
  const Real urgency4 = is_far ? Real{} : motion.urgency4;
  if constexpr (kBoth) store(out.asks + q, !is_skipped && !is_far);
  else store(out.asks + q, !is_skipped);
  store<Real>(out.smooth4 + q, motion.is_impact ? Real{} : urgency4);
  store<Real>(out.impact4 + q, motion.is_impact ? urgency4 : Real{});
  store<Real>(out.scale + q, inverse_mass * w.per_unit);
}

/// The entries of NormalMatrix::of() and the urgencies.
Real8 ask_of(const core::PairDirection& direction, double scale, double smooth4, double impact4) {
  const Real4 n = wide(direction), scaled = scale * n;
  const Real8 products = __builtin_shufflevector(scaled, scaled, 0, 1, 2, 0, 0, 1, 3, 3) *
                         __builtin_shufflevector(n, n, 0, 1, 2, 1, 2, 2, 3, 3);
  const Real8 whole = (products + kWholeNumber) - kWholeNumber;
  const Real8 urgencies = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, smooth4, impact4};
  return Int8{0, 0, 0, 0, 0, 0, -1, -1} != 0 ? urgencies : whole;
}

void add(Need& to, Real8 ask) {
  Real8& need = *reinterpret_cast<Real8*>(&to);
  const Real8 larger = need > ask ? need : ask;
  need = Int8{0, 0, 0, 0, 0, 0, -1, -1} != 0 ? larger : need + ask;
}

template <bool kBoth>
void add_block(const core::PairSpan& pairs, const core::PairRecords& book, std::size_t first, std::size_t n,
               const Judged& judged, Need* needs, std::uint32_t first_row) {
  // Those that ask in a row of their own: which do follows no pattern.
  std::size_t asking[kBlock], count = 0;
  for (std::size_t q = 0; q < n; ++q) {
    asking[count] = q;
    count += judged.asks[q] & 1;
  }
  for (std::size_t c = 0; c < count; ++c) {
    const std::size_t q = asking[c], p = first + q;
    const Real8 ask = ask_of(book.direction[p], judged.scale[q], judged.smooth4[q], judged.impact4[q]);
    add(needs[pairs.i[p] - first_row], ask);
    if constexpr (kBoth) add(needs[pairs.j[p] - first_row], ask);
  }
}

template <bool kBoth>
void add_needs_of(const core::PairSpan& pairs, const core::PairRecords& book, const core::Path* paths,
                  const double* margin, const NeedParameters& with, Level* level, Need* needs, std::uint32_t first_row,
                  std::size_t begin, std::size_t end) {
  Gathered gathered;
  Judged judged;
  for (std::size_t first = begin; first < end; first += kBlock) {
    const std::size_t n = end - first < kBlock ? end - first : kBlock;
    gather<kBoth>(pairs, book, paths, margin, needs, first_row, first, n, gathered);
    std::size_t q = 0;
    for (; q + 8 <= n; q += 8) judge<Real8, kBoth>(book, with, first + q, q, gathered, level, judged);
    for (; q < n; ++q) judge<double, kBoth>(book, with, first + q, q, gathered, level, judged);
    add_block<kBoth>(pairs, book, first, n, judged, needs, first_row);
  }
}

void add_needs(core::PairSpan pairs, const core::PairRecords& book, const core::Path* paths, const double* margin,
               const NeedParameters& with, Level* level, Need* needs, std::uint32_t first_row, std::size_t begin,
               std::size_t end) {
  if (with.both) add_needs_of<true>(pairs, book, paths, margin, with, level, needs, first_row, begin, end);
  else add_needs_of<false>(pairs, book, paths, margin, with, level, needs, first_row, begin, end);
}

/// Needs of as many balls as Real has lanes.
template <class Real>
struct NeedsOf {
  Real matrix[6] = {}, smooth4 = {}, impact4 = {};
};

[[gnu::always_inline]] inline NeedsOf<double> numbers(const Need* needs, double) {
  NeedsOf<double> out;
  for (int k = 0; k < 6; ++k) out.matrix[k] = needs->matrix[k];
  out.smooth4 = needs->smooth4;
  out.impact4 = needs->impact4;
  return out;
}
[[gnu::always_inline]] inline bool is_any(bool value) { return value; }
[[gnu::always_inline]] inline bool is_any(Int8 mask) {
  const Char8 bytes = __builtin_convertvector(mask, Char8);
  return *reinterpret_cast<const Eight*>(&bytes) != 0;
}
#if defined(__AVX512F__)
/// Eight balls' needs, transposed.
[[gnu::always_inline]] inline NeedsOf<Real8> numbers(const Need* needs, Real8) {
  const Real8* d = reinterpret_cast<const Real8*>(needs);
  Real8 e[8], f[8];
#pragma GCC unroll 4
  for (int k = 0; k < 8; k += 2) {
    e[k] = __builtin_shufflevector(d[k], d[k + 1], 0, 8, 2, 10, 4, 12, 6, 14);
    e[k + 1] = __builtin_shufflevector(d[k], d[k + 1], 1, 9, 3, 11, 5, 13, 7, 15);
  }
#pragma GCC unroll 4
  for (int k = 0; k < 4; ++k) {
    const int from = 4 * (k / 2) + k % 2;  // of columns k % 2 and k % 2 + 2
    f[2 * k] = __builtin_shufflevector(e[from], e[from + 2], 0, 1, 8, 9, 4, 5, 12, 13);
    f[2 * k + 1] = __builtin_shufflevector(e[from], e[from + 2], 2, 3, 10, 11, 6, 7, 14, 15);
  }
  Real8 column[8];
#pragma GCC unroll 4
  for (int k = 0; k < 4; ++k) {
    const int at = k / 2 + 2 * (k % 2);
    column[at] = __builtin_shufflevector(f[k], f[k + 4], 0, 1, 2, 3, 8, 9, 10, 11);
    column[at + 4] = __builtin_shufflevector(f[k], f[k + 4], 4, 5, 6, 7, 12, 13, 14, 15);
  }
  return {{column[0], column[1], column[2], column[3], column[4], column[5]}, column[6], column[7]};
}
#endif

/// Adds up matrices, keeps the larger urgencies.
template <class Real>
[[gnu::always_inline]] inline void take(Need* needs, Real (&matrix)[6], Real& smooth4, Real& impact4) {
  const NeedsOf<Real> its = numbers(needs, Real{});
  for (int k = 0; k < 6; ++k) matrix[k] += its.matrix[k];
  smooth4 = smooth4 < its.smooth4 ? its.smooth4 : smooth4;
  impact4 = impact4 < its.impact4 ? its.impact4 : impact4;
  for (std::size_t k = 0; k < sizeof(Real) / 8; ++k) reinterpret_cast<Real8*>(needs)[k] = Real8{};
}

[[gnu::always_inline]] inline void store_levels(Level* to, std::int64_t level) { *to = static_cast<Level>(level); }
[[gnu::always_inline]] inline void store_levels(Level* to, Int8 level) { *reinterpret_cast<Char8*>(to) = __builtin_convertvector(level, Char8); }

template <class Real, class Int>
[[gnu::always_inline]] inline void take_some(Need* const* ball, int parts, Need* fixed, std::size_t row, const StepWeights* weights,
                                             Level coarsest, double* smooth4, double* impact4, Level* level) {
  Real of_ball[6] = {}, of_fixed[6] = {}, smooth = {}, impact = {};
  for (int t = 0; t < parts; ++t) take(ball[t] + row, of_ball, smooth, impact);
  if (fixed != nullptr) take(fixed + row, of_fixed, smooth, impact);
  store<Real>(smooth4 + row, smooth);
  store<Real>(impact4 + row, eased_impact4(impact, smooth));
  Int its = Int{} + std::int64_t{coarsest};
  auto is_unstable = Real{} <= Real{};  // at all levels so far
  for (int l = coarsest; l > 0; --l) {
    is_unstable &= is_stable(of_ball, of_fixed, weights[l]) == 0;
    if (!is_any(is_unstable)) break;
    its -= is_unstable ? Int{} + 1 : Int{};
  }
  store_levels(level + row, its);
}

void take_needs(Need* const* ball, int parts, Need* fixed, std::size_t n, const StepWeights* weights, Level coarsest,
                double* smooth4, double* impact4, Level* level) {
  std::size_t row = 0;
#if defined(__AVX512F__)
  for (; row + 8 <= n; row += 8)
    take_some<Real8, Int8>(ball, parts, fixed, row, weights, coarsest, smooth4, impact4, level);
#endif
  for (; row < n; ++row)
    take_some<double, std::int64_t>(ball, parts, fixed, row, weights, coarsest, smooth4, impact4, level);
}

#define GC_PASTE_(a, b) a##b
#define GC_PASTE(a, b) GC_PASTE_(a, b)

}  // namespace

extern const NeedKernels GC_PASTE(need_kernels_, GRAINCLOCK_KERNEL_SET);
const NeedKernels GC_PASTE(need_kernels_, GRAINCLOCK_KERNEL_SET) = {add_needs, take_needs};

}  // namespace grainclock::multirate
