// Where a run stands, exactly: a checkpoint continues bitwise.
#pragma once

#include "core/ledger.hpp"
#include "core/state.hpp"
#include "core/stepper.hpp"
#include "silo/phases.hpp"

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace grainclock::silo {

/// Position of a run in its scene.
struct Position {
  std::int64_t phase = 0;          // index; the number of phases once the run is over
  std::int64_t steps = 0;          // coarsest steps since the phase's start
  std::int64_t total_steps = 0;    // the same since the run's start
  std::int64_t frames = 0;         // recorded until now
  std::int64_t records = 0;        // of observables, likewise
  std::uint64_t scene = 0;         // checksum of scene.toml
  double phase_start = 0.0;        // s
  double step = 0.0;               // s, the phase's coarsest step
  std::int64_t fell_back = 0;      // 1: this phase steps uniformly though its scene says multirate
  core::BallId first_collar = -1;  // of the filling, -1: none, or taken away
  Watch watch;
  MeanBall mean;                   // at the phase's start
  core::Energies start;            // of the run
  core::Ledger ledger;
  core::Costs costs;
};

struct Checkpoint {
  core::State state;  // with its restart members
  Position position;
};

/// Writes DIR/NNNNNN.h5 aside and renamed, and removes all but the newest three; gives its path. Throws FileError.
std::string write_checkpoint(const std::filesystem::path& directory, const Checkpoint& checkpoint);
/// Throws FileError where the file is missing, damaged or no checkpoint.
Checkpoint read_checkpoint(const std::filesystem::path& path);
/// The checkpoints of a directory, newest first; other files there are passed over.
std::vector<std::filesystem::path> checkpoints_in(const std::filesystem::path& directory);

}  // namespace grainclock::silo
