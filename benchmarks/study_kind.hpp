// What every kind of study offers: jobs that run alone, each into a file of its own, and tables made from these files.
#pragma once

#include "benchmarks/table.hpp"

#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace grainclock::benchmarks {

/// A piece of a study that is run in a process of its own and never again once its file is there.
struct Job {
  std::string id;     // fit for a file name; changes with all that the result depends on
  std::string label;  // for people
  double work = 1.0;  // expected, in any unit common to the study's jobs; for the estimate of the remaining time only
};

/// Where the jobs' files are, by id.
using JobFiles = std::map<std::string, std::filesystem::path>;

class StudyKind {
 public:
  virtual ~StudyKind() = default;
  /// All jobs, in the order in which they should run. Later jobs do not need the results of earlier ones.
  virtual std::vector<Job> jobs() const = 0;
  /// Runs one of jobs() and writes its HDF5 file aside, renamed when whole. A method whose numerics fail leaves a file
  /// that says so; only what makes the whole study worthless (bad input, files) is thrown.
  virtual void run(const Job& job, const std::filesystem::path& file) const = 0;
  /// The tables of all jobs. Throws FileError where a file is missing or damaged.
  virtual std::vector<Table> tables(const JobFiles& files) const = 0;
  /// What the tables' file says about where they come from.
  virtual TableOrigin origin() const = 0;
  /// What a user should be told about the tables, one line each.
  virtual std::vector<std::string> warnings(const std::vector<Table>& tables) const = 0;
};

/// Reads a study file of any `kind` ("trajectories", the default, "statistics" or "stability").
/// Throws FileError for a file that is not there, InputError with file:line, value and remedy for wrong content.
std::unique_ptr<StudyKind> make_study(const std::string& path, int threads);

}  // namespace grainclock::benchmarks
