#include "silo/run.hpp"

#include "core/check.hpp"
#include "core/critical_step.hpp"
#include "core/files.hpp"
#include "core/snapshot.hpp"
#include "multirate/stepper.hpp"
#include "silo/check.hpp"
#include "silo/checkpoint.hpp"
#include "silo/diagnosis.hpp"
#include "silo/energy_watch.hpp"
#include "silo/filling.hpp"
#include "silo/observables.hpp"
#include "silo/phases.hpp"
#include "silo/progress.hpp"
#include "silo/run_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstring>
#include <filesystem>

namespace grainclock::silo {
namespace {

namespace fs = std::filesystem;
using core::Energies;
using core::Phase;
using core::Scene;
using core::State;
using core::Stepper;
using core::StepperSetup;
using Clock = std::chrono::steady_clock;

constexpr const char* kSceneFile = "scene.toml";
constexpr const char* kCheckpoints = "checkpoints";
constexpr const char* kFinalState = "final.h5";
constexpr const char* kDiagnosis = "diagnosis.h5";
constexpr double kCheckEvery = 0.01;  // s simulated, between checks whether a phase is over
// Coarsest steps between looks at the ledger: a look takes as long as some ten of them.
constexpr std::int64_t kLookEvery = 2000;

// A signal handler can reach nothing but a variable of this kind.
volatile std::sig_atomic_t stop_signal = 0;
extern "C" void note_signal(int signal) { stop_signal = signal; }

/// Takes the signals that ask for an end while it lives: also that of a terminal that is closed, unless the caller had
/// it ignored (nohup), and that of a pipe for the log that nobody reads any more.
class SignalGuard {
 public:
  SignalGuard() {
    stop_signal = 0;
    struct sigaction action {};
    action.sa_handler = note_signal;
    action.sa_flags = SA_RESTART;
    for (std::size_t k = 0; k < kTaken.size(); ++k) {
      ::sigaction(kTaken[k], nullptr, &old_[k]);
      const bool stays_ignored = old_[k].sa_handler == SIG_IGN && (kTaken[k] == SIGHUP || kTaken[k] == SIGPIPE);
      if (!stays_ignored) ::sigaction(kTaken[k], &action, nullptr);
    }
  }
  ~SignalGuard() {
    for (std::size_t k = 0; k < kTaken.size(); ++k) ::sigaction(kTaken[k], &old_[k], nullptr);
  }
  SignalGuard(const SignalGuard&) = delete;
  SignalGuard& operator=(const SignalGuard&) = delete;

 private:
  static constexpr std::array kTaken{SIGINT, SIGTERM, SIGHUP, SIGPIPE};
  std::array<struct sigaction, kTaken.size()> old_{};
};

double seconds_since(Clock::time_point then) { return std::chrono::duration<double>(Clock::now() - then).count(); }

class Run {
 public:
  Run(Scene scene, fs::path directory, const RunOptions& options, RunFile file, WatchedWall wall)
      : scene_(std::move(scene)), directory_(std::move(directory)), options_(options), file_(std::move(file)), wall_(std::move(wall)) {}

  /// From the very beginning.
  void begin(Start start) {
    at_.scene = core::checksum(scene_.text);
    at_.first_collar = start.first_collar;
    at_.phase_start = start.state.time;
    start_phase(fresh(std::move(start.state)), nullptr);
    at_.start = stepper_->energies();
    add_record();
    add_frame();
    go();
  }

  /// From a checkpoint of the same run.
  void go_on(const Checkpoint& checkpoint) {
    at_ = checkpoint.position;
    StepperSetup setup = setup_of(phase(), checkpoint.state);
    setup.stepping.method = at_.fell_back != 0 ? core::Method::uniform : phase().stepping.method;
    setup.stepping.step = at_.step;
    setup.steps_done = at_.steps;
    setup.ledger = at_.ledger;
    setup.costs = at_.costs;
    make_stepper(checkpoint.state, setup);
    go();
  }

