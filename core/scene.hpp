// A scene as data: what a TOML file says, resolved and checked. No physics.
#pragma once

#include "core/materials.hpp"
#include "core/state.hpp"

#include <toml++/impl/forward_declarations.h>

#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace grainclock::core {

class TomlKeys;

enum class Integrator { lagged, predicted, pece };
enum class Method { uniform, multirate };
enum class Dashpot { explicit_, relaxed, pairwise, solve };
enum class Interface { accumulate, impulse, extrapolate, frozen };
std::string_view name(Integrator v);
std::string_view name(Method v);
std::string_view name(Dashpot v);
std::string_view name(Interface v);

/// How time is stepped: the keys of [stepping], which a [[phase]] may override one by one.
struct Stepping {
  Method method = Method::multirate;
  Integrator integrator = Integrator::predicted;
  bool events = true;                  // event-corrected quadrature
  Dashpot dashpot = Dashpot::explicit_;
  std::optional<double> step;          // s; uniform: the step; multirate: the coarsest. Default from stability
  double tolerance = 1e-4;             // multirate: the one accuracy knob
  Interface interface = Interface::accumulate;
  int levels = 8;                      // 1 to 12
  int limiter = 2;                     // largest difference of level across a contact
  bool fallback = false;               // step uniformly where multi-rate does not pay
};

enum class Until { duration, empty, rest, discharged };

struct Phase {
  std::string name;
  Until until = Until::duration;
  double duration = 0.0;       // s; for until != duration the longest it may take (max_duration)
  double fraction = 0.0;       // of the count at the phase's start, for Until::discharged
  bool outlet_open = false;
  bool first_impact = false;   // a ball's vertical velocity is set to zero at its first impact
  Stepping stepping;           // the scene's, with this phase's overrides
  Materials materials;         // the scene's, with this phase's overrides of [contact]
  double every = 0.0;          // s between frames: [output].every, or the phase
  double observables_every = 0.0;  // s between records of observables: [output].observables_every, or every; divides it
};

/// Where balls may be. Content below outlet_z leaves and is counted; leaving the box elsewhere is a failure.
struct Domain {
  std::optional<double> outlet_z;         // m
  std::optional<Vec3> lower, upper;       // m
};

struct Scene {
  std::string path;                 // of the file, for messages
  std::string text;                 // resolved scene as TOML: defaults and --set applied
  Vec3 gravity{0.0, 0.0, -9.81};    // m/s2
  std::uint64_t seed = 1;
  Materials materials;
  std::string initial_state;        // path as seen from the working directory; empty if a [silo] builds one
  bool has_silo = false;            // the scene builds its own state
  std::shared_ptr<const toml::table> silo;  // the [silo] table as written, with --set applied; silo/ reads it
  Domain domain;
  std::vector<Phase> phases;
};

/// What a reader wants of the file that [initial] names: a run that goes on from a checkpoint needs it no more.
enum class StateFile { must_exist, may_be_gone };

/// Reads and checks a scene. `overrides` are "key=value" of --set, keys dotted, values TOML.
/// Unknown keys, wrong types and impossible values throw InputError with file, line, value and remedy;
/// an unreadable file throws FileError. [silo] is left to silo/ but must be a table.
Scene read_scene(const std::string& path, const std::vector<std::string>& overrides = {},
                 StateFile file = StateFile::must_exist);

/// Reads the stepping keys of a table (of a scene or a study) over what `stepping` says already.
/// Throws InputError with file, line, value and remedy; leaves finish() to the caller.
void read_stepping(TomlKeys& keys, Stepping& stepping);

/// Frame interval and step: the coarsest step is every/n with the smallest n that respects `wanted` [s].
struct StepCount { double step; std::int64_t n; };
StepCount step_for(double every, double wanted);

}  // namespace grainclock::core
