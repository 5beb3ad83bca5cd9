#include "silo/segments.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "silo/progress.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>

namespace grainclock::silo {
namespace {

namespace fs = std::filesystem;
using core::FileError;
using core::Hdf5File;
using core::Hdf5Group;

constexpr std::size_t kFanIn = 8;  // segments merged into one

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

/// Throws FileError unless the file opens and every dataset in it has so many rows.
void require_whole(const fs::path& path, std::int64_t rows) {
  const Hdf5File file = Hdf5File::open(path);
  const auto require_rows = [rows](const Hdf5Group& group) {
    for (const std::string& name : group.names()) {
      if (group.is_group(name)) continue;
      const auto shape = group.shape(name);
      if (shape.empty() || shape[0] != static_cast<std::uint64_t>(rows)) group.fail(name, fmt::format("has not {} rows: it is damaged", rows));
    }
  };
  require_rows(file);
  require_rows(file.group("observables"));
}

/// Writes one segment from the rows of several, in order, aside and renamed.
void join(const std::vector<Rows>& sources, const fs::path& target) {
  std::vector<Hdf5File> files;
  for (const Rows& source : sources) files.push_back(Hdf5File::open(source.file));
  core::AsideFile aside(target);
  Hdf5File into = Hdf5File::create(aside.part(), core::Hdf5Sums::yes);
  for (const std::string& name : files.front().names()) {
    if (files.front().is_group(name)) continue;
    if (name == "step") join_dataset<std::int64_t>(files, sources, into, name);
    else if (name == "level") join_dataset<std::uint8_t>(files, sources, into, name);
    else join_dataset<double>(files, sources, into, name);
  }
  Hdf5Group observables = into.create_group("observables");
  for (const std::string& name : files.front().group("observables").names()) {
    const std::string path = "observables/" + name;
    join_dataset<double>(files, sources, into, path);
    observables.write_attribute(name, "unit", files.front().text_attribute(path, "unit"));
  }
  into.close();
  aside.commit();
}

}  // namespace

Segments::Segments(fs::path directory, std::string folder, std::string name)
    : directory_(std::move(directory)), folder_(std::move(folder)), name_(std::move(name)) {}

std::string Segments::name_of(const Segment& segment) const {
  return fmt::format("{}/{}-{:08}-{:08}.h5", folder_, name_, segment.first, segment.end);
}

/// What stands in the folder under this name, longest first where several begin at the same row.
std::vector<Segments::Segment> Segments::found() const {
  std::vector<Segment> found;
  for (const auto& entry : fs::directory_iterator(directory_ / folder_)) {
    const std::string file = entry.path().filename().string(), prefix = name_ + "-";
    Segment segment{};
    if (!file.starts_with(prefix) || std::sscanf(file.c_str() + prefix.size(), "%ld-%ld.h5", &segment.first, &segment.end) != 2) continue;
    if (segment.end <= segment.first) continue;
    if (entry.path() == path_of(segment)) found.push_back(segment);
  }
  std::sort(found.begin(), found.end(), [](const Segment& a, const Segment& b) {
    return a.first != b.first ? a.first < b.first : a.end > b.end;
  });
  return found;
}

void Segments::resume(std::int64_t wanted) {
  obsolete_ = found();
  std::string trouble;
  for (const Segment& segment : obsolete_) {
    // A kill may leave merged segments beside the ones that they were made from: the longest whole one counts.
    if (segment.first != rows() || rows() >= wanted) continue;
    try {
      require_whole(path_of(segment), segment.count());
      segments_.push_back(segment);
    } catch (const FileError& error) {
      trouble += fmt::format("; {}", error.what());
    }
  }
  if (rows() < wanted)
    throw FileError(fmt::format("{}: {} {} to {}, which a checkpoint needs, are missing or damaged{}", (directory_ / folder_).string(), name_,
                                rows(), wanted - 1, trouble));
}

void Segments::cut(std::int64_t wanted) {
  if (rows() <= wanted) return;
  const Segment whole = segments_.back(), beginning{whole.first, wanted};
  join({{path_of(whole), beginning.count()}}, path_of(beginning));
  segments_.back() = beginning;
}

void Segments::add(std::int64_t count, const std::function<void(Hdf5File&)>& write) {
  const Segment segment{rows(), rows() + count};
  core::AsideFile aside(path_of(segment));
  Hdf5File file = Hdf5File::create(aside.part(), core::Hdf5Sums::yes);
  write(file);
  file.close();
  aside.commit();
  segments_.push_back(segment);
  merge();
}

/// A segment of rank r holds 8^r to 8^(r+1) - 1 rows. Whenever eight segments at the end are of some rank
/// or below, they become one: fewer than eight of each rank remain, and a row is copied once per rank.
void Segments::merge() {
  const auto rank = [](const Segment& segment) {
    int r = 0;
    for (std::int64_t n = segment.count(); n >= static_cast<std::int64_t>(kFanIn); n /= static_cast<std::int64_t>(kFanIn)) ++r;
    return r;
  };
  for (int r = 0;; ++r) {
    const std::size_t mergeable = segments_.size() - mergeable_from_;
    std::size_t count = 0;
    while (count < mergeable && rank(segments_[segments_.size() - 1 - count]) <= r) ++count;
    if (count >= kFanIn) {
      const auto first = segments_.end() - static_cast<std::ptrdiff_t>(count);
      const Segment merged{first->first, segments_.back().end};
      std::vector<Rows> sources;
      for (auto segment = first; segment != segments_.end(); ++segment) sources.push_back({path_of(*segment), segment->count()});
      try {
        join(sources, path_of(merged));
      } catch (const FileError& error) {  // merging only saves files: the run is worth more
        say("warning: the {} before it stay in small files: {}\n", name_, error.what());
        mergeable_from_ = segments_.size();
        break;
      }
      obsolete_.insert(obsolete_.end(), first, segments_.end());
      segments_.erase(first, segments_.end());
      segments_.push_back(merged);
    } else if (count == mergeable) {
      break;
    }
  }
}

void Segments::remove_obsolete() {
  for (const Segment& old : obsolete_)
    if (std::find(segments_.begin(), segments_.end(), old) == segments_.end()) fs::remove(path_of(old));
  obsolete_.clear();
}

std::vector<core::Hdf5Part> Segments::parts() const {
  std::vector<core::Hdf5Part> parts;
  for (const Segment& segment : segments_) parts.push_back({name_of(segment), "", static_cast<std::uint64_t>(segment.count())});
  return parts;
}

}  // namespace grainclock::silo