 private:
  const Phase& phase() const { return scene_.phases[static_cast<std::size_t>(at_.phase)]; }
  StepperSetup setup_of(const Phase& its_phase, const State& state) const {
    return phase_setup(scene_, its_phase, state, options_.threads);
  }
  std::int64_t steps_per_frame() const { return std::llround(phase().every / at_.step); }
  std::int64_t last_step() const { return std::llround(phase().duration / phase().every) * steps_per_frame(); }

  /// The first step after the present one that ends nearest to a multiple of `observables_every` (every step if that is shorter):
  /// what is recorded changes no step.
  std::int64_t next_record() const {
    const std::int64_t n = steps_per_frame(), records = std::llround(phase().every / phase().observables_every);
    const auto step_of = [&](std::int64_t record) { return (2 * record * n + records) / (2 * records); };
    std::int64_t record = at_.steps * records / n;
    while (step_of(record) <= at_.steps) ++record;
    return step_of(record);
  }

  /// Time of a step of the phase [s], never summed up: whole frames of `every` and whole steps beyond them.
  double time_at(std::int64_t steps) const {
    const std::int64_t n = steps_per_frame(), frames = steps / n;
    return at_.phase_start + static_cast<double>(frames) * phase().every + static_cast<double>(steps % n) * at_.step;
  }

  void go() {
    try {
      while (true) {
        run_phase();
        if (at_.phase + 1 == static_cast<std::int64_t>(scene_.phases.size()) || is_empty()) break;
        next_phase();
      }
      finish();
    } catch (const core::NumericsError& error) {
      file_.flush();
      throw core::NumericsError(diagnosis(error), error.balls());
    }
  }

  // -------------------------------------------------------------- phases

  void make_stepper(const State& state, const StepperSetup& setup) {
    stepper_ = multirate::make_stepper(state, setup);
    setup_ = setup;
  }

  /// A new stepper for the phase at_.phase from this state; `before`: the stepper that it takes over from.
  void start_phase(const State& state, const Stepper* before) {
    StepperSetup setup = setup_of(phase(), state);
    if (before) {
      setup.ledger = at_.ledger;
      setup.costs = before->costs();
      make_stepper(state, setup);
      // What the energy jumps by is the switch's doing: other stiffness, a plug that comes or goes.
      const Energies energies = stepper_->energies();
      setup.ledger.switched_energy += energies.total() - energy_before_switch_;
    }
    // Before the stepper, because it makes some of its own: of millions of balls each takes gigabytes.
    const Report report = phase_report(phase(), state, setup);
    make_stepper(state, setup);
    at_.step = *setup.stepping.step;
    at_.fell_back = setup.stepping.method != phase().stepping.method ? 1 : 0;
    at_.steps = 0;
    at_.mean = mean_ball(state, setup.materials);
    const std::int64_t discharged = stepper_->ledger().discharged;
    at_.watch = {-1, -1, discharged, static_cast<std::int64_t>(state.count(core::Kind::content)), discharged, 0};

    critical_step_ = critical_steps(state, setup.materials, setup.outlet_open, setup.stepping).smallest;
    say("\nphase {} of {}, from {:.6g} s\n{}", at_.phase + 1, scene_.phases.size(), at_.phase_start, report.text(2));
    if (at_.fell_back != 0) {
      say("  multi-rate will not pay here: uniform steps of {:.4g} s instead (stepping.fallback)\n", at_.step);
    }
    std::fflush(stdout);
  }

  /// Whether no ball is left for another phase; says so.
  bool is_empty() const {
    if (stepper_->state().count(core::Kind::content) > 0) return false;
    say("no ball is left: the phases after \"{}\" have nothing to move\n", phase().name);
    return true;
  }

