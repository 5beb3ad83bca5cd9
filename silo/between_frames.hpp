// What runs record between frames, read as the paper does (sections 5.3 and 5.4, conclusions 2, 4 and 6): stoppages and
// beats of a discharge, the frequencies of what pushes the silo sideways, the hammer.
#pragma once

#include "silo/discharge.hpp"
#include "silo/pressure_history.hpp"
#include "silo/run_file.hpp"
#include "silo/spectrum.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace grainclock::silo {

/// A phase as its records show it: [first, end), the first of them the one that it begins with, which is the phase before's last.
struct RecordedPhase {
  std::string name;
  bool is_open;
  std::size_t first, end;
};
/// `phase`: number of the phase of each record; `scene` as the run keeps it. Phases without records are left out. Throws FileError
/// for numbers that the scene has no phases for.
std::vector<RecordedPhase> recorded_phases(const std::vector<double>& phase, const toml::table& scene);

/// The content's motion over time, one value for each record.
struct BulkMotion {
  std::vector<double> time;           // s
  std::vector<double> discharged;     // balls
  std::vector<double> energy;         // kinetic, per ball that is still there, in m g r of a mean ball
  std::vector<double> sinking_speed;  // m/s, downward momentum over the mass of as many mean balls as are still there
  std::vector<double> rate;           // balls/s, over a second around each record
};

/// How a phase with an open outlet goes on. Beats: prominence of a quarter of the phase's mean and more (discharge.hpp).
struct Rhythm {
  std::vector<TimeSpan> pauses;     // no ball leaves for a quarter of a second and more
  std::vector<TimeSpan> stoppages;  // and the content but creeps: energy below 5e-3
  double longest_pause = 0.0;       // s, of any length
  std::vector<Beat> energy_beats, speed_beats;
};
Rhythm rhythm_of(const BulkMotion& motion, const RecordedPhase& phase);

/// The mean force over each interval between records [N], from the impulse since the run began [N s] (`width` numbers at each time, of
/// which `axis` is taken): unlike forces of moments it holds nothing that is faster than the records but what a mean over the interval
/// leaves of it. One value less than there are times.
std::vector<double> mean_force(const Recorded& impulse, std::size_t axis);

/// How far the pressures of some places exceed references while the outlet is shut.
struct HammerPressures {
  std::vector<std::string> place;       // layers, "patch" if it is recorded, "wall" for all of it
  std::vector<Overpressure> over_rest;  // over the mean of the phase before the first opening, level: a tenth above
  std::vector<Overpressure> over_flow;  // over the mean of the 20 s before the outlet is shut (all of the phase if shorter)
};

/// All of it, from a run; nothing if it has no records of motion (older runs).
struct BetweenFrames {
  struct Spectra {
    std::vector<double> frequency;  // Hz, up to half the records' rate
    /// Densities per Hz: energy and sinking speed, patch pressure (empty without), and of each axis the lateral force, as mean force
    /// of intervals; by layer the sum over both axes of forces of moments.
    std::vector<double> energy, sinking_speed, patch_pressure, lateral_x, lateral_y;
    std::vector<std::vector<double>> by_layer;
  };
  struct Phase {
    RecordedPhase phase;
    Rhythm rhythm;
    std::optional<Spectra> spectra;  // of phases of 20 s and more
  };
  BulkMotion motion;
  std::vector<Phase> open;  // with an open outlet
  std::optional<HammerPressures> hammer;
};
std::optional<BetweenFrames> between_frames(const RunReader& run);
/// Writes it into a group: time and the motion's series, phase_K with pauses, stoppages, beats and spectra, hammer.
void write(core::Hdf5Group& group, const BetweenFrames& found);

}  // namespace grainclock::silo
