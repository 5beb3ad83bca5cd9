#include "silo/paraview.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "silo/frame_contacts.hpp"
#include "silo/progress.hpp"
#include "silo/vtp.hpp"

#include <algorithm>
#include <filesystem>

namespace grainclock::silo {
namespace {

namespace fs = std::filesystem;
using core::Contact;
using core::Kind;
using core::State;
using core::Vec3;

constexpr const char* kFrames = "frames";

/// The numbers of the balls of a state that `counts` holds for.
template <class Counts>
std::vector<std::size_t> balls_where(const State& state, Counts counts) {
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < state.size(); ++i)
    if (counts(state.kind[i])) chosen.push_back(i);
  return chosen;
}

template <class T>
std::vector<T> of(const std::vector<std::size_t>& chosen, const std::vector<T>& all) {
  std::vector<T> values;
  values.reserve(chosen.size());
  for (const std::size_t i : chosen) values.push_back(all[i]);
  return values;
}

std::vector<std::uint8_t> numbers(const std::vector<Kind>& kinds) {
  std::vector<std::uint8_t> values;
  for (const Kind kind : kinds) values.push_back(static_cast<std::uint8_t>(kind));
  return values;
}

std::size_t ball_of(const State& state, core::BallId id) {
  const auto at = std::lower_bound(state.id.begin(), state.id.end(), id);
  GC_REQUIRE(at != state.id.end() && *at == id, "ball {} of a contact is not in the state: pass the state that the contacts belong to", id);
  return static_cast<std::size_t>(at - state.id.begin());
}

/// A directory that holds nothing yet. Throws InputError, FileError.
void make_directories(const fs::path& directory) {
  std::error_code trouble;
  GC_REQUIRE(!fs::exists(directory) || (fs::is_directory(directory) && fs::is_empty(directory)),
             "--output {}: exists and is not an empty directory; give a new one", directory.string());
  fs::create_directories(directory / kFrames, trouble);
  if (trouble) throw core::FileError(fmt::format("{}: cannot be created: {}", directory.string(), trouble.message()));
}

/// The frames of one collection.
class Series {
 public:
  Series(fs::path directory, std::string name) : directory_(std::move(directory)), name_(std::move(name)) {}
  void add(std::int64_t frame, double time, const std::string& vtp) {
    const std::string file = fmt::format("{}/{}_{:06}.vtp", kFrames, name_, frame);
    core::write_text(directory_ / file, vtp);
    files_.emplace_back(time, file);
  }
  void finish() const { core::write_text(directory_ / (name_ + ".pvd"), pvd_text(files_)); }

 private:
  fs::path directory_;
  std::string name_;
  std::vector<std::pair<double, std::string>> files_;
};

}  // namespace

std::string balls_vtp(const State& state) {
  const auto content = balls_where(state, [](Kind kind) { return kind == Kind::content; });
  const auto velocity = of(content, state.velocity);
  std::vector<double> speed;
  for (const Vec3& v : velocity) speed.push_back(v.norm());
  Vtp vtp(Vtp::Cells::vertices, state.time, of(content, state.position));
  vtp.add("id", of(content, state.id));
  vtp.add("radius", of(content, state.radius));
  vtp.add("velocity", velocity);
  vtp.add("speed", speed);
  vtp.add("level", state.level.empty() ? std::vector<std::uint8_t>(content.size(), 0) : of(content, state.level));
  vtp.add("kind", numbers(of(content, state.kind)));
  return vtp.text();
}

std::string contacts_vtp(const State& state, const std::vector<Contact>& contacts) {
  std::vector<Vec3> ends;
  std::vector<double> force, overlap;
  std::vector<Kind> kind;
  std::vector<core::BallId> first, second;
  for (const Contact& contact : contacts) {
    const Vec3 &x_i = state.position[ball_of(state, contact.i)], &x_j = state.position[ball_of(state, contact.j)];
    ends.insert(ends.end(), {x_i, x_j});
    force.push_back(contact.force.dot((x_i - x_j).normalized()));
    overlap.push_back(contact.overlap);
    kind.push_back(contact.other);
    first.push_back(contact.i);
    second.push_back(contact.j);
  }
  Vtp vtp(Vtp::Cells::lines, state.time, ends);
  vtp.add("normal_force", force);
  vtp.add("overlap", overlap);
  vtp.add("kind", numbers(kind));
  vtp.add("first", first);
  vtp.add("second", second);
  return vtp.text();
}

std::string wall_vtp(const State& state, bool with_plug, const std::vector<double>& pressure) {
  GC_REQUIRE(pressure.empty() || pressure.size() == state.size(), "{} pressures for {} balls: give one each", pressure.size(), state.size());
  const auto fixed = balls_where(state, [with_plug](Kind kind) { return kind == Kind::wall || (with_plug && kind == Kind::plug); });
  Vtp vtp(Vtp::Cells::vertices, state.time, of(fixed, state.position));
  vtp.add("id", of(fixed, state.id));
  vtp.add("radius", of(fixed, state.radius));
  vtp.add("kind", numbers(of(fixed, state.kind)));
  if (!pressure.empty()) vtp.add("pressure", of(fixed, pressure));
  return vtp.text();
}

void export_paraview(const RunReader& run, const std::string& directory, std::optional<double> at, const WallPressure& pressure) {
  GC_REQUIRE(run.frames() > 0, "the run holds no frames yet");
  const std::int64_t first = at ? run.frame_at(*at) : 0, last = at ? first : run.frames() - 1;
  const ContactFinder finder(run);
  make_directories(directory);
  Series balls(directory, "balls"), contacts(directory, "contacts"), wall(directory, "wall");
  Progress progress("export", run.times()[static_cast<std::size_t>(last)] - run.times()[static_cast<std::size_t>(first)], 0.0);
  for (std::int64_t frame = first; frame <= last; ++frame) {
    const State state = run.state(frame);
    const FrameContacts found = finder.contacts(frame, state);
    balls.add(frame, state.time, balls_vtp(state));
    contacts.add(frame, state.time, contacts_vtp(state, found.contacts));
    if (pressure) wall.add(frame, state.time, wall_vtp(state, !found.outlet_open, pressure(state, found.contacts)));
    else if (frame == first) wall.add(frame, state.time, wall_vtp(state, true));
    progress.note(state.time - run.times()[static_cast<std::size_t>(first)], 0);
  }
  for (const Series* series : {&balls, &contacts, &wall}) series->finish();
}

}  // namespace grainclock::silo
