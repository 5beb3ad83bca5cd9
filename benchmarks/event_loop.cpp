#include "benchmarks/event_loop.hpp"

#include "core/check.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

namespace grainclock::benchmarks {
namespace {

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
/// A collision takes four changes in about three windows: this many within one are no motion of balls.
constexpr int kMostChanges = 32;
constexpr int kMostSections = 100;
constexpr double kStalled = 16.0 * kEpsilon;  // of the time: no step of a motion is as short
constexpr int kMostStalled = 100;

void count(BranchChanges& changes, ChangeKind kind) {
  switch (kind) {
    case ChangeKind::touched:
      ++changes.touched;
      break;
    case ChangeKind::lost:
      ++changes.lost;
      break;
    case ChangeKind::clamped:
      ++changes.clamped;
      break;
    case ChangeKind::unclamped:
      ++changes.unclamped;
      break;
    case ChangeKind::out_of_reach:
      ++changes.out_of_reach;
      break;
    case ChangeKind::into_reach:
      ++changes.into_reach;
      break;
    case ChangeKind::parting:
      ++changes.parting;
      break;
    case ChangeKind::nearing:
      ++changes.nearing;
      break;
  }
}

/// The solution within the solver's last step.
///
/// Solvers that iterate within a step give a little less than a smooth function of time. Hence the solution that a
/// change has been seen on is kept: computed again it could be on the branch's other side.
class WithinStep {
 public:
  WithinStep(Solver& solver, ContactSystem& system, N_Vector y)
      : solver_(solver), system_(system), solution_(N_VClone(y)), kept_(N_VClone(y)) {}

  /// The step ends at `time` [s] with the solution `y`, which is kept.
  void begin(double time, N_Vector y) {
    N_VScale(1.0, y, kept_.get());
    kept_time_ = time;
  }
  const Motion& at(double time) {
    if (time == kept_time_) return system_.motion_at(kept_.get());
    solver_.evaluate_at(time, solution_.get());
    time_ = time;
    return system_.motion_at(solution_.get());
  }
  /// Keeps the solution that was last asked for.
  void keep() {
    std::swap(kept_, solution_);
    std::swap(kept_time_, time_);
  }
  N_Vector kept() const { return kept_.get(); }
  double kept_time() const { return kept_time_; }

  const WatchedPairs& watched() const { return *system_.watched(); }

 private:
  Solver& solver_;
  ContactSystem& system_;
  Vector solution_, kept_;
  double time_ = 0.0, kept_time_ = 0.0;  // s
};

/// The value of a pair's exit function over a step; it is positive within the branch.
class ExitPath {
 public:
  ExitPath(WithinStep& step, const WatchedPair& pair, const Exit& exit)
      : step_(step), pair_(pair), exit_(exit), rounding_(step.watched().rounding().of(exit)) {}

  bool is_beyond(double value) const { return value < -rounding_; }
  double first() const { return exit_.value(pair_.start); }
  double at(double time) const { return exit_.value(step_.watched().approach(pair_, step_.at(time))); }

  /// Looks for the lowest point of (begin, end) [s] by golden sections until a point is beyond the exit, and keeps that.
  bool keep_beyond(double begin, double end) const {
    constexpr double kGolden = std::numbers::phi - 1.0;
    double left = end - kGolden * (end - begin), right = begin + kGolden * (end - begin);
    double at_left = at(left), at_right = at(right);
    // The lowest value is known to rounding when its place is known to half the digits.
    const double enough = std::sqrt(kEpsilon) * (end - begin);
    while (end - begin > enough) {
      if (is_beyond(at_left) || is_beyond(at_right)) {
        if (is_beyond(at_left)) at(left);
        step_.keep();
        return true;
      }
      if (at_left < at_right) {
        end = right;
        right = left;
        at_right = at_left;
        left = end - kGolden * (end - begin);
        at_left = at(left);
      } else {
        begin = left;
        left = right;
        at_left = at_right;
        right = begin + kGolden * (end - begin);
        at_right = at(right);
      }
    }
    return false;
  }

  /// Moves what is kept from a time beyond the exit to the time at which the exit is passed after `begin` [s]: false
  /// position, the end that stays having its value halved.
  void keep_root(double begin) const {
    // Beyond the exit by no more than rounding; where the pair begins on its limit, by that much more. On the other side
    // the new branch would end at once.
    const double level = first() > rounding_ ? -0.5 * rounding_ : -1.5 * rounding_;
    double low = first() - level, high = at(step_.kept_time()) - level;
    if (high >= -0.5 * rounding_) return;
    int stayed = 0;  // which end did last
    for (int n = 0; n < kMostSections; ++n) {
      const double end = step_.kept_time();
      if (end - begin <= 2.0 * kEpsilon * end) return;
      double time = end - high * (end - begin) / (high - low);
      if (!(time > begin && time < end)) time = 0.5 * (begin + end);
      const double value = at(time) - level;
      const bool is_root = std::abs(value) <= 0.5 * rounding_;
      if (is_root || value < 0.0) step_.keep();
      if (is_root) return;
      if (value < 0.0) {
        high = value;
        if (stayed == -1) low *= 0.5;
        stayed = -1;
      } else {
        begin = time;
        low = value;
        if (stayed == 1) high *= 0.5;
        stayed = 1;
      }
    }
  }

