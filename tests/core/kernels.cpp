// The hot loops: every instruction set gives the same bits, and the portable one what the law says.
#include "core/kernels.hpp"

#include "core/balls.hpp"
#include "core/events.hpp"
#include "core/force_scale.hpp"
#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <string>

namespace grainclock::core {
namespace {

using tests::Random;
using tests::same_bits;

constexpr double kStep = 5e-5;  // s

struct TermsOn {
  bool tension;
  double cohesion;
};
constexpr TermsOn kTerms[] = {{false, 0.0}, {true, 0.0}, {false, 3e4}, {true, 3e4}};  // of reach 3 mm

/// Random content and fixed rows, and pairs of them that overlap, part, cohere, or are apart.
struct Rows {
  static constexpr std::uint32_t kContent = 200, kFixed = 120;
  Materials materials;
  Balls balls;
  ForceScale scale;
  std::vector<std::uint32_t> i, j, fixed_i, fixed_j;

  explicit Rows(const TermsOn& terms, std::uint32_t seed = 1) {
    materials.tension = terms.tension;
    materials.cohesion = terms.cohesion;
    Random random(seed);
    State state;
    for (std::uint32_t b = 0; b < kContent + kFixed; ++b) {
      const bool moves = b < kContent;
      state.add(b, moves ? Kind::content : Kind::wall, random.in_cube(0.9),
                moves ? random.in_cube(2.0) : Vec3(0.0, 0.0, 0.0), random.between(0.15, 0.3));
    }
    balls = Balls(state, materials, true);
    for (std::uint32_t row = 0; row < kContent; ++row) balls.rows[row].a = random.between(0.0, 1e4);
    scale = force_scale(materials, 9.81, 0.45, 8, kContent);
    for (std::uint32_t a = 0; a < kContent; ++a) {
      for (std::uint32_t b = a + 1; b < balls.rows.size(); ++b) {
        if (b == balls.far_row()) continue;
        const double gap = (position(balls.rows[a]) - position(balls.rows[b])).norm() - balls.rows[a].r - balls.rows[b].r;
        if (gap > 1e-2 || gap < -0.04) continue;  // within the limits of force and overlap
        (b < kContent ? i : fixed_i).push_back(a);
        (b < kContent ? j : fixed_j).push_back(b);
      }
    }
    fill(i, j);
    fill(fixed_i, fixed_j);
  }
  void fill(std::vector<std::uint32_t>& a, std::vector<std::uint32_t>& b) const {
    while (a.size() % kLanes != 0) {
      a.push_back(0);
      b.push_back(balls.far_row());
    }
  }
  PairSpan pairs(bool fixed) const {
    return fixed ? PairSpan{fixed_i.data(), fixed_j.data(), fixed_i.size()} : PairSpan{i.data(), j.data(), i.size()};
  }
  SweepLaw law(bool fixed) const { return sweep_law(materials, fixed, scale, kStep); }
  std::size_t stride() const { return kContent + 1; }
};

bool same(const SweepTotals& a, const SweepTotals& b) {
  return std::equal(a.force, a.force + 3, b.force) && a.magnitude == b.magnitude && a.power == b.power &&
         a.turned == b.turned && a.overloaded == b.overloaded;
}

/// What a sweep leaves; Sum: of a ball.
template <class Sum>
struct SweptSums {
  std::vector<Sum> sums;
  SweepTotals totals;
  std::vector<std::uint32_t> candidates;
  bool operator==(const SweptSums& o) const {
    return same_bits(sums, o.sums) && same(totals, o.totals) && candidates == o.candidates;
  }
};
using Swept = SweptSums<IntVec>;
using SweptWeighted = SweptSums<WeightedSum>;

/// Calls `run(sums, totals, candidates)`; without events the last is null.
template <class Sum, class Run>
SweptSums<Sum> swept(const Rows& rows, bool fixed, bool events, Run run) {
  SweptSums<Sum> out;
  out.sums.resize(rows.stride());
  out.candidates.resize(rows.pairs(fixed).n + kLanes);
  Candidates candidates{out.candidates.data()};
  run(out.sums.data(), out.totals, events ? &candidates : nullptr);
  out.candidates.resize(candidates.n);
  return out;
}

Swept sweep(const Kernels& kernel, const Rows& rows, bool fixed, bool events) {
  return swept<IntVec>(rows, fixed, events, [&](IntVec* sums, SweepTotals& totals, Candidates* candidates) {
    kernel.sweep(rows.balls.rows.data(), rows.pairs(fixed), rows.law(fixed), sums, totals, candidates);
  });
}

SweptWeighted sweep_weighted(const Kernels& kernel, const Rows& rows, bool fixed, int shift, bool events) {
  return swept<WeightedSum>(rows, fixed, events, [&](WeightedSum* sums, SweepTotals& totals, Candidates* candidates) {
    kernel.sweep_weighted(rows.balls.rows.data(), rows.pairs(fixed), rows.law(fixed), shift, sums, totals, candidates);
  });
}

struct Recorded {
  std::vector<float> overlap, rate;
  std::vector<PairDirection> direction;
  std::vector<WeightedSum> sums;
  SweepTotals totals;
  std::vector<std::uint32_t> candidates;
  bool operator==(const Recorded& o) const {
    return same_bits(overlap, o.overlap) && same_bits(rate, o.rate) && same_bits(direction, o.direction) &&
           same_bits(sums, o.sums) && same(totals, o.totals) && candidates == o.candidates;
  }
};

/// One level per pair; the pairs that fill up the last vector have none.
std::vector<std::uint8_t> some_levels(std::size_t n, std::uint32_t seed) {
  Random random(seed);
  std::vector<std::uint8_t> level(n);
  for (auto& l : level) l = random.below(5) == 0 ? kNoWeight : static_cast<std::uint8_t>(random.below(12));
  return level;
}

std::int64_t weight_of(std::uint8_t level) { return level == kNoWeight ? 0 : std::int64_t{1} << level; }

Recorded record(const Kernels& kernel, const Rows& rows, bool fixed, const std::vector<std::uint8_t>& level,
                bool summing = true) {
  Recorded out;
  const std::size_t n = rows.pairs(fixed).n;
  out.overlap.resize(n);
  out.rate.resize(n);
  out.direction.resize(n);
  out.sums.resize(rows.stride());
  out.candidates.resize(n + kLanes);
  Candidates candidates{out.candidates.data()};
  const PairRecords records{out.overlap.data(), out.rate.data(), out.direction.data()};
  kernel.record(rows.balls.rows.data(), rows.pairs(fixed), rows.law(fixed), level.data(), records,
                summing ? out.sums.data() : nullptr, out.totals, candidates);
  out.candidates.resize(candidates.n);
  return out;
}

/// The sums and totals of pairs, each weighted, by sweeping them one level at a time.
struct Weighted {
  std::vector<std::array<std::int64_t, 3>> impulse;
  SweepTotals totals;
};
Weighted weigh_level_by_level(const Rows& rows, bool fixed, const std::vector<std::uint8_t>& level) {
  Weighted out;
  out.impulse.resize(rows.stride());
  const PairSpan all = rows.pairs(fixed);
  for (std::uint8_t l = 0; l < 12; ++l) {
    std::vector<std::uint32_t> i, j;
    for (std::size_t p = 0; p < all.n; ++p) {
      if (level[p] != l) continue;
      i.push_back(all.i[p]);
      j.push_back(all.j[p]);
    }
    rows.fill(i, j);
    std::vector<IntVec> sums(rows.stride());
    SweepTotals totals;
    kernels().sweep(rows.balls.rows.data(), {i.data(), j.data(), i.size()}, rows.law(fixed), sums.data(), totals, nullptr);
    for (std::size_t row = 0; row < rows.stride(); ++row)
      for (int k = 0; k < 3; ++k) out.impulse[row][k] += weight_of(l) * sums[row].v[k];
    for (int k = 0; k < 3; ++k) out.totals.force[k] += weight_of(l) * totals.force[k];
    out.totals.magnitude += weight_of(l) * totals.magnitude;
    out.totals.power += weight_of(l) * totals.power;
    out.totals.turned += weight_of(l) * totals.turned;
  }
  return out;
}

/// Calls `run(kernels)` for every set and compares with the portable one's.
template <class Run>
void expect_same_bits(Run run, const std::string& what) {
  const auto sets = runnable_kernels();
  const auto portable = run(*sets[0]);
  for (const Kernels* set : sets) EXPECT_TRUE(run(*set) == portable) << what << ": " << set->name;
}

TEST(Kernels, SumsInARingAreThoseOfAllRowsThatShareAPlace) {
  const std::uint32_t ring = 31;
  for (const bool fixed : {false, true}) {
    const Rows rows{TermsOn{}};
    for (const Kernels* set : runnable_kernels()) {
      const Swept all = sweep(*set, rows, fixed, false);
      SweepLaw law = rows.law(fixed);
      law.ring = ring;
      std::vector<IntVec> sums(ring + 1);
      SweepTotals totals;
      set->sweep(rows.balls.rows.data(), rows.pairs(fixed), law, sums.data(), totals, nullptr);
      ASSERT_GT(all.sums.size(), 2 * sums.size());
      std::vector<IntVec> folded(ring + 1);
      for (std::size_t row = 0; row < all.sums.size(); ++row)
        for (int k = 0; k < 3; ++k) folded[row & ring].v[k] += all.sums[row].v[k];
      EXPECT_TRUE(same_bits(sums, folded)) << set->name << ", fixed " << fixed;
      EXPECT_TRUE(same(totals, all.totals));
    }
  }
}

TEST(Kernels, PortableIsFirstAndTheBestIsOneOfThem) {
  const auto sets = runnable_kernels();
  EXPECT_STREQ(sets.front()->name, "portable");
  EXPECT_EQ(&kernels(), sets.back());
}

TEST(Kernels, PairLoopsGiveTheSameBitsOnEveryInstructionSet) {
  for (const TermsOn& terms : kTerms) {
    for (std::uint32_t seed = 1; seed <= 3; ++seed) {
      const Rows rows(terms, seed);
      for (const bool fixed : {false, true}) {
        ASSERT_GT(rows.pairs(fixed).n, 200u);
        for (const bool events : {false, true}) {
          expect_same_bits([&](const Kernels& k) { return sweep(k, rows, fixed, events); }, "sweep");
          expect_same_bits([&](const Kernels& k) { return sweep_weighted(k, rows, fixed, 5, events); }, "sweep_weighted");
        }
        const auto level = some_levels(rows.pairs(fixed).n, 3);
        expect_same_bits([&](const Kernels& k) { return record(k, rows, fixed, level); }, "record");
      }
    }
  }
}

TEST(Kernels, SweepIsTheScalarLawSummedUp) {
  for (const TermsOn& terms : kTerms) {
    const Rows rows(terms);
    for (const bool fixed : {false, true}) {
      const PairSpan pairs = rows.pairs(fixed);
      const SweepLaw law = rows.law(fixed);
      std::vector<Vec3> force(rows.stride(), Vec3::Zero());
      Vec3 total = Vec3::Zero();
      double magnitude = 0.0, power = 0.0, turned = 0.0, scale = 0.0;
      int pulled = 0;
      for (std::size_t p = 0; p < pairs.n; ++p) {
        const BallRow& a = rows.balls.rows[pairs.i[p]];
        const BallRow& b = rows.balls.rows[pairs.j[p]];
        const Vec3 x = position(a) - position(b), n = x.normalized();
        const double overlap = a.r + b.r - x.norm(), rate = -n.dot(velocity(a) - velocity(b));
        const double f = contact_force(law.law, overlap, rate);
        force[pairs.i[p]] += f * n;
        if (!fixed) force[pairs.j[p]] -= f * n;
        total += f * n;
        magnitude += std::abs(f);
        power += (f - (overlap > 0.0 ? law.law.k * overlap : 0.0)) * rate;
        turned += std::abs(f * rate);
        scale = std::max(scale, std::abs(f));
        pulled += overlap < 0.0 && f < 0.0;
      }
      EXPECT_TRUE(fixed || (pulled > 5) == (terms.cohesion > 0.0)) << pulled;  // or cohesion would not be looked at
      const Swept found = sweep(kernels(), rows, fixed, true);
      // Rounding: some 1e-16 of the terms, of which a ball has tens and the sums hundreds, and of the overlap (k times
      // 1e-16 m); and a unit or two per pair for the integers.
      const double units = static_cast<double>(pairs.n) * 2.0;
      const double tolerance = 1e-13 * scale + law.law.k * 1e-14;
      for (std::size_t row = 0; row < rows.stride(); ++row)
        for (int axis = 0; axis < 3; ++axis)
          EXPECT_NEAR(static_cast<double>(found.sums[row].v[axis]) / law.per_unit, force[row][axis],
                      tolerance + units / law.per_unit);
      for (int axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(static_cast<double>(found.totals.force[axis]) / law.per_unit, fixed ? total[axis] : 0.0,
                    10.0 * tolerance + units / law.per_unit);
      EXPECT_NEAR(static_cast<double>(found.totals.magnitude) / law.per_total, magnitude,
                  1e-12 * magnitude + units / law.per_total);
      EXPECT_NEAR(static_cast<double>(found.totals.power) / law.per_total, power, 1e-12 * turned + units / law.per_total);
      EXPECT_NEAR(static_cast<double>(found.totals.turned) / law.per_total, turned, 1e-12 * turned + units / law.per_total);
      EXPECT_FALSE(found.totals.overloaded);
    }
  }
}

TEST(Kernels, RecordAndWeightedSweepAgreeWithSweep) {
  for (const TermsOn& terms : kTerms) {
    const Rows rows(terms);
    for (const bool fixed : {false, true}) {
      const Swept swept = sweep(kernels(), rows, fixed, true);
      const SweptWeighted weighted = sweep_weighted(kernels(), rows, fixed, 5, true);
      const std::vector<std::uint8_t> level = some_levels(rows.pairs(fixed).n, 3);
      const Recorded recorded = record(kernels(), rows, fixed, level);
      const Weighted expected = weigh_level_by_level(rows, fixed, level);
      EXPECT_TRUE(same(weighted.totals, swept.totals));
      EXPECT_TRUE(same(recorded.totals, expected.totals));
      EXPECT_EQ(recorded.candidates, swept.candidates);
      EXPECT_EQ(weighted.candidates, swept.candidates);
      EXPECT_TRUE(same_bits(sweep(kernels(), rows, fixed, false).sums, swept.sums)) << "search for events changes no force";
      for (std::size_t row = 0; row < rows.stride(); ++row)
        for (int axis = 0; axis < 3; ++axis) {
          EXPECT_EQ(weighted.sums[row].force.v[axis], swept.sums[row].v[axis]);
          EXPECT_EQ(weighted.sums[row].impulse.v[axis], 32 * swept.sums[row].v[axis]);
          EXPECT_EQ(recorded.sums[row].force.v[axis], swept.sums[row].v[axis]);
          EXPECT_EQ(recorded.sums[row].impulse.v[axis], expected.impulse[row][axis]);
        }
      const Recorded unsummed = record(kernels(), rows, fixed, level, false);
      EXPECT_TRUE(same_bits(unsummed.overlap, recorded.overlap));
      EXPECT_TRUE(same_bits(unsummed.sums, std::vector<WeightedSum>(rows.stride())));
    }
  }
}

TEST(Kernels, ReweighingAddsTheDifferenceOfTheWeights) {
  for (const TermsOn& terms : kTerms) {
    const Rows rows(terms);
    for (const bool fixed : {false, true}) {
      const PairSpan pairs = rows.pairs(fixed);
      const std::vector<std::uint8_t> from = some_levels(pairs.n, 3), to = some_levels(pairs.n, 4);
      struct Out {
        std::vector<IntVec> balance;
        SweepTotals totals;
        bool operator==(const Out& o) const { return same_bits(balance, o.balance) && same(totals, o.totals); }
      };
      const auto run = [&](const Kernels& kernel) {
        Out out;
        out.balance.resize(rows.stride());
        kernel.reweigh(rows.balls.rows.data(), pairs, rows.law(fixed), from.data(), to.data(), out.balance.data(), out.totals);
        return out;
      };
      expect_same_bits(run, "reweigh");
      const Out out = run(kernels());
      const Weighted had = weigh_level_by_level(rows, fixed, from), has = weigh_level_by_level(rows, fixed, to);
      for (std::size_t row = 0; row < rows.stride(); ++row)
        for (int axis = 0; axis < 3; ++axis) {
          EXPECT_EQ(out.balance[row].v[axis], has.impulse[row][axis] - had.impulse[row][axis]);
        }
      for (int axis = 0; axis < 3; ++axis) EXPECT_EQ(out.totals.force[axis], has.totals.force[axis] - had.totals.force[axis]);
      EXPECT_EQ(out.totals.magnitude, has.totals.magnitude - had.totals.magnitude);
      EXPECT_EQ(out.totals.power, has.totals.power - had.totals.power);
      EXPECT_EQ(out.totals.turned, has.totals.turned - had.totals.turned);
    }
  }
}

TEST(Kernels, RecordedGeometryIsThePairs) {
  const Rows rows(kTerms[0]);
  const PairSpan pairs = rows.pairs(false);
  const Recorded recorded = record(kernels(), rows, false, std::vector<std::uint8_t>(pairs.n, kNoWeight));
  for (std::size_t p = 0; p < pairs.n; ++p) {
    const BallRow& a = rows.balls.rows[pairs.i[p]];
    const BallRow& b = rows.balls.rows[pairs.j[p]];
    if (pairs.j[p] == rows.balls.far_row()) {
      EXPECT_LT(recorded.overlap[p], -1e50);
      continue;
    }
    const Vec3 x = position(a) - position(b), v = velocity(a) - velocity(b);
    // Rounded to single precision, relative 2^-24; besides rounding of the overlap's terms, some 1e-16.
    const auto expect_rounded = [](double found, double wanted) {
      EXPECT_NEAR(found, wanted, 0x1p-24 * std::abs(wanted) + 1e-14);
    };
    expect_rounded(recorded.overlap[p], a.r + b.r - x.norm());
    expect_rounded(recorded.rate[p], -x.normalized().dot(v));
    const PairDirection& d = recorded.direction[p];
    expect_rounded(d.speed, v.norm());
    const Vec3 n = x.normalized();
    expect_rounded(d.x, n.x());
    expect_rounded(d.y, n.y());
    expect_rounded(d.z, n.z());
  }
}

TEST(Kernels, OverloadIsSeenInEveryLane) {
  const Rows good(kTerms[1]);  // the clamp would turn a force that is not a number into none
  for (const Kernels* kernel : runnable_kernels()) {
    for (std::uint32_t lane = 0; lane < 8; ++lane) {
      const std::size_t p = 16 + lane;
      const auto overloaded = [&](const std::function<void(BallRow&, BallRow&)>& spoil) {
        Rows rows = good;
        spoil(rows.balls.rows[rows.i[p]], rows.balls.rows[rows.j[p]]);
        rows.i = {rows.i.begin() + 16, rows.i.begin() + 24};
        rows.j = {rows.j.begin() + 16, rows.j.begin() + 24};
        return sweep(*kernel, rows, false, true).totals.overloaded;
      };
      const auto put_at = [](BallRow& a, const BallRow& b, double distance) {
        a.x = b.x + distance;
        a.y = b.y;
        a.z = b.z;
      };
      const double nan = std::nan("");
      EXPECT_FALSE(overloaded([](BallRow&, BallRow&) {}));
      EXPECT_TRUE(overloaded([&](BallRow& a, BallRow&) { a.x = nan; })) << kernel->name << lane;
      EXPECT_TRUE(overloaded([&](BallRow& a, BallRow& b) {
        put_at(a, b, b.r + a.r - 0.001);
        b.vy = nan;
      })) << kernel->name
          << lane;
      EXPECT_TRUE(overloaded([&](BallRow& a, BallRow& b) { put_at(a, b, 0.0); })) << kernel->name << lane;
      EXPECT_TRUE(overloaded([&](BallRow& a, BallRow& b) { put_at(a, b, 0.74 * (a.r + b.r)); })) << kernel->name << lane;
      EXPECT_TRUE(overloaded([&](BallRow& a, BallRow& b) {
        put_at(a, b, 0.999 * (a.r + b.r));
        b.vx = 1e6;
      })) << kernel->name
          << lane;
    }
  }
}

// ---- advance ----

struct Advanced {
  std::vector<BallRow> rows;
  std::vector<IntVec> sums, opening;
  bool list_unsafe, crossed;
  bool operator==(const Advanced& o) const {
    return same_bits(rows, o.rows) && same_bits(sums, o.sums) && same_bits(opening, o.opening) &&
           list_unsafe == o.list_unsafe && crossed == o.crossed;
  }
};

constexpr int kParts = 3;

struct Moving {
  Rows rows{kTerms[0]};
  std::vector<SkinReference> skins;
  std::vector<IntVec> sums, opening;
  AdvanceParameters parameters{{0.1, -0.2, -9.81}, 0.0, kStep, {-2.0, -2.0, -2.0}, {2.0, 2.0, 2.0}};
  Moving() {
    Random random(5);
    parameters.unit = rows.scale.unit;
    const auto some_force = [&] {
      IntVec f;
      for (int axis = 0; axis < 3; ++axis) f.v[axis] = std::llround(random.between(-1e5, 1e5) / rows.scale.unit);
      return f;
    };
    for (std::uint32_t row = 0; row < Rows::kContent; ++row) {
      const BallRow& r = rows.balls.rows[row];
      skins.push_back({r.x, r.y, r.z, 1e-4});
      opening.push_back(some_force());
    }
    for (std::size_t k = 0; k < kParts * rows.stride(); ++k) sums.push_back(some_force());
  }
  Advanced run(const Kernels& kernel, bool lagged, Advance what, std::size_t begin = 0,
               std::size_t end = Rows::kContent) const {
    Advanced out{rows.balls.rows, sums, opening, false, false};
    const AdvanceReport report = (lagged ? kernel.advance_lagged : kernel.advance_predicted)(
        what, out.rows.data(), out.sums.data(), rows.stride(), kParts, out.opening.data(), rows.balls.inverse_mass.data(),
        skins.data(), parameters, begin, end);
    out.list_unsafe = report.list_unsafe;
    out.crossed = report.crossed;
    return out;
  }
};

TEST(Kernels, AdvanceGivesTheSameBitsOnEveryInstructionSet) {
  const Moving moving;
  for (const bool lagged : {false, true})
    for (const Advance what : {Advance::open, Advance::close, Advance::close_and_open})
      expect_same_bits([&](const Kernels& k) { return moving.run(k, lagged, what); }, "advance");
}

TEST(Kernels, CloseAndOpenIsCloseThenOpen) {
  const Moving moving;
  for (const bool lagged : {false, true}) {
    const Advanced both = moving.run(kernels(), lagged, Advance::close_and_open);
    Moving between = moving;
    const Advanced closed = moving.run(kernels(), lagged, Advance::close);
    between.rows.balls.rows = closed.rows;
    between.sums = closed.sums;
    between.opening = closed.opening;
    EXPECT_TRUE(between.run(kernels(), lagged, Advance::open) == both);
  }
}

TEST(Kernels, AdvanceIsTheScheme) {
  const Moving moving;
  const double h = kStep;
  const auto newtons = [&](const IntVec& f) -> Vec3 {
    return moving.rows.scale.unit *
           Vec3(static_cast<double>(f.v[0]), static_cast<double>(f.v[1]), static_cast<double>(f.v[2]));
  };
  for (const bool lagged : {false, true}) {
    const Advanced opened = moving.run(kernels(), lagged, Advance::open),
                   closed = moving.run(kernels(), lagged, Advance::close);
    for (std::uint32_t row = 0; row < Rows::kContent; ++row) {
      const BallRow& before = moving.rows.balls.rows[row];
      const double per_mass = moving.rows.balls.inverse_mass[row];
      const Vec3 g(0.1, -0.2, -9.81), x = position(before), v = velocity(before);
      const Vec3 a0 = g + per_mass * newtons(moving.opening[row]);
      Vec3 force = Vec3::Zero();
      for (int part = 0; part < kParts; ++part) force += newtons(moving.sums[part * moving.rows.stride() + row]);
      const Vec3 a1 = g + per_mass * force;
      // Rounding of terms of some m and m/s.
      EXPECT_NEAR((position(opened.rows[row]) - (x + h * v + 0.5 * h * h * a0)).norm(), 0.0, 1e-14);
      EXPECT_NEAR((velocity(opened.rows[row]) - (v + (lagged ? 0.5 : 1.0) * h * a0)).norm(), 0.0, 1e-13);
      EXPECT_NEAR(opened.rows[row].a, a0.lpNorm<1>(), 1e-12 * a0.lpNorm<1>());
      // Predicted: what is closed was opened with h a0, of which h (a0 - a1) / 2 is taken back.
      const Vec3 change = lagged ? Vec3(0.5 * h * a1) : Vec3(0.5 * h * (a1 - a0));
      EXPECT_NEAR((velocity(closed.rows[row]) - (v + change)).norm(), 0.0, 1e-13);
      EXPECT_EQ(position(closed.rows[row]), x);
      for (int axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(static_cast<double>(closed.opening[row].v[axis]) * moving.rows.scale.unit, force[axis], 1e-8);
        for (int part = 0; part < kParts; ++part) EXPECT_EQ(closed.sums[part * moving.rows.stride() + row].v[axis], 0);
      }
    }
  }
}

TEST(Kernels, AdvanceReportsUsedSkinsAndCrossings) {
  for (const Kernels* kernel : runnable_kernels()) {
    const auto report = [&](const std::function<void(Moving&)>& change) {
      Moving moving;
      change(moving);
      const Advanced out = moving.run(*kernel, false, Advance::open);
      return std::pair(out.list_unsafe, out.crossed);
    };
    EXPECT_EQ(report([](Moving&) {}), std::pair(false, false));
    EXPECT_EQ(report([](Moving& m) { m.skins[77].x += 0.0103; }), std::pair(true, false));
    EXPECT_EQ(report([](Moving& m) { m.skins[77].z -= 0.0097; }), std::pair(false, false));
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(report([&](Moving& m) { m.parameters.lower[axis] = -0.5; }), std::pair(false, true));
      EXPECT_EQ(report([&](Moving& m) { m.parameters.upper[axis] = 0.5; }), std::pair(false, true));
    }
    EXPECT_EQ(report([](Moving& m) { m.rows.balls.rows[3].y = std::nan(""); }), std::pair(true, true));
  }
}

// ---- paths of their own ----

TEST(Kernels, DriftKickAndWatchGiveTheSameBitsOnEveryInstructionSet) {
  const Moving moving;
  Random random(6);
  const std::uint32_t n = Rows::kContent;
  std::vector<Path> paths(n);
  std::vector<std::uint8_t> level(n);
  std::vector<std::uint32_t> which;
  std::vector<WeightedSum> sums(kParts * moving.rows.stride());
  std::vector<StraightPath> expected(n);
  for (std::uint32_t row = 0; row < n; ++row) {
    const Vec3 a = 1e3 * random.direction(), v = velocity(moving.rows.balls.rows[row]);
    const BallRow& r = moving.rows.balls.rows[row];
    paths[row] = {a.x(), a.y(), a.z(), moving.rows.balls.inverse_mass[row]};
    level[row] = static_cast<std::uint8_t>(random.below(6));
    if (random.below(3) != 0) which.push_back(row);
    expected[row] = {r.x, r.y, r.z, 1e-2, v.x(), v.y(), v.z(), 0.0};
  }
  for (WeightedSum& sum : sums)
    for (int axis = 0; axis < 3; ++axis) {
      sum.force.v[axis] = std::llround(random.between(-1e4, 1e4) / moving.rows.scale.unit);
      sum.impulse.v[axis] = 4 * sum.force.v[axis];
    }
  const RowSpan some{which.data(), which.size()};
  struct Out {
    std::vector<BallRow> rows;
    std::vector<Path> paths;
    std::vector<IntVec> balance, opening;
    std::vector<WeightedSum> sums;
    bool unsafe, crossed;
    bool operator==(const Out& o) const {
      return same_bits(rows, o.rows) && same_bits(paths, o.paths) && same_bits(balance, o.balance) &&
             same_bits(opening, o.opening) && same_bits(sums, o.sums) && unsafe == o.unsafe && crossed == o.crossed;
    }
  };
  const auto run = [&](const Kernels& kernel) {
    Out out{moving.rows.balls.rows, paths, moving.opening, std::vector<IntVec>(n), sums, false, false};
    kernel.drift(out.rows.data(), paths.data(), some, 3.0 * kStep);
    KickParameters kick{{0.1, -0.2, -9.81}, moving.rows.scale.unit, 0.5 * kStep, 3, 0.0};
    const auto kicked = [&](double drift) {
      Out after = out;
      kick.drift = drift;
      kernel.kick(after.rows.data(), after.paths.data(), after.balance.data(), after.opening.data(), level.data(),
                  after.sums.data(), moving.rows.stride(), kParts, some, kick);
      return after;
    };
    const Out at_once = kicked(2.0 * kStep);
    out = kicked(0.0);
    Out one_by_one = out;
    one_by_one.opening = at_once.opening;  // kept only where balls wait
    kernel.drift(one_by_one.rows.data(), one_by_one.paths.data(), some, 2.0 * kStep);
    EXPECT_TRUE(at_once == one_by_one) << "a kick that drifts is a kick and a drift";
    const AdvanceReport report = kernel.watch(out.rows.data(), expected.data(), 3.0 * kStep, moving.parameters, 0, n);
    out.unsafe = report.list_unsafe;
    out.crossed = report.crossed;
    return out;
  };
  expect_same_bits(run, "drift, kick, watch");

  // And against formulas, ball by ball.
  const Out out = run(kernels());
  std::vector<bool> moved(n, false);
  for (const std::uint32_t row : which) moved[row] = true;
  const double unit = moving.rows.scale.unit;
  for (std::uint32_t row = 0; row < n; ++row) {
    const BallRow& before = moving.rows.balls.rows[row];
    const Vec3 a(paths[row].ax, paths[row].ay, paths[row].az);
    const double t = moved[row] ? 3.0 * kStep : 0.0;
    EXPECT_NEAR((position(out.rows[row]) - (position(before) + t * velocity(before) + 0.5 * t * t * a)).norm(), 0.0, 1e-14);
    Vec3 v = velocity(before) + t * a;
    std::array<std::int64_t, 3> force{}, impulse{};
    for (int part = 0; part < kParts; ++part)
      for (int axis = 0; axis < 3; ++axis) {
        force[axis] += sums[part * moving.rows.stride() + row].force.v[axis];
        impulse[axis] += sums[part * moving.rows.stride() + row].impulse.v[axis];
      }
    const bool ends = moved[row] && level[row] <= 3;
    for (int axis = 0; axis < 3; ++axis) {
      const std::int64_t old = moving.opening[row].v[axis];
      if (ends) v[axis] += 0.5 * kStep * unit * paths[row].inverse_mass * static_cast<double>(old + impulse[axis]);
      const std::int64_t balance = !moved[row] ? old
                                   : ends      ? impulse[axis] - (force[axis] << (level[row] + 1))
                                               : old + 2 * impulse[axis];
      EXPECT_EQ(out.balance[row].v[axis], balance);
      EXPECT_EQ(out.opening[row].v[axis], ends ? force[axis] : 0);
    }
    EXPECT_NEAR((velocity(out.rows[row]) - v).norm(), 0.0, 1e-12 * (1.0 + v.norm()));  // rounding
  }
}

TEST(Kernels, WatchSeesBallsOffTheirPathNowAndAStepAhead) {
  for (const Kernels* kernel : runnable_kernels()) {
    const auto report = [&](const std::function<void(Moving&, std::vector<StraightPath>&)>& change) {
      Moving moving;
      std::vector<StraightPath> expected;
      for (std::uint32_t row = 0; row < Rows::kContent; ++row) {
        const BallRow& r = moving.rows.balls.rows[row];
        expected.push_back({r.x - 0.1 * r.vx, r.y - 0.1 * r.vy, r.z - 0.1 * r.vz, 1e-3, r.vx, r.vy, r.vz, 0.0});
      }
      change(moving, expected);
      const AdvanceReport seen =
          kernel->watch(moving.rows.balls.rows.data(), expected.data(), 0.1, moving.parameters, 0, Rows::kContent);
      return std::pair(seen.list_unsafe, seen.crossed);
    };
    using Paths = std::vector<StraightPath>;
    EXPECT_EQ(report([](Moving&, Paths&) {}), std::pair(false, false));
    EXPECT_EQ(report([](Moving&, Paths& paths) { paths[9].y += 1.1e-3; }), std::pair(true, false));
    EXPECT_EQ(report([](Moving&, Paths& paths) { paths[9].y += 0.9e-3; }), std::pair(false, false));
    EXPECT_EQ(report([](Moving& m, Paths&) { m.rows.balls.rows[9].vz += 1.1e-3 / kStep; }), std::pair(true, false));
    EXPECT_EQ(report([](Moving& m, Paths&) { m.parameters.upper[1] = 0.5; }), std::pair(false, true));
    EXPECT_EQ(report([](Moving& m, Paths&) { m.rows.balls.rows[9].vz = std::nan(""); }).first, true);
  }
}

}  // namespace
}  // namespace grainclock::core
