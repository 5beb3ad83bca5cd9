// The uniform stepper: every ball by the same step, three schemes.
//
//   predicted  x' = x + h v + h2/2 a, v_p = v + h a, a' = f(x', v_p), v' = v + h/2 (a + a'): the paper's
//              predictor-corrector evaluated once (PEC); order 2 on smooth damped contacts
//   pece       the same with a second evaluation at (x', v'), whose force opens the next step
//   lagged     velocity Verlet whose dashpots see the half-step velocity; order 1 with dashpots
//
// Momentum is exact to rounding in all three, for every contact force is one integer vector,
// added to one ball and subtracted from the other.
#include "core/ball_stepper.hpp"
#include "core/check.hpp"

#include <algorithm>
#include <cmath>

namespace grainclock::core {

namespace {

class UniformStepper final : public BallStepper {
 public:
  UniformStepper(const State& state, const StepperSetup& setup)
      : BallStepper(state, setup, 1, 0.0),
        scheme_(setup.stepping.integrator),
        events_(setup.stepping.events),
        event_book_(scale_, 0.5 * step_),
        threads_(std::max(1, setup.threads)),
        advance_(advance_parameters()) {
    GC_REQUIRE(setup.stepping.dashpot == Dashpot::explicit_,
               "stepping.dashpot = \"{}\" is not offered by this version; use \"explicit\"", name(setup.stepping.dashpot));
    GC_REQUIRE(!events_ || scheme_ == Integrator::predicted,
               "stepping.events = true goes with integrator = \"predicted\", not \"{}\"; set events = false", name(scheme_));
    opening_.resize(balls_.content_count());
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
      evaluate();
      // What needs a synchronised state is done between the halves; they give the same bits apart.
      const bool apart = k == n || crossed_ || setup_.first_impact || scheme_ == Integrator::pece;
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
      if (stopped) stop_first_impacts();
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
    reorder_like(opening_, order);
    sums_.assign(static_cast<std::size_t>(threads_) * stride(), IntVec{});
  }

  /// Force sums per thread: the content and the far row.
  std::size_t stride() const { return balls_.content_count() + std::size_t{1}; }
  std::size_t listed_pairs() const { return list_.ball_pairs().count + list_.fixed_pairs().count; }

  /// First forces, at the rows as they are: they open the first step.
  void begin(const std::vector<std::uint8_t>& leaving = {}) {
    keep_evaluated();
    build_list(leaving);
    sweep_pairs();
    take_sums_as_opening();
    previous_ = {ball_totals_, fixed_totals_};
  }

  void refresh_list() {
    if (!list_unsafe_) return;
    build_list();
    list_unsafe_ = false;
  }

  /// Forces at the rows' predicted positions and velocities, into sums_.
  void evaluate() {
    sweep_pairs();
    costs_.ball_updates += balls_.content_count();
  }

  /// New opening forces at a synchronised state.
  void evaluate_again() {
    keep_evaluated();
    sweep_pairs();
    take_sums_as_opening();
  }

  void sweep_pairs() {
    ball_totals_ = fixed_totals_ = {};
    const Kernels& kernel = *setup_.kernels;
    struct Part {
      SweepTotals ball, fixed;
    };
    std::vector<Part> parts(static_cast<std::size_t>(threads_));
    candidates_.resize(static_cast<std::size_t>(threads_));
    const SweepLaw ball_law = law(false, step_), fixed_law = law(true, step_);
#pragma omp parallel for num_threads(threads_) schedule(static, 1) if (threads_ > 1)
    for (int t = 0; t < threads_; ++t) {
      Part& part = parts[static_cast<std::size_t>(t)];
      FoundCandidates& found = candidates_[static_cast<std::size_t>(t)];
      IntVec* sums = sums_.data() + static_cast<std::size_t>(t) * stride();
      sweep_part(kernel, list_.ball_pairs(), ball_law, t, sums, part.ball, found.ball);
      sweep_part(kernel, list_.fixed_pairs(), fixed_law, t, sums, part.fixed, found.fixed);
    }
    for (const Part& part : parts) {
      ball_totals_ += part.ball;
      fixed_totals_ += part.fixed;
    }
    costs_.contact_evaluations += listed_pairs();
    if (ball_totals_.overloaded || fixed_totals_.overloaded) throw_overloaded();
  }

