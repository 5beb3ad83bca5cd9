#include "core/scene.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "core/snapshot.hpp"
#include "core/toml_keys.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <functional>
#include <sstream>

namespace grainclock::core {

std::string_view name(Integrator v) {
  switch (v) {
    case Integrator::lagged: return "lagged";
    case Integrator::predicted: return "predicted";
    case Integrator::pece: return "pece";
  }
  return "?";
}

std::string_view name(Method v) {
  switch (v) {
    case Method::uniform: return "uniform";
    case Method::multirate: return "multirate";
  }
  return "?";
}

std::string_view name(Dashpot v) {
  switch (v) {
    case Dashpot::explicit_: return "explicit";
    case Dashpot::relaxed: return "relaxed";
    case Dashpot::pairwise: return "pairwise";
    case Dashpot::solve: return "solve";
  }
  return "?";
}

std::string_view name(Interface v) {
  switch (v) {
    case Interface::accumulate: return "accumulate";
    case Interface::impulse: return "impulse";
    case Interface::extrapolate: return "extrapolate";
    case Interface::frozen: return "frozen";
  }
  return "?";
}

namespace {

constexpr int kMostLevels = 12;
/// A quotient this close to a whole number (relative) is one: decimal fractions are not exact in binary.
constexpr double kWholeGuard = 1e-9;

// ---------------------------------------------------------------- --set

/// The value of --set with its source set to the assignment itself, so that messages name it.
toml::table parse_assigned(const std::string& assignment, const std::string& value) {
  const std::string source = "--set " + assignment;
  const auto parsed = [&](const std::string& text) {
    toml::table table = parse_toml("value = " + text, source);
    // Anything after the value would be keys of its own.
    GC_REQUIRE(table.size() == 1, "{}: is more than one value; give each key a --set of its own", source);
    return table;
  };
  try {
    return parsed(value);
  } catch (const InputError& error) {
    // A bare word is a string: shells eat the quotes.
    const bool is_word = !value.empty() && value.find_first_of(" \t\n\"'[]{}=,#") == std::string::npos;
    if (is_word) return parsed("'" + value + "'");
    throw InputError(fmt::format("{}: `{}` is not a TOML value: {}", source, excerpt(value), error.what()));
  }
}

/// The element of an array of tables by index, or by its `name`.
toml::node* element(toml::array& array, const std::string& word) {
  std::size_t index = 0;
  const auto [end, trouble] = std::from_chars(word.data(), word.data() + word.size(), index);
  if (trouble == std::errc() && end == word.data() + word.size()) return array.get(index);
  for (toml::node& item : array)
    if (toml::table* table = item.as_table(); table && (*table)["name"].value<std::string>() == word) return &item;
  return nullptr;
}

/// Applies "a.b.0.c=value" to the document.
void apply_override(toml::table& root, const std::string& assignment) {
  const std::size_t equals = assignment.find('=');
  GC_REQUIRE(equals != std::string::npos && equals > 0,
             "--set {}: write it as key=value, as in --set stepping.step=1e-5", assignment);
  toml::table parsed = parse_assigned(assignment, assignment.substr(equals + 1));

  std::vector<std::string> words;
  std::istringstream path(assignment.substr(0, equals));
  for (std::string word; std::getline(path, word, '.');) {
    GC_REQUIRE(!word.empty(), "--set {}: there is an empty name between two points", assignment);
    words.push_back(word);
  }
  toml::table* table = &root;
  for (std::size_t n = 0; n + 1 < words.size(); ++n) {
    toml::node* next = table->get(words[n]);
    if (!next) next = &table->insert_or_assign(words[n], toml::table{}).first->second;
    if (toml::array* array = next->as_array()) {
      GC_REQUIRE(n + 2 < words.size(), "--set {}: `{}` is a list of tables; name one and its key, as in {}.0.{}", assignment,
                 words[n], words[n], words[n + 1]);
      next = element(*array, words[++n]);
      GC_REQUIRE(next, "--set {}: there is no {} `{}`; there are {}, counted from 0", assignment, words[n - 1], words[n],
                 array->size());
    }
    table = next->as_table();
    GC_REQUIRE(table, "--set {}: `{}` is a value, not a table; a key cannot follow it", assignment, words[n]);
  }
  // Moved, because only moved nodes keep their source.
  parsed.get("value")->visit([&](auto& value) { table->insert_or_assign(words.back(), std::move(value)); });
}

// ---------------------------------------------------------------- tables

template <class Enum>
void read_choice(TomlKeys& keys, std::string_view key, Enum& value, std::initializer_list<Enum> all) {
  const auto text = keys.string(key);
  if (!text) return;
  std::string names;
  for (const Enum candidate : all) {
    if (name(candidate) == *text) {
      value = candidate;
      return;
    }
    names += fmt::format("{}\"{}\"", names.empty() ? "" : " or ", name(candidate));
  }
  keys.fail(key, "must be " + names);
}

void read_not_negative(TomlKeys& keys, std::string_view key, std::string_view unit, double& value) {
  if (const auto given = keys.number(key)) {
    keys.require(*given >= 0.0, key, fmt::format("must be at least 0 {}", unit));
    value = *given;
  }
}

void read_positive(TomlKeys& keys, std::string_view key, std::string_view unit, double& value) {
  if (const auto given = keys.positive(key, unit)) value = *given;
}

}  // namespace

void read_stepping(TomlKeys& keys, Stepping& stepping) {
  read_choice(keys, "method", stepping.method, {Method::uniform, Method::multirate});
  read_choice(keys, "integrator", stepping.integrator, {Integrator::lagged, Integrator::predicted, Integrator::pece});
  stepping.events = keys.boolean("events").value_or(stepping.events);
  read_choice(keys, "dashpot", stepping.dashpot,
              {Dashpot::explicit_, Dashpot::relaxed, Dashpot::pairwise, Dashpot::solve});
  if (const auto step = keys.positive("step", "s")) stepping.step = step;
  read_positive(keys, "tolerance", "", stepping.tolerance);
  read_choice(keys, "interface", stepping.interface,
              {Interface::accumulate, Interface::impulse, Interface::extrapolate, Interface::frozen});
  if (const auto levels = keys.integer("levels")) {
    keys.require(*levels >= 1 && *levels <= kMostLevels, "levels", fmt::format("must be 1 to {}", kMostLevels));
    stepping.levels = static_cast<int>(*levels);
  }
  if (const auto limiter = keys.integer("limiter")) {
    keys.require(*limiter >= 1 && *limiter < kMostLevels, "limiter", fmt::format("must be 1 to {}", kMostLevels - 1));
    stepping.limiter = static_cast<int>(*limiter);
  }
  stepping.fallback = keys.boolean("fallback").value_or(stepping.fallback);
}

namespace {

/// Mean radius of the scene's content [m], for whoever needs it: reading a state only for that is not for free.
using MeanRadius = std::function<double(const TomlKeys&, std::string_view key)>;

/// k, and c either as such or by the restitution of a free collision; `mean_masses` is m_eff over the mean mass.
void read_pair(TomlKeys& keys, const std::string& which, double mean_masses, const Materials& materials,
               const MeanRadius& mean_radius, PairLaw& law) {
  const std::string c = "c_" + which, restitution = "restitution_" + which;
  read_positive(keys, "k_" + which, "N/m", law.k);
  read_not_negative(keys, c, "N s/m", law.c);
  if (const auto e = keys.number(restitution)) {
    keys.require(!keys.has(c), restitution, fmt::format("give either {} or {}, not both", c, restitution));
    keys.require(*e > 0.0 && *e <= 1.0, restitution, "must be above 0 and at most 1");
    const double m_eff = mean_masses * materials.mass(mean_radius(keys, restitution));
    law.c = dashpot_for_restitution(law.k, m_eff, *e, materials.tension);
  }
}

void read_contact(TomlKeys& keys, Materials& materials, const MeanRadius& mean_radius) {
  materials.tension = keys.boolean("tension").value_or(materials.tension);
  read_not_negative(keys, "cohesion", "N", materials.cohesion);
  read_pair(keys, "ball", 0.5, materials, mean_radius, materials.ball);
  read_pair(keys, "wall", 1.0, materials, mean_radius, materials.wall);
}

bool is_whole_multiple(double value, double part) {
  const double n = std::round(value / part);
  return n >= 1.0 && std::abs(value - n * part) <= kWholeGuard * value;
}

/// Throws InputError where so many frames or records would be made.
void require_countable(const TomlKeys& keys, std::string_view key, double n) {
  constexpr double kMost = 1e9;
  keys.require(n <= kMost, key, fmt::format("makes {:.3g} frames or records; at most {:g}", n, kMost));
}

void require_whole_multiple(const TomlKeys& keys, std::string_view key, double value, std::string_view part_name, double part) {
  require_countable(keys, key, value / part);
  if (is_whole_multiple(value, part)) return;
  const double below = std::floor(value / part);
  const std::string nearest = below >= 1.0 ? fmt::format("{:.12g} or {:.12g}", below * part, (below + 1.0) * part)
                                           : fmt::format("{:.12g}", part);
  keys.fail(key, fmt::format("must be a whole multiple of {} = {:.12g} s; nearest: {} s", part_name, part, nearest));
}

void require_part(const TomlKeys& keys, std::string_view key, double part, std::string_view whole_name, double whole) {
  require_countable(keys, key, whole / part);
  if (is_whole_multiple(whole, part)) return;
  const double below = std::floor(whole / part);
  const std::string nearest = below >= 1.0 ? fmt::format("{:.12g} or {:.12g}", whole / (below + 1.0), whole / below)
                                           : fmt::format("{:.12g}", whole);
  keys.fail(key, fmt::format("must divide {} = {:.12g} s; nearest: {} s", whole_name, whole, nearest));
}

void read_until(TomlKeys& keys, const std::string& text, Phase& phase) {
  constexpr std::string_view kDischarged = "discharged:";
  if (text == "empty") {
    phase.until = Until::empty;
  } else if (text == "rest") {
    phase.until = Until::rest;
  } else if (text.starts_with(kDischarged)) {
    phase.until = Until::discharged;
    const char* const end = text.data() + text.size();
    const auto [stop, trouble] = std::from_chars(text.data() + kDischarged.size(), end, phase.fraction);
    keys.require(trouble == std::errc() && stop == end && phase.fraction > 0.0 && phase.fraction <= 1.0, "until",
                 "the discharged fraction must be above 0 and at most 1, as in \"discharged:0.22\"");
  } else {
    keys.fail("until", "must be \"empty\" or \"rest\" or \"discharged:0.22\" (a fraction)");
  }
}

void read_outlet(TomlKeys& keys, const Scene& scene, Phase& phase) {
  phase.outlet_open = keys.choice("outlet", {"open", "closed"}) == "open";
  if (phase.until != Until::empty && phase.until != Until::discharged) return;
  keys.require(phase.outlet_open, "until", "nothing can leave while the outlet is closed; write outlet = \"open\"");
  keys.require(scene.domain.outlet_z.has_value(), "until",
               "nothing is counted as discharged without [domain] outlet_z; give it");
}

/// Keys of [output], which a phase may override.
struct Output {
  std::optional<double> every, observables_every;  // s
};

Output read_output(TomlKeys keys) {
  const Output output{keys.positive("every", "s"), keys.positive("observables_every", "s")};
  if (output.every && output.observables_every)
    require_part(keys, "observables_every", *output.observables_every, "every", *output.every);
  keys.finish();
  return output;
}

/// `duration_key`: of the phase's duration, which `every` must divide.
void read_intervals(TomlKeys& keys, std::string_view duration_key, const Output& output, Phase& phase) {
  const auto every = keys.positive("every", "s"), observables_every = keys.positive("observables_every", "s");
  phase.every = every ? *every : output.every.value_or(phase.duration);
  require_whole_multiple(keys, duration_key, phase.duration, "every", phase.every);
  phase.observables_every = observables_every ? *observables_every : output.observables_every.value_or(phase.every);
  if (observables_every) require_part(keys, "observables_every", phase.observables_every, "every", phase.every);
  else require_whole_multiple(keys, every ? "every" : duration_key, phase.every, "observables_every", phase.observables_every);
}

Phase read_phase(TomlKeys keys, const Scene& scene, const Stepping& stepping, const Output& output, const MeanRadius& mean_radius) {
  Phase phase;
  phase.name = keys.string("name").value_or(fmt::format("phase {}", scene.phases.size()));
  const auto duration = keys.positive("duration", "s"), longest = keys.positive("max_duration", "s");
  const auto until = keys.string("until");
  const char* const key = until ? "max_duration" : "duration";
  if (until) {
    read_until(keys, *until, phase);
    keys.require(!duration, "duration", "give either duration or until with max_duration, not both");
    keys.require(longest.has_value(), "max_duration", "a phase with `until` needs the longest time it may take, in s");
  } else {
    keys.require(duration.has_value(), "duration", "give the phase a duration in s, or until with max_duration");
    keys.require(!longest, "max_duration", "goes with `until`; write duration instead");
  }
  phase.duration = until ? *longest : *duration;
  read_intervals(keys, key, output, phase);
  read_outlet(keys, scene, phase);
  phase.first_impact = keys.boolean("first_impact").value_or(false);
  phase.stepping = stepping;
  read_stepping(keys, phase.stepping);
  phase.materials = scene.materials;
  if (auto contact = keys.table("contact")) {
    read_contact(*contact, phase.materials, mean_radius);
    contact->finish();
  }
  keys.finish();
  return phase;
}

Domain read_domain(TomlKeys keys) {
  Domain domain;
  domain.outlet_z = keys.number("outlet_z");
  domain.lower = keys.vec3("lower");
  domain.upper = keys.vec3("upper");
  if (domain.lower && domain.upper)
    keys.require((domain.lower->array() < domain.upper->array()).all(), "upper", "must be above `lower` in x, y and z");
  if (domain.lower && domain.outlet_z)
    keys.require((*domain.lower)[2] <= *domain.outlet_z, "outlet_z", "must not lie below the z of `lower`: no ball could reach it");
  if (domain.upper && domain.outlet_z)
    keys.require(*domain.outlet_z < (*domain.upper)[2], "outlet_z", "must lie below the z of `upper`");
  keys.finish();
  return domain;
}

/// The state's path as seen from anywhere: relative ones start at the scene file, else at the working directory.
std::string state_path(TomlKeys& keys, const std::string& scene_path, StateFile file) {
  namespace fs = std::filesystem;
  const auto given = keys.string("state");
  keys.require(given.has_value(), "state", "give the path of a state file (.csv or .h5)");
  const fs::path beside = fs::path(scene_path).parent_path() / *given;
  for (const fs::path& candidate : {beside, fs::path(*given)})
    if (std::error_code ignored; fs::exists(candidate, ignored)) return fs::absolute(candidate).lexically_normal().string();
  if (file == StateFile::may_be_gone) return *given;
  throw FileError(fmt::format("{}: there is no state file \"{}\", neither beside the scene nor in the working directory",
                              keys.where("state"), *given));
}

/// Mean radius: of the range that [silo] draws from, else over the content of the initial state.
double mean_radius_of(const Scene& scene, const TomlKeys& keys, std::string_view key) {
  if (scene.has_silo) {
    const auto smallest = (*scene.silo)["r_min"].value<double>(), largest = (*scene.silo)["r_max"].value<double>();
    keys.require(smallest && largest && *smallest > 0.0 && *largest >= *smallest, key,
                 "needs the mean radius: give [silo] r_min and r_max, or give the dashpot (c_...) instead");
    return 0.5 * (*smallest + *largest);
  }
  const State state = read_state(scene.initial_state);
  double sum = 0.0;
  for (std::size_t i = 0; i < state.size(); ++i)
    if (state.kind[i] == Kind::content) sum += state.radius[i];
  const std::size_t n = state.count(Kind::content);
  keys.require(n > 0, key, fmt::format("needs the mean radius, but {} has no content balls", scene.initial_state));
  return sum / static_cast<double>(n);
}

// ---------------------------------------------------------------- echo

std::string quoted(const std::string& text) { return toml_text(toml::value<std::string>(text)); }

std::string vector_text(const Vec3& v) { return fmt::format("[{}, {}, {}]", toml_text(v[0]), toml_text(v[1]), toml_text(v[2])); }

using Lines = std::vector<std::pair<std::string, std::string>>;  // key, value as TOML text

Lines lines_of(const Stepping& s) {
  Lines lines{{"method", quoted(std::string(name(s.method)))},
              {"integrator", quoted(std::string(name(s.integrator)))},
              {"events", fmt::format("{}", s.events)},
              {"dashpot", quoted(std::string(name(s.dashpot)))},
              {"tolerance", toml_text(s.tolerance)},
              {"interface", quoted(std::string(name(s.interface)))},
              {"levels", fmt::format("{}", s.levels)},
              {"limiter", fmt::format("{}", s.limiter)},
              {"fallback", fmt::format("{}", s.fallback)}};
  if (s.step) lines.emplace_back("step", toml_text(*s.step));
  return lines;
}

Lines lines_of(const Materials& m) {
  return {{"k_ball", toml_text(m.ball.k)}, {"k_wall", toml_text(m.wall.k)},          {"c_ball", toml_text(m.ball.c)},
          {"c_wall", toml_text(m.wall.c)}, {"tension", fmt::format("{}", m.tension)}, {"cohesion", toml_text(m.cohesion)}};
}

/// The lines that differ from the scene's own: a phase's overrides.
Lines overrides_of(const Lines& phase, const Lines& scene) {
  Lines changed;
  for (const auto& line : phase)
    if (std::find(scene.begin(), scene.end(), line) == scene.end()) changed.push_back(line);
  return changed;
}

std::string text_of(const Lines& lines) {
  std::string text;
  for (const auto& [key, value] : lines) text += fmt::format("{} = {}\n", key, value);
  return text;
}

std::string text_of(const Phase& phase, const Lines& scene_stepping, const Lines& scene_contact) {
  Lines lines{{"name", quoted(phase.name)}};
  switch (phase.until) {
    case Until::duration: lines.emplace_back("duration", toml_text(phase.duration)); break;
    case Until::empty: lines.emplace_back("until", "\"empty\""); break;
    case Until::rest: lines.emplace_back("until", "\"rest\""); break;
    case Until::discharged: lines.emplace_back("until", fmt::format("\"discharged:{}\"", phase.fraction)); break;
  }
  if (phase.until != Until::duration) lines.emplace_back("max_duration", toml_text(phase.duration));
  lines.emplace_back("every", toml_text(phase.every));
  lines.emplace_back("observables_every", toml_text(phase.observables_every));
  lines.emplace_back("outlet", phase.outlet_open ? "\"open\"" : "\"closed\"");
  lines.emplace_back("first_impact", fmt::format("{}", phase.first_impact));
  for (const auto& line : overrides_of(lines_of(phase.stepping), scene_stepping)) lines.push_back(line);
  std::string text = "\n[[phase]]\n" + text_of(lines);
  const Lines contact = overrides_of(lines_of(phase.materials), scene_contact);
  if (!contact.empty()) text += "[phase.contact]\n" + text_of(contact);
  return text;
}

std::string text_of(const Domain& domain) {
  Lines lines;
  if (domain.outlet_z) lines.emplace_back("outlet_z", toml_text(*domain.outlet_z));
  if (domain.lower) lines.emplace_back("lower", vector_text(*domain.lower));
  if (domain.upper) lines.emplace_back("upper", vector_text(*domain.upper));
  return lines.empty() ? "" : "\n[domain]\n" + text_of(lines);
}

std::string resolved_text(const Scene& scene, const Stepping& stepping) {
  std::string text = text_of(Lines{{"gravity", vector_text(scene.gravity)}, {"seed", fmt::format("{}", scene.seed)}});
  text += "\n[material]\n" + text_of(Lines{{"density", toml_text(scene.materials.density)}});
  text += "\n[contact]\n" + text_of(lines_of(scene.materials));
  text += "\n[stepping]\n" + text_of(lines_of(stepping));
  text += text_of(scene.domain);
  text += scene.has_silo ? "\n" + toml_text(*scene.silo, "silo")
                         : "\n[initial]\n" + text_of(Lines{{"state", quoted(scene.initial_state)}});
  for (const Phase& phase : scene.phases) text += text_of(phase, lines_of(stepping), lines_of(scene.materials));
  return text;
}

}  // namespace

Scene read_scene(const std::string& path, const std::vector<std::string>& overrides, StateFile file) {
  toml::table table = parse_toml_file(path);
  for (const std::string& assignment : overrides) apply_override(table, assignment);
  TomlKeys keys(table, "", path);

  Scene scene;
  scene.path = path;
  scene.gravity = keys.vec3("gravity").value_or(scene.gravity);
  if (const auto seed = keys.integer("seed")) {
    keys.require(*seed >= 0, "seed", "must be at least 0");
    scene.seed = static_cast<std::uint64_t>(*seed);
  }
  keys.require(!keys.has("initial") || !keys.has("silo"), "initial", "give either [initial] state or [silo], not both");
  if (auto silo = keys.table("silo")) {
    scene.has_silo = true;
    scene.silo = std::make_shared<toml::table>(std::move(*table.get("silo")->as_table()));
  } else {
    auto initial = keys.table("initial");
    keys.require(initial.has_value(), "initial", "give [initial] state = \"state.csv\" (or .h5), or a [silo] table that builds one");
    scene.initial_state = state_path(*initial, path, file);
    initial->finish();
  }
  if (auto material = keys.table("material")) {
    read_positive(*material, "density", "kg/m3", scene.materials.density);
    material->finish();
  }
  const MeanRadius mean_radius = [&scene](const TomlKeys& where, std::string_view key) {
    return mean_radius_of(scene, where, key);
  };
  if (auto contact = keys.table("contact")) {
    read_contact(*contact, scene.materials, mean_radius);
    contact->finish();
  }
  if (auto domain = keys.table("domain")) scene.domain = read_domain(*domain);
  Stepping stepping;
  if (auto given = keys.table("stepping")) {
    read_stepping(*given, stepping);
    given->finish();
  }
  Output output;
  if (auto given = keys.table("output")) output = read_output(std::move(*given));
  keys.require(keys.has("phase"), "phase", "a scene needs at least one [[phase]] with a duration");
  for (TomlKeys& phase : keys.tables("phase"))
    scene.phases.push_back(read_phase(std::move(phase), scene, stepping, output, mean_radius));
  keys.require(!scene.phases.empty(), "phase", "a scene needs at least one [[phase]] with a duration");
  keys.finish();
  scene.text = resolved_text(scene, stepping);
  return scene;
}

StepCount step_for(double every, double wanted) {
  GC_REQUIRE(every > 0.0 && wanted > 0.0 && std::isfinite(every), "every = {} s with a step of {} s: both must be above 0", every,
             wanted);
  const double n = std::max(1.0, std::ceil(every / wanted * (1.0 - kWholeGuard)));
  constexpr double kMostSteps = 1e15;
  GC_REQUIRE(n <= kMostSteps, "a step of {} s takes {:.3g} steps to every = {} s: take a larger step", wanted, n, every);
  return {every / n, static_cast<std::int64_t>(n)};
}

}  // namespace grainclock::core
