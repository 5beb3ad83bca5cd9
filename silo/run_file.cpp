#include "silo/run_file.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "core/snapshot.hpp"
#include "silo/provenance.hpp"

#include <algorithm>
#include <cmath>
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
constexpr std::chrono::seconds kFlushEvery{2};         // the most work that a kill can lose, in frames taken
constexpr std::size_t kFlushBytes = std::size_t{32} << 20;
constexpr std::size_t kFanIn = 8;                      // segments merged into one

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

/// The first rows of every dataset of a segment's file.
struct Rows {
  fs::path file;
  std::int64_t count;
};

/// Appends the rows of one dataset of all sources, in pieces that fit into memory.
template <class T>
void join_dataset(const std::vector<Hdf5File>& files, const std::vector<Rows>& sources, Hdf5Group& into, const std::string& name) {
  constexpr std::uint64_t kPiece = std::uint64_t{16} << 20;  // bytes
  Hdf5Group::Shape shape = files.front().shape(name);
  std::uint64_t row_bytes = sizeof(T);
  for (std::size_t axis = 1; axis < shape.size(); ++axis) row_bytes *= shape[axis];
  const std::uint64_t piece = std::max<std::uint64_t>(1, kPiece / std::max<std::uint64_t>(1, row_bytes));
  shape[0] = 0;
  for (const Rows& source : sources) shape[0] += static_cast<std::uint64_t>(source.count);
  into.create_rows<T>(name, shape);
  std::uint64_t to = 0;
  for (std::size_t k = 0; k < sources.size(); ++k) {
    const auto count = static_cast<std::uint64_t>(sources[k].count);
    for (std::uint64_t row = 0; row < count; row += piece) {
      const std::uint64_t rows = std::min(piece, count - row);
      into.write_rows(name, to, files[k].read_rows<T>(name, row, rows));
      to += rows;
    }
  }
}

/// Writes one segment from the rows of several, in order, aside and renamed.
void join(const std::vector<Rows>& sources, const fs::path& target) {
  std::vector<Hdf5File> files;
  for (const Rows& source : sources) files.push_back(Hdf5File::open(source.file));
  core::AsideFile aside(target);
  Hdf5File into = Hdf5File::create(aside.part());
  join_dataset<std::int64_t>(files, sources, into, "step");
  join_dataset<std::uint8_t>(files, sources, into, "level");
  for (const char* name : {"time", "position", "velocity"}) join_dataset<double>(files, sources, into, name);
  Hdf5Group observables = into.create_group("observables");
  for (const std::string& name : files.front().group("observables").names()) {
    const std::string path = "observables/" + name;
    join_dataset<double>(files, sources, into, path);
    observables.write_attribute(name, "unit", files.front().text_attribute(path, "unit"));
  }
  into.close();
  aside.commit();
}

std::string observable_path(const std::string& name) { return "observables/" + name; }

}  // namespace

// ---------------------------------------------------------------- writing

std::string RunFile::Segment::name() const { return fmt::format("{}/{:08}-{:08}.h5", kSegments, first, end); }

RunFile::RunFile(fs::path directory, Header header) : directory_(std::move(directory)), header_(std::move(header)) {}

RunFile::RunFile(fs::path directory, const State& start, Header header) : RunFile(std::move(directory), std::move(header)) {
  start_ = start;
  content_ = content_ids(start_);
  std::error_code trouble;
  fs::create_directory(directory_ / kSegments, trouble);
  if (trouble) throw FileError(fmt::format("{}: cannot be created: {}", (directory_ / kSegments).string(), trouble.message()));
  core::write_state((directory_ / kSegments / kStart).string(), start_);
  write_index();
}

