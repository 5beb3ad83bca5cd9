// The selective stepper: runs the schedule of each coarse step, evaluates contacts, books, and renews levels. How balls
// move between evaluations is the interface strategy's (interface.hpp).
//
// A renewal of classes: one evaluation of all listed pairs closes every step and says what pairs ask of their balls
// (needs.hpp). Balances (interface.hpp) and ledger carry over for pairs that keep their level; only those that change are
// evaluated again, with the same integers, and paid the difference of their weights.
#include "multirate/stepper.hpp"

#include "core/ball_stepper.hpp"
#include "core/candidate_list.hpp"
#include "core/check.hpp"
#include "core/critical_step.hpp"
#include "core/share_work.hpp"
#include "multirate/batches.hpp"
#include "multirate/interface.hpp"
#include "multirate/level_choice.hpp"
#include "multirate/schedule.hpp"
#include "multirate/straight_paths.hpp"

#include <algorithm>
#include <cmath>

namespace grainclock::multirate {

namespace {

using core::BallRow;
using core::IntVec;
using core::PairList;
using core::SweepTotals;
using core::Vec3;
using core::share_work;

constexpr double kReachRoom = 1.0 + 1e-6;    // recorded overlaps are rounded to seven digits
constexpr int kMostCoarseSteps = 8;    // between regular renewals
constexpr double kRenewalPhase = 1.6;  // omega times the time between renewals, of two mean balls

/// Coarse steps between regular renewals of classes: while a pulse passes few balls only.
int renew_every(const core::Materials& materials, double diameter, double coarsest_step) {
  return std::clamp(static_cast<int>(kRenewalPhase / (omega(materials, diameter) * coarsest_step)), 1, kMostCoarseSteps);
}

class MultirateStepper final : public core::BallStepper {
 public:
  MultirateStepper(const core::State& state, const core::StepperSetup& setup)
      : BallStepper(state, setup, setup.stepping.levels,
                    StraightPaths::look_ahead(kMostCoarseSteps * setup.stepping.step.value_or(0.0))),
        ladder_(step_, setup.stepping.levels),
        renew_every_(renew_every(setup.materials, length_scale_, step_)),
        interval_(renew_every_ * step_),
        events_(setup.stepping.events),
        event_books_(static_cast<std::size_t>(std::max(1, setup.threads)), core::EventBook(scale_, 0.5 * ladder_.tick())),
        threads_(std::max(1, setup.threads)),
        straight_(*setup_.kernels, advance_parameters(), interval_, length_scale_, threads_),
        strategy_(make_interface(setup.stepping, {*setup_.kernels, setup_.gravity, scale_.unit, 0.5 * ladder_.tick(),
                                                      {law(false, 0.0), law(true, 0.0)}})),
        choice_(ladder_, setup, law(false, 0.0).law, law(true, 0.0).law, length_scale_, interval_, strategy_->levels_below()),
        batches_(ladder_.levels(), threads_),
        drifted_(static_cast<std::size_t>(ladder_.levels())),
        listed_shares_(static_cast<std::size_t>(threads_)),
        listed_touched_(threads_),
        totals_(static_cast<std::size_t>(threads_)),
        found_(static_cast<std::size_t>(threads_)),
        balls_at_(static_cast<std::size_t>(ladder_.levels())),
        contacts_at_(static_cast<std::size_t>(ladder_.levels())) {
    const std::uint32_t n = balls_.content_count();
    steps_.paths.resize(n);
    steps_.balance.resize(n);
    steps_.opening.resize(n);
    steps_.level.assign(n, ladder_.coarsest());
    if (!state.level.empty() && !state.evaluated_position.empty()) {
      std::uint32_t row = 0;
      for (std::size_t i = 0; i < state.size(); ++i) {
        if (state.kind[i] == core::Kind::content) steps_.level[row++] = std::min(state.level[i], ladder_.coarsest());
      }
    }
    evaluated_ = balls_.rows;
    build_list();
    record_and_open();
    if (!state.evaluated_position.empty()) load_synchronised(state);
    begin_lines();
    classify(true);
    costs_ = setup.costs;
    records_ = 0;
  }

