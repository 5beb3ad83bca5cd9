// Strays and their new lines: by hand at each rule's edge, by chance against all that could happen, and in a flowing silo.
#include "multirate/straight_paths.hpp"

#include "tests/support/silo_runs.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <set>

namespace grainclock::multirate {
namespace {

using core::BallRow;
using core::Kind;
using core::Vec3;
using tests::oblique;
using tests::Random;

constexpr double kInterval = 1.6e-3;                         // s, between regular renewals
constexpr double kStep = kInterval / 5;                      // s, the coarsest
constexpr double kRadius = 0.22, kDiameter = 2.0 * kRadius;  // m
constexpr double kSoonGap = kSoon * kDiameter;               // m
// m. Above the rounding of metres, 1e-16, and of recorded gaps of centimetres, 1e-9; far below what any rule allows for.
constexpr double kHair = 1e-7;

/// Of a ball.
struct Motion {
  Vec3 x, v;           // m, m/s
  double a = 0.0;      // m/s2
  double r = kRadius;  // m
};

core::AdvanceParameters wide_domain() {
  core::AdvanceParameters p{};
  p.step = kStep;
  for (int k = 0; k < 3; ++k) {
    p.lower[k] = -100.0;
    p.upper[k] = 100.0;
  }
  return p;
}

/// A few balls whose lines begin now, and pairs of them.
struct Flight {
  core::Balls balls;
  core::PairList pairs[2];
  PairBook books[2];
  double reach = 0.0;
  StraightPaths paths;

  explicit Flight(const std::vector<Motion>& content, const std::vector<Motion>& fixed = {}, int threads = 1)
      : paths(core::kernels(), wide_domain(), kInterval, kDiameter, threads) {
    core::State state;
    for (const bool moves : {true, false}) {
      for (const Motion& m : moves ? content : fixed) {
        state.add(static_cast<core::BallId>(state.size()), moves ? Kind::content : Kind::wall, m.x, m.v, m.r);
      }
    }
    balls = core::Balls(state, {}, true);
    for (std::uint32_t row = 0; row < content.size(); ++row) balls.rows[row].a = content[row].a;
    begin();
  }

  /// With a list that will do.
  void begin() {
    constexpr double kFar = std::numeric_limits<double>::infinity();
    paths.begin(balls, std::vector<core::SkinReference>(balls.content_count(), {0.0, 0.0, 0.0, kFar}));
  }

  /// Lists a pair that a renewal has skipped.
  void skip(std::uint32_t i, std::uint32_t j) { list(i, j, kSkipped, 1.0, 0.0); }
  /// Lists a pair that a renewal has given level 0, when it was so far apart and approached so fast.
  void keep(std::uint32_t i, std::uint32_t j, double gap, double rate) { list(i, j, 0, gap, rate); }

  void move(std::uint32_t row, const Motion& to) {
    balls.rows[row] = {to.x.x(), to.x.y(), to.x.z(), to.r, to.v.x(), to.v.y(), to.v.z(), to.a};
  }
  bool redirect(double seconds) {
    core::PairList whole[2] = {pairs[0], pairs[1]};
    PairsByBall by_ball[2];
    for (const bool fixed : {false, true}) {
      whole[fixed].finish(balls.far_row());
      by_ball[fixed].begin(whole[fixed], balls.content_count());
    }
    return paths.redirect_strays(
        balls, {{whole[0], by_ball[0], books[0], false, reach}, {whole[1], by_ball[1], books[1], true, reach}}, seconds);
  }
  bool has_strays(double seconds) const { return paths.watch(balls, seconds).list_unsafe; }

