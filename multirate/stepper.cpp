// Strategy *accumulate*: a contact is evaluated at the finer level of its two balls, the coarser ball taken on
// the very path that it will take (x + t v + t2/2 a, velocity v + t a). The finer ball takes its impulse at its
// own step end; the equal and opposite impulse waits on the coarser ball's balance and is paid at that ball's
// own step end, with the same quadrature weights.
//
// Per ball, in integers (force units times half ticks): a step opens with balance = sum_c w_c F_c - W F, where w_c = 2^level
// of contact c, W = 2^(own level + 1) and F the force sum that the path takes as constant; evaluations within the
// step add 2 w_c F_c, the closing one w_c F_c. What the velocity gains beyond v + H a is the balance over
// the mass: the trapezoid rule on each contact's own time grid. Both balls of a contact get the same integers, so momentum,
// balances included, is exact to rounding of the velocities.
//
// A renewal of classes: one evaluation of all listed pairs closes every step and says what pairs ask of their balls
// (needs.hpp). Balances and ledger carry over for pairs that keep their level; only those that change are evaluated again,
// with the same integers, and paid the difference of their weights.
#include "multirate/stepper.hpp"

#include "core/ball_stepper.hpp"
#include "core/candidate_list.hpp"
#include "core/check.hpp"
#include "core/critical_step.hpp"
#include "core/order_free_sum.hpp"
#include "multirate/limiter.hpp"
#include "multirate/pair_book.hpp"
#include "multirate/schedule.hpp"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace grainclock::multirate {

namespace {

using core::BallRow;
using core::IntVec;
using core::PairList;
using core::SweepTotals;
using core::Vec3;

constexpr double kMargin = 2.4e-3; // mean diameters that a ball may stray from its straight path between renewals
constexpr double kAhead = 1.1 * kAccelerating;  // intervals between renewals that lists look ahead
constexpr double kSoon = 2.5e-4;   // mean diameters: gaps below it count as about to close
constexpr std::size_t kWorthThreads = 1024;  // pairs or balls
constexpr std::uint32_t kRowsAtOnce = 128;   // rows whose needs from fixed balls are found together
constexpr double kReachRoom = 1.0 + 1e-6;    // recorded overlaps are rounded to seven digits
// Speeds below these shares of sqrt(g d) and of omega d need not be resolved relative to themselves.
constexpr double kQuiet = 0.05, kStill = 1e-6;
constexpr int kMostCoarseSteps = 6;     // between regular renewals
constexpr double kRenewalPhase = 1.25;  // omega times the time between renewals, of two mean balls

constexpr double fourth(double x) { return (x * x) * (x * x); }

/// 1/s4, of a ball's impacts, eased where other contacts hold it.
double eased_impact4(double impact4, double smooth4) {
  return smooth4 > 0.0 ? impact4 / fourth(kConfinedReach) : impact4;
}

/// Contacts of one level, contiguous.
struct Batch {
  PairList ball, fixed;
  PairList& pairs(bool with_fixed) { return with_fixed ? fixed : ball; }
};

/// Pairs that change level at a renewal, whole vectors.
struct ChangedPairs {
  PairList pairs;
  std::vector<Level> from, to;

