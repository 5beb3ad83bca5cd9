// The H5MD file of a run: DIR/run.h5 over closed segments in DIR/segments.
//
// Two samplings of one run: frames, with every ball, and records, of observables only and as dense as one likes. Both are
// collected and written as segments (segments.hpp); then run.h5 is written anew, aside and renamed, with
// virtual datasets over all segments. So run.h5 can be opened at any moment, even after a kill, and shows what was
// flushed. Each frame has a record of its step.
// Reference: H5MD 1.1, https://www.nongnu.org/h5md/h5md.html
#pragma once

#include "core/hdf5.hpp"
#include "core/scene.hpp"
#include "core/state.hpp"
#include "silo/segments.hpp"

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

/// One moment of a run between frames, or with one.
struct Record {
  double time = 0.0;      // s
  std::int64_t step = 0;  // coarsest steps since the run began
  std::vector<Observable> observables;  // the same ones, in the same order, in every record; none that frames have
};

/// One moment of a run with its balls.
struct Frame {
  double time = 0.0;        // s
  std::int64_t step = 0;    // coarsest steps since the run began
  core::State state;        // only its content is recorded; wall balls never move
  std::vector<Observable> observables;  // the same ones, in the same order, in every frame
};

inline constexpr std::uint8_t kLevelOfLeftBall = 255;
inline constexpr const char* kWallForceByLayer = "wall_force_by_layer";  // carry the layers' edges as attribute
inline constexpr const char* kLateralForceByLayer = "lateral_force_by_layer";

class RunFile {
 public:
  struct Header {
    core::Scene scene;
    int threads = 1;
    std::vector<double> layer_edges;  // m, of the observables by layer
  };
  /// Starts the file in the directory, which must exist. `start` holds every ball that will ever be there.
  RunFile(std::filesystem::path directory, const core::State& start, Header header);
  /// Goes on with the file of a run that was stopped, after its first `frames` frames and `records` records: later ones are
  /// dropped, and the parts that a kill left too. Throws FileError, before anything is changed, if some of them are missing or
  /// damaged.
  static RunFile resumed(std::filesystem::path directory, Header header, std::int64_t frames, std::int64_t records);

  /// The state that the run of this directory began with. Throws FileError.
  static core::State start_in(const std::filesystem::path& directory);

  /// Takes a frame or a record; writes it out at once or, to write larger pieces, within about two seconds.
  void add(const Frame& frame);
  void add(const Record& record);
  /// Writes out what add() still holds.
  void flush();
  /// Taken so far.
  std::int64_t frames() const { return frames_.rows() + static_cast<std::int64_t>(frame_rows_.times.size()); }
  std::int64_t records() const { return records_.rows() + static_cast<std::int64_t>(record_rows_.times.size()); }

 private:
  struct Column {  // an observable's values, row after row
    Observable like;
    std::vector<double> values;
  };
  /// Rows not yet written: what frames and records have in common.
  struct Rows {
    std::vector<double> times;
    std::vector<std::int64_t> steps;
    std::vector<Column> columns;
    void add(double time, std::int64_t step, const std::vector<Observable>& observables);
    void write(core::Hdf5File& file) const;
    void clear();
  };
  explicit RunFile(std::filesystem::path directory, Header header);

  void flush_when_due();
  void write_frames();
  void write_records();
  void write_index() const;
  void write_observables(core::Hdf5File& file, const Segments& segments, const std::string& shared) const;

  std::filesystem::path directory_;
  Header header_;
  core::State start_;
  std::vector<core::BallId> content_;  // ids of the rows
  Segments frames_, records_;

  Rows frame_rows_, record_rows_;
  std::vector<double> positions_, velocities_;  // of the frames not yet written
  std::vector<std::uint8_t> levels_;
  std::chrono::steady_clock::time_point last_flush_ = std::chrono::steady_clock::now();
};

/// An observable over time, as it was recorded.
struct Recorded {
  std::vector<double> time;        // s
  std::vector<double> values;      // `width` for each time
  std::size_t width = 1;
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
  /// Names of the observables, and one of them in a frame or throughout; nothing if the run has no such one.
  std::vector<std::string> observables() const;
  std::optional<std::vector<double>> observable(const std::string& name, std::int64_t frame) const;
  std::optional<Recorded> series(const std::string& name) const;
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