 private:
  void list(std::uint32_t i, std::uint32_t j, Level level, double gap, double rate) {
    const bool fixed = j > balls.far_row();
    core::PairList& its = pairs[fixed];
    const auto at = std::upper_bound(its.i.begin(), its.i.end(), i) - its.i.begin();  // lists are in order of i
    const auto insert = [at](auto& values, auto value) { values.insert(values.begin() + at, value); };
    insert(its.i, i);
    insert(its.j, j);
    insert(books[fixed].level, level);
    insert(books[fixed].overlap, static_cast<float>(-gap));
    insert(books[fixed].rate, static_cast<float>(rate));
  }
};

/// How far a ball of this acceleration [m/s2] may stray [m].
double margin_at(double a) { return Flight({{Vec3::Zero(), Vec3::Zero(), a}}).paths.margin()[0]; }
/// How far from where its line began lists have looked for what a ball of this speed [m/s] could touch [m].
double outlook_at(double speed) { return margin_at(0.0) + StraightPaths::look_ahead(kInterval) * speed; }

/// Where a line is.
Motion after(double seconds, const Motion& from) { return {from.x + seconds * from.v, from.v, from.a, from.r}; }
/// Where a line that is here now began.
Motion before(double seconds, const Motion& now) { return after(-seconds, now); }
/// As far off a line as no ball may be.
Vec3 well_off() { return 3.0 * margin_at(0.0) * Vec3::UnitY(); }

TEST(StraightPaths, MarginsGrowWithAccelerationUpToTwice) {
  const double least = margin_at(0.0);
  EXPECT_GT(least, 0.0);
  const double a = least / (kInterval * kInterval);  // in an interval it takes a ball half the least margin off its line
  EXPECT_DOUBLE_EQ(margin_at(a), 1.5 * least);
  EXPECT_EQ(margin_at(4.0 * a), 2.0 * least);
}

TEST(StraightPaths, WatchSeesWhoIsOffOrWillBeAStepLater) {
  const Motion begun{Vec3(0.1, -0.2, 0.3), Vec3(4.0, -3.0, 5.0)};
  const double seconds = 2.0 * kStep, margin = margin_at(0.0);
  for (const double side : {1.0 - 1e-6, 1.0 + 1e-6}) {  // rounding of metres: 1e-13 of the margin
    const Vec3 off = side * margin * oblique();
    Flight now({begun}), soon({begun}), back({begun});
    const Motion there = after(seconds, begun);
    now.move(0, {there.x + off, there.v});
    soon.move(0, {there.x, there.v + off / kStep});
    back.move(0, {there.x + off, there.v - off / kStep});  // on the line again after the step
    for (const Flight* flight : {&now, &soon, &back}) EXPECT_EQ(flight->has_strays(seconds), side > 1.0);
  }
}

TEST(StraightPaths, WatchSeesWhoLeavesTheDomain) {
  Flight flight({{Vec3(99.9, 0.0, 0.0), Vec3(1000.0, 0.0, 0.0)}});
  EXPECT_FALSE(flight.paths.watch(flight.balls, 0.0).crossed);
  flight.move(0, {Vec3(100.5, 0.0, 0.0), Vec3(1000.0, 0.0, 0.0)});
  EXPECT_TRUE(flight.paths.watch(flight.balls, 6e-4).crossed);
  EXPECT_FALSE(flight.has_strays(6e-4));
}

TEST(StraightPaths, AStrayFarFromAllGoesOnAlongAnotherLine) {
  const Motion begun{Vec3(1.0, 2.0, 3.0), Vec3(10.0, 0.0, 0.0)};
  for (const int threads : {1, 2, 3}) {
    Flight flight({begun, {Vec3(1.0, 4.0, 3.0), begun.v}}, {{Vec3(1.0, 0.0, 3.0), Vec3::Zero()}}, threads);
    flight.skip(0, 1);
    flight.skip(0, 3);
    const double seconds = 2.0 * kStep;
    const Motion now{after(seconds, begun).x + well_off(), Vec3(9.0, 1.0, 2.0), 100.0};
    flight.move(0, now);
    flight.move(1, after(seconds, {Vec3(1.0, 4.0, 3.0), begun.v}));
    EXPECT_TRUE(flight.has_strays(seconds));
    EXPECT_TRUE(flight.redirect(seconds));
    EXPECT_FALSE(flight.has_strays(seconds));
    EXPECT_EQ(flight.paths.margin()[0], margin_at(100.0));
    EXPECT_EQ(flight.paths.margin()[1], margin_at(0.0));
    // Later it is expected on the new line, with the new margin, and no longer on the old one.
    const double later = seconds + kStep;
    flight.move(1, after(later, {Vec3(1.0, 4.0, 3.0), begun.v}));
    for (const double side : {1.0 - 1e-6, 1.0 + 1e-6}) {
      flight.move(0, {after(kStep, now).x + side * margin_at(100.0) * oblique(), now.v});
      EXPECT_EQ(flight.has_strays(later), side > 1.0);
    }
    flight.move(0, after(later, begun));
    EXPECT_TRUE(flight.has_strays(later));
  }
}

TEST(StraightPaths, StraysAreFoundAmongManyAndOthersKeepTheirLines) {
  const std::vector<std::uint32_t> strays{0, 63, 64, 127, 128, 129};
  std::vector<Motion> begun;
  for (int k = 0; k < 130; ++k) begun.push_back({Vec3(k % 10, k / 10, 0.0), Vec3(0.0, 0.0, 10.0)});
  Flight flight(begun);
  const double seconds = kStep, most = 0.9 * margin_at(0.0);
  const auto move_all = [&](double off) {
    for (std::uint32_t row = 0; row < begun.size(); ++row) {
      const bool strays_now = std::count(strays.begin(), strays.end(), row) > 0;
      flight.move(row, {after(seconds, begun[row]).x + (strays_now ? well_off() : Vec3(off, 0.0, 0.0)), begun[row].v});
    }
  };
  move_all(most);
  EXPECT_TRUE(flight.redirect(seconds));
  EXPECT_FALSE(flight.has_strays(seconds));
  move_all(-most);  // twice that from where they were
  EXPECT_FALSE(flight.has_strays(seconds));
}

/// A stray in motion `now`, from a line that began at `begun`, and its partner, content or fixed: how a renewal saw them.
struct Encounter {
  static constexpr double kSeconds = 2.0 * kStep, kLeft = kInterval - kSeconds;
  Motion begun{Vec3(0.3, -0.4, 0.5), Vec3(12.0, 0.0, 0.0)};
  Motion now{after(kSeconds, begun).x + well_off(), Vec3(11.0, 3.0, 0.0), 100.0};
  Vec3 partner_speed;
  bool fixed, is_second;  // the partner is fixed; the stray is the pair's second ball
  double reach;

