// Compiled once per instruction set (core/kernels.cmake), like core/kernels.cpp: nothing but built-in vector types and
// inlined functions.
#include "multirate/needs.hpp"

namespace grainclock::multirate {
namespace {

typedef double Real8 [[gnu::vector_size(64)]];
typedef std::int64_t Int8 [[gnu::vector_size(64)]];
constexpr std::size_t kBlock = 64;  // pairs

/// What a block's pairs need of their balls, gathered one by one for the loop over all of them.
struct Gathered {
  double acceleration[kBlock];  // m/s2, towards each other
  double inverse_mass[kBlock];  // 1/kg, of both
  double room[kBlock];          // m, both margins
};
struct Judged {
  double smooth4[kBlock], impact4[kBlock];  // 1/s4, of each pair
  double scale[kBlock];                     // of its normal matrix
  bool asks[kBlock];
};

template <bool kBoth>
void gather(const core::PairSpan& pairs, const core::PairRecords& book, const core::Path* paths, const double* margin,
            std::size_t first, std::size_t n, Gathered& out) {
  for (std::size_t q = 0; q < n; ++q) {
    const std::size_t p = first + q;
    const core::Path& a = paths[pairs.i[p]];
    const core::Normal& normal = book.normal[p];
    if constexpr (kBoth) {
      const core::Path& b = paths[pairs.j[p]];
      out.acceleration[q] = (a.ax - b.ax) * normal.x + (a.ay - b.ay) * normal.y + (a.az - b.az) * normal.z;
      out.inverse_mass[q] = a.inverse_mass + b.inverse_mass;
      out.room[q] = margin[pairs.i[p]] + margin[pairs.j[p]];
    } else {
      out.acceleration[q] = a.ax * normal.x + a.ay * normal.y + a.az * normal.z;
      out.inverse_mass[q] = a.inverse_mass;
      out.room[q] = margin[pairs.i[p]];
    }
  }
}

void judge(const core::PairRecords& book, const NeedParameters& w, std::size_t first, std::size_t n, const Gathered& in,
           Level* level, Judged& out) {
  const double* overlap = book.overlap + first;
  const double* rate = book.rate + first;
  const double* speed = book.speed + first;
#pragma GCC ivdep
  for (std::size_t q = 0; q < n; ++q) {
    const double gap = -overlap[q] - w.reach;
    const double approach = rate[q] > 0.0 ? rate[q] : 0.0;
    const bool is_skipped = gap > speed[q] * w.interval + in.room[q];
    const bool asks = !is_skipped && !(gap > kAccelerating * approach * w.interval + w.soon);
    const PairMotion motion = motion_of(overlap[q], rate[q], in.acceleration[q], w.k * in.inverse_mass[q], w.speed2);
    level[first + q] = is_skipped ? kSkipped : Level{0};
    out.asks[q] = asks;
    out.smooth4[q] = motion.is_impact ? 0.0 : motion.urgency4;
    out.impact4[q] = motion.is_impact ? motion.urgency4 : 0.0;
    out.scale[q] = in.inverse_mass[q] * w.per_unit;
  }
}

/// The entries of NormalMatrix::of() and the urgencies.
Real8 ask_of(const core::Normal& n, double scale, double smooth4, double impact4) {
  const double sx = scale * n.x, sy = scale * n.y, sz = scale * n.z;
  const Real8 products = Real8{sx, sy, sz, sx, sx, sy, 0.0, 0.0} * Real8{n.x, n.y, n.z, n.y, n.z, n.z, 0.0, 0.0};
  const Real8 whole = (products + kWholeNumber) - kWholeNumber;
  const Real8 urgencies = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, smooth4, impact4};
  return Int8{0, 0, 0, 0, 0, 0, -1, -1} != 0 ? urgencies : whole;
}

void add(Real8& need, Real8 ask) {
  const Real8 larger = need > ask ? need : ask;
  need = Int8{0, 0, 0, 0, 0, 0, -1, -1} != 0 ? larger : need + ask;
}

template <bool kBoth>
void add_block(const core::PairSpan& pairs, const core::PairRecords& book, std::size_t first, std::size_t n,
               const Judged& judged, Need* needs) {
  for (std::size_t q = 0; q < n; ++q) {
    if (!judged.asks[q]) continue;
    const std::size_t p = first + q;
    const Real8 ask = ask_of(book.normal[p], judged.scale[q], judged.smooth4[q], judged.impact4[q]);
    add(*reinterpret_cast<Real8*>(needs + pairs.i[p]), ask);
    if constexpr (kBoth) add(*reinterpret_cast<Real8*>(needs + pairs.j[p]), ask);
  }
}

template <bool kBoth>
void add_needs_of(const core::PairSpan& pairs, const core::PairRecords& book, const core::Path* paths,
                  const double* margin, const NeedParameters& with, Level* level, Need* needs, std::size_t begin,
                  std::size_t end) {
  Gathered gathered;
  Judged judged;
  for (std::size_t first = begin; first < end; first += kBlock) {
    const std::size_t n = end - first < kBlock ? end - first : kBlock;
    gather<kBoth>(pairs, book, paths, margin, first, n, gathered);
    judge(book, with, first, n, gathered, level, judged);
    add_block<kBoth>(pairs, book, first, n, judged, needs);
  }
}

void add_needs(core::PairSpan pairs, const core::PairRecords& book, const core::Path* paths, const double* margin,
               const NeedParameters& with, Level* level, Need* needs, std::size_t begin, std::size_t end) {
  if (with.both) add_needs_of<true>(pairs, book, paths, margin, with, level, needs, begin, end);
  else add_needs_of<false>(pairs, book, paths, margin, with, level, needs, begin, end);
}

#define GC_PASTE_(a, b) a##b
#define GC_PASTE(a, b) GC_PASTE_(a, b)

}  // namespace

extern const AddNeeds GC_PASTE(add_needs_, GRAINCLOCK_KERNEL_SET);
const AddNeeds GC_PASTE(add_needs_, GRAINCLOCK_KERNEL_SET) = add_needs;

}  // namespace grainclock::multirate
