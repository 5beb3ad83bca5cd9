// Contacts of a run's recorded frames: found again from the balls and the law of the phase that they were recorded in.
//
// A run records balls, not contacts. Positions and velocities of a frame give the same contacts, overlaps and forces
// again (to the rounding of a force), because frames are taken at synchronised times. What cannot be found again: contacts
// with the collar of a filling, which is not recorded; and forces of dashpots with a memory (stepping.dashpot other than
// explicit): here a dashpot's force is that of its moment.
#pragma once

#include "core/stepper.hpp"
#include "silo/run_file.hpp"

#include <toml++/toml.h>

#include <vector>

namespace grainclock::silo {

/// What forces come from in a phase, and when its frames can be: after `earliest`, and not after `latest`.
struct PhaseLaw {
  core::Materials materials;
  bool outlet_open = false;
  double earliest = 0.0, latest = 0.0;  // s after the run began
};

/// The laws of all phases, from a resolved scene as runs keep it. Throws FileError where something is missing.
std::vector<PhaseLaw> phase_laws(const toml::table& scene);

struct FrameContacts {
  std::vector<core::Contact> contacts;
  bool outlet_open = false;  // then the plug is not there
};

class ContactFinder {
 public:
  /// `run` must outlive this.
  explicit ContactFinder(const RunReader& run);

  /// Contacts in the frame of which `state` is the state, by the law of the phase that the run recorded with it. Runs of
  /// earlier versions did not record it: where phases that end by a condition leave it open, it is the one whose law gives
  /// the elastic energy and the wall forces that were recorded (if these cannot tell, the earlier one).
  /// Throws FileError where a frame fits no phase.
  FrameContacts contacts(std::int64_t frame, const core::State& state) const;

 private:
  std::unique_ptr<core::Stepper> stepper(const core::State& state, const PhaseLaw& law) const;
  std::vector<PhaseLaw> candidates(std::int64_t frame) const;
  double mismatch(std::int64_t frame, const core::State& state, const core::Stepper& stepper) const;

  const RunReader& run_;
  std::vector<PhaseLaw> laws_;
};

}  // namespace grainclock::silo
