// A study as data: what its TOML file says, resolved, checked and swept. Runs nothing.
#pragma once

#include "benchmarks/reference.hpp"
#include "core/scene.hpp"

#include <toml++/impl/forward_declarations.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace grainclock::benchmarks {

/// One way of stepping: a point on the chart for each start state.
struct Point {
  std::string name;                           // of its [[method]], or made from the keys
  std::optional<ReferenceSettings> sundials;  // set: SUNDIALS integrates through the same force routine
  core::Stepping stepping;                    // of our own steppers, otherwise
  int repeat = 1;                             // for the median of the wall clock
};

/// "uniform", "multirate", "cvode" or "arkode".
std::string_view method_name(const Point& point);
/// "adams", "bdf", "erk", "implicit", "imex" or "mri"; empty for our own steppers.
std::string_view variant_name(const Point& point);
/// "step 1e-05", "tolerance 0.0001" or "rtol 1e-06": what is turned along a method's line on the chart.
std::string knob_text(const Point& point);
/// A name made of the keys that say how, not how finely: "uniform predicted events".
std::string made_name(const Point& point);
/// Every key that the result depends on, defaults too, as text: equal texts give equal results.
std::string keys_text(const Point& point);
/// Contact sweeps that this point may take over `duration` [s]; coarse, for the estimate of the remaining time only.
double expected_sweeps(const Point& point, double duration);
/// The same point at twice the step, and at 10 times the rtol: how far a reference is from being converged.
Point coarser(const Point& reference);

/// Growth of a tiny perturbation: the [divergence] table.
struct Divergence {
  double perturbation = 1e-12;  // m, largest random displacement of each content ball along each axis
  double step = 0.0;            // s, uniform with events
  double horizon = 0.0;         // s; default: the study's
  int samples = 64;             // equal intervals of the horizon, each one's end is a sample
};

/// A study of trajectories (`kind = "trajectories"`).
struct Study {
  std::string path;                 // of the file, for messages
  std::string text;                 // the file as it stands
  std::string scene;                // path as seen from the working directory
  std::vector<std::string> starts;  // state files, the same
  double horizon = 0.0;             // s
  Point reference;                  // its step is set, or its rtol
  std::vector<Point> points;        // every [[method]] with its lists swept (cartesian product)
  std::optional<Divergence> divergence;
};

/// Reads and checks a study. `scene` and `start` are looked for beside the study file, then in the working directory.
/// Throws FileError for a file that is not there, InputError with file:line, value and remedy for wrong content.
Study read_study(const std::string& path);

// What every kind of study reads the same way; `text` is the whole file `path`. All throw as read_study() does.

/// The file that the study names: beside it, or else in the working directory. `where` for the message.
std::string file_of_study(const std::string& file, const std::string& study_path, const std::string& where);
/// The scene of the key `scene`.
std::string read_scene_path(core::TomlKeys& keys, const std::string& path);
/// The state files of the key `start`.
std::vector<std::string> read_starts(core::TomlKeys& keys, const toml::table& root, const std::string& path);
/// All points of the [[method]] tables, the last key (in alphabetical order) running fastest.
std::vector<Point> read_methods(const std::string& text, const std::string& path, int repeat);

/// What of a scene a job's result may depend on: its resolved text, but for the initial state, since a study brings its own.
std::string scene_text(const core::Scene& scene);

}  // namespace grainclock::benchmarks
