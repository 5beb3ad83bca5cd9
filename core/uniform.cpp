// The uniform stepper: every ball by the same step, three schemes.
//
//   predicted  x' = x + h v + h2/2 a, v_p = v + h a, a' = f(x', v_p), v' = v + h/2 (a + a'): the paper's
//              predictor-corrector evaluated once (PEC); order 2 on smooth damped contacts
//   pece       the same with a second evaluation at (x', v'), whose force opens the next step
//   lagged     velocity Verlet whose dashpots see the half-step velocity; order 1 with dashpots
//
// Dashpots are explicit here; see dashpot_stepper.hpp for other ways.
//
// Momentum is exact to rounding in all three, for every contact force is one integer vector,
// added to one ball and subtracted from the other.
#include "core/ball_stepper.hpp"
#include "core/candidate_list.hpp"
#include "core/check.hpp"
#include "core/dashpot_stepper.hpp"
#include "core/row_shares.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

namespace grainclock::core {

namespace {

constexpr std::uint32_t kRowsAtOnce = 1024;  // swept, then moved while they are in the cache

class UniformStepper final : public BallStepper {
 public:
  UniformStepper(const State& state, const StepperSetup& setup)
      : BallStepper(state, setup, 1, 0.0),
        scheme_(setup.stepping.integrator),
        events_(setup.stepping.events),
        event_book_(scale_, 0.5 * step_),
        threads_(std::max(1, setup.threads)),
        advance_(advance_parameters()),
        ball_law_(law(false, step_)),
        fixed_law_(law(true, step_)),
        shares_(static_cast<std::size_t>(threads_)),
        work_(static_cast<std::size_t>(threads_)) {
    GC_REQUIRE(!events_ || scheme_ == Integrator::predicted,
               "stepping.events = true goes with integrator = \"predicted\", not \"{}\"; set events = false", name(scheme_));
    advance_.bound = events_;
    opening_.resize(balls_.content_count());
    build_list();
    begin();
    costs_ = setup.costs;  // making a stepper costs nothing that a run would count
    if (!state.evaluated_position.empty()) load_synchronised(state);
  }

  bool is_checkpointable() const override { return true; }

  void advance(std::int64_t n) override {
    if (n <= 0) return;
    move(Advance::open);
    for (std::int64_t k = 1; k <= n; ++k) {
      refresh_list();
      costs_.ball_updates += balls_.content_count();
      // What needs a synchronised state is done between the halves; they give the same bits apart.
      const bool apart = k == n || crossed_ || setup_.first_impact || scheme_ == Integrator::pece;
      if (!apart && !events_) {
        sweep_and_move();
        finish_step();
        continue;
      }
      sweep_pairs();
      if (k == n) keep_evaluated();
      correct_events();
      if (!apart) {
        finish_step();
        move(Advance::close_and_open);
        continue;
      }
      if (setup_.first_impact) note_impacts();
      move(Advance::close);
      finish_step();
      const bool stopped = setup_.first_impact && !first_hit_.empty();
      if (stopped) stop_first_impacts(first_hit_);
      if (stopped || scheme_ == Integrator::pece) {
        // The dashpots' forces change with the velocities: the next step opens with new ones, and books those.
        evaluate_again();
        previous_ = {ball_totals_, fixed_totals_};
      }
      if (crossed_) remove_leaving();
      if (k < n) move(Advance::open);
    }
  }

  LevelStatistics level_statistics() const override {
    const auto pairs = static_cast<double>(listed_pairs());
    return {{step_}, {static_cast<double>(balls_.content_count())}, {pairs}, pairs};
  }

 private:
  void follow_order(std::span<const std::uint32_t> order) override {
    reorder_like(opening_, order, balls_.spare, threads_);
    sums_.assign(static_cast<std::size_t>(threads_) * stride(), IntVec{});
    cut_shares(list_.ball_pairs(), list_.fixed_pairs(), balls_.content_count(), shares_);
    for (std::size_t t = 0; t < shares_.size(); ++t) work_[t].head.resize(shares_[t].own - shares_[t].begin);
    choose_ring();
  }

