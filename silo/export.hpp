// States and frames for other programs: ParaView, OVITO, LAMMPS, spreadsheets.
#pragma once

#include "core/state.hpp"

#include <optional>
#include <string>
#include <string_view>

namespace grainclock::silo {

enum class Format { vtk, paraview, lammps_data, lammps_dump, csv, scene };

struct ExportOptions {
  Format format;
  std::string output;        // a file; for paraview (see paraview.hpp) and scene a new directory
  std::optional<double> at;  // s; default: the last frame, for paraview all of them
  bool all = false;          // every frame of a run: .pvd with .vtp files beside it, or one dump
};

/// Exports a state, a checkpoint or a run. Throws InputError for options that do not go together, FileError.
/// Units are SI. LAMMPS counts atoms from 1: its id is ours plus 1; types are 1 content, 2 wall, 3 plug.
/// As a scene a run becomes DIR/scene.toml, with the DIR/start.h5 that it needs: run again they give the same run, bit for bit.
/// The density in LAMMPS data is the run's, or the default where the file does not tell.
void export_file(const std::string& path, const ExportOptions& options);

/// The texts of single states. `step`: LAMMPS's timestep.
std::string vtp_text(const core::State& state);
std::string lammps_data_text(const core::State& state, double density);
std::string lammps_dump_text(const core::State& state, std::int64_t step);

}  // namespace grainclock::silo
