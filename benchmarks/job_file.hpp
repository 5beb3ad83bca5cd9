// The HDF5 file of a job that steps a scene: its fields below /job, and where it was made.
//
// Each kind of job has one list of fields, a function each_field(access, its) that calls access(name, unit, field) for
// every one; it serves for writing and for reading. Scalars are datasets of one value.
#pragma once

#include "core/hdf5.hpp"
#include "core/scene.hpp"

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace grainclock::benchmarks {

/// Writes fields; an unknown number is nan.
class FieldWriter {
 public:
  explicit FieldWriter(core::Hdf5Group group) : group_(std::move(group)) {}
  void operator()(const char* name, const char* unit, double number);
  void operator()(const char* name, const char* unit, std::uint64_t number);
  void operator()(const char* name, const char* unit, const std::optional<double>& number);
  void operator()(const char* name, const char* unit, const std::string& text);
  void operator()(const char* name, const char* unit, const std::vector<double>& numbers);
  core::Hdf5Group& group() { return group_; }

 private:
  void add_unit(const char* name, const char* unit);
  core::Hdf5Group group_;
};

/// Reads the same fields. All calls throw FileError where a field is missing or of another type.
class FieldReader {
 public:
  explicit FieldReader(core::Hdf5Group group) : group_(std::move(group)) {}
  void operator()(const char* name, const char* unit, double& number);
  void operator()(const char* name, const char* unit, std::uint64_t& number);
  void operator()(const char* name, const char* unit, std::optional<double>& number);
  void operator()(const char* name, const char* unit, std::string& text);
  void operator()(const char* name, const char* unit, std::vector<double>& numbers);
  const core::Hdf5Group& group() const { return group_; }

 private:
  template <class Number>
  Number scalar(const char* name) const;
  core::Hdf5Group group_;
};

/// What a file says about where it comes from, for /provenance.
struct JobOrigin {
  const core::Scene& scene;
  int threads;
};

/// Writes what `fields` writes, and the provenance, aside; renamed when whole. Throws FileError.
void write_job_file(const std::filesystem::path& path, const JobOrigin& origin,
                    const std::function<void(FieldWriter&)>& fields);

/// Where a job was run, and with what.
struct JobMaker {
  std::string host, revision;
  std::int64_t threads = 1;
};

/// Reads what `fields` reads. Throws FileError where the file is missing or damaged.
JobMaker read_job_file(const std::filesystem::path& path, const std::function<void(FieldReader&)>& fields);

}  // namespace grainclock::benchmarks
