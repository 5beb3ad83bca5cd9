// The H5MD file of a run: DIR/run.h5 over closed segments in DIR/segments.
//
// Frames are collected and written as a segment of their own, aside and renamed; then run.h5 is written
// anew, aside and renamed, with virtual datasets over all segments. So run.h5 can be opened at any
// moment, even after a kill, and shows every frame that was flushed. Many small segments are merged
// into larger ones, so that their number grows with the logarithm of the number of frames. Segments carry HDF5's checksums:
// damaged frames are refused by every reader.
// Reference: H5MD 1.1, https://www.nongnu.org/h5md/h5md.html
#pragma once

#include "core/hdf5.hpp"
#include "core/scene.hpp"
#include "core/state.hpp"

#include <toml++/toml.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace grainclock::silo {

/// A quantity of one moment; `shape` of its values, empty for a single one.
struct Observable {
  std::string name, unit;
  std::vector<std::uint64_t> shape;
  std::vector<double> values;
};

/// One moment of a run.
struct Frame {
  double time = 0.0;        // s
  std::int64_t step = 0;    // coarsest steps since the run began
  core::State state;        // only its content is recorded; wall balls never move
  std::vector<Observable> observables;  // the same ones, in the same order, in every frame
};

inline constexpr std::uint8_t kLevelOfLeftBall = 255;
inline constexpr const char* kWallForceByLayer = "wall_force_by_layer";  // carries the layers' edges as attribute

class RunFile {
 public:
  struct Header {
    core::Scene scene;
    int threads = 1;
    std::vector<double> layer_edges;  // m, of the observables by layer
  };
  /// Starts the file in the directory, which must exist. `start` holds every ball that will ever be there.
  RunFile(std::filesystem::path directory, const core::State& start, Header header);
  /// Goes on with the file of a run that was stopped, after its first `frames` frames: later ones are dropped, and the
  /// parts that a kill left too. Throws FileError, before anything is changed, if some of the frames are missing or damaged.
  static RunFile resumed(std::filesystem::path directory, Header header, std::int64_t frames);

  /// The state that the run of this directory began with. Throws FileError.
  static core::State start_in(const std::filesystem::path& directory);

  /// Takes a frame; writes it out at once or, to write larger pieces, within about two seconds of frames.
  void add(const Frame& frame);
  /// Writes out what add() still holds.
  void flush();
  /// Frames taken so far.
  std::int64_t frames() const { return written() + static_cast<std::int64_t>(times_.size()); }

 private:
  struct Segment {
    std::int64_t first, end;  // frames [first, end)
    std::int64_t count() const { return end - first; }
    bool operator==(const Segment&) const = default;
    std::string name() const;  // relative to the directory
  };
  struct Column {  // an observable's values, frame after frame
    Observable like;
    std::vector<double> values;
  };
  explicit RunFile(std::filesystem::path directory, Header header);

  std::int64_t written() const { return segments_.empty() ? 0 : segments_.back().end; }
  void write_segment();
  void merge_segments();
  void remove_unused(const std::vector<Segment>& candidates) const;
  void write_index() const;
  std::filesystem::path path_of(const Segment& segment) const { return directory_ / segment.name(); }

  std::filesystem::path directory_;
  Header header_;
  core::State start_;
  std::vector<core::BallId> content_;  // ids of the rows
  std::vector<Segment> segments_;      // in order, without gaps
  std::size_t mergeable_from_ = 0;     // segments before it stay as they are: one of them cannot be read any more

  // Frames not yet written.
  std::vector<double> times_, positions_, velocities_;
  std::vector<std::int64_t> steps_;
  std::vector<std::uint8_t> levels_;
  std::vector<Column> columns_;
  std::chrono::steady_clock::time_point last_flush_ = std::chrono::steady_clock::now();
};

/// Reads the frames of a run. Throws FileError where the file or a segment is missing or damaged.
class RunReader {
 public:
  /// `path`: run.h5, or the directory that it stands in.
  explicit RunReader(const std::filesystem::path& path);
  const std::vector<double>& times() const { return times_; }
  std::int64_t frames() const { return static_cast<std::int64_t>(times_.size()); }
  std::int64_t step(std::int64_t frame) const;
  /// The frame nearest in time. Throws InputError for a time outside the run.
  std::int64_t frame_at(double time) const;
  /// The balls that are there in this frame, wall and plug included; `level` is filled.
  core::State state(std::int64_t frame) const;
  /// Names of the observables, and one of them in a frame; nothing if the run has no such one.
  std::vector<std::string> observables() const;
  std::optional<std::vector<double>> observable(const std::string& name, std::int64_t frame) const;
  /// The resolved scene.
  toml::table scene() const;

 private:
  core::Hdf5File file_;
  std::string path_;
  std::vector<double> times_;
};

/// Whether an HDF5 file is a run (and not a state or checkpoint).
bool is_run(const std::string& path);
/// A state from a state file, a checkpoint or a frame of a run (default: the last).
/// Throws InputError if `at` is given for a file that holds one moment only.
core::State read_moment(const std::string& path, std::optional<double> at = std::nullopt);

}  // namespace grainclock::silo