  bool is_checkpointable() const override { return renewed_at_ == steps_done_; }

  void advance(std::int64_t n) override {
    for (std::int64_t k = 0; k < n; ++k) {
      bool renewing = false;
      const Level coarsest = ladder_.coarsest(), finest = batches_.finest();
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
    out.common_step = choice_.common_step();
    out.ran_out = choice_.ran_out();
    out.listed = static_cast<double>(list_.ball_pairs().count + list_.fixed_pairs().count);
    for (Level l = 0; l <= ladder_.coarsest(); ++l) {
      const auto mean = [this](std::int64_t sum, std::size_t now) {
        return coarse_steps_ > 0 ? static_cast<double>(sum) / static_cast<double>(coarse_steps_) : static_cast<double>(now);
      };
      out.step.push_back(ladder_.step(l));
      out.balls.push_back(mean(balls_at_[l], batches_.balls(l)));
      out.contacts.push_back(mean(contacts_at_[l], batches_.contacts(l)));
    }
    return out;
  }

 private:
  struct Totals {
    SweepTotals ball, fixed;
    Totals& operator+=(const Totals& other) {
      ball += other.ball;
      fixed += other.fixed;
      return *this;
    }
  };
  /// Halves of contact steps that an evaluation opens, for the ledger.
  struct Opened {
    Totals totals;
    double seconds;
  };

  // ---- one tick ----

  /// Moves the rows that take part at this level to its next tick, unless they went on with their last kick.
  void drift(Level level) {
    if (drifted_[level] != 0) {
      drifted_[level] = 0;
      return;
    }
    const double step = ladder_.step(level);
    share_rows(level, [&](core::RowSpan rows) { strategy_->drift(balls_.rows.data(), steps_, rows, step); });
  }

  void evaluate(Level level) {
    strategy_->before_evaluation(steps_, level);
    const Batch& batch = batches_[level];
    const double step = ladder_.step(level);
    costs_.contact_evaluations += batch.ball.count + batch.fixed.count;
    share_work(static_cast<int>(batch.shares.size()), [&](int t) {
      const core::RowShare& share = batch.shares[static_cast<std::size_t>(t)];
      Totals& totals = totals_[static_cast<std::size_t>(t)];
      totals.ball = sweep(t, batch.ball, share.ball, law(false, step), level);
      totals.fixed = sweep(t, batch.fixed, share.fixed, law(true, step), level);
    });
    Totals sum;
    for (std::size_t t = 0; t < batch.shares.size(); ++t) sum += totals_[t];
    if (sum.ball.overloaded || sum.fixed.overloaded) throw_overloaded();
    // Half a step closes now; the half that opens belongs to what follows, which may be after this synchronised time.
    book(sum.ball, sum.fixed, 0.5 * step);
    opened_.push_back({sum, 0.5 * step});
  }

  SweepTotals sweep(int t, const PairList& pairs, core::PairRange range, const core::SweepLaw& law, Level level) {
    SweepTotals totals;
    if (range.begin == range.end) return totals;
    const core::PairSpan span{pairs.i.data() + range.begin, pairs.j.data() + range.begin, range.end - range.begin};
    core::CandidateList& found = found_[static_cast<std::size_t>(t)];
    core::Candidates candidates = found.room_for(span.n);
    setup_.kernels->sweep_weighted(balls_.rows.data(), span, law, level, steps_.sums_of(t), totals,
                                   events_ ? &candidates : nullptr);
    found.take(candidates, range.begin);
    if (!totals.overloaded) examine(t, pairs, found.pairs(), law, [&](std::uint32_t) { return law.step; });
    return totals;
  }

  /// Looks for branch changes among what thread t has found.
  template <class StepOf>
  void examine(int t, const PairList& pairs, std::span<const std::uint32_t> found, const core::SweepLaw& law, StepOf step_of) {
    event_books_[static_cast<std::size_t>(t)].examine(
        balls_.rows, pairs.span(), found, law, step_of,
        [this](std::uint32_t row) { return acceleration_of(row); });
  }

  Vec3 acceleration_of(std::uint32_t row) const {
    const core::Path& path = steps_.paths[row];
    return {path.ax, path.ay, path.az};
  }

  void apply_events(Level active) {
    core::EventBook& book = event_books_[0];
    for (std::size_t t = 1; t < event_books_.size(); ++t) book.take(event_books_[t]);
    if (book.entries().empty()) return;
    for (const core::EventBook::Entry& e : book.entries()) {
      for (int k = 0; k < 3; ++k) {
        steps_.balance[e.i].v[k] += e.impulse[k];
        if (e.both) steps_.balance[e.j].v[k] -= e.impulse[k];
      }
    }
    // Only a ball whose step ends now, and those of its contacts, has all its forces evaluated.
    const int below = strategy_->levels_below();
    apply_position_corrections(book, [&](std::uint32_t row) {
      const bool has_all = steps_.level[row] + below <= active || active == ladder_.coarsest();
      return has_all ? newtons(steps_.total_force(row)) : mass(row) * (acceleration_of(row) - setup_.gravity);
    });
    book.clear();
  }

  /// Ends the steps of balls of `active` and finer; if `go_on`, all that take part move to their next tick at once, while
  /// they are in the cache.
  void kick(Level active, bool go_on) {
    core::KickParameters p{};
    for (int k = 0; k < 3; ++k) p.gravity[k] = setup_.gravity[k];
    p.unit = scale_.unit;
    p.half_tick = 0.5 * ladder_.tick();
    p.level = active;
    for (Level l = batches_.finest(); l <= active; ++l) {
      p.drift = go_on ? ladder_.step(l) : 0.0;
      drifted_[l] = go_on;
      const TouchedRows& touched = recorded_ ? listed_touched_ : batches_.touched(l, active);
      share_rows(l, [&](core::RowSpan rows) {
        while (rows.n > 0) {
          const SummedRows some = touched.first_alike(rows);
          strategy_->kick(balls_.rows.data(), steps_, some, p);
          rows = {rows.row + some.rows.n, rows.n - some.rows.n};
        }
      });
    }
    recorded_ = false;
  }

  /// Calls work(begin, end) for shares of the content, by threads.
  template <class Work>
  void share_balls(Work work) {
    core::share_range(balls_.content_count(), threads_, [&](int /*t*/, std::size_t begin, std::size_t end) {
      work(static_cast<std::uint32_t>(begin), static_cast<std::uint32_t>(end));
    });
  }

  /// Calls work(RowSpan) for shares of the rows of this level, by threads where it pays.
  template <class Work>
  void share_rows(Level level, Work work) {
    const std::vector<std::uint32_t>& rows = batches_.rows(level);
    const int parts = rows.size() >= kWorthThreads ? threads_ : 1;
    core::share_range(rows.size(), parts, [&](int /*t*/, std::size_t begin, std::size_t end) {
      work(core::RowSpan{rows.data() + begin, end - begin});
    });
  }

  void finish_coarse_step() {
    ++steps_done_;
    ++coarse_steps_;
    book_gravity(step_);
    for (Level l = batches_.finest(); l <= ladder_.coarsest(); ++l) {
      balls_at_[l] += static_cast<std::int64_t>(batches_.balls(l));
      contacts_at_[l] += static_cast<std::int64_t>(batches_.contacts(l));
      costs_.ball_updates += batches_.balls(l) << (ladder_.coarsest() - l);
    }
  }

  // ---- renewal of classes, at the end of a coarse step ----

  /// Every few coarse steps; at once when a ball leaves the silo, or strays from the straight path that classes rely on.
  bool is_renewal_due() {
    const double seconds = static_cast<double>(steps_done_ + 1 - renewed_at_) * step_;
    const auto [has_strays, crossed] = straight_.watch(balls_, seconds);
    crossed_ = crossed;
    if (crossed || (steps_done_ + 1) % renew_every_ == 0) return true;
    return has_strays && !straight_.redirect_strays(balls_, {classed(false), classed(true)}, seconds);
  }
  ClassedPairs classed(bool fixed) const {
    return {listed(fixed), by_ball_[fixed], books_[fixed], fixed, law(fixed, 0.0).law.reach};
  }

  const PairList& listed(bool fixed) const { return fixed ? list_.fixed_pairs() : list_.ball_pairs(); }

  /// Evaluates every listed pair at `rows`; if `summing`, into the sums with the weights of the pairs' levels. Calls
  /// see(thread, fixed, candidates) for what may have changed branch. Returns the totals, weighted.
  template <class See>
  Opened record(const std::vector<BallRow>& rows, bool summing, See see) {
    list_.count_sweep();
    ++records_;
    recorded_ = summing;
    share_work(threads_, [&](int t) {
      const core::RowShare& share = listed_shares_[static_cast<std::size_t>(t)];
      core::CandidateList& found = found_[static_cast<std::size_t>(t)];
      Totals& totals = totals_[static_cast<std::size_t>(t)] = {};
      for (const bool fixed : {false, true}) {
        const PairList& pairs = listed(fixed);
        const auto [begin, end] = fixed ? share.fixed : share.ball;
        const core::PairSpan span{pairs.i.data() + begin, pairs.j.data() + begin, end - begin};
        SweepTotals& its = fixed ? totals.fixed : totals.ball;
        core::Candidates candidates = found.room_for(span.n);
        setup_.kernels->record(rows.data(), span, law(fixed, step_), books_[fixed].level.data() + begin,
                               books_[fixed].records(begin), summing ? steps_.sums_of(t) : nullptr, its, candidates);
        found.take(candidates, begin);
        if (!its.overloaded) see(t, fixed, found.pairs());
      }
    });
    Opened half{{}, 0.5 * ladder_.tick()};
    for (const Totals& part : totals_) half.totals += part;
    if (half.totals.ball.overloaded || half.totals.fixed.overloaded) throw_overloaded();
    costs_.contact_evaluations += listed(false).count + listed(true).count;
    return half;
  }
  static constexpr auto kIgnoreCandidates = [](int, bool, std::span<const std::uint32_t>) {};

  /// The halves of contact steps that the last evaluations opened.
  void book_opened() {
    for (const Opened& half : opened_) book(half.totals.ball, half.totals.fixed, half.seconds);
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
    book(half.totals.ball, half.totals.fixed, half.seconds);
    opened_ = {half};
  }

  void renew() {
    require_slow();  // lists of fast balls reach far, and are seldom made anew
    if (crossed_) {
      crossed_ = false;
      const std::vector<std::uint8_t> leaving = find_leaving();
      if (!leaving.empty()) {
        // Without the balls that left the forces are evaluated anew: they open the next steps.
        remove_balls(leaving);
        evaluated_ = balls_.rows;
        record_and_open();
        begin_lines();
        classify(true);
        return;
      }
    }
    classify(begin_lines());
  }

  /// Lines of all balls from now on, with a list that will do for them. Tells whether it is a new one.
  bool begin_lines() {
    const bool is_worn = straight_.begin(balls_, list_.skins());
    if (!is_worn) return false;
    relist();
    straight_.begin(balls_, list_.skins());
    return true;
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
      steps_.paths[row].inverse_mass = balls_.inverse_mass[row];
      begin_path(steps_, row, balls_.rows[row], steps_.total_force(row), setup_.gravity, scale_.unit);
    }
    steps_.clear_sums();
    recorded_ = false;
  }

