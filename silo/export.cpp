#include "silo/export.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "core/materials.hpp"
#include "core/snapshot.hpp"
#include "silo/paraview.hpp"
#include "silo/run_file.hpp"
#include "silo/vtp.hpp"
#include "silo/wall_pressure.hpp"

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

namespace grainclock::silo {
namespace {

namespace fs = std::filesystem;
using core::State;
using core::Vec3;

int lammps_type(core::Kind kind) { return static_cast<int>(kind) + 1; }

struct Box {
  Vec3 lower = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 upper = -lower;
};

Box box_of(const State& state) {
  Box box;
  for (std::size_t i = 0; i < state.size(); ++i) {
    box.lower = box.lower.cwiseMin(state.position[i] - Vec3::Constant(state.radius[i]));
    box.upper = box.upper.cwiseMax(state.position[i] + Vec3::Constant(state.radius[i]));
  }
  return box;
}

double density_of(const RunReader& run) { return run.scene()["material"]["density"].value_or(core::Materials{}.density); }

/// Pressure on every wall ball [Pa]; other balls have none.
std::vector<double> pressures(const State& state, const std::vector<core::Contact>& contacts) {
  std::vector<double> pressure(state.size(), std::numeric_limits<double>::quiet_NaN());
  // Its shape tells where a ball is on the unfolded wall, which does not matter here: any will do.
  std::size_t ball = 0;  // loads are in order of id too
  for (const WallLoad& load : wall_loads(state, contacts, SiloShape{})) {
    while (state.id[ball] != load.id) ++ball;
    pressure[ball] = load.pressure();
  }
  return pressure;
}

/// Frame after frame: the dump of a long run does not fit into memory.
void write_whole_dump(const RunReader& run, const std::string& path) {
  core::AsideFile aside(path);
  std::ofstream out(aside.part(), std::ios::binary);
  if (!out) throw core::FileError(fmt::format("{}: cannot be written: {}", path, std::strerror(errno)));
  for (std::int64_t frame = 0; frame < run.frames(); ++frame) out << lammps_dump_text(run.state(frame), run.step(frame));
  out.close();
  if (!out) throw core::FileError(fmt::format("{}: cannot be written in full: is the disk full?", path));
  aside.commit();
}

void export_all(const RunReader& run, const ExportOptions& options) {
  if (options.format == Format::lammps_dump) return write_whole_dump(run, options.output);
  std::vector<std::pair<double, std::string>> files;
  for (std::int64_t frame = 0; frame < run.frames(); ++frame) {
    const State state = run.state(frame);
    fs::path file(options.output);
    file.replace_filename(fmt::format("{}_{:06}.vtp", file.stem().string(), frame));
    core::write_text(file, vtp_text(state));
    files.emplace_back(state.time, file.filename().string());
  }
  core::write_text(options.output, pvd_text(files));
}

/// The scene that repeats a run, from nothing but the run's file.
void export_scene(const RunReader& run, const fs::path& directory) {
  std::error_code trouble;
  GC_REQUIRE(!fs::exists(directory) || (fs::is_directory(directory) && fs::is_empty(directory)),
             "--output {}: exists and is not an empty directory; give a new one", directory.string());
  toml::table scene = run.scene();
  fs::create_directories(directory, trouble);
  if (trouble) throw core::FileError(fmt::format("{}: cannot be created: {}", directory.string(), trouble.message()));
  if (toml::table* const initial = scene["initial"].as_table()) {
    State start = run.state(0);
    start.level.clear();
    core::write_state((directory / "start.h5").string(), start);
    initial->insert_or_assign("state", "start.h5");
  }
  std::ostringstream text;
  text << scene << '\n';
  core::write_text(directory / "scene.toml", text.str());
}

void require_extension(const std::string& output, const std::string& wanted, const char* what) {
  const std::string extension = fs::path(output).extension().string();
  GC_REQUIRE(extension == wanted, "--output {}: {} goes into a file that ends with {}, not `{}`", output, what, wanted, extension);
}

}  // namespace

std::string vtp_text(const State& state) {
  std::vector<std::uint8_t> kind, level = state.level;
  for (const core::Kind its : state.kind) kind.push_back(static_cast<std::uint8_t>(its));
  level.resize(state.size(), 0);
  Vtp vtp(Vtp::Cells::vertices, state.time, state.position);
  vtp.add("id", state.id);
  vtp.add("kind", kind);
  vtp.add("radius", state.radius);
  vtp.add("velocity", state.velocity);
  vtp.add("level", level);
  return vtp.text();
}

std::string lammps_data_text(const State& state, double density) {
  const Box box = box_of(state);
  std::string text = fmt::format("grainclock, units si, time {:.17g} s, types 1 content 2 wall 3 plug\n\n{} atoms\n3 atom types\n\n", state.time,
                                 state.size());
  for (int k = 0; k < 3; ++k) text += fmt::format("{0:.17g} {1:.17g} {2}lo {2}hi\n", box.lower[k], box.upper[k], "xyz"[k]);
  text += "\nAtoms # sphere\n\n";
  for (std::size_t i = 0; i < state.size(); ++i)
    text += fmt::format("{} {} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n", state.id[i] + 1, lammps_type(state.kind[i]), 2.0 * state.radius[i], density,
                        state.position[i][0], state.position[i][1], state.position[i][2]);
  text += "\nVelocities\n\n";
  for (std::size_t i = 0; i < state.size(); ++i)
    text += fmt::format("{} {:.17g} {:.17g} {:.17g} 0 0 0\n", state.id[i] + 1, state.velocity[i][0], state.velocity[i][1], state.velocity[i][2]);
  return text;
}

std::string lammps_dump_text(const State& state, std::int64_t step) {
  const Box box = box_of(state);
  std::string text = fmt::format("ITEM: UNITS\nsi\nITEM: TIME\n{:.17g}\nITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n{}\nITEM: BOX BOUNDS ff ff ff\n",
                                 state.time, step, state.size());
  for (int k = 0; k < 3; ++k) text += fmt::format("{:.17g} {:.17g}\n", box.lower[k], box.upper[k]);
  text += "ITEM: ATOMS id type x y z vx vy vz radius\n";
  for (std::size_t i = 0; i < state.size(); ++i) {
    const Vec3 &x = state.position[i], &v = state.velocity[i];
    text += fmt::format("{} {} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}\n", state.id[i] + 1, lammps_type(state.kind[i]), x[0], x[1], x[2],
                        v[0], v[1], v[2], state.radius[i]);
  }
  return text;
}

void export_file(const std::string& path, const ExportOptions& options) {
  if (options.format == Format::vtk) require_extension(options.output, options.all ? ".pvd" : ".vtp", options.all ? "a series" : "one frame");
  if (options.format == Format::csv) require_extension(options.output, ".csv", "a table");
  const bool is_a_run = fs::is_directory(path) || (fs::path(path).extension() == ".h5" && is_run(path));
  GC_REQUIRE(!options.all || !options.at, "give either --all or --at, not both");
  if (options.format == Format::paraview) {
    GC_REQUIRE(is_a_run, "{}: is not the file of a run, and contacts come from a run's scene; --to vtk shows the balls alone", path);
    return export_paraview(RunReader(path), options.output, options.at, pressures);
  }
  if (options.format == Format::scene) {
    GC_REQUIRE(is_a_run && !options.at && !options.all, "{}: --to scene repeats a whole run; give the run's file, without --at and --all", path);
    return export_scene(RunReader(path), options.output);
  }
  if (options.all) {
    GC_REQUIRE(options.format == Format::vtk || options.format == Format::lammps_dump, "--all goes with --to vtk, paraview or lammps-dump");
    GC_REQUIRE(is_a_run, "{}: holds one moment only; --all goes with the file of a run", path);
    return export_all(RunReader(path), options);
  }
  const State state = read_moment(path, options.at);
  switch (options.format) {
    case Format::paraview:
    case Format::scene: break;  // done above
    case Format::vtk: return core::write_text(options.output, vtp_text(state));
    case Format::csv: return core::write_state(options.output, state);
    case Format::lammps_dump: {
      std::int64_t step = 0;
      if (is_a_run) {
        const RunReader run(path);
        step = run.step(run.frame_at(state.time));
      }
      return core::write_text(options.output, lammps_dump_text(state, step));
    }
    case Format::lammps_data: {
      const double density = is_a_run ? density_of(RunReader(path)) : core::Materials{}.density;
      return core::write_text(options.output, lammps_data_text(state, density));
    }
  }
}

}  // namespace grainclock::silo