  void next_phase() {
    const bool was_open = phase().outlet_open;
    State state = fresh(stepper_->state());
    state.time = time_at(at_.steps);
    at_.phase_start = state.time;
    at_.ledger = stepper_->ledger();
    energy_before_switch_ = stepper_->energies().total();
    ++at_.phase;
    if (at_.first_collar >= 0) {
      remove_collar(state, at_.first_collar);
      at_.first_collar = -1;
    }
    if (was_open && !phase().outlet_open) cut_off(state);
    start_phase(state, stepper_.get());
  }

  /// Closing the outlet: the gate takes the balls that it would shut in.
  void cut_off(State& state) {
    const State whole = state;
    const std::vector<core::BallId> cut = clear_gate(state);
    const core::Materials& materials = phase().materials;
    for (const core::BallId id : cut) {
      const auto i = static_cast<std::size_t>(std::lower_bound(whole.id.begin(), whole.id.end(), id) - whole.id.begin());
      const double m = materials.mass(whole.radius[i]);
      const core::Vec3 &x = whole.position[i], &v = whole.velocity[i];
      const double energy = 0.5 * m * v.squaredNorm() - m * scene_.gravity.dot(x);
      at_.ledger.removed_energy += energy;
      at_.ledger.removed_momentum += m * v;
      energy_before_switch_ -= energy;
    }
    at_.ledger.discharged += static_cast<std::int64_t>(cut.size());
    if (!cut.empty())
      say("closing the outlet: {} balls stand in the gate's way; it cuts them off, and they count as discharged\n", cut.size());
  }

  void run_phase() {
    progress_.emplace(phase().name, phase().duration, time_at(at_.steps) - at_.phase_start);
    const std::int64_t n_frame = steps_per_frame(), last = last_step();
    const bool is_watched = phase().until != core::Until::duration;
    const double weight = static_cast<double>(stepper_->state().count(core::Kind::content)) * at_.mean.mass * scene_.gravity.norm();
    EnergyWatch energy(at_.start, stepper_->energies(), stepper_->ledger(), weight * at_.mean.radius);
    heat_warned_ = false;
    missed_before_ = stepper_->costs().missed_contacts;
    const std::int64_t n_check = std::max<std::int64_t>(1, std::llround(kCheckEvery / at_.step));
    std::optional<std::string> reason;
    while (at_.steps < last && !reason) {
      const std::int64_t record = next_record();  // never beyond the next frame
      std::int64_t target = std::min(record, (at_.steps / kLookEvery + 1) * kLookEvery);
      if (is_watched) target = std::min(target, (at_.steps / n_check + 1) * n_check);
      advance_to(target);
      if (is_watched && at_.steps % n_check == 0)
        reason = phase_end(phase(), at_.mean, scene_.gravity.norm(), at_.step, at_.steps, stepper_->kinetic_energy(),
                           stepper_->ledger().discharged, at_.watch);
      if (at_.steps == record || reason) add_record();
      if (at_.steps % n_frame == 0 || reason) add_frame();
      if (at_.steps % kLookEvery == 0 || at_.steps == last || reason) look_at(energy);
    }
    progress_.reset();
    say("phase \"{}\" ends at {:.6g} s: {}\n", phase().name, time_at(at_.steps),
        reason ? *reason : is_watched ? "the longest time it may take is over" : "its duration is over");
    std::fflush(stdout);
  }

  /// Steps may go wrong without anything flying apart: energy that nothing accounts for, contacts that were missed.
  void look_at(EnergyWatch& energy) {
    if (const auto created = energy.look(stepper_->energies(), stepper_->ledger())) {
      if (created->spoils)
        throw core::NumericsError(fmt::format("the steps heat the content, at {:.6g} s: {}; use a smaller step", time_at(at_.steps), created->text));
      if (!heat_warned_) warn(fmt::format("the steps heat a few balls: {}; a smaller step would not", created->text));
      heat_warned_ = true;
    }
    const std::uint64_t missed = stepper_->costs().missed_contacts - missed_before_;
    if (missed == 0) return;
    missed_before_ += missed;
    warn(fmt::format("{} contacts closed unseen and were found late; use a smaller stepping.step or tolerance", missed));
  }