  /// Levels of balls and contacts from the records; opens all steps at them. `is_new`: no pair of the list had a level.
  void classify(bool is_new) {
    for (PairBook& book : books_) book.before.swap(book.level);
    choice_.choose({listed(false), listed(true), by_ball_[false], books_, straight_.margin(), straight_.speed2()}, steps_);
    if (is_new) opened_ = {Opened{{}, 0.5 * ladder_.tick()}};
    share_balls([&](std::uint32_t begin, std::uint32_t end) { strategy_->open(steps_, is_new, begin, end); });
    batches_.begin(steps_.level.size());
    for (const bool fixed : {false, true}) {
      batches_.sort_pairs(fixed, listed(fixed), books_[fixed], choice_.for_contacts(fixed, steps_),
                          kReachRoom * law(fixed, 0.0).law.reach, balls_.far_row());
      reweigh_changed(fixed);
    }
    batches_.cut(balls_.content_count());
    batches_.sort_balls(steps_.level);
    strategy_->begin(steps_, evaluated_.data(), batches_);
    renewed_at_ = steps_done_;
  }

  /// Balances and ledger of contact steps that all begin now. What the last evaluation left holds for pairs that keep their
  /// levels; the others' forces are evaluated again where they were.
  void reweigh_changed(bool fixed) {
    Opened& half = opened_.front();
    for (const ChangedPairs& changed : batches_.changed()) {
      costs_.contact_evaluations += changed.pairs.count;
      setup_.kernels->reweigh(evaluated_.data(), changed.pairs.span(), law(fixed, step_), changed.from.data(), changed.to.data(),
                              steps_.balance.data(), fixed ? half.totals.fixed : half.totals.ball);
    }
  }

