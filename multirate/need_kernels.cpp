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
            std::size_t first, std::size_t n, Gathered& out) {
  for (std::size_t q = 0; q < n; ++q) {
    const std::size_t p = first + q;
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
    gather<kBoth>(pairs, book, paths, margin, first, n, gathered);
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

#define GC_PASTE_(a, b) a##b
#define GC_PASTE(a, b) GC_PASTE_(a, b)

}  // namespace

extern const AddNeeds GC_PASTE(add_needs_, GRAINCLOCK_KERNEL_SET);
const AddNeeds GC_PASTE(add_needs_, GRAINCLOCK_KERNEL_SET) = add_needs;

}  // namespace grainclock::multirate
