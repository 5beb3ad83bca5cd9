#include "silo/checkpoint.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "core/snapshot.hpp"

#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>

namespace grainclock::silo {
namespace {

namespace fs = std::filesystem;
using core::Hdf5File;
using core::Hdf5Group;
using core::Vec3;

constexpr const char* kGroup = "position_in_run";
constexpr const char* kChecksum = "checksum";
constexpr std::size_t kKept = 3;

/// Calls visit(name, member) for every number of a position: the one table of the file's fields.
template <class P, class Visit>
void each_field(P& p, Visit visit) {
  visit("phase", p.phase);
  visit("steps", p.steps);
  visit("total_steps", p.total_steps);
  visit("frames", p.frames);
  visit("records", p.records);
  visit("scene", p.scene);
  visit("phase_start", p.phase_start);
  visit("step", p.step);
  visit("fell_back", p.fell_back);
  visit("first_collar", p.first_collar);
  visit("slow_since", p.watch.slow_since);
  visit("rest_since", p.watch.rest_since);
  visit("discharged_before", p.watch.discharged_before);
  visit("content_before", p.watch.content_before);
  visit("discharged_last", p.watch.discharged_last);
  visit("left_last", p.watch.left_last);
  visit("mean_radius", p.mean.radius);
  visit("mean_mass", p.mean.mass);
  visit("start_kinetic", p.start.kinetic);
  visit("start_gravity", p.start.gravity);
  visit("start_elastic", p.start.elastic);
  visit("start_momentum", p.start.momentum);
  visit("dissipated", p.ledger.dissipated);
  visit("first_impact", p.ledger.first_impact);
  visit("event_work", p.ledger.event_work);
  visit("removed_energy", p.ledger.removed_energy);
  visit("switched_energy", p.ledger.switched_energy);
  visit("wall_impulse", p.ledger.wall_impulse);
  visit("gravity_impulse", p.ledger.gravity_impulse);
  visit("first_impact_impulse", p.ledger.first_impact_impulse);
  visit("removed_momentum", p.ledger.removed_momentum);
  visit("total_impulse", p.ledger.total_impulse);
  visit("turned_over", p.ledger.turned_over);
  visit("discharged", p.ledger.discharged);
  visit("contact_evaluations", p.costs.contact_evaluations);
  visit("ball_updates", p.costs.ball_updates);
  visit("list_builds", p.costs.list_builds);
  visit("events", p.costs.events);
  visit("missed_contacts", p.costs.missed_contacts);
}

std::uint64_t checksum(const Position& position) {
  std::uint64_t sum = 0;
  const auto add = [&sum](std::uint64_t bits) { sum = std::rotl(sum * 0x9e3779b97f4a7c15u, 7) ^ bits; };
  each_field(position, [&]<class T>(const char*, const T& value) {
    if constexpr (std::is_same_v<T, Vec3>)
      for (int k = 0; k < 3; ++k) add(std::bit_cast<std::uint64_t>(value[k]));
    else
      add(std::bit_cast<std::uint64_t>(value));
  });
  return sum;
}

/// The number of a checkpoint, by its name; -1 if that is of another kind.
std::int64_t number_of(const fs::path& path) {
  const std::string stem = path.stem().string();
  std::int64_t number = -1;
  const auto [end, trouble] = std::from_chars(stem.data(), stem.data() + stem.size(), number);
  return path.extension() == ".h5" && trouble == std::errc() && end == stem.data() + stem.size() ? number : -1;
}

/// Throws FileError for a position that no run can have.
void require_possible(const Position& position, const Hdf5Group& group) {
  each_field(position, [&]<class T>(const char* name, const T& value) {
    if constexpr (std::is_same_v<T, Vec3>) {
      if (!value.allFinite()) group.fail(name, "must be finite");
    } else if constexpr (std::is_same_v<T, double>) {
      if (!std::isfinite(value)) group.fail(name, fmt::format("is {}; must be finite", value));
    } else if constexpr (std::is_same_v<T, std::int64_t>) {
      if (value < -1) group.fail(name, fmt::format("is {}; must not be negative", value));  // some have -1 for none
    }
  });
  if (position.phase < 0 || position.steps < 0 || position.frames < 0) group.fail("", "phase, steps and frames must not be negative");
  if (!(position.step > 0.0)) group.fail("step", fmt::format("is {} s; must be above 0", position.step));
}

}  // namespace

std::string write_checkpoint(const fs::path& directory, const Checkpoint& checkpoint) {
  const auto older = checkpoints_in(directory);
  const std::int64_t number = older.empty() ? 0 : number_of(older.front()) + 1;
  const fs::path path = directory / fmt::format("{:06}.h5", number);
  core::AsideFile aside(path);
  Hdf5File file = Hdf5File::create(aside.part());
  write_state(file, checkpoint.state);
  Hdf5Group group = file.create_group(kGroup);
  each_field(checkpoint.position, [&]<class T>(const char* name, const T& value) {
    if constexpr (std::is_same_v<T, Vec3>)
      group.write(name, std::vector<double>(value.data(), value.data() + 3));
    else
      group.write(name, std::vector<T>{value});
  });
  group.write(kChecksum, std::vector{checksum(checkpoint.position)});
  file.close();
  aside.commit();
  for (std::size_t k = kKept - 1; k < older.size(); ++k) fs::remove(older[k]);
  return path.string();
}

Checkpoint read_checkpoint(const fs::path& path) {
  const Hdf5File file = Hdf5File::open(path);
  Checkpoint checkpoint;
  checkpoint.state = core::read_state(static_cast<const Hdf5Group&>(file));
  validate(checkpoint.state, path.string());
  const Hdf5Group group = file.group(kGroup);
  each_field(checkpoint.position, [&]<class T>(const char* name, T& value) {
    if constexpr (std::is_same_v<T, Vec3>) {
      const auto values = group.read<double>(name);
      if (values.size() != 3) group.fail(name, "must have three numbers");
      value = Vec3(values.data());
    } else {
      value = group.read_one<T>(name);
    }
  });
  if (group.read_one<std::uint64_t>(kChecksum) != checksum(checkpoint.position)) group.fail(kChecksum, "does not match: the file is damaged");
  require_possible(checkpoint.position, group);
  return checkpoint;
}

std::vector<fs::path> checkpoints_in(const fs::path& directory) {
  std::vector<fs::path> found;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(directory, ignored))
    if (number_of(entry.path()) >= 0) found.push_back(entry.path());
  std::sort(found.begin(), found.end(), [](const fs::path& a, const fs::path& b) { return number_of(a) > number_of(b); });
  return found;
}

}  // namespace grainclock::silo