RunFile RunFile::resumed(fs::path directory, Header header, std::int64_t frames) {
  RunFile file(std::move(directory), std::move(header));
  const fs::path segments = file.directory_ / kSegments;
  file.start_ = start_in(file.directory_);
  file.content_ = content_ids(file.start_);

  // A kill may leave merged segments beside the ones that they were made from: the longest one counts.
  std::vector<Segment> found;
  for (const auto& entry : fs::directory_iterator(segments)) {
    Segment segment{};
    if (std::sscanf(entry.path().filename().c_str(), "%8ld-%8ld.h5", &segment.first, &segment.end) == 2) found.push_back(segment);
  }
  std::sort(found.begin(), found.end(), [](const Segment& a, const Segment& b) {
    return a.first != b.first ? a.first < b.first : a.end > b.end;
  });
  for (Segment segment : found) {
    if (segment.first != file.written() || file.written() >= frames) continue;
    if (segment.end > frames) {  // a merged one that goes beyond an older checkpoint: its beginning is kept
      const Segment beginning{segment.first, frames};
      join({{file.path_of(segment), beginning.count()}}, file.path_of(beginning));
      segment = beginning;
    }
    file.segments_.push_back(segment);
  }
  if (file.written() < frames)
    throw FileError(fmt::format("{}: holds {} of the {} frames that the checkpoint needs: segments are missing", segments.string(),
                                file.written(), frames));
  file.write_index();
  file.remove_unused(found);
  return file;
}

State RunFile::start_in(const fs::path& directory) { return core::read_state((directory / kSegments / kStart).string()); }

void RunFile::add(const Frame& frame) {
  const State& state = frame.state;
  times_.push_back(frame.time);
  steps_.push_back(frame.step);
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
  if (columns_.empty())
    for (const Observable& observable : frame.observables) columns_.push_back({observable, {}});
  for (std::size_t k = 0; k < columns_.size(); ++k) {
    const auto& values = frame.observables.at(k).values;
    columns_[k].values.insert(columns_[k].values.end(), values.begin(), values.end());
  }
  const std::size_t bytes = (positions_.size() + velocities_.size()) * sizeof(double);
  if (bytes > kFlushBytes || std::chrono::steady_clock::now() - last_flush_ > kFlushEvery) flush();
}

void RunFile::flush() {
  last_flush_ = std::chrono::steady_clock::now();
  if (times_.empty()) return;
  write_segment();
  merge_segments();
}

void RunFile::write_segment() {
  const Segment segment{written(), frames()};
  core::AsideFile aside(path_of(segment));
  Hdf5File file = Hdf5File::create(aside.part());
  const std::uint64_t n = times_.size(), balls = content_.size();
  file.write("step", steps_);
  file.write("time", times_);
  file.write("position", positions_, {n, balls, 3});
  file.write("velocity", velocities_, {n, balls, 3});
  file.write("level", levels_, {n, balls});
  Hdf5Group observables = file.create_group("observables");
  for (Column& column : columns_) {
    Hdf5Group::Shape shape = column.like.shape;
    shape.insert(shape.begin(), n);
    observables.write(column.like.name, column.values, shape);
    observables.write_attribute(column.like.name, "unit", column.like.unit);
    column.values.clear();
  }
  file.close();
  aside.commit();
  segments_.push_back(segment);
  times_.clear();
  steps_.clear();
  positions_.clear();
  velocities_.clear();
  levels_.clear();
}

/// A segment of rank r holds 8^r to 8^(r+1) - 1 frames. Whenever eight segments at the end are of some rank
/// or below, they become one: fewer than eight of each rank remain, and a frame is copied once per rank.
void RunFile::merge_segments() {
  const auto rank = [](const Segment& segment) {
    int r = 0;
    for (std::int64_t n = segment.count(); n >= static_cast<std::int64_t>(kFanIn); n /= static_cast<std::int64_t>(kFanIn)) ++r;
    return r;
  };
  const std::vector<Segment> before = segments_;
  for (int r = 0;; ++r) {
    std::size_t count = 0;
    while (count < segments_.size() && rank(segments_[segments_.size() - 1 - count]) <= r) ++count;
    if (count >= kFanIn) {
      const auto first = segments_.end() - static_cast<std::ptrdiff_t>(count);
      const Segment merged{first->first, segments_.back().end};
      std::vector<Rows> sources;
      for (auto segment = first; segment != segments_.end(); ++segment) sources.push_back({path_of(*segment), segment->count()});
      join(sources, path_of(merged));
      segments_.erase(first, segments_.end());
      segments_.push_back(merged);
    } else if (count == segments_.size()) {
      break;
    }
  }
  write_index();
  remove_unused(before);
}

