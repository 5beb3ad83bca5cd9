// What was seen where the numerics failed, as text and as a file.
#pragma once

#include "core/check.hpp"
#include "core/stepper.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace grainclock::silo {

/// Where and how a run failed.
struct Failure {
  std::string what;                 // the error's text
  std::vector<core::BallId> balls;  // that it was seen at, the worst first; may be none
  std::string phase;
  double time = 0.0;                // s, of the last whole step
  double critical_step = 0.0;       // s, smallest at the phase's start; 0: not known
  std::string last_checkpoint;      // path; empty: none yet
};

/// The failure with what is around it.
struct Diagnosis {
  Failure failure;
  core::State balls;                   // within three mean diameters of the worst ball, fixed ones too, as the failing step left them
  std::vector<double> critical_step;   // s, of each of these balls; NaN for fixed balls and those that are nowhere
  std::vector<core::Contact> contacts; // of these balls with each other
  core::LevelStatistics levels;
  core::Ledger ledger;
  core::Energies start, now;           // of the run; at the failure
  double step = 0.0;                   // s, coarsest
};

/// Looks around the worst ball; where none is named, at the one whose step is the most too long. Where it is no longer at
/// a finite place, around the one that it had in `before`, a state of the same run.
Diagnosis diagnose(const core::Stepper& stepper, const core::StepperSetup& setup, Failure failure, const core::Energies& start,
                   const std::optional<core::State>& before);

/// Lines for people: the error, the balls with their dt/dt_crit and contacts, levels, ledger, last checkpoint, remedies.
std::string text(const Diagnosis& diagnosis);

/// As HDF5: /balls, /contacts, /levels, /ledger, and the failure as attributes of the root. Aside, then renamed. FileError.
void write(const std::filesystem::path& path, const Diagnosis& diagnosis);

}  // namespace grainclock::silo
