#include "silo/diagnosis.hpp"

#include "core/critical_step.hpp"
#include "core/files.hpp"
#include "core/hdf5.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace grainclock::silo {
namespace {

using core::BallId;
using core::Contact;
using core::Kind;
using core::State;
using core::Vec3;

constexpr double kAround = 3.0;      // mean diameters, what is shown
constexpr double kTouching = 4.0;    // the same, what may touch that
constexpr std::size_t kNamed = 6;    // balls and contacts in the text
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::optional<std::size_t> place_of(const State& state, BallId id) {
  const auto at = std::lower_bound(state.id.begin(), state.id.end(), id);
  if (at == state.id.end() || *at != id) return std::nullopt;
  return static_cast<std::size_t>(at - state.id.begin());
}

std::optional<Vec3> position_in(const State& state, BallId id) {
  const auto at = place_of(state, id);
  if (!at || !state.position[*at].allFinite()) return std::nullopt;
  return state.position[*at];
}

/// The balls within `reach` [m] of a point, and always `worst`.
State around(const State& state, const Vec3& center, double reach, BallId worst) {
  State out;
  out.time = state.time;
  out.length_scale = state.length_scale;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.id[i] != worst && !((state.position[i] - center).norm() <= reach)) continue;
    out.add(state.id[i], state.kind[i], state.position[i], state.velocity[i], state.radius[i]);
    out.level.push_back(state.level.empty() ? std::uint8_t{0} : state.level[i]);
  }
  return out;
}

State finite_part(const State& state) {
  State out;
  out.length_scale = state.length_scale;
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.position[i].allFinite() && state.velocity[i].allFinite())
      out.add(state.id[i], state.kind[i], state.position[i], state.velocity[i], state.radius[i]);
  }
  return out;
}

/// The largest stable step of each ball [s], by what it touches.
std::vector<double> critical_steps_of(const State& wanted, const State& wider, const core::StepperSetup& setup) {
  const State finite = finite_part(wider);
  std::vector<double> out(wanted.size(), kNaN);
  if (finite.count(Kind::content) == 0) return out;
  const core::StepBounds bounds = critical_steps(finite, setup.materials, setup.outlet_open, setup.stepping);
  std::size_t next = 0;
  for (std::size_t i = 0; i < finite.size(); ++i) {
    if (finite.kind[i] != Kind::content) continue;
    const double bound = bounds.per_ball[next++];
    if (const auto at = place_of(wanted, finite.id[i])) out[*at] = bound;
  }
  return out;
}

std::string point(const Vec3& x) { return fmt::format("({:.6g}, {:.6g}, {:.6g})", x.x(), x.y(), x.z()); }

}  // namespace

Diagnosis diagnose(const core::Stepper& stepper, const core::StepperSetup& setup, Failure failure, const core::Energies& start,
                   const std::optional<State>& before) {
  Diagnosis out;
  out.levels = stepper.level_statistics();
  out.ledger = stepper.ledger();
  out.start = start;
  out.now = stepper.energies();
  out.step = stepper.step();
  const State now = stepper.state();
  const State finite = finite_part(now);
  if (failure.balls.empty() && finite.count(Kind::content) > 0) {
    const core::StepBounds bounds = critical_steps(finite, setup.materials, setup.outlet_open, setup.stepping);
    if (bounds.at >= 0) failure.balls.push_back(bounds.at);
  }
  out.failure = std::move(failure);
  if (out.failure.balls.empty()) return out;

  const BallId worst = out.failure.balls.front();
  std::optional<Vec3> center = position_in(now, worst);
  if (!center && before) center = position_in(*before, worst);
  const Vec3 where = center.value_or(Vec3::Constant(kNaN));
  const double diameter = now.length_scale;
  out.balls = around(now, where, kAround * diameter, worst);
  out.critical_step = critical_steps_of(out.balls, around(now, where, kTouching * diameter, worst), setup);
  for (const Contact& contact : stepper.contacts()) {
    if (place_of(out.balls, contact.i) && place_of(out.balls, contact.j)) out.contacts.push_back(contact);
  }
  return out;
}