  void clear() {
    pairs.clear();
    from.clear();
    to.clear();
  }
  void add(std::uint32_t i, std::uint32_t j, Level its_from, Level its_to) {
    pairs.add(i, j);
    from.push_back(its_from);
    to.push_back(its_to);
  }
  void finish(std::uint32_t far) {
    pairs.finish(far);
    from.resize(pairs.i.size(), kSkipped);
    to.resize(pairs.i.size(), kSkipped);
  }
};

using LevelCount = std::array<std::size_t, kMostLevels + 1>;  // the last: skipped

/// Lowers a level that several threads may lower at once.
void lower(Level& level, Level to) {
  std::atomic_ref<Level> shared(level);
  Level now = shared.load(std::memory_order_relaxed);
  while (to < now && !shared.compare_exchange_weak(now, to, std::memory_order_relaxed)) {
  }
}

/// 1/s4, what a ball's smooth pairs and its impacts ask of its step, see classes.hpp.
struct Urgency {
  double smooth4 = 0.0, impact4 = 0.0;
};

/// Circular frequency of two undamped balls of this diameter in contact [1/s].
double omega(const core::Materials& materials, double diameter) {
  return std::sqrt(2.0 * materials.ball.k / materials.mass(0.5 * diameter));
}

/// Coarse steps between regular renewals of classes: while a pulse passes few balls only.
int renew_every(const core::Materials& materials, double diameter, double coarsest_step) {
  return std::clamp(static_cast<int>(kRenewalPhase / (omega(materials, diameter) * coarsest_step)), 1, kMostCoarseSteps);
}

class MultirateStepper final : public core::BallStepper {
 public:
  MultirateStepper(const core::State& state, const core::StepperSetup& setup)
      : BallStepper(state, setup, setup.stepping.levels, kAhead * kMostCoarseSteps * *setup.stepping.step),
        ladder_(step_, setup.stepping.levels),
        renew_every_(renew_every(setup.materials, length_scale_, step_)),
        interval_(renew_every_ * step_),
        events_(setup.stepping.events),
        event_books_(static_cast<std::size_t>(std::max(1, setup.threads)), core::EventBook(scale_, 0.5 * ladder_.tick())),
        threads_(std::max(1, setup.threads)),
        advance_(advance_parameters()),
        add_needs_(add_needs_on(*setup.kernels)),
        drifted_(static_cast<std::size_t>(ladder_.levels())),
        totals_(static_cast<std::size_t>(threads_)),
        found_(static_cast<std::size_t>(threads_)),
        needs_(static_cast<std::size_t>(threads_)),
        beyond_(static_cast<std::size_t>(threads_)),
        level_pairs_(static_cast<std::size_t>(threads_)),
        changed_(static_cast<std::size_t>(threads_)),
        batches_(static_cast<std::size_t>(ladder_.levels())),
        drifting_(static_cast<std::size_t>(ladder_.levels())),
        balls_at_(static_cast<std::size_t>(ladder_.levels())),
        contacts_at_(static_cast<std::size_t>(ladder_.levels())) {
    const std::uint32_t n = balls_.content_count();
    paths_.resize(n);
    balance_.resize(n);
    expected_.resize(n);
    level_.assign(n, ladder_.coarsest());
    if (!state.level.empty() && !state.evaluated_position.empty()) {
      std::uint32_t row = 0;
      for (std::size_t i = 0; i < state.size(); ++i) {
        if (state.kind[i] == core::Kind::content) level_[row++] = std::min(state.level[i], ladder_.coarsest());
      }
    }
    evaluated_ = balls_.rows;
    build_list();
    record_and_open();
    if (!state.evaluated_position.empty()) load_synchronised(state);
    if (is_list_worn()) relist();
    classify(true);
    costs_ = setup.costs;
    records_ = 0;
  }

  bool is_checkpointable() const override { return renewed_at_ == steps_done_; }

  void advance(std::int64_t n) override {
    for (std::int64_t k = 0; k < n; ++k) {
      bool renewing = false;
      const Level coarsest = ladder_.coarsest(), finest = finest_;
      run_schedule(finest, coarsest, [&](const Action& action) {
        const bool last = action.tick.count == ticks_of(coarsest);
        switch (action.kind) {
          case Action::Kind::drift:
            if (action.level == finest) book_opened();
            drift(action.level);
            break;
          case Action::Kind::evaluate:
            if (last && action.level == finest) renewing = is_renewal_due();
            if (last && renewing) {
              if (action.level == finest) close_all_with_records();
            } else {
              evaluate(action.level);
            }
            break;
          case Action::Kind::kick:
            apply_events(action.level);
            // At a synchronised time that is looked at from outside, or that classes are renewed at, balls wait.
            kick(action.level, !(last && (renewing || k + 1 == n)));
            break;
        }
      });
      finish_coarse_step();
      if (renewing) renew();
    }
  }

  core::LevelStatistics level_statistics() const override {
    core::LevelStatistics out;
    out.renew_every = renew_every_;
    out.renewals = coarse_steps_ > 0 ? static_cast<double>(records_) / static_cast<double>(coarse_steps_) : 1.0 / renew_every_;
    out.ran_out = ran_out_;
    out.listed = static_cast<double>(list_.ball_pairs().count + list_.fixed_pairs().count);
    for (Level l = 0; l < ladder_.levels(); ++l) {
      const auto mean = [this](std::int64_t sum, std::size_t now) {
        return coarse_steps_ > 0 ? static_cast<double>(sum) / static_cast<double>(coarse_steps_) : static_cast<double>(now);
      };
      out.step.push_back(ladder_.step(l));
      out.balls.push_back(mean(balls_at_[l], level_count_[l]));
      out.contacts.push_back(mean(contacts_at_[l], batches_[l].ball.count + batches_[l].fixed.count));
    }
    return out;
  }

 private:
  /// Halves of contact steps that an evaluation opens, for the ledger.
  struct Opened {
    SweepTotals ball, fixed;
    double seconds;
  };

  // ---- one tick ----

  /// Moves the rows that take part at this level to its next tick, unless they went on with their last kick.
  void drift(Level level) {
    if (drifted_[level] != 0) {
      drifted_[level] = 0;
      return;
    }
    const core::Kernels& kernel = *setup_.kernels;
    share_rows(drifting_[level], [&](core::RowSpan rows) { kernel.drift(balls_.rows.data(), paths_.data(), rows, ladder_.step(level)); });
  }