  Vec3 relative_velocity() const { return now.v - partner_speed; }
  double margins() const { return margin_at(now.a) + (fixed ? 0.0 : margin_at(30.0)); }
  /// Whether the stray may go on when its partner's line is now `gap` away in direction `to`.
  template <class List>
  bool goes_on(double gap, const Vec3& to, List list) const {
    // Where the partner is on its line, and that it is not quite there, must not matter.
    const Motion partner{now.x + (now.r + 0.3 + reach + gap) * to, partner_speed, 30.0, 0.3};
    const Vec3 off = 0.5 * margin_at(30.0) * oblique();
    std::vector<Motion> content{begun};
    if (!fixed) content.insert(is_second ? content.begin() : content.end(), before(kSeconds, partner));
    Flight flight(content, fixed ? std::vector<Motion>{partner} : std::vector<Motion>{});
    flight.reach = reach;
    const std::uint32_t stray = is_second ? 1 : 0, other = fixed ? flight.balls.first_fixed_row() : 1 - stray;
    list(flight, std::min(stray, other), std::max(stray, other));
    flight.move(stray, now);
    if (!fixed) flight.move(other, {partner.x + off, partner.v, partner.a, partner.r});
    EXPECT_TRUE(flight.has_strays(kSeconds));
    return flight.redirect(kSeconds);
  }
};

/// Calls judge(encounter) for partners of all kinds.
template <class Judge>
void for_all_encounters(Judge judge) {
  for (const double reach : {0.0, 2e-3}) {
    for (const bool is_second : {false, true})
      judge(Encounter{.partner_speed = Vec3(-4.0, 1.0, 2.0), .fixed = false, .is_second = is_second, .reach = reach});
    judge(Encounter{.partner_speed = Vec3::Zero(), .fixed = true, .is_second = false, .reach = reach});
  }
}

TEST(StraightPaths, NoStrayMayTouchASkippedPartner) {
  for_all_encounters([](const Encounter& its) {
    SCOPED_TRACE(testing::Message() << "fixed " << its.fixed << ", second " << its.is_second << ", reach " << its.reach);
    const auto list = [](Flight& flight, std::uint32_t i, std::uint32_t j) { flight.skip(i, j); };
    const double edge = its.relative_velocity().norm() * its.kLeft + its.margins();
    // Whichever way it goes: balls of a pair that is not evaluated may turn.
    for (const Vec3& to : {oblique(), Vec3(-oblique()), Vec3(its.relative_velocity().normalized())}) {
      EXPECT_TRUE(its.goes_on(edge + kHair, to, list));
      EXPECT_FALSE(its.goes_on(edge - kHair, to, list));
    }
  });
}

TEST(StraightPaths, NoStrayMayBringAPairWithinReach) {
  for_all_encounters([](const Encounter& its) {
    SCOPED_TRACE(testing::Message() << "fixed " << its.fixed << ", second " << its.is_second << ", reach " << its.reach);
    const auto was_far = [&](Flight& flight, std::uint32_t i, std::uint32_t j) {
      flight.keep(i, j, its.reach + 2.0 * kSoonGap, 0.0);
    };
    const Vec3 approaching = its.relative_velocity().normalized();
    for (const Vec3& to : {approaching, oblique(), Vec3(-approaching)}) {
      const double edge = kAccelerating * std::max(0.0, its.relative_velocity().dot(to)) * its.kLeft + kSoonGap;
      EXPECT_TRUE(its.goes_on(edge + kHair, to, was_far));
      EXPECT_FALSE(its.goes_on(edge - kHair, to, was_far));
    }
  });
}

TEST(StraightPaths, APairWithinReachMayComeCloser) {
  for_all_encounters([](const Encounter& its) {
    SCOPED_TRACE(testing::Message() << "fixed " << its.fixed << ", second " << its.is_second << ", reach " << its.reach);
    for (const double rate : {2.0, -2.0}) {
      const double edge = kAccelerating * std::max(0.0, rate) * kInterval + kSoonGap;
      for (const double side : {-kHair, kHair}) {
        const auto list = [&](Flight& flight, std::uint32_t i, std::uint32_t j) {
          flight.keep(i, j, its.reach + edge + side, rate);
        };
        EXPECT_EQ(its.goes_on(0.1 * kSoonGap, oblique(), list), side < 0.0);
        EXPECT_EQ(its.goes_on(-1e-3, oblique(), list), side < 0.0);
      }
    }
  });
}

TEST(StraightPaths, PairsOfOthersDoNotMatter) {
  const Motion begun{Vec3::Zero(), Vec3(10.0, 0.0, 0.0)}, other{Vec3(2.0, 0.0, 0.0), begun.v};
  const Motion near{other.x + kDiameter * oblique(), begun.v};
  const auto off = [](double seconds, const Motion& of) { return Motion{after(seconds, of).x + well_off(), of.v}; };
  for (const bool has_strayed_before : {false, true}) {
    Flight flight({begun, other, near});
    flight.move(0, after(kStep, begun));
    flight.move(1, has_strayed_before ? off(kStep, other) : after(kStep, other));
    flight.move(2, after(kStep, near));
    EXPECT_TRUE(flight.redirect(kStep));
    flight.skip(1, 2);  // as no renewal would
    flight.move(0, off(2.0 * kStep, begun));
    flight.move(1, after(kStep, {position(flight.balls.rows[1]), begun.v}));
    flight.move(2, after(2.0 * kStep, near));
    EXPECT_TRUE(flight.redirect(2.0 * kStep));
  }
}

TEST(StraightPaths, AllPairsOfAStrayAreAsked) {
  constexpr std::size_t kPartners = 11;
  const Motion begun{Vec3::Zero(), Vec3(10.0, 0.0, 0.0)};
  for (const bool fixed : {false, true}) {
    for (const int threads : {1, 2, 3}) {
      for (std::size_t near = 0; near <= kPartners; ++near) {  // the last: none
        SCOPED_TRACE(testing::Message() << "fixed " << fixed << ", " << threads << " threads, near " << near);
        std::vector<Motion> content{begun}, partners;
        for (std::size_t k = 0; k < kPartners; ++k) {
          partners.push_back({Vec3(k == near ? kDiameter + 0.01 : 1.0, 0.0, 1e-3 * static_cast<double>(k)), Vec3::Zero()});
        }
        if (!fixed) content.insert(content.end(), partners.begin(), partners.end());
        Flight flight(content, fixed ? partners : std::vector<Motion>{}, threads);
        for (std::uint32_t k = 0; k < kPartners; ++k) flight.skip(0, k + (fixed ? flight.balls.first_fixed_row() : 1));
        flight.move(0, {after(kStep, begun).x + well_off(), begun.v});
        EXPECT_EQ(flight.redirect(kStep), near == kPartners);
      }
    }
  }
}

TEST(StraightPaths, NoStrayMayOutrunWhatTheListLookedAt) {
  const double seconds = 3.0 * kStep, left = kInterval - seconds;
  for (const double speed : {10.0, 30.0}) {
    const Motion begun{Vec3(0.3, -0.4, 0.5), speed * Vec3::UnitX()};
    const Vec3 now = Vec3(0.3, 0.5, -0.2) * speed;
    const double edge = outlook_at(speed) - margin_at(50.0) - kAccelerating * left * now.norm();
    for (const double side : {-kHair, kHair}) {
      for (const Vec3& to : {oblique(), Vec3(-oblique())}) {
        Flight flight({begun});
        flight.move(0, {begun.x + (edge + side) * to, now, 50.0});
        EXPECT_TRUE(flight.has_strays(seconds));
        EXPECT_EQ(flight.redirect(seconds), side < 0.0);
      }
    }
  }
  // For a ball at rest no list looks ahead.
  Flight resting({{Vec3::Zero(), Vec3::Zero()}});
  resting.move(0, {1.01 * margin_at(0.0) * oblique(), Vec3::Zero()});
  EXPECT_FALSE(resting.redirect(kStep));
}

TEST(StraightPaths, StrayingTwiceUsesUpTheOutlook) {
  const Motion begun{Vec3(0.3, -0.4, 0.5), Vec3(20.0, 0.0, 0.0)};
  const Motion first{after(kStep, begun).x + 3.0 * well_off(), Vec3(18.0, 4.0, -3.0)};
  const Vec3 new_start = before(kStep, first).x, used = new_start - begun.x;
  const double seconds = 3.0 * kStep, margin = margin_at(0.0);
  const Vec3 now(-10.0, 5.0, 0.0);
  const double needed = margin + kAccelerating * (kInterval - seconds) * now.norm();
  const double edge = outlook_at(begun.v.norm()) - used.norm() - needed;
  for (const double side : {-kHair, kHair}) {
    Flight flight({begun});
    flight.move(0, first);
    EXPECT_TRUE(flight.redirect(kStep));
    // On the way back: from where it began it would be seen easily.
    const Vec3 there = new_start - (edge + side) * used.normalized();
    EXPECT_LT((there - begun.x).norm() + needed, outlook_at(begun.v.norm()) - margin);
    flight.move(0, {there, now});
    EXPECT_TRUE(flight.has_strays(seconds));
    EXPECT_EQ(flight.redirect(seconds), side < 0.0);
  }
}

TEST(StraightPaths, ARenewalBeginsAnew) {
  const Motion begun{Vec3(0.3, -0.4, 0.5), Vec3(20.0, 0.0, 0.0)};
  Flight flight({begun});
  Motion now = begun;
  for (int renewal = 0; renewal < 20; ++renewal) {  // one outlook would last for a few
    now = {after(kStep, now).x + well_off(), now.v};
    flight.move(0, now);
    EXPECT_TRUE(flight.redirect(kStep));
    flight.begin();
    EXPECT_FALSE(flight.has_strays(0.0));
  }
}

TEST(StraightPaths, WhatIsNoNumberHasNoLine) {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN(), kInfinite = std::numeric_limits<double>::infinity();
  const Motion begun{Vec3::Zero(), Vec3(10.0, 0.0, 0.0)};
  for (const double wrong : {kNone, kInfinite, -kInfinite}) {
    for (int k = 0; k < 6; ++k) {
      for (const bool is_paired : {false, true}) {
        Flight flight({begun, {Vec3(2.0, 0.0, 0.0), Vec3::Zero()}});
        if (is_paired) flight.skip(0, 1);
        Motion now = after(kStep, begun);
        (k < 3 ? now.x : now.v)[k % 3] = wrong;
        flight.move(0, now);
        EXPECT_TRUE(flight.has_strays(kStep));
        EXPECT_FALSE(flight.redirect(kStep));
      }
    }
  }
}

TEST(ListWear, BallsMustStayWithinTheirSkinsWhileTheListLooksAhead) {
  const Motion ball{Vec3(0.3, -0.4, 0.5), Vec3(3.0, -2.0, 6.0), 80.0}, resting{Vec3::Zero(), Vec3::Zero()};
  const double ahead = StraightPaths::look_ahead(kInterval) * ball.v.norm();
  const auto is_worn = [&](double radius, const Vec3& away, const Vec3& v, int threads) {
    Flight flight({resting, {ball.x, v, ball.a}}, {}, threads);
    const Vec3 reference = ball.x - away;
    return flight.paths.begin(flight.balls,
                              {{0.0, 0.0, 0.0, 1.0}, {reference.x(), reference.y(), reference.z(), radius * radius}});
  };
  for (const int threads : {1, 2, 3}) {
    for (const double moved : {0.0, 5e-3}) {
      const double edge = moved + margin_at(ball.a) + ahead;
      EXPECT_FALSE(is_worn(edge + kHair, moved * oblique(), ball.v, threads));
      EXPECT_TRUE(is_worn(edge - kHair, moved * oblique(), ball.v, threads));
    }
    // A skin smaller than what lies ahead does not do, however far that goes below zero.
    EXPECT_TRUE(is_worn(1e-3, 1e-3 * oblique(), ball.v, threads));
    const double none = std::numeric_limits<double>::quiet_NaN();
    EXPECT_TRUE(is_worn(1.0, Vec3(none, 0.0, 0.0), ball.v, threads));
    EXPECT_TRUE(is_worn(1.0, Vec3::Zero(), Vec3(0.0, none, 0.0), threads));
  }
}

/// Balls here and there that stray again and again until classes would have to be renewed.
class Scatter {
 public:
  explicit Scatter(std::uint32_t seed) : random_(seed) {
    reach_ = random_.below(2) == 0 ? 0.0 : 1e-3;
    for (int b = 0; b < 24; ++b)
      begun_.push_back({random_.in_cube(0.6), random_.in_cube(12.0), random_.between(0.0, 500.0)});
    for (int b = 0; b < 8; ++b) fixed_.push_back({random_.in_cube(0.6), Vec3::Zero()});
    for (int k = 1; k < 5; ++k) {
      Tick tick{k * kStep, std::vector<Motion>(begun_.size())};
      for (Motion& off : tick.off) {
        // Off the lines by less than half the margin, or by more than it.
        const bool strays = random_.below(12) == 0;
        const double a = random_.between(0.0, 500.0);
        off = strays ? Motion{random_.between(2.1, 4.0) * least_ * random_.direction(), random_.in_cube(1.0), a}
                     : Motion{random_.between(0.0, 0.5) * least_ * random_.direction(), Vec3::Zero(), a};
        tick.strays += strays ? 1 : 0;
      }
      ticks_.push_back(tick);
    }
  }