/// Only after nothing refers to them any more.
void RunFile::remove_unused(const std::vector<Segment>& candidates) const {
  for (const Segment& old : candidates)
    if (std::find(segments_.begin(), segments_.end(), old) == segments_.end()) fs::remove(path_of(old));
}

// ---------------------------------------------------------------- index

namespace {

/// /particles/content/NAME or /observables/NAME: its values over the shared step and time.
template <class T>
void write_element(Hdf5Group& file, const std::string& element, const std::string& dataset, const std::string& unit,
                   const Hdf5Group::Shape& row, std::vector<Hdf5Part> parts) {
  for (Hdf5Part& part : parts) part.dataset = dataset;
  Hdf5Group group = file.create_group(element);
  group.write_virtual<T>("value", row, parts);
  if (!unit.empty()) group.write_attribute("value", "unit", unit);
  // H5MD lets elements of one sampling share step and time.
  if (element == "particles/content/position") {
    for (Hdf5Part& part : parts) part.dataset = "/step";
    group.write_virtual<std::int64_t>("step", {}, parts);
    for (Hdf5Part& part : parts) part.dataset = "/time";
    group.write_virtual<double>("time", {}, parts);
    group.write_attribute("time", "unit", std::string("s"));
  } else {
    file.link("particles/content/position/step", element + "/step");
    file.link("particles/content/position/time", element + "/time");
  }
}

}  // namespace

void RunFile::write_index() const {
  core::AsideFile aside(directory_ / kIndex);
  Hdf5File file = Hdf5File::create(aside.part());
  write_h5md(file);
  Hdf5Group particles = file.create_group("particles"), content = particles.create_group("content");
  write_box(content);
  write_fixed(particles, content, start_);

  std::vector<Hdf5Part> parts;
  for (const Segment& segment : segments_) parts.push_back({segment.name(), "", static_cast<std::uint64_t>(segment.count())});
  const std::uint64_t balls = content_.size();
  write_element<double>(file, "particles/content/position", "/position", "m", {balls, 3}, parts);
  write_element<double>(file, "particles/content/velocity", "/velocity", "m s-1", {balls, 3}, parts);
  write_element<std::uint8_t>(file, "particles/content/level", "/level", "", {balls}, parts);
  file.write_attribute("particles/content/level/value", "text", fmt::format("0 is the finest; {} has left", kLevelOfLeftBall));

  Hdf5Group observables = file.create_group("observables");
  if (!segments_.empty()) {
    const Hdf5File first = Hdf5File::open(path_of(segments_.front()));
    const Hdf5Group columns = first.group("observables");
    for (const std::string& name : columns.names()) {
      const auto shape = columns.shape(name);
      write_element<double>(file, observable_path(name), "/" + observable_path(name), columns.text_attribute(name, "unit"),
                            {shape.begin() + 1, shape.end()}, parts);
      if (name == kWallForceByLayer && !header_.layer_edges.empty())
        observables.write_attribute(name + "/value", "layer_edges", header_.layer_edges);  // m
    }
  }
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
  const auto position = content.read_rows<double>("position/value", row, 1), velocity = content.read_rows<double>("velocity/value", row, 1);
  const auto level = content.read_rows<std::uint8_t>("level/value", row, 1), kind = wall.read<std::uint8_t>("kind");
  const auto wall_position = wall.read_vectors("position");
  if (position.size() != 3 * id.size() || velocity.size() != position.size() || level.size() != id.size() || radius.size() != id.size() ||
      kind.size() != wall_id.size() || wall_radius.size() != wall_id.size() || wall_position.size() != wall_id.size())
    throw FileError(fmt::format("{}: its arrays have different lengths: it is damaged", path_));

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
  const std::string path = observable_path(name) + "/value";
  if (!file_.has(path)) return std::nullopt;
  return file_.read_rows<double>(path, static_cast<std::uint64_t>(frame), 1);
}

toml::table RunReader::scene() const {
  try {
    return toml::parse(file_.read_text("provenance/scene"));
  } catch (const toml::parse_error& error) {
    file_.fail("provenance/scene", fmt::format("is not TOML, so it is damaged: {}", error.description()));
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