  void warn(const std::string& text) {
    progress_->end_line();
    say("  warning, at {:.6g} s: {}\n", time_at(at_.steps), text);
    std::fflush(stdout);
  }

  /// Steps to this step of the phase, with checkpoints and signals served on the way. Chunks change no result.
  void advance_to(std::int64_t target) {
    while (at_.steps < target) {
      const bool is_wanted = stop_signal != 0 || last_checkpoint_.empty() || seconds_since(checkpoint_time_) > options_.checkpoint_every;
      if (is_wanted && stepper_->is_checkpointable()) {
        save();
        if (stop_signal != 0) stop();
      }
      const std::int64_t n = std::min(target - at_.steps, is_wanted ? 1 : chunk_);
      const auto begin = Clock::now();
      stepper_->advance(n);
      at_.steps += n;
      at_.total_steps += n;
      // As many steps at once as take about a tenth of a second: a signal is served soon, yet the clock is read rarely.
      const double elapsed = seconds_since(begin);
      if (n == chunk_) chunk_ = elapsed > 0.1 ? std::max<std::int64_t>(1, chunk_ / 2) : elapsed < 0.05 ? chunk_ * 2 : chunk_;
      progress_->note(time_at(at_.steps) - at_.phase_start, stepper_->ledger().discharged);
    }
  }

  // -------------------------------------------------------------- output

  State state_now() const {
    State state = stepper_->state();
    state.time = time_at(at_.steps);
    return state;
  }

  void add_record() {
    file_.add(Record{time_at(at_.steps), at_.total_steps, observe_between(*stepper_, wall_, at_.phase)});
  }

  void add_frame() {
    State state = state_now();
    std::vector<Observable> observed = observe(*stepper_, at_.start);
    const double time = state.time;
    file_.add(Frame{time, at_.total_steps, std::move(state), std::move(observed)});
  }

  void save() {
    file_.flush();  // a checkpoint never refers to frames that are not on the disk
    at_.frames = file_.frames();
    at_.records = file_.records();
    at_.ledger = stepper_->ledger();
    at_.costs = stepper_->costs();
    last_checkpoint_ = write_checkpoint(directory_ / kCheckpoints, {state_now(), at_});
    checkpoint_time_ = Clock::now();
  }

  [[noreturn]] void stop() {
    progress_->end_line();
    throw core::Stopped(fmt::format("stopped by SIG{} at {:.6g} s; `grainclock resume {}` goes on", ::sigabbrev_np(stop_signal),
                                    time_at(at_.steps), directory_.string()));
  }

  void finish() {
    const Energies energies = stepper_->energies();
    State state = fresh(state_now());
    state.impacted.clear();  // a scene that starts from here has impacts of its own
    if (at_.first_collar >= 0) remove_collar(state, at_.first_collar);
    file_.flush();
    core::write_state((directory_ / kFinalState).string(), state);
    at_.frames = file_.frames();
    at_.records = file_.records();
    at_.ledger = stepper_->ledger();
    at_.costs = stepper_->costs();
    at_.phase_start = state.time;
    at_.phase = static_cast<std::int64_t>(scene_.phases.size());
    write_checkpoint(directory_ / kCheckpoints, {state, at_});
    print_ledger(energies);
  }