  void evaluate(Level level) {
    const Batch& batch = batches_[level];
    const double step = ladder_.step(level);
    const SweepTotals ball = sweep(batch.ball, law(false, step), level), fixed = sweep(batch.fixed, law(true, step), level);
    // Half a step closes now; the half that opens belongs to what follows, which may be after this synchronised time.
    book(ball, fixed, 0.5 * step);
    opened_.push_back({ball, fixed, 0.5 * step});
  }

  SweepTotals sweep(const PairList& pairs, const core::SweepLaw& law, Level level) {
    if (pairs.count == 0) return {};
    const core::Kernels& kernel = *setup_.kernels;
    costs_.contact_evaluations += pairs.count;
    const int parts = pairs.count >= kWorthThreads ? threads_ : 1;
    parts_ = std::max(parts_, parts);
    const std::size_t groups = pairs.i.size() / core::kLanes;
    const auto work = [&](int t) {
      const std::size_t begin = groups * t / parts * core::kLanes, end = groups * (t + 1) / parts * core::kLanes;
      const core::PairSpan span{pairs.i.data() + begin, pairs.j.data() + begin, end - begin};
      core::WeightedSum* sums = sums_.data() + static_cast<std::size_t>(t) * stride();
      SweepTotals& totals = totals_[static_cast<std::size_t>(t)] = {};
      core::CandidateList& found = found_[static_cast<std::size_t>(t)];
      core::Candidates candidates = found.room_for(span.n);
      kernel.sweep_weighted(balls_.rows.data(), span, law, level, sums, totals, events_ ? &candidates : nullptr);
      found.take(candidates, begin);
      if (!totals.overloaded) examine(t, pairs, found.pairs(), law, [&](std::uint32_t) { return law.step; });
    };
    share_work(parts, work);
    SweepTotals sum;
    for (int t = 0; t < parts; ++t) sum += totals_[static_cast<std::size_t>(t)];
    if (sum.overloaded) throw_overloaded();
    return sum;
  }

  /// Looks for branch changes among what thread t has found.
  template <class StepOf>
  void examine(int t, const PairList& pairs, std::span<const std::uint32_t> found, const core::SweepLaw& law, StepOf step_of) {
    event_books_[static_cast<std::size_t>(t)].examine(
        balls_.rows, pairs.span(), found, law, step_of,
        [this](std::uint32_t row) { return path_acceleration(row, paths_[row].opening); });
  }

  void apply_events(Level active) {
    core::EventBook& book = event_books_[0];
    for (std::size_t t = 1; t < event_books_.size(); ++t) book.take(event_books_[t]);
    if (book.entries().empty()) return;
    for (const core::EventBook::Entry& e : book.entries()) {
      for (int k = 0; k < 3; ++k) {
        balance_[e.i].v[k] += e.impulse[k];
        if (e.both) balance_[e.j].v[k] -= e.impulse[k];
      }
    }
    // Only a ball whose step ends now has all its forces evaluated.
    apply_position_corrections(book, [&](std::uint32_t row) {
      return newtons(level_[row] <= active ? total_force(row) : paths_[row].opening);
    });
    book.clear();
  }

  /// Ends the steps of balls of `active` and finer; if `go_on`, all that take part move to their next tick at once, while
  /// they are in the cache.
  void kick(Level active, bool go_on) {
    const core::Kernels& kernel = *setup_.kernels;
    core::KickParameters p{};
    for (int k = 0; k < 3; ++k) p.gravity[k] = setup_.gravity[k];
    p.unit = scale_.unit;
    p.half_tick = 0.5 * ladder_.tick();
    p.level = active;
    for (Level l = finest_; l <= active; ++l) {
      p.drift = go_on ? ladder_.step(l) : 0.0;
      drifted_[l] = go_on;
      share_rows(drifting_[l], [&](core::RowSpan rows) {
        kernel.kick(balls_.rows.data(), paths_.data(), balance_.data(), level_.data(), sums_.data(), stride(), parts_, rows, p);
      });
    }
    parts_ = 1;
  }

  /// Calls work(begin, end) for shares of the content, by threads.
  template <class Work>
  void share_balls(Work work) {
    const std::uint64_t n = balls_.content_count();
    share_work(threads_, [&](int t) {
      work(static_cast<std::uint32_t>(n * t / threads_), static_cast<std::uint32_t>(n * (t + 1) / threads_));
    });
  }

  /// Calls work(RowSpan) for shares of `rows`, by threads where it pays.
  template <class Work>
  void share_rows(const std::vector<std::uint32_t>& rows, Work work) {
    const int parts = rows.size() >= kWorthThreads ? threads_ : 1;
    share_work(parts, [&](int t) {
      const std::size_t begin = rows.size() * t / parts, end = rows.size() * (t + 1) / parts;
      work(core::RowSpan{rows.data() + begin, end - begin});
    });
  }