  /// The answers of each step with strays, to the first no. With all pairs listed, or those that must be; each yes is
  /// held against what could happen until the next renewal.
  std::vector<bool> answers(bool are_all_listed, int threads) const {
    Flight flight(begun_, fixed_, threads);
    flight.reach = reach_;
    std::vector<Motion> lines = begun_;  // where they were or would have been at the renewal
    const std::vector<Listed> listed = list(flight, are_all_listed);
    std::vector<bool> out;
    for (const Tick& tick : ticks_) {
      std::vector<Motion> next = lines;
      for (std::uint32_t row = 0; row < lines.size(); ++row) {
        const Motion &line = lines[row], &off = tick.off[row];
        const Motion now{after(tick.seconds, line).x + off.x, line.v + off.v, off.a};
        flight.move(row, now);
        if (off.x.norm() > least_) next[row] = before(tick.seconds, now);
      }
      EXPECT_EQ(flight.has_strays(tick.seconds), tick.strays > 0);
      if (tick.strays == 0) continue;
      out.push_back(flight.redirect(tick.seconds));
      if (!out.back()) break;
      EXPECT_FALSE(flight.has_strays(tick.seconds));
      lines = next;
      expect_none_can_touch(flight, lines, tick.seconds, listed);
    }
    return out;
  }

