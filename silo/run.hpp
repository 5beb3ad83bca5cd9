// A run: the phases of a scene, with frames, checkpoints and an orderly end.
#pragma once

#include "core/scene.hpp"

#include <string>

namespace grainclock::silo {

struct RunOptions {
  int threads = 1;
  double checkpoint_every = 60.0;  // s of wall clock
};

/// Runs the scene's phases into a directory that is empty or not there:
///   scene.toml       the resolved scene
///   run.h5, segments the frames (H5MD)
///   checkpoints      the newest ones
///   final.h5         the last state
/// Prints header, progress and ledger to standard output. Wrong input throws InputError before anything is written.
/// Throws NumericsError with a diagnosis, Stopped after SIGINT, SIGTERM, SIGHUP or SIGPIPE and a last checkpoint, InputError
/// where another run is at work there, and FileError.
void run_scene(const core::Scene& scene, const std::string& directory, const RunOptions& options);

/// Goes on with a run from its newest intact checkpoint, bitwise as if it had never stopped. The run is
/// known by its own copy of the scene; where that was changed, InputError. Passes over checkpoints that are damaged or whose
/// frames are; throws FileError with all reasons if none is left. A run that is over gets back a final.h5 or run.h5 it lost.
void resume_run(const std::string& directory, const RunOptions& options);

}  // namespace grainclock::silo
