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

void count(BranchChanges& changes, ChangeKind kind) {
  switch (kind) {
    case ChangeKind::touched: ++changes.touched; break;
    case ChangeKind::lost: ++changes.lost; break;
    case ChangeKind::clamped: ++changes.clamped; break;
    case ChangeKind::unclamped: ++changes.unclamped; break;
    case ChangeKind::out_of_reach: ++changes.out_of_reach; break;
    case ChangeKind::into_reach: ++changes.into_reach; break;
    case ChangeKind::parting: ++changes.parting; break;
    case ChangeKind::nearing: ++changes.nearing; break;
  }
}

/// The solution within the solver's last step.
class WithinStep {
 public:
  WithinStep(Solver& solver, ContactSystem& system, N_Vector y) : solver_(solver), system_(system), solution_(N_VClone(y)) {}

  /// The solution at this time [s]; the last one is kept.
  N_Vector at(double time) {
    if (!time_ || *time_ != time) solver_.evaluate_at(time, solution_.get());
    time_ = time;
    return solution_.get();
  }
  /// Another step has been taken.
  void forget() { time_.reset(); }

  ContactSystem& system() { return system_; }

 private:
  Solver& solver_;
  ContactSystem& system_;
  Vector solution_;
  std::optional<double> time_;  // s, of the solution
};

/// The value of a pair's exit function over a step; it is positive within the branch.
class ExitPath {
 public:
  ExitPath(WithinStep& step, const WatchedPair& pair, const Exit& exit)
      : step_(step), pair_(pair), exit_(exit), rounding_(step.system().watched()->rounding().of(exit)) {}

  bool is_beyond(double value) const { return value < -rounding_; }
  double first() const { return exit_.value(pair_.start); }
  double at(double time) const { return exit_.value(step_.system().watched()->approach(pair_, step_.system().motion_at(step_.at(time)))); }

  /// A time [s] in (begin, end) at which the exit has been passed, if the lowest point in between is beyond it: golden sections.
  std::optional<double> beyond(double begin, double end) const {
    constexpr double kGolden = std::numbers::phi - 1.0;
    double left = end - kGolden * (end - begin), right = begin + kGolden * (end - begin);
    double at_left = at(left), at_right = at(right);
    // The lowest value is known to rounding when its place is known to half the digits.
    const double enough = std::sqrt(kEpsilon) * (end - begin);
    while (end - begin > enough) {
      if (is_beyond(at_left)) return left;
      if (is_beyond(at_right)) return right;
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
    return std::nullopt;
  }

  /// The time [s] between `begin`, within the branch, and `end`, beyond it with `last`, at which the exit is passed: false
  /// position, the end that stays having its value halved.
  double root(double begin, double end, double last) const {
    // A pair that begins on its limit leaves it when it is beyond by more than rounding.
    const double level = first() > rounding_ ? 0.0 : -rounding_;
    double low = first() - level, high = last - level;
    int kept = 0;  // which end stayed last
    for (int n = 0; n < kMostSections && end - begin > 2.0 * kEpsilon * end; ++n) {
      double time = end - high * (end - begin) / (high - low);
      if (!(time > begin && time < end)) time = 0.5 * (begin + end);
      const double value = at(time) - level;
      if (std::abs(value) <= 0.25 * rounding_) return time;
      if (value < 0.0) {
        end = time;
        high = value;
        if (kept == -1) low *= 0.5;
        kept = -1;
      } else {
        begin = time;
        low = value;
        if (kept == 1) high *= 0.5;
        kept = 1;
      }
    }
    return end;
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
      if (system_.watched()) {
        WatchedPairs& watched = *system_.watched();
        watched.note_end(system_.motion_at(y_));
        if (const std::optional<Found> change = first_change(time, reached)) {
          stop_at(*change);
          time = change->time;
          continue;
        }
        watched.begin_step();
        const Motion& motion = system_.motion_at(y_);
        if (watched.is_worn(motion)) watched.renew(motion);
      }
      time = reached;
    }
    return std::move(result_);
  }

 private:
  /// The earliest change within the step from `begin` to `end` [s].
  std::optional<Found> first_change(double begin, double end) {
    std::optional<Found> first;
    within_.forget();
    WatchedPairs& watched = *system_.watched();
    for (WatchedPair& pair : watched.pairs()) {
      const Exits exits = exits_of(watched.law(pair), pair.branch);
      for (const Exit& exit : exits.all()) {
        const Passage how = passage(exit, pair.start, pair.end, end - begin, watched.rounding());
        if (how == Passage::none) continue;
        const ExitPath path(within_, pair, exit);
        if (path.is_beyond(path.first())) return Found{begin, &pair, exit};  // at the same time as the change before
        std::optional<double> beyond = first ? first->time : end;
        double last = first ? path.at(*beyond) : exit.value(pair.end);
        if (!path.is_beyond(last)) {
          if (how == Passage::grazing) beyond = path.beyond(begin, *beyond);
          else beyond.reset();  // passed after the first change
          if (beyond) last = path.at(*beyond);
        }
        if (beyond) first = Found{path.root(begin, *beyond, last), &pair, exit};
      }
    }
    return first;
  }

  /// Puts the pair onto its new branch and starts the solver anew.
  void stop_at(const Found& change) {
    WatchedPairs& watched = *system_.watched();
    N_VScale(1.0, within_.at(change.time), y_);
    WatchedPair& pair = *change.pair;
    pair.branch = change.exit.to;
    if (change.time - pair.window > window_) {
      pair.window = change.time;
      pair.changes = 0;
    }
    if (++pair.changes > kMostChanges) {
      throw core::NumericsError(fmt::format(
          "reference: balls {} and {} change their branch more than {} times within {} s, at {} s: the law switches its force "
          "on and off there without end (as cohesion does that carries a load); integrate without roots, or without cohesion",
          watched.id_of(pair.i), watched.id_of(pair.j), kMostChanges, window_, change.time));
    }
    count(result_.changes, change.exit.kind);
    result_.log.push_back({change.time, watched.id_of(pair.i), watched.id_of(pair.j), change.exit.kind});
    ++result_.restarts;
    watched.note_end(system_.motion_at(y_));
    watched.begin_step();
    if (horizon_ > change.time) solver_.restart(change.time, y_, horizon_);
  }

  double horizon_;  // s
  Solver& solver_;
  ContactSystem& system_;
  N_Vector y_;
  WithinStep within_;
  double window_;   // s
  LoopResult result_;
};

}  // namespace

LoopResult run_to(double horizon, Solver& solver, ContactSystem& system, N_Vector y, double window) {
  return EventLoop(horizon, solver, system, y, window).run();
}

}  // namespace grainclock::benchmarks
