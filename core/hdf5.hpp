// A thin owner of HDF5 files: groups, arrays of rows, attributes, virtual datasets.
//
// Elements are double, int64, uint64 or uint8; positions are n x 3 doubles; texts are
// variable-length UTF-8 scalars. Every failure is a FileError that names the file and the object.
//
// A file may be damaged, or made by anybody: before anything is read, what its headers claim is held against what the file
// can hold (sizes, before memory is taken for them), and only plain data are followed: hard links, numbers and texts, storage
// in the file itself or in regular files of virtual datasets, gzip or no compression.
#pragma once

#include "core/state.hpp"

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace grainclock::core {

/// An HDF5 identifier that is released with its owner.
class Hdf5Handle {
 public:
  using Id = std::int64_t;
  using Closer = int (*)(Id);
  Hdf5Handle(Id id, Closer closer) : id_(id), closer_(closer) {}
  ~Hdf5Handle();
  Hdf5Handle(Hdf5Handle&& other) noexcept;
  Hdf5Handle& operator=(Hdf5Handle&& other) noexcept;
  Id id() const { return id_; }
  bool is_valid() const { return id_ >= 0; }
  /// Releases now; false if HDF5 could not (a full disk shows here).
  bool close();

 private:
  Id id_;
  Closer closer_;
};

/// Rows of a dataset in another file, as a part of a virtual dataset.
struct Hdf5Part {
  std::string file;         // relative to the directory of the virtual dataset's file
  std::string dataset;      // absolute path in it
  std::uint64_t rows = 0;   // taken from the dataset's first row on
};

/// Whether a file carries checksums over all its parts, which every reader's HDF5 (1.10 or later) checks.
enum class Hdf5Sums { no, yes };

class Hdf5Group {
 public:
  using Shape = std::vector<std::uint64_t>;

  bool has(const std::string& name) const;       // any link; the path to it may have groups in it
  bool is_group(const std::string& name) const;
  std::vector<std::string> names() const;        // of the links here, in alphabetical order
  Hdf5Group group(const std::string& name) const;
  Hdf5Group create_group(const std::string& name);
  /// Makes `name` another name of `target`.
  void link(const std::string& target, const std::string& name);

  Shape shape(const std::string& name) const;
  /// All elements, row by row. The dataset's type must be the wanted one or convert to it without loss of kind.
  template <class T> std::vector<T> read(const std::string& name) const;
  /// `count` rows (along the first axis) from `first` on.
  template <class T> std::vector<T> read_rows(const std::string& name, std::uint64_t first, std::uint64_t count) const;
  /// The one number of a dataset.
  template <class T> T read_one(const std::string& name) const;
  std::vector<Vec3> read_vectors(const std::string& name) const;
  std::string read_text(const std::string& name) const;

  template <class T> void write(const std::string& name, const std::vector<T>& values);
  template <class T> void write(const std::string& name, const std::vector<T>& values, const Shape& shape);
  void write_vectors(const std::string& name, const std::vector<Vec3>& values);
  void write_text(const std::string& name, const std::string& text);
  /// A column of texts.
  void write_texts(const std::string& name, const std::vector<std::string>& texts);
  /// An array without content yet, to be filled by write_rows.
  template <class T> void create_rows(const std::string& name, const Shape& shape);
  template <class T> void write_rows(const std::string& name, std::uint64_t first, const std::vector<T>& values);
  /// An array whose rows are those of the parts, in order; `row` is the shape of one row.
  /// Rows of a part whose file is missing read as nan (integers: as 0).
  template <class T> void write_virtual(const std::string& name, const Shape& row, const std::vector<Hdf5Part>& parts);

  // Attributes of the object `name` here; "." is the group itself. Numbers are scalars or 1-D.
  bool has_attribute(const std::string& name, const std::string& attribute) const;
  template <class T> std::vector<T> attribute(const std::string& name, const std::string& attribute) const;
  double number_attribute(const std::string& name, const std::string& attribute) const;
  std::string text_attribute(const std::string& name, const std::string& attribute) const;
  template <class T>
  void write_attribute(const std::string& name, const std::string& attribute, const std::vector<T>& values);
  void write_attribute(const std::string& name, const std::string& attribute, const std::string& text);
  void write_attribute(const std::string& name, const std::string& attribute, const std::vector<std::string>& texts);

  /// Throws FileError about the object `name` here: the file, the path and `what`.
  [[noreturn]] void fail(const std::string& name, const std::string& what) const;

 private:
  /// A dataset that is to be read; throws FileError if it is missing.
  Hdf5Handle dataset(const std::string& name) const;
  /// Throws FileError unless the dataset can have as many elements as it claims, and lies where it can be read.
  void require_believable(const std::string& name, Hdf5Handle::Id dataset, Hdf5Handle::Id type) const;

 protected:
  Hdf5Group(Hdf5Handle handle, std::string file, std::string path, Hdf5Sums sums)
      : handle_(std::move(handle)), file_(std::move(file)), path_(std::move(path)), sums_(sums) {}
  Hdf5Handle handle_;
  std::string file_;  // for messages
  std::string path_;  // of this group, ends with '/'
  Hdf5Sums sums_;     // of new datasets
};

/// A file is its root group.
class Hdf5File : public Hdf5Group {
 public:
  /// Creates or empties the file.
  static Hdf5File create(const std::filesystem::path& path, Hdf5Sums sums = Hdf5Sums::no);
  /// Opens for reading only.
  static Hdf5File open(const std::filesystem::path& path);
  /// Writes everything out. Throws FileError; the destructor would be silent.
  void close();

 private:
  using Hdf5Group::Hdf5Group;
};

}  // namespace grainclock::core
