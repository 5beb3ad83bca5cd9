#include "silo/export.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "core/materials.hpp"
#include "core/snapshot.hpp"
#include "silo/run_file.hpp"

#include <cstring>
#include <filesystem>
#include <limits>

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

/// The arrays of a VTK file, one after the other behind the XML, each with its length before it.
class Appended {
 public:
  /// Adds an array and gives the XML element that refers to it.
  template <class T>
  std::string add(const char* type, const char* name, std::size_t components, const std::vector<T>& values) {
    const std::string element = fmt::format("<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" offset=\"{}\"/>\n",
                                            type, name, components, bytes_.size());
    const std::uint64_t length = values.size() * sizeof(T);
    append(&length, sizeof length);
    append(values.data(), length);
    return element;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  void append(const void* data, std::size_t length) { bytes_.append(static_cast<const char*>(data), length); }
  std::string bytes_;
};

std::string pvd_text(const std::vector<std::pair<double, std::string>>& files) {
  std::string text = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n";
  for (const auto& [time, file] : files) text += fmt::format("<DataSet timestep=\"{:.17g}\" file=\"{}\"/>\n", time, file);
  return text + "</Collection>\n</VTKFile>\n";
}

double density_of(const RunReader& run) { return run.scene()["material"]["density"].value_or(core::Materials{}.density); }

void export_all(const RunReader& run, const ExportOptions& options) {
  if (options.format == Format::lammps_dump) {
    std::string text;
    for (std::int64_t frame = 0; frame < run.frames(); ++frame) text += lammps_dump_text(run.state(frame), run.step(frame));
    return core::write_text(options.output, text);
  }
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

void require_extension(const std::string& output, const std::string& wanted, const char* what) {
  const std::string extension = fs::path(output).extension().string();
  GC_REQUIRE(extension == wanted, "--output {}: {} goes into a file that ends with {}, not `{}`", output, what, wanted, extension);
}

}  // namespace

std::string vtp_text(const State& state) {
  const std::size_t n = state.size();
  std::vector<double> position, velocity;
  std::vector<std::uint8_t> kind, level = state.level;
  std::vector<std::int64_t> connectivity, offsets;
  level.resize(n, 0);
  for (std::size_t i = 0; i < n; ++i) {
    position.insert(position.end(), state.position[i].data(), state.position[i].data() + 3);
    velocity.insert(velocity.end(), state.velocity[i].data(), state.velocity[i].data() + 3);
    kind.push_back(static_cast<std::uint8_t>(state.kind[i]));
    connectivity.push_back(static_cast<std::int64_t>(i));
    offsets.push_back(static_cast<std::int64_t>(i) + 1);
  }
  Appended data;
  std::string text = "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n";
  text += "<FieldData>\n" + data.add("Float64", "TimeValue", 1, std::vector{state.time}) + "</FieldData>\n";
  text += fmt::format("<Piece NumberOfPoints=\"{0}\" NumberOfVerts=\"{0}\">\n<PointData>\n", n);
  text += data.add("Int64", "id", 1, state.id) + data.add("UInt8", "kind", 1, kind) + data.add("Float64", "radius", 1, state.radius);
  text += data.add("Float64", "velocity", 3, velocity) + data.add("UInt8", "level", 1, level) + "</PointData>\n";
  text += "<Points>\n" + data.add("Float64", "position", 3, position) + "</Points>\n";
  text += "<Verts>\n" + data.add("Int64", "connectivity", 1, connectivity) + data.add("Int64", "offsets", 1, offsets) + "</Verts>\n";
  return text + "</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_" + data.bytes() + "\n</AppendedData>\n</VTKFile>\n";
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
  if (options.all) {
    GC_REQUIRE(options.format == Format::vtk || options.format == Format::lammps_dump, "--all goes with --to vtk or lammps-dump");
    GC_REQUIRE(is_a_run, "{}: holds one moment only; --all goes with the file of a run", path);
    GC_REQUIRE(!options.at, "give either --all or --at, not both");
    return export_all(RunReader(path), options);
  }
  const State state = read_moment(path, options.at);
  switch (options.format) {
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