  /// How much of the sums a fused step uses: enough for the rows that a block of pairs can add to.
  void choose_ring() {
    const std::uint32_t reach = std::max(vector_reach(list_.ball_pairs(), true), vector_reach(list_.fixed_pairs(), false));
    const std::uint32_t room = std::bit_ceil(reach + kRowsAtOnce + 1);
    ring_ = room < stride() ? room - 1 : kNoRing;
  }

  struct Totals {
    SweepTotals ball, fixed;
  };
  /// What a thread finds in its share of a step.
  struct alignas(64) Work {
    SweepTotals ball, fixed;
    CandidateList ball_candidates, fixed_candidates;
    std::vector<IntVec> head;  // force sums of the rows that earlier shares add to as well
    AdvanceReport moved;
    std::uint32_t reached = 0;  // own rows of the share below it have moved on
  };

  /// Force sums per thread: the content and the far row.
  std::size_t stride() const { return balls_.content_count() + std::size_t{1}; }
  std::size_t listed_pairs() const { return list_.ball_pairs().count + list_.fixed_pairs().count; }

  /// First forces, at the rows as they are: they open the first step.
  void begin() {
    evaluate_again();
    previous_ = {ball_totals_, fixed_totals_};
  }

  void refresh_list() {
    if (!list_unsafe_) return;
    build_list();
    list_unsafe_ = false;
  }

  /// New opening forces at a synchronised state.
  void evaluate_again() {
    keep_evaluated();
    sweep_pairs();
    take_sums_as_opening();
  }

  /// Sums up the forces of all pairs.
  void sweep_pairs() {
    share_work(threads_, [this](int t) {
      Work& work = work_[static_cast<std::size_t>(t)];
      const RowShare& share = shares_[static_cast<std::size_t>(t)];
      work.ball = work.fixed = {};
      work.reached = share.begin;
      sweep_ball_pairs(t, share.ball, kNoRing, work);
      sweep_fixed_pairs(t, share.fixed, kNoRing, work);
    });
    add_up_totals();
  }

  /// The same, and each ball closes its step and opens the next as soon as its last pair is done, while it is in
  /// the cache: the lists are in order of the first row, so nothing later in the list touches an earlier row.
  /// The sums of rows that have moved on make room for later rows'.
  void sweep_and_move() {
    share_work(threads_, [this](int t) {
      Work& work = work_[static_cast<std::size_t>(t)];
      const RowShare& share = shares_[static_cast<std::size_t>(t)];
      work.ball = work.fixed = {};
      work.moved = {};
      work.reached = share.begin;
      std::size_t ball = share.ball.begin, fixed = share.fixed.begin;
      while (work.reached < share.end) {
        // Blocks begin at whole multiples, so that none is cut by the end of the ring.
        const std::uint32_t next = std::min((work.reached / kRowsAtOnce + 1) * kRowsAtOnce, share.end);
        ball = sweep_ball_pairs(t, {ball, end_of(list_.ball_pairs(), {ball, share.ball.end}, next)}, ring_, work);
        fixed = sweep_fixed_pairs(t, {fixed, end_of(list_.fixed_pairs(), {fixed, share.fixed.end}, next)}, ring_, work);
        if (work.ball.overloaded || work.fixed.overloaded) break;  // the rows stay for a diagnosis
        const std::uint32_t own = std::clamp(share.own, work.reached, next);
        for (std::uint32_t row = work.reached; row < own; ++row) {
          work.head[row - share.begin] = std::exchange(sums_of(t)[row & ring_], IntVec{});
        }
        move_rows(Advance::close_and_open, own, next, sums_of(t) + (own & ring_), 1, work);
        work.reached = next;
      }
      sweep_ball_pairs(t, {ball, share.ball.end}, ring_, work);
      sweep_fixed_pairs(t, {fixed, share.fixed.end}, ring_, work);
    });
    add_up_totals();
    share_work(threads_, [this](int t) { move_head(t); });
    take_reports();
  }