 private:
  struct Tick {
    double seconds;
    std::vector<Motion> off;
    int strays = 0;
  };
  struct Listed {
    std::uint32_t i, j;
    bool skipped;
  };

  /// All pairs and whether a renewal skips them; lists those that may be within each other's outlook, or all.
  std::vector<Listed> list(Flight& flight, bool are_all) const {
    std::vector<Listed> out;
    const auto& rows = flight.balls.rows;
    for (std::uint32_t i = 0; i < begun_.size(); ++i) {
      for (std::uint32_t j = i + 1; j < rows.size(); ++j) {
        if (j == flight.balls.far_row()) continue;
        const Vec3 apart = position(rows[i]) - position(rows[j]), speed = velocity(rows[i]) - velocity(rows[j]);
        const double gap = apart.norm() - kDiameter, room = margin(flight, i) + margin(flight, j);
        const bool skipped = gap - reach_ > speed.norm() * kInterval + room;
        const double ahead = StraightPaths::look_ahead(kInterval) * (velocity(rows[i]).norm() + velocity(rows[j]).norm());
        out.push_back({i, j, skipped});
        if (!skipped) flight.keep(i, j, gap, -apart.dot(speed) / apart.norm());
        if (skipped && (are_all || gap - reach_ <= room + ahead)) flight.skip(i, j);
      }
    }
    return out;
  }
  static double margin(const Flight& flight, std::uint32_t row) {
    return row < flight.balls.far_row() ? flight.paths.margin()[row] : 0.0;
  }
  void expect_none_can_touch(const Flight& flight, const std::vector<Motion>& lines, double seconds,
                             const std::vector<Listed>& listed) const {
    for (const auto& [i, j, skipped] : listed) {
      if (!skipped) continue;
      const Motion other = j < lines.size() ? lines[j] : Motion{position(flight.balls.rows[j]), Vec3::Zero()};
      const Vec3 apart = after(seconds, lines[i]).x - after(seconds, other).x, speed = lines[i].v - other.v;
      const double nearest = std::clamp(-apart.dot(speed) / speed.squaredNorm(), 0.0, kInterval - seconds);
      const double gap = (apart + nearest * speed).norm() - kDiameter - reach_ - margin(flight, i) - margin(flight, j);
      EXPECT_GT(gap, -1e-14) << "balls " << i << " and " << j;  // rounding of metres
    }
  }

