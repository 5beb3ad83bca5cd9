// The hot loops: sweep over pairs, advance of balls. Each is compiled once per
// instruction set (kernels.cpp) and chosen at run time; all give the same bits,
// for every operation is elementwise, nothing is contracted, and sums are integer.
#pragma once

#include "core/contact_law.hpp"
#include "core/rows.hpp"

#include <vector>

namespace grainclock::core {

/// Pairs of rows; the number is a multiple of kLanes (filled up with pairs that cannot touch).
constexpr std::size_t kLanes = 8;
struct PairSpan {
  const std::uint32_t* i;
  const std::uint32_t* j;
  std::size_t n;
};

constexpr std::uint32_t kNoRing = 0xffffffff;

/// Constants of one sweep.
struct SweepLaw {
  ContactLaw law;
  double per_unit = 0.0;      // 1/N, inverse of the integer force unit, a power of two
  double per_total = 0.0;     // 1/N or 1/W, the same for sums over all contacts (coarser, so that they fit)
  double force_limit = 0.0;   // N, beyond it the numerics have failed
  double step = 0.0;          // s, of these contacts; used to find event candidates
  bool both = true;           // j is content and feels the reaction
  std::uint32_t ring = kNoRing;  // a power of two less one: sums of row r are at r & ring (sweep alone)
};

/// Sums over the pairs of a sweep, in integer units, hence exact.
struct SweepTotals {
  std::int64_t force[3] = {0, 0, 0};   // force units, on i; only of pairs with fixed balls (SweepLaw::both is false)
  std::int64_t magnitude = 0;          // total units, sum of |F|
  std::int64_t power = 0;              // total units, sum of (F - k d) d'
  std::int64_t turned = 0;             // total units, sum of |F d'|
  bool overloaded = false;             // a force beyond the limit, an overlap beyond a quarter of the radii, or a NaN
  SweepTotals& operator+=(const SweepTotals& other);
};
/// Where a pair points, and how fast its balls move against each other.
struct alignas(16) PairDirection {
  float x, y, z;  // unit vector from j to i
  float speed;    // m/s, relative
};
/// What classification needs of each pair, pair by pair; room for whole vectors. Seven digits will do for that, and a
/// renewal has to write and read them all.
struct PairRecords {
  float* overlap;  // m
  float* rate;     // m/s
  PairDirection* direction;
};

/// Level of a pair that has no weight, instead of 2^level: it adds to force sums only.
constexpr std::uint8_t kNoWeight = 255;

/// Indices of pairs that may have changed branch within the step.
struct Candidates {
  std::uint32_t* pair;  // room for n + kLanes entries
  std::size_t n = 0;
};

/// Constants of an advance of balls.
struct AdvanceParameters {
  double gravity[3];
  double unit = 0.0;   // N
  double step = 0.0;   // s
  double lower[3], upper[3];  // m, content outside is reported; the outlet is the lower end in z
  bool bound = true;   // keep BallRow::a, which only the search for events needs
};
/// What an advance saw.
struct AdvanceReport {
  bool list_unsafe = false;   // a ball has used up its skin
  bool crossed = false;       // a ball is below the outlet or outside the domain, or not finite
};

enum class Advance { open, close, close_and_open };

/// Balls that move on their own paths (multi-rate), by row number.
struct RowSpan {
  const std::uint32_t* row;
  std::size_t n;
};
/// How a ball moves between its own step ends.
struct alignas(32) Path {
  double ax, ay, az;    // m/s2, acceleration of its present step
  double inverse_mass;  // 1/kg
};
/// Where a ball is expected: on a straight line from `x` at `v`, give or take `margin`.
struct alignas(64) StraightPath {
  double x, y, z, margin;  // m
  double vx, vy, vz;       // m/s
  double outlook;          // m, how far from `x` lists have looked for what the ball could touch
};
struct KickParameters {
  double gravity[3];
  double unit;         // N
  double half_tick;    // s
  int level;           // balls of this level or finer end their steps now
  double drift;        // s, by which all balls go on at once along their paths; 0 for none
};

/// Spheres sorted by cubes: `start[c] .. start[c + 1]` are in cube c = (z size[1] + y) size[0] + x. Spheres that meet are in the
/// same cube or in neighbouring ones. The arrays can be read kLanes beyond their ends.
struct CubedSpheres {
  const double *x, *y, *z, *reach;  // m
  const std::uint32_t* start;
  std::int32_t size[3];
};
/// How far a search for pairs has come, and where it puts them.
struct PairSearch {
  std::size_t cube, end_cube;  // to be searched
  std::uint32_t row;           // first sphere that has not been searched, in `cube`
  std::uint32_t *i, *j;
  std::size_t n = 0, room = 0;  // pairs found, and for how many there is room
  std::size_t wanted = 0;       // room without which the search did not go on
};

struct Kernels {
  const char* name;
  /// Adds the force of every pair to `sums[i]` (and its reaction to `sums[j]`).
  void (*sweep)(const BallRow* rows, PairSpan pairs, const SweepLaw&, IntVec* sums, SweepTotals&, Candidates*);
  /// The same, and the force times 2^shift to the impulses.
  void (*sweep_weighted)(const BallRow* rows, PairSpan pairs, const SweepLaw&, int shift, WeightedSum* sums,
                         SweepTotals&, Candidates*);
  /// Records pairs of several levels. Unless `sums` is null, adds forces, and forces times 2^level to the impulses;
  /// totals are then weighted in the same way.
  void (*record)(const BallRow* rows, PairSpan pairs, const SweepLaw&, const std::uint8_t* level, PairRecords,
                 WeightedSum* sums, SweepTotals&, Candidates&);
  /// Evaluates pairs that change level and adds their forces, times what their weights 2^level change by, to the balances
  /// of their balls; totals likewise.
  void (*reweigh)(const BallRow* rows, PairSpan pairs, const SweepLaw&, const std::uint8_t* from, const std::uint8_t* to,
                  IntVec* balance, SweepTotals&);
  /// Predicted scheme, for rows [begin, end). `sums` are `parts` arrays, `stride` apart, cleared after use.
  AdvanceReport (*advance_predicted)(Advance, BallRow* rows, IntVec* sums, std::size_t stride, int parts,
                                     IntVec* opening, const double* inverse_mass, const SkinReference*,
                                     const AdvanceParameters&, std::size_t begin, std::size_t end);
  /// Lagged scheme, likewise.
  AdvanceReport (*advance_lagged)(Advance, BallRow* rows, IntVec* sums, std::size_t stride, int parts,
                                  IntVec* opening, const double* inverse_mass, const SkinReference*,
                                  const AdvanceParameters&, std::size_t begin, std::size_t end);
  /// Moves balls along their present paths by `seconds`.
  void (*drift)(BallRow* rows, const Path* paths, RowSpan which, double seconds);
  /// After the forces of a tick: balls whose own step ends get their velocity and open the next step; all others
  /// put the impulse onto their balance. Clears the sums. Where balls do not go on, keeps in `opening` the force sums that
  /// open their steps.
  void (*kick)(BallRow* rows, Path* paths, IntVec* balance, IntVec* opening, const std::uint8_t* level, WeightedSum* sums,
               std::size_t stride, int parts, RowSpan which, const KickParameters&);
  /// Rows [begin, end) against their straight paths `seconds` after these began, now and, if they go on as they do, a
  /// step of `AdvanceParameters` later; and against the domain.
  AdvanceReport (*watch)(const BallRow* rows, const StraightPath* expected, double seconds, const AdvanceParameters&,
                         std::size_t begin, std::size_t end);
  /// Appends every pair of spheres that meet, i < j, i in the cubes [cube, end_cube), in ascending order of i and j.
  /// Stops early if the room might not do for the next sphere.
  void (*find_pairs)(const CubedSpheres&, PairSearch&);
};

/// The set named by the environment's GRAINCLOCK_KERNELS (portable, avx2 or avx512); without it the best that this processor
/// runs. Throws InputError for a set that it does not run.
const Kernels& kernels();
/// All sets this processor runs, the portable one first (for tests).
std::vector<const Kernels*> runnable_kernels();

}  // namespace grainclock::core