  /// The rows that earlier shares may have added to: their forces are complete when all have been swept.
  void move_head(int t) {
    const RowShare& share = shares_[static_cast<std::size_t>(t)];
    Work& work = work_[static_cast<std::size_t>(t)];
    for (int s = 0; s < t; ++s) {
      for (std::uint32_t row = share.begin; row < std::min(share.own, shares_[static_cast<std::size_t>(s)].touched); ++row) {
        const IntVec part = std::exchange(sums_of(s)[row & ring_], IntVec{});
        for (int k = 0; k < 3; ++k) work.head[row - share.begin].v[k] += part.v[k];
      }
    }
    move_rows(Advance::close_and_open, share.begin, share.own, work.head.data(), 1, work);
  }

  IntVec* sums_of(int t) { return sums_.data() + static_cast<std::size_t>(t) * stride(); }

  /// The first whole vector of the range that has nothing to do with rows below `row`.
  static std::size_t end_of(const PairList& pairs, PairRange range, std::uint32_t row) {
    while (range.begin < range.end && pairs.i[range.begin] < row) range.begin += kLanes;
    return range.begin;
  }

  std::size_t sweep_ball_pairs(int t, PairRange range, std::uint32_t ring, Work& work) {
    return sweep(list_.ball_pairs(), range, ball_law_, ring, t, work.ball, work.ball_candidates);
  }
  std::size_t sweep_fixed_pairs(int t, PairRange range, std::uint32_t ring, Work& work) {
    return sweep(list_.fixed_pairs(), range, fixed_law_, ring, t, work.fixed, work.fixed_candidates);
  }
  std::size_t sweep(const PairList& pairs, PairRange range, SweepLaw law, std::uint32_t ring, int t, SweepTotals& totals,
                    CandidateList& found) {
    const PairSpan span{pairs.i.data() + range.begin, pairs.j.data() + range.begin, range.end - range.begin};
    law.ring = ring;
    if (!events_) {
      setup_.kernels->sweep(balls_.rows.data(), span, law, sums_of(t), totals, nullptr);
      return range.end;
    }
    Candidates candidates = found.room_for(span.n);
    setup_.kernels->sweep(balls_.rows.data(), span, law, sums_of(t), totals, &candidates);
    found.take(candidates, range.begin);
    return range.end;
  }

  void add_up_totals() {
    list_.count_sweep();
    ball_totals_ = fixed_totals_ = {};
    for (const Work& work : work_) {
      ball_totals_ += work.ball;
      fixed_totals_ += work.fixed;
    }
    costs_.contact_evaluations += listed_pairs();
    if (!ball_totals_.overloaded && !fixed_totals_.overloaded) return;
    throw_overloaded([this](std::uint32_t row) {
      for (std::size_t t = 0; t < shares_.size(); ++t) {
        if (row >= shares_[t].own && row < work_[t].reached) return false;  // has moved on
      }
      return true;
    });
  }

  IntVec total_force(std::uint32_t row) const {
    IntVec sum;
    for (int t = 0; t < threads_; ++t) {
      const IntVec& part = sums_[static_cast<std::size_t>(t) * stride() + row];
      for (int k = 0; k < 3; ++k) sum.v[k] += part.v[k];
    }
    return sum;
  }

  /// Impulses of branch changes within the step, to both balls; positions likewise.
  void correct_events() {
    if (!events_) return;
    event_book_.clear();
    const auto step_of = [this](std::uint32_t) { return step_; };
    const auto acceleration = [this](std::uint32_t row) { return path_acceleration(row, opening_[row]); };
    for (const Work& work : work_) {
      event_book_.examine(balls_.rows, list_.ball_pairs().span(), work.ball_candidates.pairs(), ball_law_, step_of, acceleration);
      event_book_.examine(balls_.rows, list_.fixed_pairs().span(), work.fixed_candidates.pairs(), fixed_law_, step_of, acceleration);
    }
    if (event_book_.entries().empty()) return;
    apply_position_corrections(event_book_, [this](std::uint32_t row) { return newtons(total_force(row)); });
    // The closing velocity is v_p + (sum - opening) h / 2m: an impulse is one more term of it.
    for (const EventBook::Entry& e : event_book_.entries()) {
      for (int k = 0; k < 3; ++k) {
        opening_[e.i].v[k] -= e.impulse[k];
        if (e.both) opening_[e.j].v[k] += e.impulse[k];
      }
    }
  }

