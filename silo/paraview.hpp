// A run for ParaView: content, contacts and wall, each a collection over time.
//
// In the directory: balls.pvd, contacts.pvd, wall.pvd, and their frames in frames/. Every file is written aside and renamed,
// the collections last: what they name is there. SI units.
//   balls     points: id, radius, velocity, speed, level (0 is the finest), kind
//   contacts  lines between centres: normal_force (positive where it pushes), overlap, kind (of the second ball: 0 content,
//             1 wall, 2 plug), first, second (ids)
//   wall      points: id, radius, kind (1 wall, 2 plug), and pressure where it is given
// Balls show as spheres by Point Gaussian (scaled by radius) or Glyph, contacts by Cell Data to Point Data and Tube.
#pragma once

#include "core/stepper.hpp"
#include "silo/run_file.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace grainclock::silo {

/// The texts of single frames.
std::string balls_vtp(const core::State& state);
/// Throws InputError for a contact of a ball that is not in the state.
std::string contacts_vtp(const core::State& state, const std::vector<core::Contact>& contacts);
/// `pressure`: one value per ball of the state [Pa], or empty; without the plug if not `with_plug`.
std::string wall_vtp(const core::State& state, bool with_plug, const std::vector<double>& pressure = {});

/// Pressure [Pa] of every ball of a state (only that of fixed balls is looked at) by its contacts.
using WallPressure = std::function<std::vector<double>(const core::State&, const std::vector<core::Contact>&)>;

/// Writes all frames of a run, or the one at a time [s], into a new or empty directory. With `pressure` the wall is
/// written in every frame, its plug while the outlet is closed; without, once and with its plug.
/// Throws InputError (a directory that is in use, a time outside the run), FileError.
void export_paraview(const RunReader& run, const std::string& directory, std::optional<double> at = std::nullopt,
                     const WallPressure& pressure = {});

}  // namespace grainclock::silo