  const double least_ = margin_at(0.0);
  Random random_;
  double reach_ = 0.0;
  std::vector<Motion> begun_;
  std::vector<Motion> fixed_;
  std::vector<Tick> ticks_;
};

TEST(StraightPaths, AnswersAreSafeAndFurtherPairsDoNotMatter) {
  std::size_t yes = 0, no = 0;
  for (std::uint32_t seed = 1; seed <= 2000 && !HasFailure(); ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    const Scatter scatter(seed);
    const std::vector<bool> answers = scatter.answers(false, 1);
    EXPECT_EQ(answers, scatter.answers(true, 1));
    for (const bool goes_on : answers) ++(goes_on ? yes : no);
  }
  // Or the trials would show nothing.
  EXPECT_GT(yes, 1000U);
  EXPECT_GT(no, 200U);
}

TEST(StraightPaths, ThreadsDoNotMatter) {
  for (std::uint32_t seed = 1; seed <= 8; ++seed) {
    SCOPED_TRACE(testing::Message() << "seed " << seed);
    const Scatter scatter(seed);
    const std::vector<bool> answers = scatter.answers(true, 1);
    for (const int threads : {2, 3}) EXPECT_EQ(scatter.answers(true, threads), answers) << threads << " threads";
  }
}

/// What a selective run does at the last tick of its coarse steps, seen through its kernels.
struct LastTick {
  std::vector<BallRow> rows;                                // of balls and fixed balls
  std::set<std::pair<std::uint32_t, std::uint32_t>> pairs;  // that were evaluated with weight
  bool has_strays = false, crossed = false;
  bool is_over = true;  // until the next last tick
  std::size_t content, all;
  bool is_blind;  // strays are not reported