  void move(Advance what) {
    share_work(threads_, [this, what](int t) {
      const RowShare& share = shares_[static_cast<std::size_t>(t)];
      Work& work = work_[static_cast<std::size_t>(t)];
      work.moved = {};
      move_rows(what, share.begin, share.end, sums_.data() + share.begin, threads_, work);
    });
    if (what != Advance::close) take_reports();  // else positions moved, and were checked, when the step opened
  }

  /// Rows [begin, end) with `parts` arrays of sums, the first row's first.
  void move_rows(Advance what, std::uint32_t begin, std::uint32_t end, IntVec* sums, int parts, Work& work) {
    if (begin >= end) return;
    const auto advance = scheme_ == Integrator::lagged ? setup_.kernels->advance_lagged : setup_.kernels->advance_predicted;
    const AdvanceReport report =
        advance(what, balls_.rows.data() + begin, sums, stride(), parts, opening_.data() + begin, balls_.inverse_mass.data() + begin,
                list_.skins().data() + begin, advance_, 0, end - begin);
    work.moved.list_unsafe = work.moved.list_unsafe || report.list_unsafe;
    work.moved.crossed = work.moved.crossed || report.crossed;
  }

  void take_reports() {
    list_unsafe_ = crossed_ = false;
    for (const Work& work : work_) {
      list_unsafe_ = list_unsafe_ || work.moved.list_unsafe;
      crossed_ = crossed_ || work.moved.crossed;
    }
  }

  void take_sums_as_opening() {
    for (std::uint32_t row = 0; row < balls_.content_count(); ++row) opening_[row] = total_force(row);
    std::fill(sums_.begin(), sums_.end(), IntVec{});
  }

  void keep_evaluated() { evaluated_ = balls_.rows; }

  void finish_step() {
    ++steps_done_;
    book_gravity(step_);
    book(previous_.ball, previous_.fixed, 0.5 * step_);
    book(ball_totals_, fixed_totals_, 0.5 * step_);
    previous_ = {ball_totals_, fixed_totals_};
  }

  /// Balls below the outlet leave at the end of a step; the forces are evaluated anew without them.
  void remove_leaving() {
    const std::vector<std::uint8_t> leaving = find_leaving();
    crossed_ = false;
    if (leaving.empty()) return;
    remove_balls(leaving);
    begin();
  }

  /// Balls that feel a contact for the first time (paper, section 5.3).
  void note_impacts() {
    first_hit_.clear();
    for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
      const IntVec force = total_force(row);
      if (impacted_[row] == 0 && (force.v[0] != 0 || force.v[1] != 0 || force.v[2] != 0)) first_hit_.push_back(row);
    }
  }

  Integrator scheme_;
  bool events_;
  EventBook event_book_;
  int threads_;
  AdvanceParameters advance_;
  SweepLaw ball_law_, fixed_law_;
  std::vector<RowShare> shares_;  // one per thread
  std::vector<Work> work_;        // likewise
  std::vector<IntVec> sums_;     // force units, one array per thread; zero between uses
  std::uint32_t ring_ = kNoRing;  // fused steps keep row r's sums at r & ring
  std::vector<IntVec> opening_;  // force units, the force that opened the step
  std::vector<std::uint32_t> first_hit_;
  SweepTotals ball_totals_, fixed_totals_;
  Totals previous_;
  bool list_unsafe_ = false;
  bool crossed_ = false;
};

}  // namespace

std::unique_ptr<Stepper> make_uniform_stepper(const State& state, const StepperSetup& setup) {
  if (setup.stepping.dashpot != Dashpot::explicit_) return make_dashpot_stepper(state, setup);
  return std::make_unique<UniformStepper>(state, setup);
}

}  // namespace grainclock::core