 private:
  WithinStep& step_;
  const WatchedPair& pair_;
  const Exit& exit_;
  double rounding_;
};

struct Found {
  double time;  // s
  WatchedPair* pair;
  Exit exit;
};

class EventLoop {
 public:
  EventLoop(double horizon, Solver& solver, ContactSystem& system, N_Vector y, double window)
      : horizon_(horizon), solver_(solver), system_(system), y_(y), within_(solver, system, y), window_(window) {}

  LoopResult run() {
    double time = 0.0;
    solver_.restart(time, y_, horizon_);
    while (horizon_ - time > 8.0 * kEpsilon * horizon_) {
      const double reached = solver_.step(y_);
      ++result_.steps;
      require_progress(time, reached);
      if (system_.watched()) {
        WatchedPairs& watched = *system_.watched();
        watched.note_end(system_.motion_at(y_));
        const std::optional<Found> change = first_change(time, reached);
        time = change ? change->time : reached;
        if (change) stop_at(*change);
        watched.begin_step();
        // After a change too: where they come thick and fast no step is ever finished.
        const Motion& motion = system_.motion_at(y_);
        if (watched.is_worn(motion)) watched.renew(motion);
      } else {
        time = reached;
      }
    }
    return std::move(result_);
  }

 private:
  /// Towards a state whose forces are refused CVODE's steps shrink to nothing, each of them a success.
  void require_progress(double begin, double end) {
    stalled_ = end - begin > kStalled * end ? 0 : stalled_ + 1;
    if (stalled_ < kMostStalled) return;
    throw core::NumericsError(
        fmt::format("reference: {} steps in a row advance by less than rounding at {} s: beyond that a contact force or "
                    "overlap is at its limit; use stiffer contacts, slower balls or a shorter horizon",
                    kMostStalled, end));
  }

  /// The earliest change within the step from `begin` to `end` [s]; the solution there is kept.
  std::optional<Found> first_change(double begin, double end) {
    std::optional<Found> first;
    WatchedPairs& watched = *system_.watched();
    for (WatchedPair& pair : watched.pairs()) {
      const Exits exits = exits_of(watched.law(pair), pair.branch);
      for (const Exit& exit : exits.all()) {
        const Passage how = passage(exit, pair.start, pair.end, end - begin, watched.rounding());
        if (how == Passage::none) continue;
        if (!first) within_.begin(end, y_);
        const ExitPath path(within_, pair, exit);
        if (path.is_beyond(path.first())) {  // at the same time as the change before
          path.at(begin);
          within_.keep();
          return Found{begin, &pair, exit};
        }
        // What is kept is the step's end or the first change: a later one does not count.
        const bool passed = path.is_beyond(path.at(within_.kept_time())) ||
                            (how == Passage::grazing && path.keep_beyond(begin, within_.kept_time()));
        if (!passed) continue;
        path.keep_root(begin);
        first = Found{within_.kept_time(), &pair, exit};
      }
    }
    return first;
  }

  /// Puts the pair onto its new branch and starts the solver anew.
  void stop_at(const Found& change) {
    WatchedPairs& watched = *system_.watched();
    N_VScale(1.0, within_.kept(), y_);
    WatchedPair& pair = *change.pair;
    pair.branch = change.exit.to;
    if (change.time - pair.window > window_) {
      pair.window = change.time;
      pair.changes = 0;
    }
    if (++pair.changes > kMostChanges) {
      throw core::NumericsError(
          fmt::format("reference: balls {} and {} change their branch more than {} times within {} s, at {} s: the law "
                      "switches its force on and off there without end (as cohesion does that carries a load); use a "
                      "smaller rtol, no roots, or no cohesion",
                      watched.id_of(pair.i), watched.id_of(pair.j), kMostChanges, window_, change.time));
    }
    count(result_.changes, change.exit.kind);
    result_.log.push_back({change.time, watched.id_of(pair.i), watched.id_of(pair.j), change.exit.kind});
    ++result_.restarts;
    watched.note_end(system_.motion_at(y_));
    if (horizon_ > change.time) solver_.restart(change.time, y_, horizon_);
  }

  double horizon_;  // s
  Solver& solver_;
  ContactSystem& system_;
  N_Vector y_;
  WithinStep within_;
  double window_;    // s
  int stalled_ = 0;  // steps in a row
  LoopResult result_;
};

}  // namespace

LoopResult run_to(double horizon, Solver& solver, ContactSystem& system, N_Vector y, double window) {
  return EventLoop(horizon, solver, system, y, window).run();
}

}  // namespace grainclock::benchmarks
