// What the paper reads off a silo, from the frames of a recorded run: one file of series beside it.
//
// The file (HDF5) holds, for the measured frames,
//   time          s
//   series/NAME   one row per frame, attribute `unit`; see moment_of(); layer_edges [m] and force_edges (over the mean force) are
//                 attributes of the group
//   between_frames/...  stoppages, beats, spectra and the hammer, from what the run records between frames; see between_frames.hpp
//   wall/...      id, angle, around, along, z, area of the wall balls, and their pressure frame by frame
//   bridges/...   bonds, ids of two balls that support each other: those of the larger bridges, frame after frame; begin, the first
//                 row of each frame and at last their number; attribute least, the balls of the smallest bridge that is there
#pragma once

#include "core/state.hpp"
#include "core/stepper.hpp"
#include "silo/arches.hpp"
#include "silo/geometry.hpp"
#include "silo/run_file.hpp"
#include "silo/wall_pressure.hpp"

#include <optional>
#include <string>
#include <vector>

namespace grainclock::silo {

struct MeasureOptions {
  std::string output;             // empty: measures.h5 beside the run
  std::string silo;               // scene whose [silo] the wall is of; empty: that of the run
  std::optional<double> every;    // s, least time between measured frames; all frames without
  int threads = 1;
};

/// The silo whose content is measured.
struct MeasuredSilo {
  SiloShape shape;
  Layers layers;   // of the wall
  double density;  // kg/m3, of the balls
};

/// What is read off one moment.
struct Reading {
  std::vector<Observable> series;
  std::vector<WallLoad> wall;
  std::vector<Bond> bonds;  // of the bridges of kLargeBridge balls and more
};

inline constexpr std::size_t kLargeBridge = 4;
/// Edges of the classes of series/force_distribution, over the mean force.
const std::vector<double>& force_edges();

/// All measures of one moment: density.hpp, surface.hpp, order.hpp, chains.hpp, arches.hpp, flux.hpp and wall_pressure.hpp
/// say what they mean. `before`: an earlier moment, for mean velocities; without, velocities are those of the moment.
Reading moment_of(const core::State& state, const std::vector<core::Contact>& contacts, const core::State* before,
                  const MeasuredSilo& silo);

/// Measures a run, its frames shared among threads. Throws InputError without a [silo] or a wall, FileError.
void measure_run(const std::string& run, const MeasureOptions& options);

}  // namespace grainclock::silo
