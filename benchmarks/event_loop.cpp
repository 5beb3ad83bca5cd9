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
constexpr int kMostHalvings = 100;

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

/// An exit function over a step; positive within the branch.
class Watcher {
 public:
  Watcher(Solver& solver, ContactSystem& system, const WatchedPair& pair, const Exit& exit, N_Vector scratch)
      : solver_(solver), system_(system), pair_(pair), exit_(exit), scratch_(scratch),
        rounding_(system.watched()->rounding().of(exit)), first_(exit.value(pair.start)) {}

  double rounding() const { return rounding_; }
  double first() const { return first_; }
  double at(double time) const {
    solver_.evaluate_at(time, scratch_);
    return exit_.value(system_.watched()->approach(pair_, system_.motion_at(scratch_)));
  }

  /// A time in (begin, end) at which the exit is passed, if the lowest point in between is beyond it: golden sections.
  std::optional<double> beyond(double begin, double end) const {
    constexpr double kGolden = std::numbers::phi - 1.0;
    double left = end - kGolden * (end - begin), right = begin + kGolden * (end - begin);
    double at_left = at(left), at_right = at(right);
    // The lowest value is known to rounding when its place is known to half the digits.
    const double enough = std::sqrt(kEpsilon) * (end - begin);
    while (end - begin > enough) {
      if (at_left < -rounding_) return left;
      if (at_right < -rounding_) return right;
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

  /// The time between `begin`, within the branch, and `end`, beyond it, at which the exit is passed: false position, the
  /// end that stays having its value halved.
  double root(double begin, double end) const {
    // A pair that begins on its limit leaves it when it is beyond by more than rounding.
    const double level = first_ > rounding_ ? 0.0 : -rounding_;
    double low = first_ - level, high = at(end) - level;
    if (low <= 0.0) return begin;
    int kept = 0;  // which end stayed last
    for (int n = 0; n < kMostHalvings && end - begin > 2.0 * kEpsilon * end; ++n) {
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
  Solver& solver_;
  ContactSystem& system_;
  const WatchedPair& pair_;
  const Exit& exit_;
  N_Vector scratch_;
  double rounding_, first_;
};

struct Found {
  double time;  // s
  WatchedPair* pair;
  Exit exit;
};

class EventLoop {
 public:
  EventLoop(double horizon, Solver& solver, ContactSystem& system, N_Vector y, double window)
      : horizon_(horizon), solver_(solver), system_(system), y_(y), scratch_(N_VClone(y)), window_(window) {}

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
    WatchedPairs& watched = *system_.watched();
    for (WatchedPair& pair : watched.pairs()) {
      const Exits exits = exits_of(watched.law(pair), pair.branch);
      for (const Exit& exit : exits.all()) {
        const Passage how = passage(exit, pair.start, pair.end, end - begin, watched.rounding().of(exit));
        if (how == Passage::none) continue;
        const double last = first ? first->time : end;
        const Watcher watcher(solver_, system_, pair, exit, scratch_.get());
        std::optional<double> beyond;
        if (watcher.first() < -watcher.rounding()) return Found{begin, &pair, exit};  // changes may coincide
        if (watcher.at(last) < -watcher.rounding()) beyond = last;
        else if (how == Passage::grazing) beyond = watcher.beyond(begin, last);
        if (beyond) first = Found{watcher.root(begin, *beyond), &pair, exit};
      }
    }
    return first;
  }

  /// Puts the pair onto its new branch and starts the solver anew.
  void stop_at(const Found& change) {
    WatchedPairs& watched = *system_.watched();
    solver_.evaluate_at(change.time, y_);
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
  Vector scratch_;
  double window_;   // s
  LoopResult result_;
};

}  // namespace

LoopResult run_to(double horizon, Solver& solver, ContactSystem& system, N_Vector y, double window) {
  return EventLoop(horizon, solver, system, y, window).run();
}

}  // namespace grainclock::benchmarks