  void finish_coarse_step() {
    ++steps_done_;
    ++coarse_steps_;
    book_gravity(step_);
    for (Level l = finest_; l < ladder_.levels(); ++l) {
      balls_at_[l] += static_cast<std::int64_t>(level_count_[l]);
      contacts_at_[l] += static_cast<std::int64_t>(batches_[l].ball.count + batches_[l].fixed.count);
      costs_.ball_updates += level_count_[l] << (ladder_.coarsest() - l);
    }
  }

  // ---- renewal of classes, at the end of a coarse step ----

  /// Every few coarse steps; at once when a ball strays from the straight path that the skipped pairs rely on.
  bool is_renewal_due() {
    const double seconds = static_cast<double>(steps_done_ + 1 - renewed_at_) * step_;
    const std::uint32_t n = balls_.content_count();
    bool strayed = false, crossed = false;
#pragma omp parallel for num_threads(threads_) schedule(static, 1) reduction(|| : strayed, crossed) if (threads_ > 1)
    for (int t = 0; t < threads_; ++t) {
      const auto report = setup_.kernels->watch(balls_.rows.data(), expected_.data(), seconds, advance_,
                                                std::size_t{n} * t / threads_, std::size_t{n} * (t + 1) / threads_);
      strayed = strayed || report.list_unsafe;
      crossed = crossed || report.crossed;
    }
    crossed_ = crossed;
    return strayed || crossed || (steps_done_ + 1) % renew_every_ == 0;
  }

  const PairList& listed(bool fixed) const { return fixed ? list_.fixed_pairs() : list_.ball_pairs(); }

  /// Evaluates every listed pair at `rows`; if `summing`, into the sums with the weights of the pairs' levels. Calls
  /// see(thread, fixed, candidates) for what may have changed branch. Returns the totals, weighted.
  template <class See>
  Opened record(const std::vector<BallRow>& rows, bool summing, See see) {
    list_.count_sweep();
    ++records_;
    Opened total{{}, {}, 0.5 * ladder_.tick()};
    if (summing) parts_ = threads_;
    for (const bool fixed : {false, true}) {
      const PairList& pairs = listed(fixed);
      PairBook& book = books_[fixed];
      const core::SweepLaw its = law(fixed, step_);
      const std::size_t groups = pairs.i.size() / core::kLanes;
      costs_.contact_evaluations += pairs.count;
      share_work(threads_, [&](int t) {
        const std::size_t begin = groups * t / threads_ * core::kLanes, end = groups * (t + 1) / threads_ * core::kLanes;
        const core::PairSpan span{pairs.i.data() + begin, pairs.j.data() + begin, end - begin};
        core::WeightedSum* sums = summing ? sums_.data() + static_cast<std::size_t>(t) * stride() : nullptr;
        SweepTotals& totals = totals_[static_cast<std::size_t>(t)] = {};
        core::Candidates candidates = found_[static_cast<std::size_t>(t)].room_for(span.n);
        setup_.kernels->record(rows.data(), span, its, book.level.data() + begin, book.records(begin), sums, totals, candidates);
        found_[static_cast<std::size_t>(t)].take(candidates, begin);
        if (!totals.overloaded) see(t, fixed, found_[static_cast<std::size_t>(t)].pairs());
      });
      for (const SweepTotals& part : totals_) (fixed ? total.fixed : total.ball) += part;
    }
    if (total.ball.overloaded || total.fixed.overloaded) throw_overloaded();
    return total;
  }
  static constexpr auto kIgnoreCandidates = [](int, bool, std::span<const std::uint32_t>) {};

  /// The halves of contact steps that the last evaluations opened.
  void book_opened() {
    for (const Opened& half : opened_) book(half.ball, half.fixed, half.seconds);
    opened_.clear();
  }

  /// The last tick before a renewal: one evaluation of all listed pairs closes every step and feeds the classes.
  void close_all_with_records() {
    share_balls([this](std::uint32_t begin, std::uint32_t end) {
      std::copy(balls_.rows.begin() + begin, balls_.rows.begin() + end, evaluated_.begin() + begin);
    });
    // A missed contact has no weight: it pays nothing backwards.
    const Opened half = record(balls_.rows, true, [&](int t, bool fixed, std::span<const std::uint32_t> found) {
      if (!events_) return;
      const PairBook& book = books_[fixed];
      examine(t, listed(fixed), found, law(fixed, step_),
              [&](std::uint32_t p) { return book.level[p] == kSkipped ? 0.0 : ladder_.step(book.level[p]); });
    });
    for (const PairBook& book : books_) costs_.missed_contacts += book.skipped_contacts();
    book(half.ball, half.fixed, half.seconds);
    opened_ = {half};
  }

