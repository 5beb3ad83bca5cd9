// Rows that a run records, in closed files of their own: a table that can be read whole after a kill at any moment.
//
// Rows are written as a segment, aside and renamed. Whoever reads them does so through virtual datasets over all segments
// (run_file.hpp), written anew after each change. Many small segments are merged into larger ones, so that
// their number grows with the logarithm of the number of rows. Segments carry HDF5's checksums: damaged rows are refused
// by every reader.
#pragma once

#include "core/hdf5.hpp"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

namespace grainclock::silo {

class Segments {
 public:
  /// An empty table whose files are DIRECTORY/FOLDER/NAME-FIRST-END.h5, for rows [FIRST, END).
  Segments(std::filesystem::path directory, std::string folder, std::string name);

  /// Takes up the files of a run that was stopped, as far as they hold its first `rows` rows. Changes none. Throws FileError
  /// where rows are missing or damaged.
  void resume(std::int64_t rows);
  /// Drops what goes beyond `rows` rows. Throws FileError.
  void cut(std::int64_t rows);

  /// Writes `rows` more; `write` fills the file: datasets along whose first axis the rows go, at its root and in the group
  /// "observables".
  void add(std::int64_t rows, const std::function<void(core::Hdf5File&)>& write);
  /// Removes files that others have taken the place of: only after nothing refers to them any more.
  void remove_obsolete();

  std::int64_t rows() const { return segments_.empty() ? 0 : segments_.back().end; }
  /// All segments as parts of a virtual dataset; their datasets are still to be named.
  std::vector<core::Hdf5Part> parts() const;
  /// Path of the newest segment; there must be one.
  std::filesystem::path newest() const { return path_of(segments_.back()); }

 private:
  struct Segment {
    std::int64_t first, end;  // rows [first, end)
    std::int64_t count() const { return end - first; }
    bool operator==(const Segment&) const = default;
  };
  void merge();
  std::vector<Segment> found() const;
  std::string name_of(const Segment& segment) const;  // relative to the directory
  std::filesystem::path path_of(const Segment& segment) const { return directory_ / name_of(segment); }

  std::filesystem::path directory_;
  std::string folder_, name_;
  std::vector<Segment> segments_;  // in order, without gaps
  std::vector<Segment> obsolete_;
  std::size_t mergeable_from_ = 0;  // segments before it stay as they are: one of them cannot be read any more
};

}  // namespace grainclock::silo
