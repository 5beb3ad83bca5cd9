// What listed pairs ask of the steps of their balls (classes.hpp), for all pairs at once. The loop is compiled once per
// instruction set, as the sweeps of the core are, and gives the same bits on all.
#pragma once

#include "core/kernels.hpp"
#include "multirate/classes.hpp"

namespace grainclock::multirate {

constexpr Level kSkipped = core::kNoWeight;  // of a pair that cannot touch before the next renewal
constexpr double kAccelerating = 1.5;        // an approach may be faster than it looks now by this much
constexpr double kSoon = 2.5e-4;             // mean diameters: gaps below it count as about to close

/// What a ball's pairs of one kind, with balls or with fixed balls, ask of its step.
struct alignas(64) Need {
  double matrix[6];  // sum of NormalMatrix entries, see is_stable()
  double smooth4;    // 1/s4, the largest urgency of smooth pairs to the fourth power; above 0 a pair holds the ball
  double impact4;    // 1/s4, of impacts
};

struct NeedParameters {
  double k;         // N/m
  double reach;     // m, largest gap at which a pair interacts
  double interval;  // s, to the next renewal
  double soon;      // m, gaps below it count as about to close
  double speed2;    // m2/s2, the scene's speed squared
  double per_unit;  // kg, turns inverse masses into scales of NormalMatrix
  bool both;        // j is content
};

// Real is double or a vector of it. Both are written so that a NaN is neither skipped nor out of reach.

/// Whether balls `gap` [m] apart, each on its straight path or at most `room` [m] off (together), cannot meet within
/// `interval` [s], whatever the direction of their relative speed [m/s].
template <class Real>
[[gnu::always_inline]] inline auto cannot_touch(Real gap, Real speed, double interval, Real room) {
  return gap > speed * interval + room;
}
/// Whether a pair that may touch within the interval will not, by its `rate` [m/s] of approach: it asks for no step.
template <class Real>
[[gnu::always_inline]] inline auto is_out_of_reach(Real gap, Real rate, double interval, double soon) {
  const Real approach = rate > Real{} ? rate : Real{};
  return gap > kAccelerating * approach * interval + soon;
}

/// Marks pairs [begin, end) that cannot touch within the interval as kSkipped, others as 0, and adds what these ask to
/// `needs` of their balls: urgencies if they are about to touch, and then, or if one ball is fixed, their normals. Rows
/// from `first_row` on. Pairs as recorded at the end of a step, `paths` as they go on; `margin` [m] is how far a ball may
/// stray from its straight path. Sums are whole numbers, so that any order gives the same.
using AddNeeds = void (*)(core::PairSpan, const core::PairRecords&, const core::Path* paths, const double* margin,
                          const NeedParameters&, Level* level, Need* needs, std::uint32_t first_row, std::size_t begin,
                          std::size_t end);

/// Takes the needs of `n` balls, which are none from then on: what `parts` arrays hold of pairs among balls, and `fixed` of
/// pairs with fixed balls (null: none). Gives each ball's urgencies to the fourth power, 1/s4, impacts' eased where smooth
/// pairs hold it, and the coarsest stable level, `weights` being those of level 0 to `coarsest`; 0 if none is.
using TakeNeeds = void (*)(Need* const* ball, int parts, Need* fixed, std::size_t n, const StepWeights* weights,
                           Level coarsest, double* smooth4, double* impact4, Level* level);

struct NeedKernels {
  AddNeeds add;
  TakeNeeds take;
};
/// The loops for the instruction set of `kernels`.
const NeedKernels& need_kernels_on(const core::Kernels& kernels);

}  // namespace grainclock::multirate
