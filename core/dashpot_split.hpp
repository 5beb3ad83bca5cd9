// Drift, kick, drift: half a step on straight lines, all forces at once, half a step on straight lines.
//
// The kick's dashpots see velocities that they have already slowed down, and no ball moves before they have: where
// a dashpot holds two balls together, these creep at the speed that the law says, however long the step.
#pragma once

#include "core/dashpot_stepper.hpp"

namespace grainclock::core {

class SplitStepper : public DashpotStepper {
 public:
  using DashpotStepper::DashpotStepper;

 protected:
  /// Sets the touches' dashpot forces: means over the step.
  virtual void find_dashpots() = 0;
  /// Takes the springs' forces alone for a start: velocities after a kick of theirs, per row.
  void kick_without_dashpots(std::vector<Vec3>& velocity);
  /// Velocities after `seconds` of gravity and of the forces in sums_, per row.
  void kick(double seconds, std::vector<Vec3>& velocity) const;

 private:
  void restart() final {}
  void take_step() final;
  void drift();

  std::vector<Vec3> kicked_;  // m/s
};

}  // namespace grainclock::core
