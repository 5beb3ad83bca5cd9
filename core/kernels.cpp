// Compiled once per instruction set (kernels.cmake). Uses nothing but built-in
// vector types and inlined functions, so that no code for a newer processor
// leaks into the rest of the program.
#include "core/kernels.hpp"

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace grainclock::core {
namespace {

#if defined(__AVX512F__)
constexpr int kWidth = 8;
#elif defined(__AVX__)
constexpr int kWidth = 4;
#else
constexpr int kWidth = 2;
#endif
typedef double Real [[gnu::vector_size(8 * kWidth)]];
typedef std::int64_t Int [[gnu::vector_size(8 * kWidth)]];
typedef double RealOut [[gnu::vector_size(8 * kWidth), gnu::aligned(8)]];  // where arrays are only element-aligned
typedef std::uint8_t Bytes [[gnu::vector_size(kWidth), gnu::aligned(1)]];
typedef float Single [[gnu::vector_size(4 * kWidth)]];
typedef float SingleOut [[gnu::vector_size(4 * kWidth), gnu::aligned(4)]];
typedef double Real4 [[gnu::vector_size(32)]];
typedef std::int64_t Int4 [[gnu::vector_size(32)]];

#define GC_INLINE [[gnu::always_inline]] inline
#define GC_INLINE_LAMBDA __attribute__((always_inline))

#if defined(__clang__)  // builds only the fuzzers, which need not be fast
template <class Vector, class Mask>
GC_INLINE Vector shuffled(Vector a, Vector b, Mask mask) {
  constexpr auto kLanes = static_cast<std::int64_t>(sizeof(Vector) / 8);
  Vector out{};
  for (std::int64_t k = 0; k < kLanes; ++k) out[k] = mask[k] < kLanes ? a[mask[k]] : b[mask[k] - kLanes];
  return out;
}
#define __builtin_shuffle shuffled  // NOLINT(bugprone-reserved-identifier): what g++ has
#endif

GC_INLINE Real splat(double value) { return Real{} + value; }

GC_INLINE Real square_root(Real x) {
#if defined(__AVX512F__) && defined(__clang__)
  return (Real)_mm512_sqrt_pd((__m512d)x);
#elif defined(__AVX512F__)
  return __builtin_ia32_sqrtpd512_mask(x, x, static_cast<unsigned char>(-1), _MM_FROUND_CUR_DIRECTION);
#elif defined(__AVX__)
  return (Real)_mm256_sqrt_pd((__m256d)x);
#elif defined(__SSE2__)
  return (Real)_mm_sqrt_pd((__m128d)x);
#else
  Real root;
  for (int k = 0; k < kWidth; ++k) root[k] = __builtin_sqrt(x[k]);
  return root;
#endif
}

GC_INLINE Real magnitude(Real x) { return (Real)((Int)x & (Int{} + std::int64_t{0x7fffffffffffffff})); }
GC_INLINE Real4 magnitude4(Real4 x) { return (Real4)((Int4)x & (Int4{} + std::int64_t{0x7fffffffffffffff})); }
GC_INLINE double three_sum(Real4 x) { return x[0] + x[1] + x[2]; }
GC_INLINE Real smaller(Real a, Real b) { return a < b ? a : b; }
GC_INLINE Real larger(Real a, Real b) { return a > b ? a : b; }

/// One bit per lane that is set.
GC_INLINE unsigned lane_bits(Int mask) {
#if defined(__AVX512DQ__)
  return _mm512_movepi64_mask((__m512i)mask);
#elif defined(__AVX__)
  return static_cast<unsigned>(_mm256_movemask_pd((__m256d)mask));
#elif defined(__SSE2__)
  return static_cast<unsigned>(_mm_movemask_pd((__m128d)mask));
#else
  unsigned bits = 0;
  for (int k = 0; k < kWidth; ++k) bits |= (mask[k] != 0 ? 1U : 0U) << k;
  return bits;
#endif
}

GC_INLINE std::int64_t lane_sum(Int x) {
  std::int64_t sum = 0;
  for (int k = 0; k < kWidth; ++k) sum += x[k];
  return sum;
}

/// Relative rows of kWidth pairs, transposed: one vector per component.
struct Relative {
  Real x, y, z;     // x_i - x_j
  Real radii;       // r_i + r_j
  Real vx, vy, vz;  // v_i - v_j
  Real a;           // a_i + a_j
};

GC_INLINE Relative relative(const BallRow* rows, const std::uint32_t* i, const std::uint32_t* j) {
  Relative out;
#if defined(__AVX512F__)
  // r and a are added, the rest is subtracted: a product with 1 or -1 is exact, so fusing it changes no bit.
  const Real sign = {-1.0, -1.0, -1.0, 1.0, -1.0, -1.0, -1.0, 1.0};
  Real d[8];
#pragma GCC unroll 8
  for (int k = 0; k < 8; ++k) {
    d[k] = (Real)_mm512_fmadd_pd((__m512d)*reinterpret_cast<const Real*>(rows + j[k]), (__m512d)sign,
                                 (__m512d)*reinterpret_cast<const Real*>(rows + i[k]));
  }
  Real e[8];
#pragma GCC unroll 4
  for (int k = 0; k < 8; k += 2) {
    e[k] = __builtin_shuffle(d[k], d[k + 1], Int{0, 8, 2, 10, 4, 12, 6, 14});
    e[k + 1] = __builtin_shuffle(d[k], d[k + 1], Int{1, 9, 3, 11, 5, 13, 7, 15});
  }
  const Int low = {0, 1, 8, 9, 4, 5, 12, 13}, high = {2, 3, 10, 11, 6, 7, 14, 15};
  const Real x04 = __builtin_shuffle(e[0], e[2], low), x26 = __builtin_shuffle(e[0], e[2], high);
  const Real y04 = __builtin_shuffle(e[1], e[3], low), y26 = __builtin_shuffle(e[1], e[3], high);
  const Real z04 = __builtin_shuffle(e[4], e[6], low), z26 = __builtin_shuffle(e[4], e[6], high);
  const Real w04 = __builtin_shuffle(e[5], e[7], low), w26 = __builtin_shuffle(e[5], e[7], high);
  const Int first = {0, 1, 2, 3, 8, 9, 10, 11}, second = {4, 5, 6, 7, 12, 13, 14, 15};
  out.x = __builtin_shuffle(x04, z04, first);
  out.vx = __builtin_shuffle(x04, z04, second);
  out.y = __builtin_shuffle(y04, w04, first);
  out.vy = __builtin_shuffle(y04, w04, second);
  out.z = __builtin_shuffle(x26, z26, first);
  out.vz = __builtin_shuffle(x26, z26, second);
  out.radii = __builtin_shuffle(y26, w26, first);
  out.a = __builtin_shuffle(y26, w26, second);
#elif defined(__AVX__)
  constexpr std::int64_t kSign = INT64_MIN;
  const Int flip = {0, 0, 0, kSign};
#pragma GCC unroll 2
  for (int half = 0; half < 2; ++half) {
    Real d[4];
#pragma GCC unroll 4
    for (int k = 0; k < 4; ++k) {
      d[k] = reinterpret_cast<const Real*>(rows + i[k])[half] -
             (Real)(reinterpret_cast<const Int*>(rows + j[k])[half] ^ flip);
    }
    const Int even = {0, 4, 2, 6}, odd = {1, 5, 3, 7}, low = {0, 1, 4, 5}, high = {2, 3, 6, 7};
    const Real e0 = __builtin_shuffle(d[0], d[1], even), e1 = __builtin_shuffle(d[0], d[1], odd);
    const Real e2 = __builtin_shuffle(d[2], d[3], even), e3 = __builtin_shuffle(d[2], d[3], odd);
    (half == 0 ? out.x : out.vx) = __builtin_shuffle(e0, e2, low);
    (half == 0 ? out.y : out.vy) = __builtin_shuffle(e1, e3, low);
    (half == 0 ? out.z : out.vz) = __builtin_shuffle(e0, e2, high);
    (half == 0 ? out.radii : out.a) = __builtin_shuffle(e1, e3, high);
  }
#else
  const Int low = {0, 2}, high = {1, 3};
  const auto components = [&](int quarter, Real& first, Real& second) GC_INLINE_LAMBDA {
    const Real i0 = reinterpret_cast<const Real*>(rows + i[0])[quarter], i1 = reinterpret_cast<const Real*>(rows + i[1])[quarter];
    const Real j0 = reinterpret_cast<const Real*>(rows + j[0])[quarter], j1 = reinterpret_cast<const Real*>(rows + j[1])[quarter];
    first = __builtin_shuffle(i0, i1, low) - __builtin_shuffle(j0, j1, low);
    const Real of_i = __builtin_shuffle(i0, i1, high), of_j = __builtin_shuffle(j0, j1, high);
    second = quarter % 2 == 0 ? of_i - of_j : of_i + of_j;
  };
  components(0, out.x, out.y);
  components(1, out.z, out.radii);
  components(2, out.vx, out.vy);
  components(3, out.vz, out.a);
#endif
  return out;
}

/// Writes kWidth rows (x, y, z, 0). Slot s belongs to pair kSlotPair[s] of the group, and pair s to slot kSlotPair[s].
#if defined(__AVX512F__)
constexpr int kSlotPair[8] = {0, 4, 2, 6, 1, 5, 3, 7};
#elif defined(__AVX__)
constexpr int kSlotPair[4] = {0, 2, 1, 3};
#else
constexpr int kSlotPair[2] = {0, 1};
#endif
GC_INLINE void store_rows(Int x, Int y, Int z, IntVec* out) {
  const Int zero = {};
  Int* rows = reinterpret_cast<Int*>(out);
#if defined(__AVX512F__)
  const Int even = {0, 8, 2, 10, 4, 12, 6, 14}, odd = {1, 9, 3, 11, 5, 13, 7, 15};
  const Int a0 = __builtin_shuffle(x, y, even), a1 = __builtin_shuffle(x, y, odd);
  const Int b0 = __builtin_shuffle(z, zero, even), b1 = __builtin_shuffle(z, zero, odd);
  const Int low = {0, 1, 8, 9, 4, 5, 12, 13}, high = {2, 3, 10, 11, 6, 7, 14, 15};
  rows[0] = __builtin_shuffle(a0, b0, low);
  rows[1] = __builtin_shuffle(a0, b0, high);
  rows[2] = __builtin_shuffle(a1, b1, low);
  rows[3] = __builtin_shuffle(a1, b1, high);
#elif defined(__AVX__)
  const Int even = {0, 4, 2, 6}, odd = {1, 5, 3, 7}, low = {0, 1, 4, 5}, high = {2, 3, 6, 7};
  const Int a0 = __builtin_shuffle(x, y, even), a1 = __builtin_shuffle(x, y, odd);
  const Int b0 = __builtin_shuffle(z, zero, even), b1 = __builtin_shuffle(z, zero, odd);
  rows[0] = __builtin_shuffle(a0, b0, low);
  rows[1] = __builtin_shuffle(a0, b0, high);
  rows[2] = __builtin_shuffle(a1, b1, low);
  rows[3] = __builtin_shuffle(a1, b1, high);
#else
  const Int low = {0, 2}, high = {1, 3};
  rows[0] = __builtin_shuffle(x, y, low);
  rows[1] = __builtin_shuffle(z, zero, low);
  rows[2] = __builtin_shuffle(x, y, high);
  rows[3] = __builtin_shuffle(z, zero, high);
#endif
}

/// Writes the vectors of a group as one row per pair.
GC_INLINE void store_directions(Single x, Single y, Single z, Single speed, PairDirection* out) {
#if defined(__AVX512F__)
  const Single xy0 = __builtin_shufflevector(x, y, 0, 8, 1, 9, 4, 12, 5, 13);
  const Single xy2 = __builtin_shufflevector(x, y, 2, 10, 3, 11, 6, 14, 7, 15);
  const Single zs0 = __builtin_shufflevector(z, speed, 0, 8, 1, 9, 4, 12, 5, 13);
  const Single zs2 = __builtin_shufflevector(z, speed, 2, 10, 3, 11, 6, 14, 7, 15);
  const Single row04 = __builtin_shufflevector(xy0, zs0, 0, 1, 8, 9, 4, 5, 12, 13);
  const Single row15 = __builtin_shufflevector(xy0, zs0, 2, 3, 10, 11, 6, 7, 14, 15);
  const Single row26 = __builtin_shufflevector(xy2, zs2, 0, 1, 8, 9, 4, 5, 12, 13);
  const Single row37 = __builtin_shufflevector(xy2, zs2, 2, 3, 10, 11, 6, 7, 14, 15);
  SingleOut* rows = reinterpret_cast<SingleOut*>(out);
  rows[0] = __builtin_shufflevector(row04, row15, 0, 1, 2, 3, 8, 9, 10, 11);
  rows[1] = __builtin_shufflevector(row26, row37, 0, 1, 2, 3, 8, 9, 10, 11);
  rows[2] = __builtin_shufflevector(row04, row15, 4, 5, 6, 7, 12, 13, 14, 15);
  rows[3] = __builtin_shufflevector(row26, row37, 4, 5, 6, 7, 12, 13, 14, 15);
#else
  for (int k = 0; k < kWidth; ++k) out[k] = {x[k], y[k], z[k], speed[k]};
#endif
}

/// Lane sums of a sweep, kept as vectors until its end.
struct LaneTotals {
  Int fx = {}, fy = {}, fz = {}, magnitude = {}, power = {}, turned = {};
  unsigned bad = 0;  // one bit per lane
  GC_INLINE void add_to(SweepTotals& totals) const {
    totals.force[0] += lane_sum(fx);
    totals.force[1] += lane_sum(fy);
    totals.force[2] += lane_sum(fz);
    totals.magnitude += lane_sum(magnitude);
    totals.power += lane_sum(power);
    totals.turned += lane_sum(turned);
    totals.overloaded = totals.overloaded || bad != 0;
  }
};

/// What the law says of kWidth pairs.
struct Evaluated {
  Real overlap, rate, nx, ny, nz, speed;
  Int fx, fy, fz, magnitude, power, turned;
  unsigned candidates;
};

/// What is left of two rows when they have been gathered.
struct Gathered {
  Real x, y, z, radii;   // m
  Real square;           // m2, distance squared
  Real product;          // m2/s, relative position times velocity
  Real length, inverse;  // m, 1/m, of the distance; by take_root()
  Real a, v2;            // m/s2, m2/s2; only for event candidates
};

template <bool kEvents>
GC_INLINE Gathered gather(const BallRow* rows, const std::uint32_t* i, const std::uint32_t* j) {
  const Relative d = relative(rows, i, j);
  Gathered out;
  out.x = d.x;
  out.y = d.y;
  out.z = d.z;
  out.radii = d.radii;
  out.square = d.x * d.x + d.y * d.y + d.z * d.z;
  out.product = d.x * d.vx + d.y * d.vy + d.z * d.vz;
  if constexpr (kEvents) {
    out.a = d.a;
    out.v2 = d.vx * d.vx + d.vy * d.vy + d.vz * d.vz;
  }
  return out;
}

/// Apart from gather() and evaluate(): root and quotient take longest, and other groups go on meanwhile.
GC_INLINE void take_root(Gathered& d) {
  d.length = square_root(d.square);
  d.inverse = splat(1.0) / d.length;
}

template <class T, bool kEvents>
GC_INLINE Evaluated evaluate(const Gathered& d, const SweepLaw& law, LaneTotals& totals) {
  const Real zero = {};
  const Real inverse = d.inverse;
  Evaluated out;
  out.nx = d.x * inverse;
  out.ny = d.y * inverse;
  out.nz = d.z * inverse;
  out.overlap = d.radii - d.length;
  out.rate = -d.product * inverse;
  // The law in force units: these are powers of two, so it says the same to the bit.
  const double k = law.law.k * law.per_unit, c = law.law.c * law.per_unit, per_total = law.per_total / law.per_unit;
  const Real force = contact_force<T>(out.overlap, out.rate, k, c, law.law.reach);
  out.fx = __builtin_convertvector(force * out.nx, Int);
  out.fy = __builtin_convertvector(force * out.ny, Int);
  out.fz = __builtin_convertvector(force * out.nz, Int);
  if (!law.both) {
    totals.fx += out.fx;
    totals.fy += out.fy;
    totals.fz += out.fz;
  }
  const Real size = T::tension || T::cohesion ? magnitude(force) : force;
  const Real spring = out.overlap > zero ? k * out.overlap : zero;
  const Real speed = out.rate * per_total;
  out.magnitude = __builtin_convertvector(size * per_total, Int);
  out.power = __builtin_convertvector((force - spring) * speed, Int);
  out.turned = __builtin_convertvector(magnitude(force * speed), Int);
  totals.magnitude += out.magnitude;
  totals.power += out.power;
  totals.turned += out.turned;
  // Written so that a NaN counts as overloaded.
  totals.bad |= lane_bits(~((size <= splat(law.force_limit * law.per_unit)) & (4.0 * out.overlap <= d.radii)));

  out.candidates = 0;
  if constexpr (kEvents) {
    // Could the pair have changed branch within the step that ends here? Seen backwards from the
    // end, overlap and rate differ from straight lines by at most the relative acceleration:
    // |d2 overlap / dt2| <= a_i + a_j + v2 / length.
    const double h = law.step;
    const Real bend = h * (d.a + d.v2 * inverse);     // of the rate [m/s]
    const Real margin = h * bend;                     // of the overlap [m], twice what is needed
    const Real before = out.overlap - h * out.rate;
    const Real lowest = smaller(before, out.overlap) - margin;
    const Real highest = larger(before, out.overlap) + margin;
    Int settled = highest <= splat(-law.law.reach);
    if constexpr (T::tension) {
      settled |= lowest > zero;
    } else {
      const Int pressed = k * lowest + c * (out.rate - bend) > zero;
      const Int clamped = k * highest + c * (out.rate + bend) < zero;
      settled |= (lowest > zero) & (pressed | clamped);
    }
    out.candidates = lane_bits(~settled);
    out.speed = square_root(d.v2);
  }
  return out;
}

GC_INLINE void note_candidates(unsigned bits, std::size_t first, Candidates& candidates) {
  while (bits != 0) {
    candidates.pair[candidates.n++] = static_cast<std::uint32_t>(first) + static_cast<std::uint32_t>(__builtin_ctz(bits));
    bits &= bits - 1;
  }
}

constexpr std::size_t kPrefetch = 64;  // pairs ahead whose second rows are fetched; 32 to 128 measure alike

/// Evaluates all pairs, calls see(first pair, Evaluated) for each group and add(pair, force) for each pair.
template <class T, bool kEvents, class See, class Add>
GC_INLINE void sweep_pairs(const BallRow* rows, const PairSpan& pairs, const SweepLaw& law_in, LaneTotals& lanes,
                           Candidates* candidates, See see, Add add) {
  if (pairs.n == 0) return;
  const SweepLaw law = law_in;
  // A pipeline: one turn of the loop does four groups' stages, so that no group waits for its own long chain.
  Gathered ring[4];
  alignas(64) IntVec force[2][kWidth];
  const std::size_t last = pairs.n - kWidth;
  const auto start = [&](std::size_t p, Gathered& out) GC_INLINE_LAMBDA {
    const std::size_t at = p < last ? p : last;
    const std::uint32_t* ahead = pairs.j + (p + kPrefetch < last ? p + kPrefetch : last);
#pragma GCC unroll 8
    for (int k = 0; k < kWidth; ++k) __builtin_prefetch(rows + ahead[k]);
    out = gather<kEvents>(rows, pairs.i + at, pairs.j + at);
  };
  const auto end = [&](std::size_t p, const IntVec* forces) GC_INLINE_LAMBDA {
    const Int4* f = reinterpret_cast<const Int4*>(forces);
#pragma GCC unroll 8
    for (int s = 0; s < kWidth; ++s) add(p + kSlotPair[s], f[s]);
  };
  start(0, ring[0]);
  start(kWidth, ring[1]);
  take_root(ring[0]);
  for (std::size_t p = 0, turn = 0; p < pairs.n; p += kWidth, ++turn) {
    start(p + kWidth + kWidth, ring[(turn + 2) % 4]);
    take_root(ring[(turn + 1) % 4]);
    const Evaluated e = evaluate<T, kEvents>(ring[turn % 4], law, lanes);
    store_rows(e.fx, e.fy, e.fz, force[turn % 2]);
    see(p, e);
    if constexpr (kEvents) note_candidates(e.candidates, p, *candidates);
    if (turn > 0) end(p - kWidth, force[(turn + 1) % 2]);
  }
  end(last, force[(pairs.n / kWidth + 1) % 2]);
}
constexpr auto kIgnore = [](std::size_t, const Evaluated&) {};

template <class T, bool kEvents>
void sweep_terms(const BallRow* rows, PairSpan pairs, const SweepLaw& law, IntVec* sums, SweepTotals& totals,
                 Candidates* candidates) {
  Int4* ball = reinterpret_cast<Int4*>(sums);
  const bool both = law.both;
  const std::uint32_t ring = law.ring;
  LaneTotals lanes;
  sweep_pairs<T, kEvents>(rows, pairs, law, lanes, candidates, kIgnore, [=](std::size_t pair, Int4 f) GC_INLINE_LAMBDA {
    ball[pairs.i[pair] & ring] += f;
    if (both) ball[pairs.j[pair] & ring] -= f;
  });
  lanes.add_to(totals);
}

/// Adds a force and its weighted impulse to both balls of a pair, or to the first alone.
GC_INLINE void add_weighted(Int4* ball, const PairSpan& pairs, std::size_t pair, Int4 f, Int4 impulse, bool both) {
  Int4* i = ball + 2 * std::size_t{pairs.i[pair]};  // two per ball: force, impulse
  Int4* j = ball + 2 * std::size_t{pairs.j[pair]};
#if defined(__AVX512F__)
  const Int sum = __builtin_shufflevector(f, impulse, 0, 1, 2, 3, 4, 5, 6, 7);
  *reinterpret_cast<Int*>(i) += sum;
  if (both) *reinterpret_cast<Int*>(j) -= sum;
#else
  i[0] += f;
  i[1] += impulse;
  if (!both) return;
  j[0] -= f;
  j[1] -= impulse;
#endif
}

template <class T, bool kEvents>
void weighted_terms(const BallRow* rows, PairSpan pairs, const SweepLaw& law, int shift, WeightedSum* sums,
                    SweepTotals& totals, Candidates* candidates) {
  Int4* ball = reinterpret_cast<Int4*>(sums);
  const bool both = law.both;
  LaneTotals lanes;
  sweep_pairs<T, kEvents>(rows, pairs, law, lanes, candidates, kIgnore, [=](std::size_t pair, Int4 f) GC_INLINE_LAMBDA {
    add_weighted(ball, pairs, pair, f, f << shift, both);
  });
  lanes.add_to(totals);
}

/// Each pair's value times 2^level, and 0 for kNoWeight.
GC_INLINE Int times_weight(Int x, const std::uint8_t* level) {
  const Int shift = __builtin_convertvector(*reinterpret_cast<const Bytes*>(level), Int);
  return (x << (shift & 63)) & (shift != std::int64_t{kNoWeight});
}

/// Two groups in turn, by slots: what is added to balls when the next group has been evaluated.
struct alignas(64) Impulses {
  IntVec of[2 * kWidth];
  GC_INLINE IntVec* group(std::size_t first_pair) { return of + first_pair % (2 * kWidth); }
  GC_INLINE Int4 of_pair(std::size_t pair) const {
    return *reinterpret_cast<const Int4*>(of + (pair & kWidth) + kSlotPair[pair % kWidth]);
  }
};

/// Adds a group's totals and keeps its forces, each pair's as `weigh` makes them.
template <class Weigh>
GC_INLINE void weigh_group(const Evaluated& e, bool both, LaneTotals& lanes, IntVec* impulses, Weigh weigh) {
  const Int fx = weigh(e.fx), fy = weigh(e.fy), fz = weigh(e.fz);
  store_rows(fx, fy, fz, impulses);
  if (!both) {
    lanes.fx += fx;
    lanes.fy += fy;
    lanes.fz += fz;
  }
  lanes.magnitude += weigh(e.magnitude);
  lanes.power += weigh(e.power);
  lanes.turned += weigh(e.turned);
}

template <class T, bool kSum>
void record_terms(const BallRow* rows, PairSpan pairs, const SweepLaw& law, const std::uint8_t* level, PairRecords out,
                  WeightedSum* sums, SweepTotals& totals, Candidates* candidates) {
  Int4* ball = reinterpret_cast<Int4*>(sums);
  const bool both = law.both;
  LaneTotals weighted, single;
  Impulses impulses;
  const auto see = [&](std::size_t p, const Evaluated& e) GC_INLINE_LAMBDA {
    const auto rounded = [](Real v) GC_INLINE_LAMBDA { return __builtin_convertvector(v, Single); };
    *reinterpret_cast<SingleOut*>(out.overlap + p) = rounded(e.overlap);
    *reinterpret_cast<SingleOut*>(out.rate + p) = rounded(e.rate);
    store_directions(rounded(e.nx), rounded(e.ny), rounded(e.nz), rounded(e.speed), out.direction + p);
    if constexpr (kSum) {
      weigh_group(e, both, weighted, impulses.group(p), [&](Int x) GC_INLINE_LAMBDA { return times_weight(x, level + p); });
    }
  };
  sweep_pairs<T, true>(rows, pairs, law, single, candidates, see, [&](std::size_t pair, Int4 f) GC_INLINE_LAMBDA {
    if constexpr (kSum) add_weighted(ball, pairs, pair, f, impulses.of_pair(pair), both);
    (void)f;
  });
  weighted.bad = single.bad;
  weighted.add_to(totals);
}

template <class T>
void reweigh_terms(const BallRow* rows, PairSpan pairs, const SweepLaw& law, const std::uint8_t* from,
                   const std::uint8_t* to, IntVec* balance, SweepTotals& totals) {
  Int4* ball = reinterpret_cast<Int4*>(balance);
  const bool both = law.both;
  LaneTotals weighted, single;
  Impulses impulses;
  const auto see = [&](std::size_t p, const Evaluated& e) GC_INLINE_LAMBDA {
    weigh_group(e, both, weighted, impulses.group(p), [&](Int x) GC_INLINE_LAMBDA {
      return times_weight(x, to + p) - times_weight(x, from + p);
    });
  };
  sweep_pairs<T, false>(rows, pairs, law, single, nullptr, see, [&](std::size_t pair, Int4 /*f*/) GC_INLINE_LAMBDA {
    const Int4 impulse = impulses.of_pair(pair);
    ball[pairs.i[pair]] += impulse;
    if (both) ball[pairs.j[pair]] -= impulse;
  });
  weighted.add_to(totals);
}

/// Calls `call` with the terms that the law has on.
template <class Call>
GC_INLINE void with_terms(const ContactLaw& law, Call call) {
  if (law.tension) {
    if (law.reach > 0.0) call(Terms<true, true>{});
    else call(Terms<true, false>{});
  } else {
    if (law.reach > 0.0) call(Terms<false, true>{});
    else call(Terms<false, false>{});
  }
}

void sweep(const BallRow* rows, PairSpan pairs, const SweepLaw& law, IntVec* sums, SweepTotals& totals,
           Candidates* candidates) {
  with_terms(law.law, [&](auto terms) {
    using T = decltype(terms);
    if (candidates != nullptr) sweep_terms<T, true>(rows, pairs, law, sums, totals, candidates);
    else sweep_terms<T, false>(rows, pairs, law, sums, totals, nullptr);
  });
}

void sweep_weighted(const BallRow* rows, PairSpan pairs, const SweepLaw& law, int shift, WeightedSum* sums,
                    SweepTotals& totals, Candidates* candidates) {
  with_terms(law.law, [&](auto terms) {
    using T = decltype(terms);
    if (candidates != nullptr) weighted_terms<T, true>(rows, pairs, law, shift, sums, totals, candidates);
    else weighted_terms<T, false>(rows, pairs, law, shift, sums, totals, nullptr);
  });
}

void record(const BallRow* rows, PairSpan pairs, const SweepLaw& law, const std::uint8_t* level, PairRecords out,
            WeightedSum* sums, SweepTotals& totals, Candidates& candidates) {
  with_terms(law.law, [&](auto terms) {
    using T = decltype(terms);
    if (sums != nullptr) record_terms<T, true>(rows, pairs, law, level, out, sums, totals, &candidates);
    else record_terms<T, false>(rows, pairs, law, level, out, nullptr, totals, &candidates);
  });
}

void reweigh(const BallRow* rows, PairSpan pairs, const SweepLaw& law, const std::uint8_t* from, const std::uint8_t* to,
             IntVec* balance, SweepTotals& totals) {
  with_terms(law.law, [&](auto terms) { reweigh_terms<decltype(terms)>(rows, pairs, law, from, to, balance, totals); });
}

// ---- advance of balls ----

/// Closes the step that ends (velocity from the new force sum) and opens the next one (position and
/// velocity for the next evaluation). Both halves do the same operations alone or together.
template <bool kLagged, bool kClose, bool kOpen, bool kBound>
GC_INLINE void advance_one_by_one(BallRow* rows, IntVec* sums_in, std::size_t stride, int parts, IntVec* opening_in,
                                  const double* inverse_mass, const SkinReference* skins, const AdvanceParameters& p,
                                  std::size_t begin, std::size_t end, AdvanceReport& report) {
  const Real4 gravity = {p.gravity[0], p.gravity[1], p.gravity[2], 0.0};
  const Real4 lower = {p.lower[0], p.lower[1], p.lower[2], -__builtin_inf()};  // the outlet included
  const Real4 upper = {p.upper[0], p.upper[1], p.upper[2], __builtin_inf()};
  const Int4 xyz = {-1, -1, -1, 0};
  const double h = p.step, half = 0.5 * p.step, half_square = 0.5 * p.step * p.step;
  Int4* sums = reinterpret_cast<Int4*>(sums_in);
  Int4* opening = reinterpret_cast<Int4*>(opening_in);
  Int4 outside = {};
  bool unsafe = false;
  for (std::size_t i = begin; i < end; ++i) {
    Real4* row = reinterpret_cast<Real4*>(rows + i);
    Real4 x = row[0];
    Real4 v = (Real4)((Int4)row[1] & xyz);
    const double inertia = p.unit * inverse_mass[i];
    Int4 force = opening[i];
    if constexpr (kClose) {
      force = sums[i];
      sums[i] = Int4{};
      for (int part = 1; part < parts; ++part) {
        force += sums[static_cast<std::size_t>(part) * stride + i];
        sums[static_cast<std::size_t>(part) * stride + i] = Int4{};
      }
      if constexpr (kLagged) {
        v += half * (gravity + __builtin_convertvector(force, Real4) * inertia);
      } else {
        v += __builtin_convertvector(force - opening[i], Real4) * (half * inertia);
      }
      opening[i] = force;
    }
    const Real4 a = gravity + __builtin_convertvector(force, Real4) * inertia;
    if constexpr (kOpen) {
      if constexpr (kLagged) {
        v += half * a;
        x += h * v;
      } else {
        x += h * v + half_square * a;
        v += h * a;
      }
      const Real4 away = x - *reinterpret_cast<const Real4*>(skins + i);
      // Written so that a NaN is unsafe.
      unsafe |= !(three_sum(away * away) <= skins[i].skin2);
      outside |= ~((x >= lower) & (x <= upper));
      row[0] = x;
    }
    if constexpr (kBound) v[3] = three_sum(magnitude4(a));
    row[1] = v;
  }
  report.list_unsafe |= unsafe;
  report.crossed |= (outside[0] | outside[1] | outside[2]) != 0;
}

#if defined(__AVX512F__)
// Two balls, one after the other, each x, y, z and another lane.
typedef double Two [[gnu::vector_size(64), gnu::aligned(32)]];
typedef std::int64_t IntTwo [[gnu::vector_size(64), gnu::aligned(32)]];

/// The first fours of two balls' rows.
GC_INLINE Two load_two(const Real4* from) { return __builtin_shufflevector(from[0], from[2], 0, 1, 2, 3, 4, 5, 6, 7); }
GC_INLINE void store_two(Real4* to, Two value) {
  to[0] = __builtin_shufflevector(value, value, 0, 1, 2, 3);
  to[2] = __builtin_shufflevector(value, value, 4, 5, 6, 7);
}
GC_INLINE Two twice(Real4 one) { return __builtin_shufflevector(one, one, 0, 1, 2, 3, 0, 1, 2, 3); }
template <int kLane>
GC_INLINE Two lane_of_two(Two v) {
  return __builtin_shufflevector(v, v, kLane, kLane, kLane, kLane, kLane + 4, kLane + 4, kLane + 4, kLane + 4);
}
/// x + y + z of either ball, in all its lanes.
GC_INLINE Two three_sums(Two v) { return lane_of_two<0>(v) + lane_of_two<1>(v) + lane_of_two<2>(v); }

/// The same two by two, while there are two. Returns the first row that is left.
template <bool kLagged, bool kClose, bool kOpen, bool kBound>
GC_INLINE std::size_t advance_two_by_two(BallRow* rows, IntVec* sums, std::size_t stride, int parts, IntVec* openings,
                                         const double* inverse_mass, const SkinReference* skins, const AdvanceParameters& p,
                                         std::size_t begin, std::size_t end, AdvanceReport& report) {
  const Two gravity = twice(Real4{p.gravity[0], p.gravity[1], p.gravity[2], 0.0});
  const Two lower = twice(Real4{p.lower[0], p.lower[1], p.lower[2], -__builtin_inf()});  // the outlet included
  const Two upper = twice(Real4{p.upper[0], p.upper[1], p.upper[2], __builtin_inf()});
  const IntTwo xyz = (IntTwo)twice((Real4)Int4{-1, -1, -1, 0});
  const double h = p.step, half = 0.5 * p.step, half_square = 0.5 * p.step * p.step;
  IntTwo outside = {}, unsafe = {};
  std::size_t i = begin;
  for (; i + 2 <= end; i += 2) {
    Real4* row = reinterpret_cast<Real4*>(rows + i);
    IntTwo& opening = *reinterpret_cast<IntTwo*>(openings + i);
    Two x = load_two(row);
    Two v = (Two)((IntTwo)load_two(row + 1) & xyz);
    const Two inertia = p.unit * __builtin_shufflevector(Real4{} + inverse_mass[i], Real4{} + inverse_mass[i + 1], 0, 1, 2, 3, 4, 5, 6, 7);
    IntTwo force = opening;
    if constexpr (kClose) {
      force = IntTwo{};
      for (int part = 0; part < parts; ++part) {
        IntTwo& sum = *reinterpret_cast<IntTwo*>(sums + static_cast<std::size_t>(part) * stride + i);
        force += sum;
        sum = IntTwo{};
      }
      if constexpr (kLagged) {
        v += half * (gravity + __builtin_convertvector(force, Two) * inertia);
      } else {
        v += __builtin_convertvector(force - opening, Two) * (half * inertia);
      }
      opening = force;
    }
    const Two a = gravity + __builtin_convertvector(force, Two) * inertia;
    if constexpr (kOpen) {
      if constexpr (kLagged) {
        v += half * a;
        x += h * v;
      } else {
        x += h * v + half_square * a;
        v += h * a;
      }
      const Two skin = *reinterpret_cast<const Two*>(skins + i);
      const Two away = x - skin;
      // Written so that a NaN is unsafe. The skin's square is in the fourth lane.
      unsafe |= ~(three_sums(away * away) <= skin);
      outside |= ~((x >= lower) & (x <= upper));
      store_two(row, x);
    }
    if constexpr (kBound) {
      const Two size = three_sums((Two)((IntTwo)a & (IntTwo{} + INT64_MAX)));
      v = (Two)((IntTwo)v | ((IntTwo)size & ~xyz));
    }
    store_two(row + 1, v);
  }
  for (int lane = 0; lane < 8; ++lane) {
    if (lane % 4 == 3) report.list_unsafe |= unsafe[lane] != 0;
    else report.crossed |= outside[lane] != 0;
  }
  return i;
}
#endif

template <bool kLagged, bool kClose, bool kOpen, bool kBound>
AdvanceReport advance_rows(BallRow* rows, IntVec* sums, std::size_t stride, int parts, IntVec* opening,
                           const double* inverse_mass, const SkinReference* skins, const AdvanceParameters& p,
                           std::size_t begin, std::size_t end) {
  AdvanceReport report;
#if defined(__AVX512F__)
  begin = advance_two_by_two<kLagged, kClose, kOpen, kBound>(rows, sums, stride, parts, opening, inverse_mass, skins, p, begin, end,
                                                             report);
#endif
  advance_one_by_one<kLagged, kClose, kOpen, kBound>(rows, sums, stride, parts, opening, inverse_mass, skins, p, begin, end, report);
  return report;
}

template <bool kLagged, bool kBound>
AdvanceReport advance_halves(Advance what, BallRow* rows, IntVec* sums, std::size_t stride, int parts, IntVec* opening,
                             const double* inverse_mass, const SkinReference* skins, const AdvanceParameters& p,
                             std::size_t begin, std::size_t end) {
  const auto rows_of = what == Advance::open    ? advance_rows<kLagged, false, true, kBound>
                       : what == Advance::close ? advance_rows<kLagged, true, false, kBound>
                                                : advance_rows<kLagged, true, true, kBound>;
  return rows_of(rows, sums, stride, parts, opening, inverse_mass, skins, p, begin, end);
}

template <bool kLagged>
AdvanceReport advance(Advance what, BallRow* rows, IntVec* sums, std::size_t stride, int parts, IntVec* opening,
                      const double* inverse_mass, const SkinReference* skins, const AdvanceParameters& p,
                      std::size_t begin, std::size_t end) {
  const auto halves = p.bound ? advance_halves<kLagged, true> : advance_halves<kLagged, false>;
  return halves(what, rows, sums, stride, parts, opening, inverse_mass, skins, p, begin, end);
}

/// Three lanes of four; the last is zero.
GC_INLINE Real4 xyz_of(Real4 v) {
  const Int4 xyz = {-1, -1, -1, 0};
  return (Real4)((Int4)v & xyz);
}

/// Along its parabola by h [s]; the fourth lane of the second half, the bound on the acceleration, stays.
GC_INLINE void move_row(Real4* row, Real4 a, double h) {
  const double bound = row[1][3];
  Real4 v = xyz_of(row[1]);
  row[0] += h * v + 0.5 * h * h * a;
  v += h * a;
  v[3] = bound;
  row[1] = v;
}

void drift(BallRow* rows, const Path* paths, RowSpan which, double h) {
  for (std::size_t k = 0; k < which.n; ++k) {
    const std::uint32_t i = which.row[k];
    move_row(reinterpret_cast<Real4*>(rows + i), xyz_of(*reinterpret_cast<const Real4*>(paths + i)), h);
  }
}

constexpr std::size_t kKickPrefetch = 16;  // rows ahead; 6 to 24 measure alike

template <bool kDrift>
void kick_rows(BallRow* rows, Path* paths, IntVec* balance_in, IntVec* opening, const std::uint8_t* level, WeightedSum* sums_in,
               std::size_t stride, int parts, RowSpan which, const KickParameters& p) {
  const Real4 gravity = {p.gravity[0], p.gravity[1], p.gravity[2], 0.0};
  Int4* sums = reinterpret_cast<Int4*>(sums_in);
  Int4* balance = reinterpret_cast<Int4*>(balance_in);
  for (std::size_t k = 0; k < which.n; ++k) {
    const std::uint32_t i = which.row[k];
    Real4* row = reinterpret_cast<Real4*>(rows + i);
    const std::size_t ahead = which.row[k + kKickPrefetch < which.n ? k + kKickPrefetch : which.n - 1];
    __builtin_prefetch(rows + ahead, 1);
    __builtin_prefetch(paths + ahead, 1);
    __builtin_prefetch(balance + ahead, 1);
    __builtin_prefetch(sums + 2 * ahead, 1);
    Real4* path = reinterpret_cast<Real4*>(paths + i);
    Real4 a;
    Int4 force = {}, impulse = {};
    for (int part = 0; part < parts; ++part) {
      Int4* sum = sums + 2 * (static_cast<std::size_t>(part) * stride + i);
      force += sum[0];
      impulse += sum[1];
      sum[0] = Int4{};
      sum[1] = Int4{};
    }
    if (level[i] > p.level) {
      // In mid-step: the trapezoid's inner points count twice.
      balance[i] += impulse + impulse;
      if constexpr (kDrift) a = xyz_of(*path);
    } else {
      const double inverse_mass = (*path)[3], inertia = p.unit * inverse_mass;
      Real4 v = row[1] + __builtin_convertvector(balance[i] + impulse, Real4) * (p.half_tick * inertia);
      a = gravity + __builtin_convertvector(force, Real4) * inertia;
      v[3] = three_sum(magnitude4(a));
      row[1] = v;
      Real4 next = a;
      next[3] = inverse_mass;
      *path = next;  // whole, and not read again: a vector read from parts just written would wait for them
      if constexpr (!kDrift) *reinterpret_cast<Int4*>(opening + i) = force;
      // The next step's path takes the force as constant; its balance begins with what that is wrong by.
      balance[i] = impulse - (force << (level[i] + 1));
    }
    if constexpr (kDrift) move_row(row, a, p.drift);
  }
}

void kick(BallRow* rows, Path* paths, IntVec* balance, IntVec* opening, const std::uint8_t* level, WeightedSum* sums,
          std::size_t stride, int parts, RowSpan which, const KickParameters& p) {
  const auto kicked = p.drift > 0.0 ? kick_rows<true> : kick_rows<false>;
  kicked(rows, paths, balance, opening, level, sums, stride, parts, which, p);
}

AdvanceReport watch(const BallRow* rows, const StraightPath* expected, double seconds, const AdvanceParameters& p,
                    std::size_t begin, std::size_t end) {
  const Real4 lower = {p.lower[0], p.lower[1], p.lower[2], -__builtin_inf()};  // the outlet included
  const Real4 upper = {p.upper[0], p.upper[1], p.upper[2], __builtin_inf()};
  Int4 outside = {};
  bool unsafe = false;
  for (std::size_t i = begin; i < end; ++i) {
    const Real4 x = *reinterpret_cast<const Real4*>(rows + i);
    const Real4* line = reinterpret_cast<const Real4*>(expected + i);
    const Real4 away = x - (line[0] + seconds * line[1]);
    const Real4 ahead = away + p.step * (*reinterpret_cast<const Real4*>(&rows[i].vx) - line[1]);
    const double margin = line[0][3];
    unsafe |= !(three_sum(away * away) <= margin * margin);
    unsafe |= !(three_sum(ahead * ahead) <= margin * margin);
    outside |= ~((x >= lower) & (x <= upper));
  }
  AdvanceReport report;
  report.list_unsafe = unsafe;
  report.crossed = (outside[0] | outside[1] | outside[2]) != 0;
  return report;
}

#include "core/pair_search.hpp"

#define GC_STRING_(x) #x
#define GC_STRING(x) GC_STRING_(x)
#define GC_PASTE_(a, b) a##b
#define GC_PASTE(a, b) GC_PASTE_(a, b)

}  // namespace

extern const Kernels GC_PASTE(kernels_, GRAINCLOCK_KERNEL_SET);
const Kernels GC_PASTE(kernels_, GRAINCLOCK_KERNEL_SET) = {
    GC_STRING(GRAINCLOCK_KERNEL_SET), sweep, sweep_weighted, record, reweigh, advance<false>, advance<true>, drift, kick, watch, find_pairs};

}  // namespace grainclock::core
