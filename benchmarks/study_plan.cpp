#include "benchmarks/study_plan.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "core/toml_keys.hpp"

#include <filesystem>

namespace grainclock::benchmarks {
namespace {

using core::Stepping;
using core::TomlKeys;

toml::table parse(const std::string& text, const std::string& path) {
  try {
    return toml::parse(text, path);
  } catch (const toml::parse_error& error) {
    throw core::InputError(fmt::format("{}:{}: not valid TOML: {}", path, error.source().begin.line, error.description()));
  }
}

std::string resolved(const std::string& file, const std::string& study_path, const std::string& where) {
  const std::filesystem::path wanted(file);
  const auto beside = std::filesystem::path(study_path).parent_path() / wanted;
  if (std::filesystem::exists(beside)) return beside.string();
  if (std::filesystem::exists(wanted)) return wanted.string();
  throw core::FileError(fmt::format("{}: there is no file '{}', neither beside the study nor in the working directory",
                                    where, file));
}

/// A key without effect is a mistake: uniform stepping takes none of these, but needs its step.
void require_uniform_keys(const TomlKeys& keys, const Stepping& stepping) {
  for (const char* key : {"tolerance", "interface", "levels", "limiter", "fallback"}) {
    keys.require(!keys.has(key), key, "uniform stepping does not use this key; remove it");
  }
  keys.require(stepping.step.has_value(), "step", "uniform stepping in a study needs its step in s");
}

std::string made_name(const Point& point) {
  if (point.solver != Solver::stepper) return std::string(name(point.solver));
  const Stepping& s = point.stepping;
  std::string text(core::name(s.method));
  text += s.method == core::Method::multirate ? fmt::format(" {}", core::name(s.interface))
                                              : fmt::format(" {}", core::name(s.integrator));
  if (s.events) text += " events";
  if (s.dashpot != core::Dashpot::explicit_) text += fmt::format(" {}", core::name(s.dashpot));
  return text;
}

Point read_point(TomlKeys keys) {
  Point point;
  const auto given = keys.string("name");
  const std::string method = keys.choice("method", {"uniform", "multirate", "cvode", "arkode"}).value_or("multirate");
  if (method == "cvode" || method == "arkode") {
    point.solver = method == "cvode" ? Solver::cvode : Solver::arkode;
    const auto rtol = keys.number("rtol");
    keys.require(rtol && *rtol > 0.0 && *rtol < 1.0, "rtol", "SUNDIALS needs a relative tolerance between 0 and 1");
    point.rtol = *rtol;
  } else {
    core::read_stepping(keys, point.stepping);
    if (point.stepping.method == core::Method::uniform) require_uniform_keys(keys, point.stepping);
  }
  keys.finish();
  point.name = given.value_or(made_name(point));
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
std::vector<Point> read_method(const std::string& text, const std::string& path, std::size_t which) {
  const auto method_of = [which](toml::table& root) -> toml::table& {
    return *root["method"].as_array()->get(which)->as_table();
  };
  toml::table original = parse(text, path);
  const auto swept = swept_keys(method_of(original), TomlKeys(method_of(original), "[[method]]", path));
  std::size_t combinations = 1;
  for (const auto& [key, length] : swept) combinations *= length;

  std::vector<Point> points;
  for (std::size_t c = 0; c < combinations; ++c) {
    // Parsed anew and its elements moved, not copied: copies of toml nodes lose their lines.
    toml::table root = parse(text, path);
    toml::table& method = method_of(root);
    std::size_t rest = c;
    for (auto key = swept.rbegin(); key != swept.rend(); ++key) {
      toml::array list = std::move(*method[key->first].as_array());
      list.get(rest % key->second)->visit([&](auto& value) { method.insert_or_assign(key->first, std::move(value)); });
      rest /= key->second;
    }
    points.push_back(read_point(TomlKeys(method, "[[method]]", path)));
  }
  return points;
}

std::vector<std::string> read_starts(TomlKeys& keys, const toml::table& root, const std::string& path) {
  keys.allow("start");
  const toml::node* node = root.get("start");
  keys.require(node, "start", "give a state file, or a list of them");
  std::vector<std::string> starts;
  const auto add = [&](const toml::node& one) {
    const auto file = one.value<std::string>();
    keys.require(file.has_value(), "start", "must be a path, or a list of paths");
    starts.push_back(resolved(*file, path, keys.where("start")));
  };
  if (const toml::array* list = node->as_array()) {
    for (const toml::node& one : *list) add(one);
    keys.require(!starts.empty(), "start", "an empty list starts nothing; give at least one state file");
  } else {
    add(*node);
  }
  return starts;
}

Stepping read_reference(TomlKeys& root) {
  auto keys = root.table("reference");
  root.require(keys.has_value(), "reference", "a study needs a [reference] table with the step of the fine run");
  Stepping stepping;
  stepping.method = core::Method::uniform;
  core::read_stepping(*keys, stepping);
  if (stepping.method == core::Method::uniform) require_uniform_keys(*keys, stepping);
  keys->require(stepping.step.has_value(), "step", "the reference needs its step in s: it is run at this step and at twice it");
  keys->finish();
  return stepping;
}

}  // namespace

std::string_view name(Solver solver) {
  switch (solver) {
    case Solver::stepper: return "stepper";
    case Solver::cvode: return "cvode";
    case Solver::arkode: return "arkode";
  }
  return "?";
}

std::string_view method_name(const Point& point) {
  return point.solver == Solver::stepper ? core::name(point.stepping.method) : name(point.solver);
}

Study read_study(const std::string& path) {
  Study study;
  study.path = path;
  study.text = core::read_text(path);
  const toml::table root = parse(study.text, path);
  TomlKeys keys(root, "", path);

  const auto scene = keys.string("scene");
  keys.require(scene.has_value(), "scene", "give the scene whose first phase is studied");
  study.scene = resolved(*scene, path, keys.where("scene"));
  study.starts = read_starts(keys, root, path);
  const auto horizon = keys.positive("horizon", "s");
  keys.require(horizon.has_value(), "horizon", "give the time in s over which errors are taken");
  study.horizon = *horizon;
  const std::int64_t repeat = keys.integer("repeat").value_or(study.repeat);
  keys.require(repeat >= 1 && repeat <= 1000, "repeat", "must be 1 to 1000");
  study.repeat = static_cast<int>(repeat);
  study.reference = read_reference(keys);

  const std::size_t methods = keys.tables("method").size();
  keys.require(methods > 0, "method", "a study needs at least one [[method]] table");
  keys.finish();
  for (std::size_t which = 0; which < methods; ++which) {
    for (Point& point : read_method(study.text, path, which)) study.points.push_back(std::move(point));
  }
  return study;
}

}  // namespace grainclock::benchmarks