  // ---- housekeeping ----

  void follow_order(std::span<const std::uint32_t> order) override {
    steps_.follow_order(order, balls_.spare, threads_);
    choice_.follow_order(balls_);
    for (const bool fixed : {false, true}) by_ball_[fixed].begin(listed(fixed), balls_.content_count());
    core::cut_shares(list_.ball_pairs(), list_.fixed_pairs(), balls_.content_count(), listed_shares_);
    listed_touched_ = TouchedRows(threads_);
    listed_touched_.add(listed_shares_);
    for (const bool fixed : {false, true}) books_[fixed].begin(listed(fixed).i.size());
  }
  std::vector<std::uint8_t> levels() const override { return steps_.level; }

  Ladder ladder_;
  int renew_every_;                  // coarse steps between regular renewals
  double interval_;                  // s, between regular renewals
  bool events_;
  std::vector<core::EventBook> event_books_;  // per thread
  int threads_;
  StraightPaths straight_;
  std::unique_ptr<InterfaceStrategy> strategy_;
  LevelChoice choice_;
  Batches batches_;
  BallSteps steps_;
  std::vector<std::uint8_t> drifted_;          // per level: its rows have gone on to their next tick
  std::vector<core::RowShare> listed_shares_;  // per thread, of all listed pairs
  TouchedRows listed_touched_;
  bool recorded_ = false;                      // the sums of this tick are of all listed pairs
  std::vector<Totals> totals_;                 // per thread
  std::vector<core::CandidateList> found_;     // per thread
  PairBook books_[2];                          // among balls, with fixed balls
  PairsByBall by_ball_[2];                     // likewise
  std::vector<Opened> opened_;
  std::vector<std::int64_t> balls_at_, contacts_at_;  // sums over coarse steps
  std::int64_t coarse_steps_ = 0, records_ = 0;
  std::int64_t renewed_at_ = 0;
  bool crossed_ = false;
};

}  // namespace

std::unique_ptr<core::Stepper> make_multirate_stepper(const core::State& state, const core::StepperSetup& setup) {
  const core::Stepping& s = setup.stepping;
  GC_REQUIRE(s.integrator == core::Integrator::predicted,
             "stepping.integrator = \"{}\" does not go with method = \"multirate\"; use \"predicted\"", name(s.integrator));
  GC_REQUIRE(s.dashpot == core::Dashpot::explicit_,
             "stepping.dashpot = \"{}\" is not offered by this version; use \"explicit\"", name(s.dashpot));
  GC_REQUIRE(s.levels >= 1 && s.levels <= kMostLevels, "stepping.levels = {} must be 1 to {}", s.levels, int{kMostLevels});
  GC_REQUIRE(s.limiter >= 1, "stepping.limiter = {} must be at least 1", s.limiter);
  GC_REQUIRE(s.tolerance > 0.0, "stepping.tolerance = {} must be above 0", s.tolerance);
  GC_REQUIRE(!setup.first_impact, "first_impact goes with method = \"uniform\"; set it in this phase");
  return std::make_unique<MultirateStepper>(state, setup);
}

double default_step(const core::State& state, const core::StepperSetup& setup) {
  const core::StepBounds bounds = core::critical_steps(state, setup.materials, setup.outlet_open, setup.stepping);
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
