// The loop that collects what pairs ask of their balls, against the same rules pair by pair.
#include "multirate/needs.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace grainclock::multirate {
namespace {

using core::Vec3;
using tests::Random;
using tests::same_bits;

constexpr std::size_t kBalls = 60, kPairs = 301;  // neither is a multiple of a block or a vector

/// Pairs in all states: deep, shallow, apart, approaching, receding.
struct Pairs {
  std::vector<std::uint32_t> i, j;
  std::vector<float> overlap, rate;
  std::vector<core::PairDirection> direction;
  std::vector<double> margin;
  std::vector<core::Path> paths;
  NeedParameters with{1e7, 0.0, 1.6e-3, 1e-4, 0.3, 0.0, true};

  explicit Pairs(bool both, double reach = 0.0) {
    Random random(7);
    with.both = both;
    with.reach = reach;
    with.per_unit = 50.0 / kMatrixUnit;
    for (std::size_t k = 0; k < kBalls; ++k) {
      core::Path path{random.between(-30, 30), random.between(-30, 30), random.between(-30, 30), random.between(0.01, 0.02)};
      paths.push_back(path);
      margin.push_back(random.between(1e-4, 2e-3));
    }
    for (std::size_t p = 0; p < kPairs; ++p) {
      i.push_back(static_cast<std::uint32_t>(random.below(kBalls)));
      j.push_back(static_cast<std::uint32_t>(random.below(kBalls)));
      overlap.push_back(static_cast<float>(random.between(-6e-3, 2e-3)));
      rate.push_back(static_cast<float>(random.between(-2.0, 2.0)));
      const double speed = std::abs(rate.back()) + random.between(0.0, 1.0);
      const double x = random.between(-1, 1), y = random.between(-1, 1), z = random.between(-1, 1);
      const double length = std::sqrt(x * x + y * y + z * z);
      const auto single = [](double value) { return static_cast<float>(value); };
      direction.push_back({single(x / length), single(y / length), single(z / length), single(speed)});
    }
  }
};

struct Found {
  std::vector<Level> level = std::vector<Level>(kPairs, 77);
  std::vector<Need> needs = std::vector<Need>(kBalls);
  bool operator==(const Found& o) const { return same_bits(level, o.level) && same_bits(needs, o.needs); }
};

Found find(Pairs& pairs, const core::Kernels& kernels) {
  Found out;
  const core::PairRecords records{pairs.overlap.data(), pairs.rate.data(), pairs.direction.data()};
  need_kernels_on(kernels).add({pairs.i.data(), pairs.j.data(), kPairs}, records, pairs.paths.data(), pairs.margin.data(),
                               pairs.with, out.level.data(), out.needs.data(), 0, 0, kPairs);
  return out;
}

/// classes.hpp's rules, one pair after the other.
Found expected(const Pairs& pairs) {
  Found out;
  for (std::size_t p = 0; p < kPairs; ++p) {
    const std::uint32_t i = pairs.i[p], j = pairs.j[p];
    const NeedParameters& w = pairs.with;
    const double overlap = pairs.overlap[p], rate = pairs.rate[p];
    const core::PairDirection& d = pairs.direction[p];
    const Vec3 n(d.x, d.y, d.z);
    const double gap = -overlap - w.reach;
    const double room = pairs.margin[i] + (w.both ? pairs.margin[j] : 0.0);
    out.level[p] = gap > double{d.speed} * w.interval + room ? kSkipped : Level{0};
    const bool is_far = gap > kAccelerating * std::max(rate, 0.0) * w.interval + w.soon;
    if (out.level[p] == kSkipped || (is_far && w.both)) continue;
    const core::Path none{};
    const core::Path &a = pairs.paths[i], &b = w.both ? pairs.paths[j] : none;
    const double acceleration = (a.ax - b.ax) * n.x() + (a.ay - b.ay) * n.y() + (a.az - b.az) * n.z();
    const double inverse_mass = a.inverse_mass + b.inverse_mass;
    const PairMotion<double> motion = motion_of(overlap, rate, acceleration, w.k * inverse_mass, w.speed2);
    const NormalMatrix nn = NormalMatrix::of(n.x(), n.y(), n.z(), inverse_mass * w.per_unit);
    const auto add = [&](Need& need) {
      for (int k = 0; k < 6; ++k) need.matrix[k] += nn.entry[k];
      double& urgency4 = motion.is_impact ? need.impact4 : need.smooth4;
      urgency4 = std::max(urgency4, is_far ? 0.0 : motion.urgency4);
    };
    add(out.needs[i]);
    if (w.both) add(out.needs[j]);
  }
  return out;
}

TEST(Needs, AreThoseOfThePairsOnEveryInstructionSet) {
  for (const bool both : {true, false}) {
    for (const double reach : {0.0, 1e-3}) {
      Pairs pairs(both, reach);
      const Found wanted = expected(pairs);
      for (const core::Kernels* kernels : core::runnable_kernels()) {
        EXPECT_TRUE(find(pairs, *kernels) == wanted) << kernels->name << ", both " << both << ", reach " << reach;
      }
      // The pairs are of all kinds.
      const auto skipped = std::count(wanted.level.begin(), wanted.level.end(), kSkipped);
      EXPECT_GT(skipped, 20);
      EXPECT_LT(skipped, static_cast<std::ptrdiff_t>(kPairs) - 100);
      const auto asking = [&](double Need::*urgency4) {
        return std::count_if(wanted.needs.begin(), wanted.needs.end(), [&](const Need& need) { return need.*urgency4 > 0.0; });
      };
      EXPECT_GT(asking(&Need::smooth4), 5);
      EXPECT_GT(asking(&Need::impact4), 5);
    }
  }
}

TEST(Needs, AShareOfThePairsLeavesTheOthersAlone) {
  Pairs pairs(true);
  const core::PairRecords records{pairs.overlap.data(), pairs.rate.data(), pairs.direction.data()};
  Found whole = find(pairs, core::kernels()), parts;
  for (const std::size_t cut : {std::size_t{0}, std::size_t{130}}) {
    const std::size_t end = cut == 0 ? 130 : kPairs;
    need_kernels_on(core::kernels()).add({pairs.i.data(), pairs.j.data(), kPairs}, records, pairs.paths.data(), pairs.margin.data(),
                                         pairs.with, parts.level.data(), parts.needs.data(), 0, cut, end);
    EXPECT_EQ(parts.level[130] == 77, cut == 0);
  }
  EXPECT_TRUE(parts == whole);
}

TEST(Needs, AreWrittenFromTheFirstRowOn) {
  Pairs pairs(true);
  const std::uint32_t first = 17;
  const Found whole = find(pairs, core::kernels());
  for (auto* rows : {&pairs.i, &pairs.j})
    for (std::uint32_t& row : *rows) row += first;
  pairs.paths.insert(pairs.paths.begin(), first, core::Path{});
  pairs.margin.insert(pairs.margin.begin(), first, 0.0);
  Found shifted;
  need_kernels_on(core::kernels()).add({pairs.i.data(), pairs.j.data(), kPairs},
                                       {pairs.overlap.data(), pairs.rate.data(), pairs.direction.data()}, pairs.paths.data(),
                                       pairs.margin.data(), pairs.with, shifted.level.data(), shifted.needs.data(), first, 0, kPairs);
  EXPECT_TRUE(shifted == whole);
}

/// Needs of balls about as stable at each level, in two parts and of fixed balls.
TEST(Needs, AreTakenByTheRulesOnEveryInstructionSet) {
  constexpr std::size_t kTaken = 45;  // whole vectors and some
  constexpr Level kCoarsest = 5;
  const core::ContactLaw ball_law{1e7, 2e4, 0.0, false}, fixed_law{1e9, 2e5, 0.0, false};
  std::vector<StepWeights> weights;
  for (Level l = 0; l <= kCoarsest; ++l) weights.emplace_back(std::ldexp(1e-4, l), ball_law, fixed_law, 1.0 / 50.0);
  Random random(11);
  std::vector<Need> parts[3];  // two of balls, one of fixed balls
  for (std::vector<Need>& part : parts) {
    for (std::size_t row = 0; row < kTaken; ++row) {
      Need need{};
      NormalMatrix sum;
      for (std::size_t k = random.below(4); k > 0; --k) {
        const Vec3 n = random.direction();
        sum += NormalMatrix::of(n.x(), n.y(), n.z(), std::pow(10.0, random.between(-2.0, 0.3)) / kMatrixUnit);
      }
      std::copy(sum.entry, sum.entry + 6, need.matrix);
      need.smooth4 = random.below(2) == 0 ? 0.0 : random.between(0.0, 1e12);
      need.impact4 = random.between(0.0, 1e12);
      part.push_back(need);
    }
  }
  for (const core::Kernels* kernels : core::runnable_kernels()) {
    for (const bool with_fixed : {true, false}) {
      for (const int balls : {0, 1, 2}) {
        std::vector<Need> own[3] = {parts[0], parts[1], parts[2]};
        Need* const of_balls[] = {own[0].data(), own[1].data()};
        std::vector<double> smooth4(kTaken), impact4(kTaken);
        std::vector<Level> level(kTaken);
        need_kernels_on(*kernels).take(of_balls, balls, with_fixed ? own[2].data() : nullptr, kTaken, weights.data(), kCoarsest,
                                       smooth4.data(), impact4.data(), level.data());
        std::set<Level> seen;
        for (std::size_t row = 0; row < kTaken; ++row) {
          ContactMatrix matrix;
          double smooth = 0.0, impact = 0.0;
          const auto take = [&](const Need& need, NormalMatrix& sum) {
            for (int k = 0; k < 6; ++k) sum.entry[k] += need.matrix[k];
            smooth = std::max(smooth, need.smooth4);
            impact = std::max(impact, need.impact4);
          };
          for (int t = 0; t < balls; ++t) take(parts[t][row], matrix.ball);
          if (with_fixed) take(parts[2][row], matrix.fixed);
          Level coarsest = kCoarsest;
          while (coarsest > 0 && !is_stable(matrix, weights[coarsest])) --coarsest;
          EXPECT_EQ(level[row], coarsest) << kernels->name << ", row " << row;
          EXPECT_EQ(smooth4[row], smooth);
          EXPECT_EQ(impact4[row], smooth > 0.0 ? impact / 81.0 : impact);  // kConfinedReach to the fourth power
          seen.insert(coarsest);
        }
        EXPECT_GT(seen.size(), with_fixed || balls > 0 ? 2U : 0U);  // of levels
        // None are left of those that were taken.
        for (int part = 0; part < 3; ++part) {
          const bool is_taken = part == 2 ? with_fixed : part < balls;
          EXPECT_TRUE(same_bits(own[part], is_taken ? std::vector<Need>(kTaken) : parts[part]));
        }
      }
    }
  }
}

}  // namespace
}  // namespace grainclock::multirate
