#include "multirate/schedule.hpp"

#include <fmt/format.h>

namespace grainclock::multirate {

std::vector<Action> dry_run(Level finest, Level coarsest) {
  std::vector<Action> actions;
  run_schedule(finest, coarsest, [&](const Action& action) { actions.push_back(action); });
  return actions;
}

std::string describe(const std::vector<Action>& actions) {
  constexpr const char* kNames[] = {"drift", "evaluate", "kick"};
  std::string text;
  for (const Action& a : actions) {
    text += fmt::format("tick {:4d}  {} level {}\n", a.tick.count, kNames[static_cast<int>(a.kind)], int{a.level});
  }
  return text;
}

}  // namespace grainclock::multirate
