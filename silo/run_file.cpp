#include "silo/run_file.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "core/snapshot.hpp"
#include "core/toml_keys.hpp"
#include "silo/provenance.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <unordered_map>

namespace grainclock::silo {
namespace {

namespace fs = std::filesystem;
using core::FileError;
using core::Hdf5File;
using core::Hdf5Group;
using core::Hdf5Part;
using core::InputError;
using core::Kind;
using core::State;
using core::Vec3;

constexpr const char* kIndex = "run.h5";
constexpr const char* kSegments = "segments";
constexpr const char* kStart = "start.h5";             // in segments: every ball as it was at the beginning
constexpr std::chrono::seconds kFlushEvery{2};         // the most work that a kill can lose, in frames and records taken
constexpr std::size_t kFlushBytes = std::size_t{32} << 20;

std::vector<core::BallId> content_ids(const State& state) {
  std::vector<core::BallId> ids;
  for (std::size_t i = 0; i < state.size(); ++i)
    if (state.kind[i] == Kind::content) ids.push_back(state.id[i]);
  return ids;
}

void write_box(Hdf5Group& particles) {
  Hdf5Group box = particles.create_group("box");
  box.write_attribute(".", "dimension", std::vector<std::int64_t>{3});
  box.write_attribute(".", "boundary", std::vector<std::string>{"none", "none", "none"});
}

void write_vectors(Hdf5Group& group, const char* name, const char* unit, const std::vector<Vec3>& values) {
  group.write_vectors(name, values);
  group.write_attribute(name, "unit", std::string(unit));
}

/// What never changes: /particles/wall and the identities of the content.
void write_fixed(Hdf5Group& particles, Hdf5Group& content, const State& start) {
  std::vector<std::int64_t> content_id, wall_id;
  std::vector<double> content_radius, wall_radius;
  std::vector<std::uint8_t> wall_kind;
  std::vector<Vec3> wall_position;
  for (std::size_t i = 0; i < start.size(); ++i) {
    const bool moves = start.kind[i] == Kind::content;
    (moves ? content_id : wall_id).push_back(start.id[i]);
    (moves ? content_radius : wall_radius).push_back(start.radius[i]);
    if (moves) continue;
    wall_kind.push_back(static_cast<std::uint8_t>(start.kind[i]));
    wall_position.push_back(start.position[i]);
  }
  content.write("id", content_id);
  content.write_attribute(".", "length_scale", std::vector{start.length_scale});  // m
  content.write("radius", content_radius);
  content.write_attribute("radius", "unit", std::string("m"));
  Hdf5Group wall = particles.create_group("wall");
  write_box(wall);
  wall.write("id", wall_id);
  wall.write("kind", wall_kind);
  wall.write_attribute("kind", "text", std::string("1 wall, 2 plug"));
  wall.write("radius", wall_radius);
  wall.write_attribute("radius", "unit", std::string("m"));
  write_vectors(wall, "position", "m", wall_position);
}

void write_h5md(Hdf5Group& file) {
  Hdf5Group h5md = file.create_group("h5md");
  h5md.write_attribute(".", "version", std::vector<std::int64_t>{1, 1});
  h5md.create_group("author").write_attribute(".", "name", std::string("grainclock"));
  Hdf5Group creator = h5md.create_group("creator");
  creator.write_attribute(".", "name", std::string("grainclock"));
  creator.write_attribute(".", "version", version());
  h5md.create_group("modules").create_group("units").write_attribute(".", "version", std::vector<std::int64_t>{1, 0});
}

std::string observable_path(const std::string& name) { return "observables/" + name; }

}  // namespace

// ---------------------------------------------------------------- writing

RunFile::RunFile(fs::path directory, Header header)
    : directory_(std::move(directory)), header_(std::move(header)), frames_(directory_, kSegments, "frames"), records_(directory_, kSegments, "records") {}

RunFile::RunFile(fs::path directory, const State& start, Header header) : RunFile(std::move(directory), std::move(header)) {
  start_ = start;
  content_ = content_ids(start_);
  std::error_code trouble;
  fs::create_directory(directory_ / kSegments, trouble);
  if (trouble) throw FileError(fmt::format("{}: cannot be created: {}", (directory_ / kSegments).string(), trouble.message()));
  core::write_state((directory_ / kSegments / kStart).string(), start_);
  write_index();
}

RunFile RunFile::resumed(fs::path directory, Header header, std::int64_t frames, std::int64_t records) {
  RunFile file(std::move(directory), std::move(header));
  file.start_ = start_in(file.directory_);
  file.content_ = content_ids(file.start_);
  file.frames_.resume(frames);
  file.records_.resume(records);
  file.frames_.cut(frames);
  file.records_.cut(records);
  core::remove_parts(file.directory_);
  core::remove_parts(file.directory_ / kSegments);
  file.write_index();
  file.frames_.remove_obsolete();
  file.records_.remove_obsolete();
  return file;
}

State RunFile::start_in(const fs::path& directory) { return core::read_state((directory / kSegments / kStart).string()); }

void RunFile::add(const Frame& frame) {
  const State& state = frame.state;
  frame_rows_.add(frame.time, frame.step, frame.observables);
  std::size_t from = 0;  // both lists of ids increase
  for (const core::BallId id : content_) {
    while (from < state.size() && state.id[from] < id) ++from;
    const bool is_there = from < state.size() && state.id[from] == id;
    const Vec3 nowhere = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
    const Vec3& x = is_there ? state.position[from] : nowhere;
    const Vec3& v = is_there ? state.velocity[from] : nowhere;
    positions_.insert(positions_.end(), x.data(), x.data() + 3);
    velocities_.insert(velocities_.end(), v.data(), v.data() + 3);
    levels_.push_back(!is_there ? kLevelOfLeftBall : state.level.empty() ? std::uint8_t{0} : state.level[from]);
  }
  flush_when_due();
}

void RunFile::add(const Record& record) {
  record_rows_.add(record.time, record.step, record.observables);
  flush_when_due();
}

void RunFile::Rows::add(double time, std::int64_t step, const std::vector<Observable>& observables) {
  times.push_back(time);
  steps.push_back(step);
  if (columns.empty())
    for (const Observable& observable : observables) columns.push_back({observable, {}});
  for (std::size_t k = 0; k < columns.size(); ++k) {
    const auto& values = observables.at(k).values;
    columns[k].values.insert(columns[k].values.end(), values.begin(), values.end());
  }
}

void RunFile::Rows::write(Hdf5File& file) const {
  file.write("step", steps);
  file.write("time", times);
  Hdf5Group observables = file.create_group("observables");
  for (const Column& column : columns) {
    Hdf5Group::Shape shape = column.like.shape;
    shape.insert(shape.begin(), times.size());
    observables.write(column.like.name, column.values, shape);
    observables.write_attribute(column.like.name, "unit", column.like.unit);
  }
}

void RunFile::Rows::clear() {
  times.clear();
  steps.clear();
  for (Column& column : columns) column.values.clear();
}

void RunFile::flush_when_due() {
  const std::size_t bytes = (positions_.size() + velocities_.size()) * sizeof(double);
  if (bytes > kFlushBytes || std::chrono::steady_clock::now() - last_flush_ > kFlushEvery) flush();
}

void RunFile::flush() {
  last_flush_ = std::chrono::steady_clock::now();
  if (frame_rows_.times.empty() && record_rows_.times.empty()) return;
  if (!record_rows_.times.empty()) write_records();
  if (!frame_rows_.times.empty()) write_frames();
  write_index();
  frames_.remove_obsolete();
  records_.remove_obsolete();
}

void RunFile::write_records() {
  records_.add(static_cast<std::int64_t>(record_rows_.times.size()), [this](Hdf5File& file) { record_rows_.write(file); });
  record_rows_.clear();
}

void RunFile::write_frames() {
  const std::uint64_t n = frame_rows_.times.size(), balls = content_.size();
  frames_.add(static_cast<std::int64_t>(n), [&](Hdf5File& file) {
    frame_rows_.write(file);
    file.write("position", positions_, {n, balls, 3});
    file.write("velocity", velocities_, {n, balls, 3});
    file.write("level", levels_, {n, balls});
  });
  frame_rows_.clear();
  positions_.clear();
  velocities_.clear();
  levels_.clear();
}

// ---------------------------------------------------------------- index

namespace {

/// /particles/content/NAME or /observables/NAME: its values over step and time, which H5MD lets elements of one sampling
/// share: those of the element `shared`, written with it.
template <class T>
void write_element(Hdf5Group& file, const std::string& element, const std::string& shared, const std::string& dataset, const std::string& unit,
                   const Hdf5Group::Shape& row, std::vector<Hdf5Part> parts) {
  const auto write = [&]<class Value>(Value, const char* name, const std::string& source, const Hdf5Group::Shape& its_row) {
    for (Hdf5Part& part : parts) part.dataset = source;
    file.group(element).write_virtual<Value>(name, its_row, parts);
  };
  Hdf5Group group = file.create_group(element);
  write(T{}, "value", dataset, row);
  if (!unit.empty()) group.write_attribute("value", "unit", unit);
  if (element == shared) {
    write(std::int64_t{}, "step", "/step", {});
    write(double{}, "time", "/time", {});
    group.write_attribute("time", "unit", std::string("s"));
  } else {
    file.link(shared + "/step", element + "/step");
    file.link(shared + "/time", element + "/time");
  }
}

constexpr const char* kPosition = "particles/content/position";

}  // namespace

/// Observables of frames or of records; `shared`: the element whose times they have, the first of them if empty.
void RunFile::write_observables(Hdf5File& file, const Segments& segments, const std::string& shared) const {
  if (segments.rows() == 0) return;
  const Hdf5File newest = Hdf5File::open(segments.newest());
  const Hdf5Group columns = newest.group("observables");
  std::string its_times = shared;
  for (const std::string& name : columns.names()) {
    const std::string element = observable_path(name);
    const auto shape = columns.shape(name);
    if (its_times.empty()) its_times = element;
    write_element<double>(file, element, its_times, "/" + element, columns.text_attribute(name, "unit"), {shape.begin() + 1, shape.end()},
                          segments.parts());
    if ((name == kWallForceByLayer || name == kLateralForceByLayer) && !header_.layer_edges.empty())
      file.write_attribute(element + "/value", "layer_edges", header_.layer_edges);  // m
  }
}

void RunFile::write_index() const {
  core::AsideFile aside(directory_ / kIndex);
  Hdf5File file = Hdf5File::create(aside.part());
  write_h5md(file);
  Hdf5Group particles = file.create_group("particles"), content = particles.create_group("content");
  write_box(content);
  write_fixed(particles, content, start_);

  const std::vector<Hdf5Part> parts = frames_.parts();
  const std::uint64_t balls = content_.size();
  write_element<double>(file, kPosition, kPosition, "/position", "m", {balls, 3}, parts);
  write_element<double>(file, "particles/content/velocity", kPosition, "/velocity", "m s-1", {balls, 3}, parts);
  write_element<std::uint8_t>(file, "particles/content/level", kPosition, "/level", "", {balls}, parts);
  file.write_attribute("particles/content/level/value", "text", fmt::format("0 is the finest; {} has left", kLevelOfLeftBall));

  file.create_group("observables");
  write_observables(file, frames_, kPosition);
  write_observables(file, records_, "");
  write_provenance(file, header_.threads, header_.scene.seed, header_.scene.text);
  file.close();
  aside.commit();
}

// ---------------------------------------------------------------- reading

RunReader::RunReader(const fs::path& path)
    : file_(Hdf5File::open(fs::is_directory(path) ? path / kIndex : path)), path_(path.string()) {
  if (!file_.has("particles/content/position/time")) throw FileError(fmt::format("{}: is not the file of a run", path_));
  times_ = file_.read<double>("particles/content/position/time");
  for (const double time : times_)
    if (!std::isfinite(time))
      throw FileError(fmt::format("{}: frames are missing: the directory `{}` must stand beside it, whole", path_, kSegments));
  if (std::adjacent_find(times_.begin(), times_.end(), std::greater_equal<>()) != times_.end())
    file_.fail("particles/content/position/time", "does not increase: it is damaged");
}

std::int64_t RunReader::step(std::int64_t frame) const {
  return file_.read_rows<std::int64_t>("particles/content/position/step", static_cast<std::uint64_t>(frame), 1).at(0);
}

std::int64_t RunReader::frame_at(double time) const {
  GC_REQUIRE(!times_.empty(), "{}: holds no frames yet", path_);
  // Half a frame of tolerance at the ends: times are typed in decimals.
  const double half = times_.size() > 1 ? 0.5 * (times_[1] - times_[0]) : 1e-9;
  GC_REQUIRE(time >= times_.front() - half && time <= times_.back() + half, "{}: has no frame at {} s: its frames are from {} to {} s",
             path_, time, times_.front(), times_.back());
  const auto nearer = [time](double a, double b) { return std::abs(a - time) < std::abs(b - time); };
  return std::min_element(times_.begin(), times_.end(), nearer) - times_.begin();
}

State RunReader::state(std::int64_t frame) const {
  const Hdf5Group content = file_.group("particles/content"), wall = file_.group("particles/wall");
  const auto row = static_cast<std::uint64_t>(frame);
  const auto id = content.read<std::int64_t>("id"), wall_id = wall.read<std::int64_t>("id");
  const auto radius = content.read<double>("radius"), wall_radius = wall.read<double>("radius");
  // What one row may have is known before it is read.
  const std::uint64_t frames = times_.size(), balls = id.size();
  const auto require_shape = [&](const char* name, const Hdf5Group::Shape& wanted) {
    if (content.shape(name) != wanted) content.fail(name, fmt::format("has another shape than {} frames of {} balls: it is damaged", frames, balls));
  };
  require_shape("position/value", {frames, balls, 3});
  require_shape("velocity/value", {frames, balls, 3});
  require_shape("level/value", {frames, balls});
  const auto position = content.read_rows<double>("position/value", row, 1), velocity = content.read_rows<double>("velocity/value", row, 1);
  const auto level = content.read_rows<std::uint8_t>("level/value", row, 1), kind = wall.read<std::uint8_t>("kind");
  const auto wall_position = wall.read_vectors("position");
  if (radius.size() != balls || kind.size() != wall_id.size() || wall_radius.size() != wall_id.size() || wall_position.size() != wall_id.size())
    throw FileError(fmt::format("{}: its arrays have different lengths: it is damaged", path_));
  if (std::any_of(kind.begin(), kind.end(), [](std::uint8_t its) { return its != 1 && its != 2; }))
    wall.fail("kind", "must be 1 wall or 2 plug: it is damaged");

  State state;
  state.time = times_.at(static_cast<std::size_t>(frame));
  if (content.has_attribute(".", "length_scale")) state.length_scale = content.attribute<double>(".", "length_scale").at(0);
  const auto add_wall = [&](std::size_t w) {
    state.add(wall_id[w], static_cast<Kind>(kind[w]), wall_position[w], Vec3::Zero(), wall_radius[w]);
    state.level.push_back(0);
  };
  std::size_t w = 0;  // both lists of ids increase
  for (std::size_t i = 0; i < id.size(); ++i) {
    while (w < wall_id.size() && wall_id[w] < id[i]) add_wall(w++);
    if (std::isnan(position[3 * i])) continue;  // has left
    state.add(id[i], Kind::content, Vec3(&position[3 * i]), Vec3(&velocity[3 * i]), radius[i]);
    state.level.push_back(level[i]);
  }
  while (w < wall_id.size()) add_wall(w++);
  validate(state, path_);
  return state;
}

std::vector<std::string> RunReader::observables() const { return file_.group("observables").names(); }

std::optional<std::vector<double>> RunReader::observable(const std::string& name, std::int64_t frame) const {
  const std::string path = observable_path(name);
  if (!file_.has(path)) return std::nullopt;
  const auto steps = file_.read<std::int64_t>(path + "/step");
  const auto row = std::lower_bound(steps.begin(), steps.end(), step(frame));
  if (row == steps.end() || *row != step(frame)) file_.fail(path, fmt::format("has no record of frame {}: the file is damaged", frame));
  return file_.read_rows<double>(path + "/value", static_cast<std::uint64_t>(row - steps.begin()), 1);
}

std::optional<Recorded> RunReader::series(const std::string& name) const {
  const std::string path = observable_path(name);
  if (!file_.has(path)) return std::nullopt;
  Recorded series{file_.read<double>(path + "/time"), file_.read<double>(path + "/value"), 1};
  for (const std::uint64_t length : file_.shape(path + "/value")) series.width *= length;
  series.width /= std::max<std::size_t>(1, series.time.size());
  return series;
}

toml::table RunReader::scene() const {
  try {
    return core::parse_toml(file_.read_text("provenance/scene"), "line");
  } catch (const InputError& error) {
    file_.fail("provenance/scene", fmt::format("is damaged: {}", error.what()));
  }
}

bool is_run(const std::string& path) { return Hdf5File::open(path).has("h5md"); }

State read_moment(const std::string& path, std::optional<double> at) {
  const bool is_directory = fs::is_directory(path);
  if (is_directory || (fs::path(path).extension() == ".h5" && is_run(path))) {
    const RunReader run(path);
    GC_REQUIRE(run.frames() > 0, "{}: holds no frames yet", path);
    return run.state(at ? run.frame_at(*at) : run.frames() - 1);
  }
  GC_REQUIRE(!at, "{}: holds one moment only; --at goes with the file of a run", path);
  return core::read_state(path);
}

}  // namespace grainclock::silo
