// States from other programs.
#pragma once

#include "core/state.hpp"

#include <string>

namespace grainclock::silo {

/// Reads our CSV, LAMMPS data (atom_style sphere) or a LAMMPS dump (its last frame; columns id type x y z radius, or
/// diameter, and vx vy vz if they are there); which one, the file's first line tells. SI units; LAMMPS ids count
/// from 1, ours from 0; types 1 content, 2 wall, 3 plug; velocities of wall and plug must be 0.
/// Throws FileError, and InputError with file:line, the value and what would be right.
core::State import_file(const std::string& path);

}  // namespace grainclock::silo