std::string text(const Diagnosis& d) {
  std::string out = fmt::format("{}\n  phase \"{}\", after {:.6g} s; coarsest step {:.4g} s", d.failure.what, d.failure.phase, d.failure.time, d.step);
  out += d.failure.critical_step > 0.0 ? fmt::format(", dt/dt_crit {:.3g} at the phase's start\n", d.step / d.failure.critical_step) : "\n";
  const auto own_step = [&](std::size_t i) { return d.levels.step.empty() ? d.step : d.levels.step[std::min<std::size_t>(d.balls.level[i], d.levels.step.size() - 1)]; };
  std::size_t named = 0;
  for (const BallId id : d.failure.balls) {
    const auto i = place_of(d.balls, id);
    if (!i || d.balls.kind[*i] != Kind::content || named++ == kNamed) continue;
    out += fmt::format("  ball {} at {} m, velocity {} m/s, step {:.4g} s, dt/dt_crit {:.3g}\n", id, point(d.balls.position[*i]),
                       point(d.balls.velocity[*i]), own_step(*i), own_step(*i) / d.critical_step[*i]);
  }
  std::vector<Contact> its;
  for (const Contact& c : d.contacts) {
    if (!d.failure.balls.empty() && (c.i == d.failure.balls.front() || c.j == d.failure.balls.front())) its.push_back(c);
  }
  std::stable_sort(its.begin(), its.end(), [](const Contact& a, const Contact& b) { return a.force.norm() > b.force.norm(); });
  for (std::size_t k = 0; k < std::min(kNamed, its.size()); ++k)
    out += fmt::format("  contact {} - {} ({}): overlap {:.4g} m, rate {:.4g} m/s, force {:.4g} N\n", its[k].i, its[k].j, name(its[k].other),
                       its[k].overlap, its[k].rate, its[k].force.norm());
  for (std::size_t level = 0; level < d.levels.step.size(); ++level)
    out += fmt::format("  level {}: step {:.4g} s, {:.1f} balls\n", level, d.levels.step[level], d.levels.balls[level]);
  out += fmt::format("  ledger: kinetic {:.4g} J, elastic {:.4g} J, dissipated {:.4g} J, from nowhere {:.3g} J; momentum residual {:.2g}\n",
                     d.now.kinetic, d.now.elastic, d.ledger.dissipated, created_energy(d.start, d.now, d.ledger),
                     momentum_residual(d.start, d.now, d.ledger));
  out += d.failure.last_checkpoint.empty() ? std::string("  there is no checkpoint of this phase yet\n")
                                           : fmt::format("  last good checkpoint: {}\n", d.failure.last_checkpoint);
  return out + "  take a smaller step (stepping.step, tolerance) or a weaker dashpot";
}

void write(const std::filesystem::path& path, const Diagnosis& d) {
  core::AsideFile aside(path);
  core::Hdf5File file = core::Hdf5File::create(aside.part());
  file.write_attribute(".", "what", d.failure.what);
  file.write_attribute(".", "phase", d.failure.phase);
  file.write_attribute(".", "last_checkpoint", d.failure.last_checkpoint);
  file.write_attribute(".", "time", std::vector<double>{d.failure.time});
  file.write_attribute(".", "step", std::vector<double>{d.step});
  file.write_attribute(".", "balls", std::vector<std::int64_t>(d.failure.balls.begin(), d.failure.balls.end()));

  core::Hdf5Group balls = file.create_group("balls");
  std::vector<std::uint8_t> kind;
  for (const Kind its : d.balls.kind) kind.push_back(static_cast<std::uint8_t>(its));
  balls.write("id", d.balls.id);
  balls.write("kind", kind);
  balls.write_vectors("position", d.balls.position);
  balls.write_vectors("velocity", d.balls.velocity);
  balls.write("radius", d.balls.radius);
  balls.write("level", d.balls.level);
  balls.write("critical_step", d.critical_step);

  core::Hdf5Group contacts = file.create_group("contacts");
  std::vector<std::int64_t> i, j;
  std::vector<double> overlap, rate;
  std::vector<Vec3> force;
  for (const Contact& c : d.contacts) {
    i.push_back(c.i);
    j.push_back(c.j);
    overlap.push_back(c.overlap);
    rate.push_back(c.rate);
    force.push_back(c.force);
  }
  contacts.write("i", i);
  contacts.write("j", j);
  contacts.write("overlap", overlap);
  contacts.write("rate", rate);
  contacts.write_vectors("force", force);

  core::Hdf5Group levels = file.create_group("levels");
  levels.write("step", d.levels.step);
  levels.write("balls", d.levels.balls);
  levels.write("contacts", d.levels.contacts);

  core::Hdf5Group ledger = file.create_group("ledger");
  const std::pair<const char*, double> entries[] = {{"kinetic", d.now.kinetic},
                                                    {"gravity", d.now.gravity},
                                                    {"elastic", d.now.elastic},
                                                    {"dissipated", d.ledger.dissipated},
                                                    {"first_impact", d.ledger.first_impact},
                                                    {"event_work", d.ledger.event_work},
                                                    {"removed_energy", d.ledger.removed_energy},
                                                    {"switched_energy", d.ledger.switched_energy},
                                                    {"created", created_energy(d.start, d.now, d.ledger)}};
  for (const auto& [its_name, value] : entries) {
    ledger.write(its_name, std::vector<double>{value});
    ledger.write_attribute(its_name, "unit", "J");
  }
  for (const char* its_name : {"position", "radius"}) balls.write_attribute(its_name, "unit", "m");
  balls.write_attribute("velocity", "unit", "m s-1");
  balls.write_attribute("critical_step", "unit", "s");
  contacts.write_attribute("overlap", "unit", "m");
  contacts.write_attribute("rate", "unit", "m s-1");
  contacts.write_attribute("force", "unit", "N");
  levels.write_attribute("step", "unit", "s");
  file.close();
  aside.commit();
}

}  // namespace grainclock::silo