  void add(core::PairSpan span, const std::uint8_t* level) {
    if (is_over) return;
    for (std::size_t p = 0; p < span.n; ++p) {
      if (level == nullptr || level[p] != core::kNoWeight) pairs.emplace(span.i[p], span.j[p]);
    }
  }
  /// Pairs that touch and were not evaluated.
  std::size_t missed() const {
    core::Balls balls;
    balls.rows = rows;
    balls.inverse_mass.resize(content);
    const auto touching = core::brute_force_pairs(balls, 0.0);
    EXPECT_GT(touching.size(), 50U);
    return static_cast<std::size_t>(
        std::count_if(touching.begin(), touching.end(), [&](const auto& pair) { return !pairs.contains(pair); }));
  }
};
LastTick last_tick;

core::AdvanceReport watch_seen(const BallRow* rows, const core::StraightPath* expected, double seconds,
                               const core::AdvanceParameters& p, std::size_t begin, std::size_t end) {
  core::AdvanceReport report = core::kernels().watch(rows, expected, seconds, p, begin, end);
  if (last_tick.is_blind) report.list_unsafe = false;
  if (last_tick.is_over) {  // looks at some of the rows follow
    last_tick.rows.assign(rows, rows + last_tick.all);
    last_tick.content = end;
    last_tick.pairs.clear();
    last_tick.has_strays = report.list_unsafe;
    last_tick.crossed = report.crossed;
    last_tick.is_over = false;
  }
  return report;
}
void sweep_seen(const BallRow* rows, core::PairSpan pairs, const core::SweepLaw& law, int shift, core::WeightedSum* sums,
                core::SweepTotals& totals, core::Candidates* candidates) {
  last_tick.add(pairs, nullptr);
  core::kernels().sweep_weighted(rows, pairs, law, shift, sums, totals, candidates);
}
void record_seen(const BallRow* rows, core::PairSpan pairs, const core::SweepLaw& law, const std::uint8_t* level,
                 core::PairRecords records, core::WeightedSum* sums, core::SweepTotals& totals,
                 core::Candidates& candidates) {
  last_tick.add(pairs, level);
  core::kernels().record(rows, pairs, law, level, records, sums, totals, candidates);
}
void kick_seen(BallRow* rows, core::Path* paths, core::IntVec* balance, core::IntVec* opening, const std::uint8_t* level,
               core::WeightedSum* sums, std::size_t stride, int parts, core::RowSpan which, const core::KickParameters& p) {
  last_tick.is_over = true;
  core::kernels().kick(rows, paths, balance, opening, level, sums, stride, parts, which, p);
}

struct Seen {
  std::size_t touching_missed = 0;
  std::size_t redirected = 0, renewed = 0;  // steps with strays after which classes were kept, or renewed before time
  std::uint64_t missed_contacts = 0;
};

/// The flowing silo; every ball has got up to `by` [m/s] along each axis.
core::State shaken(double by) {
  core::State state = tests::flowing_silo();
  Random random(1);
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] == Kind::content) state.velocity[i] += random.in_cube(by);
  }
  return state;
}

