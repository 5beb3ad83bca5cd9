#include "benchmarks/study_plan.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "core/toml_keys.hpp"

#include <algorithm>
#include <filesystem>

namespace grainclock::benchmarks {
namespace {

using core::Stepping;
using core::TomlKeys;

constexpr int kDefaultRepeat = 3;
constexpr std::size_t kMostPoints = 1000;  // of a study; each is read from the whole file
constexpr double kCoarserStep = 2.0, kCoarserRtol = 10.0;
/// Ten times the rtol of a reference must still be one.
constexpr double kLargestReferenceRtol = 1e-2;

/// SUNDIALS' integrators as a study names them; a method's first variant is its default.
struct NamedScheme {
  Scheme scheme;
  std::string_view method, variant;
};
constexpr NamedScheme kSchemes[] = {
    {Scheme::cvode_adams, "cvode", "adams"},  {Scheme::cvode_bdf, "cvode", "bdf"},
    {Scheme::erkstep, "arkode", "erk"},       {Scheme::arkstep_implicit, "arkode", "implicit"},
    {Scheme::arkstep_imex, "arkode", "imex"}, {Scheme::mristep, "arkode", "mri"},
};

const NamedScheme& named(Scheme scheme) {
  return *std::find_if(std::begin(kSchemes), std::end(kSchemes),
                       [=](const NamedScheme& one) { return one.scheme == scheme; });
}

Scheme read_scheme(TomlKeys& keys, const std::string& method) {
  const auto variant = method == "cvode" ? keys.choice("variant", {"adams", "bdf"})
                                         : keys.choice("variant", {"erk", "implicit", "imex", "mri"});
  const auto* const found = std::find_if(std::begin(kSchemes), std::end(kSchemes), [&](const NamedScheme& one) {
    return one.method == method && (!variant || one.variant == *variant);
  });
  return found->scheme;
}

ReferenceSettings read_sundials(TomlKeys& keys, const std::string& method) {
  ReferenceSettings settings;
  settings.scheme = read_scheme(keys, method);
  const auto rtol = keys.number("rtol");
  keys.require(rtol && *rtol > 0.0 && *rtol < 1.0, "rtol", "SUNDIALS needs a relative tolerance between 0 and 1");
  settings.rtol = *rtol;
  settings.roots = keys.boolean("roots").value_or(settings.roots);
  if (settings.scheme == Scheme::mristep) {
    const auto step = keys.positive("step", "s");
    keys.require(step.has_value(), "step", "variant \"mri\" needs its slow step in s");
    settings.slow_step = *step;
  } else {
    keys.require(!keys.has("step"), "step",
                 "only variant = \"mri\" of SUNDIALS takes a step; the others choose theirs by rtol");
  }
  return settings;
}

/// A key without effect is a mistake: uniform stepping takes none of these, but needs its step.
void require_uniform_keys(const TomlKeys& keys, const Stepping& stepping) {
  for (const char* key : {"tolerance", "interface", "levels", "limiter", "fallback"}) {
    keys.require(!keys.has(key), key, "uniform stepping does not use this key; remove it");
  }
  keys.require(stepping.step.has_value(), "step", "uniform stepping in a study needs its step in s");
}

/// Who integrates, and how; name, repeat and finish() are left to the caller.
Point read_integration(TomlKeys& keys, std::string_view default_method) {
  Point point;
  const std::string method =
      keys.choice("method", {"uniform", "multirate", "cvode", "arkode"}).value_or(std::string(default_method));
  if (method == "cvode" || method == "arkode") {
    point.sundials = read_sundials(keys, method);
    return point;
  }
  point.stepping.method = method == "uniform" ? core::Method::uniform : core::Method::multirate;
  core::read_stepping(keys, point.stepping);
  if (point.stepping.method == core::Method::uniform) require_uniform_keys(keys, point.stepping);
  return point;
}

int read_repeat(TomlKeys& keys, int otherwise) {
  const std::int64_t repeat = keys.integer("repeat").value_or(otherwise);
  keys.require(repeat >= 1 && repeat <= 1000, "repeat", "must be 1 to 1000");
  return static_cast<int>(repeat);
}

Point read_point(TomlKeys keys, int repeat) {
  const auto name = keys.string("name");
  Point point = read_integration(keys, "multirate");
  point.repeat = read_repeat(keys, repeat);
  keys.finish();
  point.name = name.value_or(made_name(point));
  return point;
}

/// The keys of one [[method]] that hold lists, with their lengths.
std::vector<std::pair<std::string, std::size_t>> swept_keys(const toml::table& method, const TomlKeys& keys) {
  std::vector<std::pair<std::string, std::size_t>> swept;
  for (const auto& [key, value] : method) {
    const toml::array* list = value.as_array();
    if (!list) continue;
    keys.require(!list->empty(), key.str(), "an empty list sweeps nothing; give at least one value");
    swept.emplace_back(key.str(), list->size());
  }
  return swept;
}

/// All combinations of one [[method]]'s lists, the last key (in alphabetical order) running fastest.
std::vector<Point> read_method(const std::string& text, const std::string& path, int repeat, std::size_t which) {
  const auto method_of = [which](toml::table& root) -> toml::table& {
    return *root["method"].as_array()->get(which)->as_table();
  };
  toml::table original = core::parse_toml(text, path);
  const auto swept = swept_keys(method_of(original), TomlKeys(method_of(original), "[[method]]", path));
  std::size_t combinations = 1;
  for (const auto& [key, length] : swept) {
    TomlKeys(method_of(original), "[[method]]", path)
        .require(length <= kMostPoints / combinations, key, fmt::format("the lists of one method make at most {} points; give shorter ones", kMostPoints));
    combinations *= length;
  }

  std::vector<Point> points;
  for (std::size_t c = 0; c < combinations; ++c) {
    // Parsed anew and its elements moved, not copied: copies of toml nodes lose their lines.
    toml::table root = core::parse_toml(text, path);
    toml::table& method = method_of(root);
    std::size_t rest = c;
    for (auto key = swept.rbegin(); key != swept.rend(); ++key) {
      toml::array list = std::move(*method[key->first].as_array());
      list.get(rest % key->second)->visit([&](auto& value) { method.insert_or_assign(key->first, std::move(value)); });
      rest /= key->second;
    }
    points.push_back(read_point(TomlKeys(method, "[[method]]", path), repeat));
  }
  return points;
}

Point read_reference(TomlKeys& root) {
  auto keys = root.table("reference");
  root.require(keys.has_value(), "reference", "a study needs a [reference] table with the step of the fine run");
  Point reference = read_integration(*keys, "uniform");
  reference.name = "reference";
  if (reference.sundials) {
    keys->require(reference.sundials->rtol <= kLargestReferenceRtol, "rtol",
                  "the reference is run at its rtol and at 10 times it; give at most 0.01");
  } else {
    keys->require(reference.stepping.step.has_value(), "step",
                  "the reference needs its step in s: it is run at this step and at twice it");
  }
  keys->finish();
  return reference;
}

std::optional<Divergence> read_divergence(TomlKeys& root, double study_horizon) {
  auto keys = root.table("divergence");
  if (!keys) return std::nullopt;
  Divergence divergence;
  divergence.perturbation = keys->positive("perturbation", "m").value_or(divergence.perturbation);
  const auto step = keys->positive("step", "s");
  keys->require(step.has_value(), "step", "give the step in s: two runs, uniform with events, are compared");
  divergence.step = *step;
  divergence.horizon = keys->positive("horizon", "s").value_or(study_horizon);
  const std::int64_t samples = keys->integer("samples").value_or(divergence.samples);
  keys->require(samples >= 4 && samples <= 100000, "samples", "must be 4 to 100000");
  divergence.samples = static_cast<int>(samples);
  keys->finish();
  return divergence;
}

}  // namespace

std::string_view method_name(const Point& point) {
  return point.sundials ? named(point.sundials->scheme).method : core::name(point.stepping.method);
}

std::string_view variant_name(const Point& point) {
  return point.sundials ? named(point.sundials->scheme).variant : std::string_view();
}

std::string knob_text(const Point& point) {
  if (point.sundials) {
    std::string text = fmt::format("rtol {:g}", point.sundials->rtol);
    if (point.sundials->slow_step > 0.0) text += fmt::format(" step {:g}", point.sundials->slow_step);
    return text;
  }
  if (point.stepping.method == core::Method::uniform) return fmt::format("step {:g}", *point.stepping.step);
  return fmt::format("tolerance {:g}", point.stepping.tolerance);
}

std::string made_name(const Point& point) {
  if (point.sundials) {
    return fmt::format("{} {}{}", method_name(point), variant_name(point), point.sundials->roots ? " roots" : "");
  }
  const Stepping& s = point.stepping;
  std::string text(core::name(s.method));
  text += s.method == core::Method::multirate ? fmt::format(" {}", core::name(s.interface))
                                              : fmt::format(" {}", core::name(s.integrator));
  if (s.events) text += " events";
  if (s.dashpot != core::Dashpot::explicit_) text += fmt::format(" {}", core::name(s.dashpot));
  return text;
}

std::string keys_text(const Point& point) {
  if (point.sundials) {
    const auto& [scheme, rtol, slow_step, roots] = *point.sundials;  // a new member stops the compiler here
    return fmt::format("{} {} rtol {} step {} roots {}", named(scheme).method, named(scheme).variant, rtol, slow_step,
                       roots);
  }
  // All members by name: a new one stops the compiler here, and old results are not taken for those of a new key.
  const auto& [method, integrator, events, dashpot, step, tolerance, interface, levels, limiter, fallback] = point.stepping;
  std::string text = fmt::format("{} integrator {} events {} dashpot {} step {}", core::name(method), core::name(integrator),
                                 events, core::name(dashpot), step ? fmt::format("{}", *step) : "default");
  if (method == core::Method::multirate) {
    text += fmt::format(" tolerance {} interface {} levels {} limiter {} fallback {}", tolerance, core::name(interface),
                        levels, limiter, fallback);
  }
  return text;
}

double expected_sweeps(const Point& point, double duration) {
  constexpr double kSelective = 4.0, kDefaultStep = 2e-4, kSundials = 2e4;  // coarse: seen on the Table 1 silo
  if (point.sundials) return kSundials;
  const Stepping& s = point.stepping;
  const double steps = duration / s.step.value_or(kDefaultStep);
  return steps * (s.method == core::Method::multirate ? kSelective : 1.0) *
         (s.integrator == core::Integrator::pece ? 2.0 : 1.0);
}

Point coarser(const Point& reference) {
  Point point = reference;
  point.name = "reference_check";
  if (point.sundials) {
    point.sundials->rtol *= kCoarserRtol;
    point.sundials->slow_step *= kCoarserStep;
  } else {
    point.stepping.step = kCoarserStep * *point.stepping.step;
  }
  return point;
}

std::string file_of_study(const std::string& file, const std::string& study_path, const std::string& where) {
  const std::filesystem::path wanted(file);
  const auto beside = std::filesystem::path(study_path).parent_path() / wanted;
  std::error_code ignored;  // a name that no file can have is not there
  if (std::filesystem::exists(beside, ignored)) return beside.string();
  if (std::filesystem::exists(wanted, ignored)) return wanted.string();
  throw core::FileError(
      fmt::format("{}: there is no file '{}', neither beside the study nor in the working directory", where, file));
}

std::string read_scene_path(TomlKeys& keys, const std::string& path) {
  const auto scene = keys.string("scene");
  keys.require(scene.has_value(), "scene", "give the scene whose first phase is studied");
  return file_of_study(*scene, path, keys.where("scene"));
}

std::vector<std::string> read_starts(TomlKeys& keys, const toml::table& root, const std::string& path) {
  keys.allow("start");
  const toml::node* node = root.get("start");
  keys.require(node, "start", "give a state file, or a list of them");
  std::vector<std::string> starts;
  const auto add = [&](const toml::node& one) {
    const auto file = one.value<std::string>();
    keys.require(file.has_value(), "start", "must be a path, or a list of paths");
    starts.push_back(file_of_study(*file, path, keys.where("start")));
  };
  if (const toml::array* list = node->as_array()) {
    keys.require(list->size() <= kMostPoints, "start", fmt::format("must be at most {} files", kMostPoints));
    for (const toml::node& one : *list) add(one);
    keys.require(!starts.empty(), "start", "an empty list starts nothing; give at least one state file");
  } else {
    add(*node);
  }
  return starts;
}

std::vector<Point> read_methods(const std::string& text, const std::string& path, int repeat) {
  const toml::table root = core::parse_toml(text, path);
  TomlKeys keys(root, "", path);
  const std::size_t methods = keys.tables("method").size();
  keys.require(methods > 0, "method", "a study needs at least one [[method]] table");
  keys.require(methods <= kMostPoints, "method", fmt::format("a study has at most {} of them", kMostPoints));
  std::vector<Point> points;
  for (std::size_t which = 0; which < methods; ++which) {
    for (Point& point : read_method(text, path, repeat, which)) points.push_back(std::move(point));
    keys.require(points.size() <= kMostPoints, "method", fmt::format("the methods make more than {} points; sweep shorter lists", kMostPoints));
  }
  return points;
}

Study read_study(const std::string& path) {
  Study study;
  study.path = path;
  study.text = core::read_text(path, core::kMostToml);
  const toml::table root = core::parse_toml(study.text, path);
  TomlKeys keys(root, "", path);

  keys.allow("kind");  // read by make_study()
  study.scene = read_scene_path(keys, path);
  study.starts = read_starts(keys, root, path);
  const auto horizon = keys.positive("horizon", "s");
  keys.require(horizon.has_value(), "horizon", "give the time in s over which errors are taken");
  study.horizon = *horizon;
  const int repeat = read_repeat(keys, kDefaultRepeat);
  study.reference = read_reference(keys);
  study.divergence = read_divergence(keys, study.horizon);
  keys.allow("method");
  keys.finish();
  study.points = read_methods(study.text, path, repeat);
  return study;
}

std::string scene_text(const core::Scene& scene) {
  std::string text = scene.text;
  const std::size_t begin = text.find("\n[initial]\n");
  if (begin != std::string::npos) text.erase(begin, text.find("\n[", begin + 1) - begin);
  return text;
}

}  // namespace grainclock::benchmarks