  /// Thread t's share of the pairs, cut at whole vectors.
  void sweep_part(const Kernels& kernel, const PairList& pairs, const SweepLaw& law, int t, IntVec* sums,
                  SweepTotals& totals, std::vector<std::uint32_t>& found) const {
    const std::size_t groups = pairs.i.size() / kLanes;
    const std::size_t begin = groups * t / threads_ * kLanes, end = groups * (t + 1) / threads_ * kLanes;
    const PairSpan span{pairs.i.data() + begin, pairs.j.data() + begin, end - begin};
    if (!events_) {
      kernel.sweep(balls_.rows.data(), span, law, sums, totals, nullptr);
      return;
    }
    found.resize(span.n + kLanes);
    Candidates candidates{found.data()};
    kernel.sweep(balls_.rows.data(), span, law, sums, totals, &candidates);
    found.resize(candidates.n);
    for (std::uint32_t& pair : found) pair += static_cast<std::uint32_t>(begin);
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
    for (const FoundCandidates& found : candidates_) {
      event_book_.examine(balls_.rows, list_.ball_pairs().span(), found.ball, law(false, step_), step_of, acceleration);
      event_book_.examine(balls_.rows, list_.fixed_pairs().span(), found.fixed, law(true, step_), step_of, acceleration);
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
    const Kernels& kernel = *setup_.kernels;
    const auto advance = scheme_ == Integrator::lagged ? kernel.advance_lagged : kernel.advance_predicted;
    const std::uint32_t n = balls_.content_count();
    bool unsafe = false, crossed = false;
#pragma omp parallel for num_threads(threads_) schedule(static, 1) reduction(|| : unsafe, crossed) if (threads_ > 1)
    for (int t = 0; t < threads_; ++t) {
      const std::size_t begin = std::size_t{n} * t / threads_, end = std::size_t{n} * (t + 1) / threads_;
      const AdvanceReport report = advance(what, balls_.rows.data(), sums_.data(), stride(), threads_, opening_.data(),
                                           balls_.inverse_mass.data(), list_.skins().data(), advance_, begin, end);
      unsafe = unsafe || report.list_unsafe;
      crossed = crossed || report.crossed;
    }
    if (what == Advance::close) return;  // positions moved, and were checked, when the step opened
    list_unsafe_ = unsafe;
    crossed_ = crossed;
  }

  void take_sums_as_opening() {
    for (std::uint32_t row = 0; row < balls_.content_count(); ++row) opening_[row] = total_force(row);
    std::fill(sums_.begin(), sums_.end(), IntVec{});
  }

  void keep_evaluated() { evaluated_.assign(balls_.rows.begin(), balls_.rows.begin() + balls_.content_count()); }

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
    if (!leaving.empty()) begin(leaving);
  }

  /// Balls that feel a contact for the first time (paper, section 5.3).
  void note_impacts() {
    first_hit_.clear();
    for (std::uint32_t row = 0; row < balls_.content_count(); ++row) {
      const IntVec force = total_force(row);
      if (impacted_[row] == 0 && (force.v[0] != 0 || force.v[1] != 0 || force.v[2] != 0)) first_hit_.push_back(row);
    }
    // In order of id, so that the ledger does not depend on the sort in space.
    std::sort(first_hit_.begin(), first_hit_.end(), [this](std::uint32_t a, std::uint32_t b) { return balls_.id[a] < balls_.id[b]; });
  }
  void stop_first_impacts() {
    for (const std::uint32_t row : first_hit_) {
      BallRow& ball = balls_.rows[row];
      impacted_[row] = 1;
      ledger_.first_impact += 0.5 * mass(row) * ball.vz * ball.vz;
      ledger_.first_impact_impulse.z() -= mass(row) * ball.vz;
      ball.vz = 0.0;
    }
  }

  struct Totals {
    SweepTotals ball, fixed;
  };
  struct FoundCandidates {
    std::vector<std::uint32_t> ball, fixed;
  };

  Integrator scheme_;
  bool events_;
  EventBook event_book_;
  int threads_;
  AdvanceParameters advance_;
  std::vector<IntVec> sums_;     // force units, one array per thread
  std::vector<IntVec> opening_;  // force units, the force that opened the step
  std::vector<FoundCandidates> candidates_;
  std::vector<std::uint32_t> first_hit_;
  SweepTotals ball_totals_, fixed_totals_;
  Totals previous_;
  bool list_unsafe_ = false;
  bool crossed_ = false;
};

}  // namespace

std::unique_ptr<Stepper> make_uniform_stepper(const State& state, const StepperSetup& setup) {
  return std::make_unique<UniformStepper>(state, setup);
}

}  // namespace grainclock::core