  void renew() {
    if (crossed_) {
      crossed_ = false;
      const std::vector<std::uint8_t> leaving = find_leaving();
      if (!leaving.empty()) {
        // Without the balls that left the forces are evaluated anew: they open the next steps.
        evaluated_ = balls_.rows;
        build_list(leaving);
        record_and_open();
        classify(true);
        return;
      }
    }
    const bool is_worn = is_list_worn();
    if (is_worn) relist();
    classify(is_worn);
  }

  /// A new list around the balls as they are, with records of the last evaluation for its pairs.
  void relist() {
    build_list();
    record(evaluated_, false, kIgnoreCandidates);
  }

  /// Records of a new list, and force sums and accelerations for balls that are not in mid-step.
  void record_and_open() {
    record(balls_.rows, true, kIgnoreCandidates);
    for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
      core::Path& path = paths_[row];
      path.opening = total_force(row);
      path.inverse_mass = balls_.inverse_mass[row];
      const double inertia = scale_.unit * path.inverse_mass;  // as the kernels do it
      double* a[3] = {&path.ax, &path.ay, &path.az};
      for (int k = 0; k < 3; ++k) *a[k] = setup_.gravity[k] + static_cast<double>(path.opening.v[k]) * inertia;
      balls_.rows[row].a = std::abs(path.ax) + std::abs(path.ay) + std::abs(path.az);
    }
    std::fill(sums_.begin(), sums_.end(), core::WeightedSum{});
    parts_ = 1;
  }

