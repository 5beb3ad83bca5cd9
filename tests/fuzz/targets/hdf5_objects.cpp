// HDF5 files that the library takes for sound, but whose objects are not what we wrote: the input is a list of changes to
// a state, a checkpoint or a run. It reaches our readers far more often than bytes do.
#include "tests/fuzz/read_hdf5.hpp"

#include <hdf5.h>

#include <algorithm>
#include <limits>
#include <vector>

namespace grainclock::fuzz {
namespace {

using core::Hdf5Handle;
using core::State;
using core::Vec3;

constexpr hsize_t kHuge = 1'000'000'000'000;

/// Takes choices from the input; zeros where it has ended.
class Choices {
 public:
  explicit Choices(std::string_view bytes) : bytes_(bytes) {}
  bool is_over() const { return bytes_.empty(); }
  unsigned below(unsigned n) {
    if (bytes_.empty()) return 0;
    const auto byte = static_cast<unsigned char>(bytes_.front());
    bytes_.remove_prefix(1);
    return byte % n;
  }
  template <class T>
  const T& of(const std::vector<T>& values) {
    return values[below(static_cast<unsigned>(values.size()))];
  }

 private:
  std::string_view bytes_;
};

State some_state() {
  State state;
  state.time = 1.5;
  for (core::BallId id = 0; id < 4; ++id)
    state.add(id, id < 2 ? core::Kind::content : id == 2 ? core::Kind::wall : core::Kind::plug, Vec3(0, 0, 1.0 * static_cast<double>(id)),
              Vec3(0, 0, id < 2 ? 0.1 : 0), 0.2);
  state.evaluated_position = state.position;
  state.evaluated_velocity = state.velocity;
  state.level.assign(4, 1);
  state.impacted.assign(4, 0);
  state.dashpot_i = {0};
  state.dashpot_j = {1};
  state.dashpot_force = {1.0};
  return state;
}

std::string bytes_of(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// The files that changes are made to.
struct Bases {
  std::string state, checkpoint, run;

  Bases() {
    std::filesystem::create_directories(place() / "run/checkpoints");
    core::write_state(place() / "state.h5", some_state());
    state = bytes_of(place() / "state.h5");
    silo::Checkpoint its{some_state(), {}};
    checkpoint = bytes_of(silo::write_checkpoint(place() / "run/checkpoints", its));
    const std::string csv = place() / "start.csv";
    core::write_state(csv, some_state());
    const core::Scene scene =
        core::read_scene(place().file("scene.toml", "[initial]\nstate = 'start.csv'\n[[phase]]\nduration = 1.0\n"));
    silo::RunFile file(place() / "run", some_state(), {scene, 1, {0.0, 1.0}});
    for (int k = 0; k < 2; ++k)
      file.add({0.5 * k, k, some_state(), {{"kinetic_energy", "J", {}, {1.0}}, {silo::kWallForceByLayer, "N", {2}, {1.0, 2.0}}}});
    file.flush();
    run = bytes_of(place() / "run/run.h5");
  }
};

const std::vector<std::string> kPaths{
    "state", "state/id", "state/kind", "state/position", "state/velocity", "state/radius", "state/evaluated_position",
    "state/evaluated_velocity", "state/level", "state/impacted", "state/dashpot_i", "state/dashpot_j", "state/dashpot_force",
    "state/checksum", "position_in_run", "position_in_run/phase", "position_in_run/frames", "position_in_run/wall_impulse",
    "position_in_run/checksum", "h5md", "particles", "particles/content", "particles/content/id", "particles/content/radius",
    "particles/content/position", "particles/content/position/value", "particles/content/position/time",
    "particles/content/position/step", "particles/content/velocity/value", "particles/content/level/value", "particles/wall",
    "particles/wall/id", "particles/wall/kind", "particles/wall/radius", "particles/wall/position", "observables",
    "observables/kinetic_energy", "observables/kinetic_energy/value", "provenance", "provenance/scene", "provenance/threads",
    "provenance/seed", "provenance/version", "job", "job/status", "job/level_step", "other"};
const std::vector<std::string> kAttributes{"time", "length_scale", "unit", "layer_edges"};
const std::vector<hsize_t> kExtents{0, 1, 2, 3, 4, 5, 64, 100000, kHuge, std::numeric_limits<hsize_t>::max() / 16};

Hdf5Handle type_of(Choices& in) {
  const auto copy = [](hid_t type) { return Hdf5Handle(H5Tcopy(type), H5Tclose); };
  switch (in.below(12)) {
    case 0: return copy(H5T_NATIVE_DOUBLE);
    case 1: return copy(H5T_NATIVE_FLOAT);
    case 2: return copy(H5T_STD_I64BE);
    case 3: return copy(H5T_NATIVE_UINT64);
    case 4: return copy(H5T_NATIVE_INT8);
    case 5: return copy(H5T_NATIVE_UINT8);
    case 6: {
      Hdf5Handle text = copy(H5T_C_S1);
      H5Tset_size(text.id(), H5T_VARIABLE);
      return text;
    }
    case 7: {
      Hdf5Handle text = copy(H5T_C_S1);
      H5Tset_size(text.id(), 1 + in.below(8));
      return text;
    }
    case 8: return {H5Tvlen_create(H5T_NATIVE_DOUBLE), H5Tclose};
    case 9: {
      Hdf5Handle pair(H5Tcreate(H5T_COMPOUND, 16), H5Tclose);
      H5Tinsert(pair.id(), "a", 0, H5T_NATIVE_DOUBLE);
      H5Tinsert(pair.id(), "b", 8, H5T_NATIVE_INT64);
      return pair;
    }
    case 10: {
      Hdf5Handle wide = copy(H5T_NATIVE_INT64);
      H5Tset_size(wide.id(), 64);
      return wide;
    }
    default: return copy(H5T_NATIVE_LDOUBLE);
  }
}

Hdf5Handle space_of(Choices& in) {
  const unsigned rank = in.below(6);
  if (rank == 0) return {H5Screate(H5S_SCALAR), H5Sclose};
  if (rank == 5) return {H5Screate(H5S_NULL), H5Sclose};
  std::vector<hsize_t> extents(rank);
  for (hsize_t& extent : extents) extent = in.of(kExtents);
  return {H5Screate_simple(static_cast<int>(rank), extents.data(), nullptr), H5Sclose};
}

hsize_t elements(hid_t space) { return static_cast<hsize_t>(std::max<hssize_t>(0, H5Sget_simple_extent_npoints(space))); }

Hdf5Handle layout_of(Choices& in, hid_t space) {
  Hdf5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  const int rank = H5Sget_simple_extent_ndims(space);
  switch (in.below(5)) {
    case 0: H5Pset_layout(properties.id(), H5D_COMPACT); break;
    case 1:
    case 2:
      if (rank > 0) {
        std::vector<hsize_t> chunk(static_cast<std::size_t>(rank));
        for (hsize_t& extent : chunk) extent = std::max<hsize_t>(1, std::min<hsize_t>(in.of(kExtents), 0xffffff));
        H5Pset_chunk(properties.id(), rank, chunk.data());
        if (in.below(2) != 0) H5Pset_deflate(properties.id(), 6);
      }
      break;
    case 3: H5Pset_external(properties.id(), "../state.h5", 0, H5F_UNLIMITED); break;
    default: break;
  }
  return properties;
}

/// Numbers that are not all fit for anything.
std::vector<double> bad_numbers(Choices& in, std::size_t count) {
  static const std::vector<double> kValues{0.0, 1.0, 2.0, 3.0, -1.0, 0.2, 1e300, -1e300, 1e-300, std::numeric_limits<double>::quiet_NaN(),
                                           std::numeric_limits<double>::infinity()};
  std::vector<double> values(count, in.of(kValues));
  if (count > 0) values[in.below(static_cast<unsigned>(count))] = in.of(kValues);
  return values;
}

void remove(hid_t file, const std::string& path) {
  if (H5Lexists(file, path.c_str(), H5P_DEFAULT) > 0) H5Ldelete(file, path.c_str(), H5P_DEFAULT);
}

void replace_dataset(hid_t file, const std::string& path, Choices& in) {
  remove(file, path);
  const Hdf5Handle type = type_of(in), space = space_of(in), properties = layout_of(in, space.id());
  const Hdf5Handle dataset(H5Dcreate2(file, path.c_str(), type.id(), space.id(), H5P_DEFAULT, properties.id(), H5P_DEFAULT), H5Dclose);
  const hsize_t count = elements(space.id());
  if (!dataset.is_valid() || count > 64 || in.below(4) == 0) return;
  const H5T_class_t kind = H5Tget_class(type.id());
  if (kind == H5T_FLOAT || kind == H5T_INTEGER)
    H5Dwrite(dataset.id(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, bad_numbers(in, count).data());
}

/// Other values in what is there.
void change_values(hid_t file, const std::string& path, Choices& in) {
  const Hdf5Handle dataset(H5Dopen2(file, path.c_str(), H5P_DEFAULT), H5Dclose);
  if (!dataset.is_valid()) return;
  const Hdf5Handle space(H5Dget_space(dataset.id()), H5Sclose), type(H5Dget_type(dataset.id()), H5Tclose);
  const hsize_t count = elements(space.id());
  const H5T_class_t kind = H5Tget_class(type.id());
  if (count > 64 || (kind != H5T_FLOAT && kind != H5T_INTEGER)) return;
  H5Dwrite(dataset.id(), H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, bad_numbers(in, count).data());
}

void replace_attribute(hid_t file, const std::string& path, Choices& in) {
  const std::string name = in.of(kAttributes);
  if (H5Lexists(file, path.c_str(), H5P_DEFAULT) <= 0) return;
  const Hdf5Handle object(H5Oopen(file, path.c_str(), H5P_DEFAULT), H5Oclose);
  if (!object.is_valid()) return;
  if (H5Aexists(object.id(), name.c_str()) > 0) H5Adelete(object.id(), name.c_str());
  if (in.below(5) == 0) return;
  const Hdf5Handle type = type_of(in), space = space_of(in);
  if (elements(space.id()) > 100000) return;  // H5Acreate2 of 1.10.8 itself asks for 2^63 bytes then
  const Hdf5Handle attribute(H5Acreate2(object.id(), name.c_str(), type.id(), space.id(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  const hsize_t count = elements(space.id());
  const H5T_class_t kind = H5Tget_class(type.id());
  if (attribute.is_valid() && count <= 64 && (kind == H5T_FLOAT || kind == H5T_INTEGER))
    H5Awrite(attribute.id(), H5T_NATIVE_DOUBLE, bad_numbers(in, count).data());
}

void replace_link(hid_t file, const std::string& path, Choices& in) {
  const std::string other = in.of(kPaths);
  remove(file, path);
  switch (in.below(4)) {
    case 0: H5Lcreate_soft(("/" + other).c_str(), file, path.c_str(), H5P_DEFAULT, H5P_DEFAULT); break;
    case 1: H5Lcreate_external("run/run.h5", ("/" + other).c_str(), file, path.c_str(), H5P_DEFAULT, H5P_DEFAULT); break;
    case 2:
      if (H5Lexists(file, other.c_str(), H5P_DEFAULT) > 0) H5Lcreate_hard(file, other.c_str(), file, path.c_str(), H5P_DEFAULT, H5P_DEFAULT);
      break;
    default: H5Gclose(H5Gcreate2(file, path.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT)); break;
  }
}

/// A virtual dataset over sources that are missing, other, or itself.
void replace_virtual(hid_t file, const std::string& path, Choices& in) {
  static const std::vector<std::string> kFiles{"segments/00000000-00000002.h5", "segments/none.h5", "run.h5", ".", "/dev/null"};
  remove(file, path);
  const Hdf5Handle type = type_of(in), space = space_of(in), properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  for (unsigned k = in.below(3) + 1; k > 0; --k) {
    const Hdf5Handle source = space_of(in);
    H5Pset_virtual(properties.id(), space.id(), in.of(kFiles).c_str(), in.below(2) != 0 ? "/position" : path.c_str(), source.id());
  }
  H5Dclose(H5Dcreate2(file, path.c_str(), type.id(), space.id(), H5P_DEFAULT, properties.id(), H5P_DEFAULT));
}

void change(hid_t file, Choices& in) {
  const std::string path = in.of(kPaths);
  switch (in.below(8)) {
    case 0: return replace_dataset(file, path, in);
    case 1: return remove(file, path);
    case 2: return replace_attribute(file, path, in);
    case 3: return replace_link(file, path, in);
    case 4: return replace_virtual(file, path, in);
    case 5: return replace_dataset(file, path, in);
    default: return change_values(file, path, in);
  }
}

/// A state with bad values and a checksum that fits them: what stands behind the checksum is reached too.
State bad_state(Choices& in) {
  State state = some_state();
  const auto number = [&] { return bad_numbers(in, 1)[0]; };
  for (unsigned k = in.below(3) + 1; k > 0; --k) {
    const unsigned ball = in.below(4);
    switch (in.below(12)) {
      case 0: state.time = number(); break;
      case 1: state.length_scale = number(); break;
      case 2: state.id[ball] = in.of(std::vector<core::BallId>{-1, 0, 3, 1LL << 62, std::numeric_limits<core::BallId>::max()}); break;
      case 3: state.kind[ball] = static_cast<core::Kind>(in.below(256)); break;
      case 4: state.position[ball][0] = number(); break;
      case 5: state.velocity[ball][1] = number(); break;
      case 6: state.radius[ball] = number(); break;
      case 7: state.evaluated_position[ball][2] = number(); break;
      case 8: state.level.resize(in.below(9), static_cast<std::uint8_t>(in.below(256))); break;
      case 9: state.dashpot_j[0] = in.below(6) - 1; break;
      case 10: state.dashpot_force[0] = number(); break;
      default: state.impacted.resize(in.below(6)); break;
    }
  }
  return state;
}

}  // namespace

void fuzz(std::string_view bytes) {
  static const Bases bases;
  Choices in(bytes);
  const unsigned which = in.below(4);
  const std::string path = place().file(which == 2 ? "run/run.h5" : "file.h5",
                                        which == 0 ? bases.state : which == 1 ? bases.checkpoint : bases.run);
  if (which == 3) core::write_state(path, bad_state(in));
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
  {
    const Hdf5Handle file(H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose);
    require(file.is_valid(), "the file that changes are made to cannot be opened");
    for (int changes = 0; !in.is_over() && changes < 6; ++changes) change(file.id(), in);
  }
  read_hdf5(path);
}

}  // namespace grainclock::fuzz
