// A study as data: what its TOML file says, resolved, checked and swept. Runs nothing.
#pragma once

#include "core/scene.hpp"

#include <optional>
#include <string>
#include <vector>

namespace grainclock::benchmarks {

/// Who integrates a point: our own steppers, or SUNDIALS through the same force routine.
enum class Solver { stepper, cvode, arkode };
std::string_view name(Solver solver);

/// One way of stepping: a point on the chart for each start state.
struct Point {
  std::string name;                // of its [[method]], or made from the keys
  Solver solver = Solver::stepper;
  core::Stepping stepping;         // Solver::stepper only
  double rtol = 0.0;               // SUNDIALS only
};

/// "uniform", "multirate", "cvode" or "arkode".
std::string_view method_name(const Point& point);

struct Study {
  std::string path;                 // of the file, for messages
  std::string text;                 // the file as it stands
  std::string scene;                // path as seen from the working directory
  std::vector<std::string> starts;  // state files, the same
  double horizon = 0.0;             // s
  int repeat = 3;                   // of each point, for the median of the wall clock
  core::Stepping reference;         // its step is set
  std::vector<Point> points;        // every [[method]] with its lists swept (cartesian product)
};

/// Reads and checks a study. `scene` and `start` are looked for beside the study file, then in the working directory.
/// Throws FileError for a file that is not there, InputError with file:line, value and remedy for wrong content.
Study read_study(const std::string& path);

}  // namespace grainclock::benchmarks