  /// Whether a pair that classification should see by its gap and speed could be missing from the list.
  bool is_list_worn() {
    const double ahead = kAhead * interval_;
    std::atomic<bool> is_worn = false;
    share_balls([&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t row = begin; row < end; ++row) {
        const BallRow& r = balls_.rows[row];
        const core::SkinReference& skin = list_.skins()[row];
        const double room = std::sqrt(skin.skin2) - margin(r) - ahead * velocity(r).norm();
        const Vec3 away = position(r) - Vec3(skin.x, skin.y, skin.z);
        if (!(room > 0.0 && away.squaredNorm() <= room * room)) is_worn = true;
      }
    });
    return is_worn;
  }

  /// How far a ball may stray from its straight path before the next renewal [m].
  double margin(const BallRow& row) const {
    const double most = kMargin * length_scale_;
    return most + std::min(most, 0.5 * interval_ * interval_ * row.a);
  }

  /// Levels of balls and contacts from the records; opens all steps at them. `is_new`: no pair of the list had a level.
  void classify(bool is_new) {
    share_balls([this](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t row = begin; row < end; ++row) {
        const BallRow& r = balls_.rows[row];
        margin_[row] = margin(r);
        expected_[row] = {r.x, r.y, r.z, margin_[row], r.vx, r.vy, r.vz, 0.0};
      }
    });
    for (PairBook& book : books_) book.before.swap(book.level);
    find_needs();
    choose_levels();
    limit_levels(level_, list_.ball_pairs().span(), list_.ball_pairs().count, setup_.stepping.limiter,
                 [&](std::size_t p) { return books_[0].level[p] != kSkipped; }, beyond_);
    open_balances(is_new);
    drift_level_.assign(level_.begin(), level_.end());
    for (const bool fixed : {false, true}) {
      sort_pairs(fixed);
      reweigh_changed(fixed);
    }
    sort_balls();
    renewed_at_ = steps_done_;
  }

  NeedParameters need_parameters(bool fixed) const {
    const core::ContactLaw its = law(fixed, 0.0).law;
    return {its.k, its.reach, interval_, kSoon * length_scale_, speed2_, 1.0 / (largest_inverse_mass_ * kMatrixUnit), !fixed};
  }

  /// Needs of balls from their pairs with each other; marks pairs that cannot touch before the next renewal.
  void find_needs() {
    speed2_ = mean_square_speed();
    largest_inverse_mass_ = 0.0;
    for (const double inverse : balls_.inverse_mass) largest_inverse_mass_ = std::max(largest_inverse_mass_, inverse);
    PairBook& book = books_[false];
    const std::size_t count = listed(false).count;
    share_work(threads_, [&](int t) {
      add_needs_(listed(false).span(), book.records(0), paths_.data(), margin_.data(), need_parameters(false), book.level.data(),
                 needs_[static_cast<std::size_t>(t)].data(), 0, count * t / threads_, count * (t + 1) / threads_);
    });
  }

  /// Each ball's level from what its pairs need, before the limiter. Clears the needs.
  void choose_levels() {
    std::vector<StepWeights> weights;
    for (Level l = 0; l < ladder_.levels(); ++l) {
      weights.emplace_back(ladder_.step(l), law(false, 0.0).law, law(true, 0.0).law, largest_inverse_mass_);
    }
    const NeedParameters with_fixed = need_parameters(true);
    const PairList& pairs = listed(true);
    PairBook& book = books_[true];
    before_.swap(level_);
    level_.resize(before_.size());
    share_balls([&](std::uint32_t begin, std::uint32_t end) {
      // The pairs with fixed balls are few and in order of their balls: a few rows at a time, in the cache.
      const auto first_of = [&](std::uint32_t row) {
        const auto its = pairs.i.begin();
        return static_cast<std::size_t>(std::lower_bound(its, its + static_cast<std::ptrdiff_t>(pairs.count), row) - its);
      };
      std::array<Need, kRowsAtOnce> of_fixed{};
      for (std::uint32_t row = begin; row < end; ++row) {
        Need& its_fixed = of_fixed[(row - begin) % kRowsAtOnce];
        if ((row - begin) % kRowsAtOnce == 0) {
          add_needs_(pairs.span(), book.records(0), paths_.data(), margin_.data(), with_fixed, book.level.data(), of_fixed.data(), row,
                     first_of(row), first_of(std::min(row + kRowsAtOnce, end)));
        }
        ContactMatrix matrix;
        Urgency& urgency = urgency_[row] = {};
        const auto take = [&urgency](Need& need, NormalMatrix& sum) {
          for (int k = 0; k < 6; ++k) sum.entry[k] += need.matrix[k];
          urgency.smooth4 = std::max(urgency.smooth4, need.smooth4);
          urgency.impact4 = std::max(urgency.impact4, need.impact4);
          need = {};
        };
        for (std::vector<Need>& part : needs_) take(part[row], matrix.ball);
        take(its_fixed, matrix.fixed);
        urgency.impact4 = eased_impact4(urgency.impact4, urgency.smooth4);
        Level level = ladder_.coarsest();
        while (level > 0 && !is_stable(matrix, weights[level])) --level;
        level_[row] = level;
      }
    });
    share_error(kSmoothError, &Urgency::smooth4);
    share_error(kImpactError, &Urgency::impact4);
  }

  /// Makes balls finer until the expected error from these urgencies is the tolerance.
  void share_error(double error_factor, double Urgency::*urgency4) {
    strides4_.clear();
    double sum4 = 0.0;  // of urgencies, 1/s4
    for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
      const double its4 = urgency_[row].*urgency4, stride4 = fourth(ladder_.step(level_[row])) * its4;
      if (stride4 > 0.0) strides4_.push_back(stride4);
      sum4 += its4;
    }
    const std::uint32_t n = balls_.content_count();
    const double reach4 = shared_reach4(strides4_, n, error_factor, setup_.stepping.tolerance);
    ran_out_ = ran_out_ || fourth(ladder_.tick()) * sum4 > affordable4(n, error_factor, setup_.stepping.tolerance);
    share_balls([&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t row = begin; row < end; ++row) {
        level_[row] = std::min(level_[row], classed(urgency_[row].*urgency4, reach4, before_[row]));
      }
    });
  }

  /// The coarsest level within the reach, coarser than `now` only with room to spare.
  Level classed(double urgency4, double reach4, Level now) const {
    if (urgency4 * fourth(kHysteresis * ladder_.step(ladder_.coarsest())) <= reach4) return ladder_.coarsest();
    const double longest = std::sqrt(std::sqrt(reach4 / urgency4));  // s
    return std::min(ladder_.level_of(longest), std::max(now, ladder_.level_of(longest / kHysteresis)));
  }

  /// Mean square of the content's speeds [m2/s2], not below what counts as quiet or still.
  double mean_square_speed() const {
    const std::uint32_t n = balls_.content_count();
    const auto square = [this](std::uint32_t row) {
      const BallRow& r = balls_.rows[row];
      return r.vx * r.vx + r.vy * r.vy + r.vz * r.vz;
    };
    const double quiet = kQuiet * kQuiet * setup_.gravity.norm() * length_scale_;
    const double still = kStill * omega(setup_.materials, length_scale_) * length_scale_;
    return std::max({core::order_free_sum(n, square) / std::max(1.0, static_cast<double>(n)), quiet, still * still});
  }

  /// Balances of steps that all begin now, as far as the force goes that a ball's path takes as constant. What the last kick
  /// left holds for balls that keep their levels.
  void open_balances(bool is_new) {
    if (is_new) opened_ = {Opened{{}, {}, 0.5 * ladder_.tick()}};
    share_balls([&](std::uint32_t begin, std::uint32_t end) {
      for (std::uint32_t row = begin; row < end; ++row) {
        if (is_new) balance_[row] = {};
        if (before_[row] == level_[row] && !is_new) continue;
        const std::int64_t had = is_new ? 0 : std::int64_t{2} << before_[row], has = std::int64_t{2} << level_[row];
        for (int k = 0; k < 3; ++k) balance_[row].v[k] += (had - has) * paths_[row].opening.v[k];
      }
    });
  }

  /// Sorts contacts by level, lowers the levels at which their balls take part, and notes pairs that change level.
  void sort_pairs(bool fixed) {
    const PairList& pairs = listed(fixed);
    PairBook& book = books_[fixed];
    // Pairs that are skipped are sorted, too, but nowhere: which are follows no pattern.
    const auto bin_of = [](Level level) { return std::min<std::size_t>(level, kMostLevels); };
    const auto begin_of = [&](int t) { return pairs.count * static_cast<std::size_t>(t) / static_cast<std::size_t>(threads_); };
    share_work(threads_, [&](int t) {
      LevelCount& count = level_pairs_[static_cast<std::size_t>(t)];
      count.fill(0);
      for (std::size_t p = begin_of(t); p < begin_of(t + 1); ++p) {
        const std::uint32_t i = pairs.i[p], j = fixed ? i : pairs.j[p];
        const Level level = std::max(book.level[p], std::min(level_[i], level_[j]));  // skipped, or 0 so far
        book.level[p] = level;
        lower(drift_level_[i], level);
        if (!fixed) lower(drift_level_[j], level);
        ++count[bin_of(level)];
      }
    });
    // Where each thread's pairs of a level begin in that level's batch.
    for (Level l = 0; l < ladder_.levels(); ++l) {
      std::size_t total = 0;
      for (LevelCount& count : level_pairs_) total += std::exchange(count[l], total);
      PairList& batch = batches_[l].pairs(fixed);
      batch.i.resize(total);
      batch.j.resize(total);
    }
    const double reach = kReachRoom * law(fixed, 0.0).law.reach;
    share_work(threads_, [&](int t) {
      struct Place {
        std::uint32_t *i, *j;
        std::size_t n, step;
      };
      std::uint32_t nowhere = 0;
      std::array<Place, kMostLevels + 1> places;
      places.fill({&nowhere, &nowhere, 0, 0});
      for (Level l = 0; l < ladder_.levels(); ++l) {
        PairList& batch = batches_[l].pairs(fixed);
        places[l] = {batch.i.data(), batch.j.data(), level_pairs_[static_cast<std::size_t>(t)][l], 1};
      }
      ChangedPairs& changed = changed_[static_cast<std::size_t>(t)];
      changed.clear();
      for (std::size_t p = begin_of(t); p < begin_of(t + 1); ++p) {
        const Level level = book.level[p];
        Place& to = places[bin_of(level)];
        to.i[to.n] = pairs.i[p];
        to.j[to.n] = pairs.j[p];
        to.n += to.step;
        const bool has_force = book.overlap[p] >= -reach;
        if (has_force && book.before[p] != level) changed.add(pairs.i[p], pairs.j[p], book.before[p], level);
      }
      changed.finish(balls_.far_row());
    });
    for (Batch& batch : batches_) batch.pairs(fixed).finish(balls_.far_row());
  }

  /// Balances and ledger of contact steps that all begin now. What the last evaluation left holds for pairs that keep their
  /// levels; the others' forces are evaluated again where they were.
  void reweigh_changed(bool fixed) {
    Opened& half = opened_.front();
    for (const ChangedPairs& changed : changed_) {
      costs_.contact_evaluations += changed.pairs.count;
      setup_.kernels->reweigh(evaluated_.data(), changed.pairs.span(), law(fixed, step_), changed.from.data(), changed.to.data(),
                              balance_.data(), fixed ? half.fixed : half.ball);
    }
  }

  /// Sorts balls by the finest level at which they take part.
  void sort_balls() {
    for (auto& rows : drifting_) rows.clear();
    level_count_.assign(static_cast<std::size_t>(ladder_.levels()), 0);
    finest_ = ladder_.coarsest();
    for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
      drifting_[drift_level_[row]].push_back(row);
      ++level_count_[level_[row]];
      finest_ = std::min(finest_, drift_level_[row]);
    }
  }

  // ---- housekeeping ----

  void follow_order(std::span<const std::uint32_t> order) override {
    core::reorder_like(paths_, order, balls_.spare, threads_);
    core::reorder_like(balance_, order, balls_.spare, threads_);
    core::reorder_like(level_, order, balls_.spare, threads_);
    expected_.resize(order.size());
    margin_.resize(order.size());
    urgency_.resize(order.size());
    for (std::vector<Need>& needs : needs_) needs.assign(order.size(), Need{});
    for (const bool fixed : {false, true}) books_[fixed].begin(listed(fixed).i.size());
    balance_.resize(order.size() + std::size_t{1});  // the far row has one too
    sums_.assign(static_cast<std::size_t>(threads_) * stride(), core::WeightedSum{});
  }
  std::vector<std::uint8_t> levels() const override { return level_; }
  /// The force sum of a ball whose contacts have all been evaluated.
  IntVec total_force(std::uint32_t row) const {
    IntVec sum;
    for (int t = 0; t < threads_; ++t) {
      const IntVec& part = sums_[static_cast<std::size_t>(t) * stride() + row].force;
      for (int k = 0; k < 3; ++k) sum.v[k] += part.v[k];
    }
    return sum;
  }
  /// Force sums per thread: the content and the far row.
  std::size_t stride() const { return balls_.content_count() + std::size_t{1}; }

  Ladder ladder_;
  int renew_every_;                  // coarse steps between regular renewals
  double interval_;                  // s, between regular renewals
  bool events_;
  std::vector<core::EventBook> event_books_;  // per thread
  int threads_;
  core::AdvanceParameters advance_;
  AddNeeds add_needs_;
  std::vector<std::uint8_t> drifted_;       // per level: its rows have gone on to their next tick
  std::vector<SweepTotals> totals_;         // per thread
  std::vector<core::CandidateList> found_;  // per thread
  std::vector<std::vector<Need>> needs_;    // per thread, of pairs among balls; clear between renewals
  PairsBeyond beyond_;                      // per thread
  std::vector<LevelCount> level_pairs_;     // per thread
  std::vector<ChangedPairs> changed_;       // per thread, of one kind
  std::vector<core::Path> paths_;
  std::vector<IntVec> balance_;      // force units times half ticks
  std::vector<Level> level_;         // of balls: their own steps
  std::vector<Level> drift_level_;   // the finest level at which a ball takes part
  std::vector<core::StraightPath> expected_;
  std::vector<core::WeightedSum> sums_;  // one array per thread
  int parts_ = 1;                        // arrays of sums_ in use since the last kick
  std::vector<Batch> batches_;           // per level
  std::vector<std::vector<std::uint32_t>> drifting_;  // rows per drift level
  PairBook books_[2];                    // among balls, with fixed balls
  std::vector<Urgency> urgency_;
  std::vector<double> strides4_;          // see shared_reach4()
  std::vector<Level> before_;             // levels of the balls before the present renewal
  std::vector<double> margin_;            // m, see margin()
  double speed2_ = 0.0;                   // m2/s2, see mean_square_speed()
  double largest_inverse_mass_ = 0.0;
  std::vector<Opened> opened_;
  std::vector<std::size_t> level_count_;
  std::vector<std::int64_t> balls_at_, contacts_at_;  // sums over coarse steps
  std::int64_t coarse_steps_ = 0, records_ = 0;
  std::int64_t renewed_at_ = 0;
  Level finest_ = 0;
  bool crossed_ = false;
  bool ran_out_ = false;  // see LevelStatistics
};

}  // namespace