/// 600 coarse steps, each with a look at what it does.
Seen watch_flow(const core::State& start, bool is_blind) {
  core::Kernels kernels = core::kernels();
  kernels.watch = watch_seen;
  kernels.sweep_weighted = sweep_seen;
  kernels.record = record_seen;
  kernels.kick = kick_seen;
  core::StepperSetup setup = tests::silo_setup(core::Method::multirate, 3.2e-4, true);
  setup.kernels = &kernels;
  const auto stepper = make_multirate_stepper(start, setup);
  last_tick = {};
  last_tick.is_blind = is_blind;
  Seen seen;
  for (int k = 0; k < 600; ++k) {
    const core::State state = stepper->state();
    last_tick.all = state.count(Kind::content) + 1 + state.count(Kind::wall);
    stepper->advance(1);
    seen.touching_missed += last_tick.missed();
    const bool is_due = stepper->steps_done() % tests::renew_every(*stepper) == 0 || last_tick.crossed;
    if (is_due || !last_tick.has_strays) {
      EXPECT_EQ(stepper->is_checkpointable(), is_due);
    } else {
      ++(stepper->is_checkpointable() ? seen.renewed : seen.redirected);
    }
  }
  seen.missed_contacts = stepper->costs().missed_contacts;
  return seen;
}

TEST(StraightPaths, InAFlowStraysGoOnAndNoContactIsMissed) {
  for (const double by : {0.0, 15.0}) {
    const Seen seen = watch_flow(shaken(by), false);
    EXPECT_EQ(seen.touching_missed, 0U);
    EXPECT_EQ(seen.missed_contacts, 0U);
    EXPECT_GT(seen.redirected, 10U);
    EXPECT_GT(seen.renewed, 10U);
  }
  // If nobody looked for strays, some would be.
  const Seen blind = watch_flow(shaken(15.0), true);
  EXPECT_GT(blind.touching_missed, 0U);
  EXPECT_GT(blind.missed_contacts, 0U);
}

}  // namespace
}  // namespace grainclock::multirate
