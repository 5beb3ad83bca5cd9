#include "silo/frame_contacts.hpp"

#include "core/check.hpp"
#include "silo/observables.hpp"

#include <cmath>
#include <limits>

namespace grainclock::silo {
namespace {

using core::FileError;
using core::Materials;
using core::State;
using core::Stepper;

template <class T>
void read(const toml::table& table, const char* key, T& value) {
  value = table[key].value<T>().value_or(value);
}

void read_contact(const toml::table& table, Materials& materials) {
  read(table, "k_ball", materials.ball.k);
  read(table, "k_wall", materials.wall.k);
  read(table, "c_ball", materials.ball.c);
  read(table, "c_wall", materials.wall.c);
  read(table, "tension", materials.tension);
  read(table, "cohesion", materials.cohesion);
}

[[noreturn]] void fail(const char* what) {
  throw FileError(fmt::format("the scene that is kept in the run has {}: its file is damaged", what));
}

void require_possible(const Materials& m) {
  const auto is_spring = [](double k) { return std::isfinite(k) && k > 0.0; };
  const auto is_other = [](double c) { return std::isfinite(c) && c >= 0.0; };
  if (!is_spring(m.density) || !is_spring(m.ball.k) || !is_spring(m.wall.k) || !is_other(m.ball.c) || !is_other(m.wall.c) || !is_other(m.cohesion))
    fail("a density, spring, dashpot or cohesion that cannot be");
}

/// How far apart two lists are, relative to their size: from 0 for equal ones to 1.
double difference(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.size() != b.size()) return 1.0;
  double apart = 0.0, size = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    apart += std::abs(a[k] - b[k]);
    size += std::abs(a[k]) + std::abs(b[k]);
  }
  return size > 0.0 ? apart / size : 0.0;
}

}  // namespace

std::vector<PhaseLaw> phase_laws(const toml::table& scene) {
  const toml::table *contact = scene["contact"].as_table(), *material = scene["material"].as_table();
  const toml::array* phases = scene["phase"].as_array();
  if (!contact || !material || !phases || phases->empty()) fail("no [contact], no [material] or no [[phase]]");
  Materials materials;
  read(*material, "density", materials.density);
  read_contact(*contact, materials);
  require_possible(materials);

  std::vector<PhaseLaw> laws;
  double earliest = 0.0, latest = 0.0;
  for (const toml::node& node : *phases) {
    if (!node.is_table()) fail("a phase that is no table");
    const toml::table& phase = *node.as_table();
    const auto duration = phase["duration"].value<double>(), longest = phase["max_duration"].value<double>();
    if (!duration && !longest) fail("a phase without duration");
    PhaseLaw law{materials, phase["outlet"].value_or(std::string()) == "open", earliest, 0.0};
    if (const toml::table* own = phase["contact"].as_table()) read_contact(*own, law.materials);
    require_possible(law.materials);
    latest += duration ? *duration : *longest;
    earliest += duration.value_or(0.0);
    law.latest = latest;
    laws.push_back(law);
  }
  return laws;
}

ContactFinder::ContactFinder(const RunReader& run) : run_(run), laws_(phase_laws(run.scene())) {}

std::vector<PhaseLaw> ContactFinder::candidates(std::int64_t frame) const {
  if (const auto phase = run_.observable("phase", frame)) {
    const double number = phase->front();
    if (!(number >= 0.0 && number < static_cast<double>(laws_.size()))) return {};
    return {laws_[static_cast<std::size_t>(number)]};
  }
  if (frame == 0) return {laws_.front()};
  constexpr double kGuard = 1e-9;  // s: far above the rounding of times, far below a step
  const double time = run_.times().at(static_cast<std::size_t>(frame)) - run_.times().front();
  std::vector<PhaseLaw> found;
  for (const PhaseLaw& law : laws_)
    if (time > law.earliest + kGuard && time <= law.latest + kGuard) found.push_back(law);
  return found;
}

std::unique_ptr<Stepper> ContactFinder::stepper(const State& state, const PhaseLaw& law) const {
  core::StepperSetup setup;
  setup.materials = law.materials;
  setup.outlet_open = law.outlet_open;
  setup.stepping.method = core::Method::uniform;
  setup.stepping.events = false;
  setup.stepping.step = 1e-9;  // s; no step is taken
  return core::make_uniform_stepper(state, setup);
}

double ContactFinder::mismatch(std::int64_t frame, const State& state, const Stepper& stepper) const {
  double sum = 0.0;
  if (const auto recorded = run_.observable("elastic_energy", frame)) sum += difference(*recorded, {stepper.energies().elastic});
  const auto layers = layers_of(state);
  const auto recorded = run_.observable(kWallForceByLayer, frame);
  if (layers && recorded) sum += difference(*recorded, wall_force_by_layer(state, stepper.contacts(), *layers));
  return sum;
}

FrameContacts ContactFinder::contacts(std::int64_t frame, const State& state) const {
  const std::vector<PhaseLaw> laws = candidates(frame);
  if (laws.empty())
    throw FileError(fmt::format("the frame at {} s lies in no phase of the scene that is kept in the run: its file is damaged", state.time));
  if (state.count(core::Kind::content) == 0) return {{}, laws.front().outlet_open};
  if (laws.size() == 1) return {stepper(state, laws.front())->contacts(), laws.front().outlet_open};

  FrameContacts best;
  double least = std::numeric_limits<double>::infinity();
  for (const PhaseLaw& law : laws) {
    try {
      const auto its = stepper(state, law);
      const double apart = mismatch(frame, state, *its);
      if (!(apart < least)) continue;
      least = apart;
      best = {its->contacts(), law.outlet_open};
    } catch (const core::NumericsError&) {
      // As with a plug amid flowing balls: their forces are beyond all limits, so this is not the frame's law.
    }
  }
  if (!std::isfinite(least))
    throw FileError(fmt::format("the frame at {} s has forces beyond all limits by every law of its scene: the file is damaged", state.time));
  return best;
}

}  // namespace grainclock::silo