std::unique_ptr<core::Stepper> make_multirate_stepper(const core::State& state, const core::StepperSetup& setup) {
  const core::Stepping& s = setup.stepping;
  GC_REQUIRE(s.integrator == core::Integrator::predicted,
             "stepping.integrator = \"{}\" does not go with method = \"multirate\"; use \"predicted\"", name(s.integrator));
  GC_REQUIRE(s.dashpot == core::Dashpot::explicit_,
             "stepping.dashpot = \"{}\" is not offered by this version; use \"explicit\"", name(s.dashpot));
  GC_REQUIRE(s.interface == core::Interface::accumulate,
             "stepping.interface = \"{}\" is not offered by this version; use \"accumulate\"", name(s.interface));
  GC_REQUIRE(s.levels >= 1 && s.levels <= kMostLevels, "stepping.levels = {} must be 1 to {}", s.levels, int{kMostLevels});
  GC_REQUIRE(s.limiter >= 1, "stepping.limiter = {} must be at least 1", s.limiter);
  GC_REQUIRE(s.tolerance > 0.0, "stepping.tolerance = {} must be above 0", s.tolerance);
  GC_REQUIRE(!setup.first_impact, "first_impact goes with method = \"uniform\"; set it in this phase");
  return std::make_unique<MultirateStepper>(state, setup);
}

double default_step(const core::State& state, const core::StepperSetup& setup) {
  const core::StepBounds bounds =
      core::critical_steps(state, setup.materials, setup.outlet_open, setup.stepping.integrator);
  if (setup.stepping.method == core::Method::uniform) return 0.7 * bounds.smallest;
  // The coarsest step is for the bulk, with room for moments when contacts crowd: three quarters of what the median of
  // the balls that touch anything can take. Balls that cannot take it step finer.
  std::vector<double> finite;
  for (const double h : bounds.per_ball) {
    if (std::isfinite(h)) finite.push_back(h);
  }
  if (finite.empty()) return 0.7 * bounds.smallest;
  const auto median = finite.begin() + static_cast<std::ptrdiff_t>(finite.size() / 2);
  std::nth_element(finite.begin(), median, finite.end());
  return 0.75 * *median;
}

std::unique_ptr<core::Stepper> make_stepper(const core::State& state, const core::StepperSetup& setup) {
  if (setup.stepping.method == core::Method::uniform) return core::make_uniform_stepper(state, setup);
  return make_multirate_stepper(state, setup);
}

}  // namespace grainclock::multirate