  void print_ledger(const Energies& now) const {
    const core::Ledger& ledger = stepper_->ledger();
    const core::Costs costs = stepper_->costs();
    Report report;
    report.add("kinetic", "kinetic energy", now.kinetic, "J");
    report.add("gravity", "gravity energy, change", now.gravity - at_.start.gravity, "J");
    report.add("elastic", "elastic energy", now.elastic, "J");
    report.add("dissipated", "dissipated by dashpots", ledger.dissipated, "J");
    report.add("first_impact", "removed by first-impact stops", ledger.first_impact, "J");
    report.add("event_work", "put in by event corrections", ledger.event_work, "J");
    report.add("removed", "carried away by balls that left", ledger.removed_energy, "J");
    report.add("switched", "put in by switching stiffness or outlet", ledger.switched_energy, "J");
    report.add("energy_residual", "energy residual / energy turned over", core::energy_residual(at_.start, now, ledger));
    report.add("momentum_residual", "momentum residual / sum of |impulses|", core::momentum_residual(at_.start, now, ledger));
    report.add("discharged", "balls discharged", ledger.discharged);
    report.add("contact_evaluations", "contact evaluations", static_cast<double>(costs.contact_evaluations));
    report.add("ball_updates", "ball updates", static_cast<double>(costs.ball_updates));
    report.add("events", "event corrections", static_cast<double>(costs.events));
    report.add("missed_contacts", "missed contacts", static_cast<std::int64_t>(costs.missed_contacts));
    const core::LevelStatistics levels = stepper_->level_statistics();
    if (levels.ran_out && levels.step.size() > 1)
      report.warn(fmt::format(
          "at times even the finest level's step of {:.3g} s was too long for the tolerance; raise stepping.levels",
          levels.step.front()));
    say("\nledger\n{}done: {}\n", report.text(2), directory_.string());
    std::fflush(stdout);
  }

  /// Writes diagnosis.h5 and gives the text.
  std::string diagnosis(const core::NumericsError& error) const {
    std::optional<State> before;
    if (!last_checkpoint_.empty()) before = read_checkpoint(last_checkpoint_).state;
    const Diagnosis its = diagnose(*stepper_, setup_, {error.what(), error.balls(), phase().name, time_at(at_.steps), critical_step_, last_checkpoint_},
                                   at_.start, before);
    const std::string file = (directory_ / kDiagnosis).string();
    try {
      write(file, its);
      return fmt::format("{}\n  the neighbourhood is in {}", text(its), file);
    } catch (const core::FileError& trouble) {  // what went wrong first matters more
      return fmt::format("{}\n  the neighbourhood could not be written: {}", text(its), trouble.what());
    }
  }

