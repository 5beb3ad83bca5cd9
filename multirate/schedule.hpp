// The order of work within one coarse step, and nothing of physics.
#pragma once

#include "multirate/time_line.hpp"

#include <string>
#include <vector>

namespace grainclock::multirate {

/// One action of the schedule at a tick. Actions of the same tick come in this order.
struct Action {
  enum class Kind {
    drift,     // rows that take part at `level` (every 2^level ticks) move to this tick
    evaluate,  // contacts of `level` are evaluated
    kick       // balls of `level` and finer end their steps and begin the next; all others book the impulse
  };
  Kind kind;
  Tick tick;
  Level level;
  bool operator==(const Action&) const = default;
};

/// Calls visit(Action) for every action of one coarse step. `finest` is the finest level in use:
/// ticks at which nothing happens are passed over. Level l acts at every multiple of 2^l ticks.
template <class Visit>
void run_schedule(Level finest, Level coarsest, Visit visit) {
  for (Tick tick{ticks_of(finest)}; tick.count <= ticks_of(coarsest); tick.count += ticks_of(finest)) {
    const Level active = coarsest_active(tick, coarsest);
    for (Level l = finest; l <= active; ++l) visit(Action{Action::Kind::drift, tick, l});
    for (Level l = finest; l <= active; ++l) visit(Action{Action::Kind::evaluate, tick, l});
    visit(Action{Action::Kind::kick, tick, active});
  }
}

/// The list of actions, for tests and for looking at.
std::vector<Action> dry_run(Level finest, Level coarsest);
std::string describe(const std::vector<Action>& actions);

}  // namespace grainclock::multirate
