#include "silo/check.hpp"

#include "core/check.hpp"
#include "core/critical_step.hpp"
#include "multirate/cost_model.hpp"
#include "multirate/interface.hpp"
#include "multirate/stepper.hpp"
#include "silo/phases.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>

namespace grainclock::silo {
namespace {

using core::Materials;
using core::Method;
using core::Phase;
using core::StepperSetup;


bool has_fixed(const core::State& state) { return state.count(core::Kind::content) < state.size(); }

std::string terms(const StepperSetup& setup) {
  std::string text = "spring, dashpot";
  if (!setup.materials.tension) text += ", clamp (no tension)";
  if (setup.materials.cohesion > 0.0) text += ", cohesion";
  if (setup.stepping.dashpot != core::Dashpot::explicit_) text += fmt::format(", {} dashpot", name(setup.stepping.dashpot));
  if (setup.stepping.events) text += ", event correction";
  if (setup.first_impact) text += ", first-impact stop";
  if (setup.domain.outlet_z) text += ", removal below the outlet";
  if (setup.domain.lower || setup.domain.upper) text += ", domain limits";
  return text;
}

std::string stepping_text(const core::Stepping& s) {
  if (s.method == Method::uniform) return fmt::format("uniform, {}", name(s.integrator));
  return fmt::format("multirate, {}, {}, tolerance {:g}, at most {} levels, limiter {}", name(s.integrator), name(s.interface),
                     s.tolerance, s.levels, s.limiter);
}

void add_pair(Report& report, const std::string& key, const std::string& label, const core::PairLaw& law, double m_eff, double step,
              const StepperSetup& setup) {
  const double damping = core::damping_ratio(law, m_eff), duration = core::collision_time(law, m_eff, setup.materials.tension);
  Report pair;
  pair.add("damping_ratio", "damping ratio", damping);
  pair.add("restitution", "restitution", core::restitution(law, m_eff, setup.materials.tension));
  pair.add("collision_time", "collision time", duration, "s");
  pair.add("collision_steps", "collision time / coarsest step", duration / step);
  const double least = multirate::least_damping_ratio(setup.stepping.interface);
  if (setup.stepping.method == Method::multirate && damping < least)
    pair.warn(fmt::format("damping ratio {:.3g} is below {}: steps of different lengths that meet here may resonate with the contact and "
                          "heat the balls (interface = \"{}\"); raise the dashpot, {}step uniformly",
                          damping, least, name(setup.stepping.interface),
                          setup.stepping.interface == core::Interface::accumulate ? "or " : "take \"accumulate\", or "));
  report.add(key, label, pair);
}

void add_stability(Report& report, const core::State& state, const StepperSetup& setup, double m) {
  const double step = *setup.stepping.step;
  const core::StepBounds bounds = critical_steps(state, setup.materials, setup.outlet_open, setup.stepping);
  const double pair = core::critical_step_of_pair(setup.materials.ball, 2.0 / m, setup.stepping);
  const double wall_pair = core::critical_step_of_pair(setup.materials.wall, 1.0 / m, setup.stepping);
  report.add("critical_step_pair", "critical step of two mean balls", pair, "s");
  if (has_fixed(state)) report.add("critical_step_wall_pair", "critical step of a mean ball at the wall", wall_pair, "s");
  report.add("critical_step", "critical step of this state", bounds.smallest, "s");
  report.add("critical_step_bulk", "critical step off the wall", bounds.bulk, "s");
  report.add("critical_step_wall", "critical step at the wall", bounds.wall, "s");
  report.add("step", "coarsest step", step, "s");
  // Multi-rate gives each ball a step that is stable for it, down to the finest level. The state may still be
  // without contacts, as before a filling: then single pairs tell.
  const bool is_uniform = setup.stepping.method == Method::uniform;
  const double finest = is_uniform ? step : std::ldexp(step, 1 - setup.stepping.levels);
  const double critical = std::min({bounds.smallest, pair, has_fixed(state) ? wall_pair : pair});
  const double ratio = finest / critical;
  report.add("step_ratio", is_uniform ? "dt/dt_crit" : "finest allowed step / dt_crit", ratio);
  if (ratio > 1.0)
    report.warn(fmt::format("dt/dt_crit = {:.3g}{}: beyond the stability bound; take a step of at most {:.3g} s", ratio,
                            critical == bounds.smallest ? fmt::format(" at ball {}", bounds.at) : "",
                            is_uniform ? critical : std::ldexp(critical, setup.stepping.levels - 1)));
}

void add_levels(Report& report, const core::State& state, const StepperSetup& setup) {
  const multirate::Prediction prediction = multirate::predict(state, setup);
  Report levels;
  levels.add("steps", "steps, finest first", prediction.step, "s");
  levels.add("balls", "balls", std::vector<double>(prediction.balls.begin(), prediction.balls.end()));
  levels.add("contacts", "contacts", std::vector<double>(prediction.contacts.begin(), prediction.contacts.end()));
  levels.add("ideal_gain", "ideal gain", prediction.ideal_gain);
  levels.add("uniform_step", "uniform steps as accurate", prediction.uniform_step, "s");
  levels.add("trial_steps", "coarse steps tried out for that", prediction.tried);
  levels.add("predicted_gain", "predicted gain over those, contact evaluations", prediction.gain);
  levels.add("predicted_wall_gain", "predicted gain over those, wall clock", prediction.wall_gain);
  if (!pays(prediction))
    levels.warn(fmt::format("multi-rate will not pay in this state: uniform steps of {:.3g} s should be as accurate and take {:.2g} "
                            "of its time; set stepping.method = \"uniform\" with stepping.step = {:.3g}, or stepping.fallback = true",
                            prediction.uniform_step, prediction.wall_gain, prediction.uniform_step));
  report.add("levels", "levels", levels);
}

/// Seconds of wall clock per second of simulated time, from a few steps.
double measured_pace(const core::State& state, const StepperSetup& setup) {
  using Clock = std::chrono::steady_clock;
  constexpr double kEnough = 0.3;  // s
  const auto stepper = multirate::make_stepper(state, setup);
  const auto begin = Clock::now();
  std::int64_t steps = 0;
  double elapsed = 0.0;
  for (std::int64_t n = 1; elapsed < kEnough && steps < 1000; n *= 2) {
    stepper->advance(n);
    steps += n;
    elapsed = std::chrono::duration<double>(Clock::now() - begin).count();
  }
  return elapsed / (static_cast<double>(steps) * stepper->step());
}

/// Values that are possible but look like other units than SI.
void add_unit_hints(Report& report, const core::State& state, const StepperSetup& setup, const MeanBall& mean) {
  const auto hint = [&](bool is_odd, const std::string& what, const char* units) {
    if (is_odd) report.warn(fmt::format("{}: is that in {}? Everything is in SI units", what, units));
  };
  double speed = 0.0;
  for (const core::Vec3& v : state.velocity) speed = std::max(speed, v.norm());
  const Materials& m = setup.materials;
  hint(mean.radius > 10.0 || mean.radius < 1e-5, fmt::format("the balls' mean radius is {:.3g} m", mean.radius), "m");
  hint(m.density < 10.0 || m.density > 30000.0, fmt::format("the density is {:.3g} kg/m3", m.density), "kg/m3, not t/m3 or g/cm3");
  hint(setup.gravity.norm() > 100.0, fmt::format("gravity is {:.3g} m/s2", setup.gravity.norm()), "m/s2");
  hint(speed > 300.0, fmt::format("the fastest ball has {:.3g} m/s", speed), "m/s");
  hint(m.ball.k < 100.0 || m.wall.k < 100.0, fmt::format("the stiffnesses are {:.3g} and {:.3g} N/m", m.ball.k, m.wall.k), "N/m, not kN/mm");
}

}  // namespace

Report phase_report(const Phase& phase, const core::State& state, const StepperSetup& setup) {
  Report report;
  const MeanBall mean = mean_ball(state, setup.materials);
  report.add("name", "name", phase.name);
  report.add("terms", "terms on", terms(setup));
  report.add("stepping", "stepping", stepping_text(setup.stepping));
  report.add("duration", phase.until == core::Until::duration ? "duration" : "duration at most", phase.duration, "s");
  report.add("outlet", "outlet", std::string(phase.outlet_open ? "open" : "closed"));
  if (mean.mass > 0.0) {
    add_unit_hints(report, state, setup, mean);
    add_pair(report, "ball_contact", "two mean balls", setup.materials.ball, 0.5 * mean.mass, *setup.stepping.step, setup);
    if (has_fixed(state))
      add_pair(report, "wall_contact", "a mean ball at the wall", setup.materials.wall, mean.mass, *setup.stepping.step, setup);
    add_stability(report, state, setup, mean.mass);
    if (setup.stepping.method == Method::multirate) add_levels(report, state, setup);
  }
  return report;
}

Report check_scene(const core::Scene& scene, int threads) {
  const Start start = start_of(scene);
  Report report;
  report.add("scene", "scene", scene.path);
  for (const core::Kind kind : {core::Kind::content, core::Kind::wall, core::Kind::plug})
    report.add(std::string(name(kind)), fmt::format("{} balls", name(kind)), static_cast<std::int64_t>(start.state.count(kind)));
  double wall_clock = 0.0;
  for (std::size_t k = 0; k < scene.phases.size(); ++k) {
    const Phase& phase = scene.phases[k];
    const core::State state = as_if_begun(scene, k, start.state);
    const StepperSetup setup = phase_setup(scene, phase, state, threads);
    Report part = phase_report(phase, state, setup);
    try {
      const double pace = measured_pace(state, setup);
      part.add("pace", "wall clock per simulated second, in the start state", pace, "s");
      wall_clock += pace * phase.duration;
    } catch (const core::NumericsError& error) {
      part.warn(fmt::format("the numerics fail within the first steps: {}", error.what()));
    }
    report.add(fmt::format("phase_{}", k), fmt::format("phase \"{}\", as if it began with the start state", phase.name), part);
  }
  report.add("wall_clock", "wall clock of all phases (a guess from the start state)", wall_clock, "s");
  rusage usage{};
  ::getrusage(RUSAGE_SELF, &usage);
  report.add("memory", "memory", static_cast<double>(usage.ru_maxrss) / 1024.0, "MiB");
  return report;
}

}  // namespace grainclock::silo