  Scene scene_;
  fs::path directory_;
  RunOptions options_;
  RunFile file_;
  WatchedWall wall_;
  std::unique_ptr<Stepper> stepper_;
  StepperSetup setup_;  // of the stepper
  Position at_;
  double energy_before_switch_ = 0.0;  // J, without the balls that the gate cut off
  double critical_step_ = 0.0;         // s, at the phase's start; 0: not known after a resume
  std::uint64_t missed_before_ = 0;    // contacts missed when last looked
  bool heat_warned_ = false;           // in this phase
  std::optional<Progress> progress_;
  std::string last_checkpoint_;
  Clock::time_point checkpoint_time_ = Clock::now();
  std::int64_t chunk_ = 1;
};

/// Everything about the output directory that can be refused before anything is done.
void require_free(const fs::path& directory) {
  if (!fs::exists(directory)) return;
  GC_REQUIRE(fs::is_directory(directory), "--out {}: is a file; give a new or an empty directory", directory.string());
  GC_REQUIRE(fs::is_empty(directory), "--out {}: exists and is not empty; give a new directory, or `grainclock resume {}` to go on",
             directory.string(), directory.string());
}

void make_directories(const fs::path& directory) {
  std::error_code trouble;
  fs::create_directories(directory, trouble);
  if (trouble) throw core::FileError(fmt::format("{}: cannot be created: {}", directory.string(), trouble.message()));
}

WatchedWall wall_of(const Scene& scene, const State& recorded) {
  return watch_wall(recorded, scene.has_silo ? std::optional(patch_above_hopper(read_silo(scene))) : std::nullopt);
}

core::DirectoryLock lock_of(const fs::path& directory) {
  return {directory, fmt::format("{}: another run is at work there; wait for its end, or give another directory", directory.string())};
}

RunFile::Header header_of(const Scene& scene, const RunOptions& options, const WatchedWall& wall) {
  return {scene, options.threads, wall.layers ? edges(*wall.layers) : std::vector<double>{}};
}

}  // namespace

void run_scene(const Scene& scene, const std::string& directory, const RunOptions& options) {
  require_free(directory);
  Start start = start_of(scene);
  // Every phase's stepper is made once, so that what is not offered shows now and not after hours.
  for (std::size_t k = 0; k < scene.phases.size(); ++k) {
    const State state = as_if_begun(scene, k, start.state);
    multirate::make_stepper(state, phase_setup(scene, scene.phases[k], state, options.threads));
  }

  State recorded = start.state;  // the collar is a tool of the filling, not part of the silo
  if (start.first_collar >= 0) remove_collar(recorded, start.first_collar);
  const SignalGuard signals;
  make_directories(directory);
  const core::DirectoryLock lock = lock_of(directory);
  require_free(directory);  // another run may have been quicker
  make_directories(fs::path(directory) / kCheckpoints);
  core::write_text(fs::path(directory) / kSceneFile, scene.text);
  const WatchedWall wall = wall_of(scene, recorded);
  Run run(scene, directory, options, RunFile(directory, recorded, header_of(scene, options, wall)), wall);
  run.begin(std::move(start));
}

void resume_run(const std::string& directory, const RunOptions& options) {
  const fs::path path(directory);
  if (!fs::exists(path / kSceneFile)) throw core::FileError(fmt::format("{}: holds no run (there is no {} in it)", directory, kSceneFile));
  const SignalGuard signals;
  const core::DirectoryLock lock = lock_of(path);
  const Scene scene = core::read_scene((path / kSceneFile).string(), {}, core::StateFile::may_be_gone);
  const std::uint64_t scene_sum = core::checksum(core::read_text(path / kSceneFile));
  core::remove_parts(path / kCheckpoints);

  const std::vector<fs::path> candidates = checkpoints_in(path / kCheckpoints);
  if (candidates.empty())
    throw core::FileError(fmt::format("{}: holds no checkpoint yet: the run ended before its first one, so nothing is lost; run the scene into another directory",
                                      (path / kCheckpoints).string()));
  const WatchedWall wall = wall_of(scene, RunFile::start_in(path));
  std::optional<Checkpoint> checkpoint;
  std::optional<RunFile> file;
  std::string troubles;
  const auto succeeds = [&troubles](const auto& call) {
    try {
      call();
      return true;
    } catch (const std::exception& error) {
      say("passing over a checkpoint: {}\n", error.what());
      troubles += fmt::format("\n  {}", error.what());
      return false;
    }
  };
  for (auto candidate = candidates.begin(); candidate != candidates.end() && !file; ++candidate) {
    if (!succeeds([&] { checkpoint = read_checkpoint(*candidate); })) continue;
    GC_REQUIRE(checkpoint->position.scene == scene_sum,
               "{}: is not the scene that this run began with; put that back (run.h5 holds it, /provenance/scene), or run the new one into another directory",
               (path / kSceneFile).string());
    const Position& at = checkpoint->position;
    succeeds([&] { file = RunFile::resumed(path, header_of(scene, options, wall), at.frames, at.records); });
  }
  if (!file) throw core::FileError(fmt::format("{}: cannot be resumed from any of its checkpoints:{}", directory, troubles));
  if (checkpoint->position.phase == static_cast<std::int64_t>(scene.phases.size())) {
    if (!fs::exists(path / kFinalState)) core::write_state((path / kFinalState).string(), checkpoint->state);
    say("{}: this run is over; there is nothing to resume\n", directory);
    return;
  }
  say("resuming at {:.6g} s\n", checkpoint->state.time);
  Run run(scene, path, options, std::move(*file), wall);
  run.go_on(*checkpoint);
}

}  // namespace grainclock::silo
