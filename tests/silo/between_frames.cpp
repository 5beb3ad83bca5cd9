// What is read off the records between frames: series whose answers are known, and a run.
#include "silo/between_frames.hpp"

#include "core/check.hpp"
#include "tests/support/gated_run.hpp"

#include <cmath>
#include <numbers>

namespace grainclock::silo {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

/// 20 s of records each 0.02 s: one ball each 0.02 s but between 5 and 5.5 s, and between 8 and 8.4 s; in the first pause the
/// content rests, in the second it goes on. Energy and speed beat once each 2 s.
BulkMotion beating() {
  BulkMotion motion;
  double count = 0.0;
  for (int k = 0; k <= 1000; ++k) {
    const double t = 0.02 * k;
    const bool rests = k > 250 && k <= 275, pauses = k > 400 && k <= 420;
    motion.time.push_back(t);
    motion.discharged.push_back(count += rests || pauses ? 0.0 : 1.0);
    const double beat = 1.0 + 0.5 * std::cos(kTwoPi * t / 2.0);
    motion.energy.push_back(rests ? 1e-3 : 0.02 * beat);
    motion.sinking_speed.push_back(rests ? 0.0 : 0.06 * beat);
  }
  return motion;
}

TEST(Rhythm, FindsPausesStoppagesAndBeats) {
  const Rhythm found = rhythm_of(beating(), {"flow", true, 0, 1001});
  ASSERT_EQ(found.pauses.size(), 2u);
  EXPECT_NEAR(found.pauses[0].from, 5.0, 1e-12);  // rounding, as below
  EXPECT_NEAR(found.pauses[0].to, 5.5, 1e-12);
  EXPECT_NEAR(found.pauses[1].to, 8.4, 1e-12);
  // From the first record that is slow: the one at 5.02 s.
  ASSERT_EQ(found.stoppages.size(), 1u);
  EXPECT_NEAR(found.stoppages[0].from, 5.02, 1e-12);
  EXPECT_NEAR(found.longest_pause, 0.5, 1e-12);
  // Maxima at 2, 4, ... 18 s; the ends are none. The rest at 5 s lies in a minimum.
  ASSERT_EQ(found.energy_beats.size(), 9u);
  for (std::size_t k = 0; k < 9; ++k) EXPECT_NEAR(found.energy_beats[k].time, 2.0 * static_cast<double>(k + 1), 1e-12);
  EXPECT_EQ(found.speed_beats.size(), 9u);
  // A part of it.
  EXPECT_EQ(rhythm_of(beating(), {"flow", true, 300, 1001}).pauses.size(), 1u);
  EXPECT_TRUE(rhythm_of(beating(), {"flow", true, 300, 301}).pauses.empty());
}

TEST(MeanForce, IsWhatTheImpulseGrowsBy) {
  // A force of 3 N along x and one of 1 Hz along z; the last interval is twice as long.
  Recorded impulse{{}, {}, 3};
  const auto add = [&](double t) {
    impulse.time.push_back(t);
    impulse.values.insert(impulse.values.end(), {3.0 * t, 0.0, std::sin(kTwoPi * t) / kTwoPi});
  };
  for (int k = 0; k < 50; ++k) add(0.02 * k);
  add(1.02);
  for (const double force : mean_force(impulse, 0)) EXPECT_NEAR(force, 3.0, 1e-12);  // rounding
  const std::vector<double> z = mean_force(impulse, 2);
  ASSERT_EQ(z.size(), 50u);
  // Mean of a cosine over an interval: its middle's value times sin(w h / 2) / (w h / 2).
  for (std::size_t k = 0; k < 49; ++k) {
    const double half = 0.01 * kTwoPi;
    EXPECT_NEAR(z[k], std::cos(kTwoPi * (impulse.time[k] + 0.01)) * std::sin(half) / half, 1e-12) << k;  // rounding
  }
}

TEST(RecordedPhases, BeginWithTheLastRecordOfTheOneBefore) {
  const toml::table scene = toml::parse("[[phase]]\nname = 'fill'\n[[phase]]\nname = 'none'\n[[phase]]\nname = 'flow'\noutlet = 'open'\n");
  const std::vector<RecordedPhase> phases = recorded_phases({0, 0, 0, 2, 2}, scene);
  ASSERT_EQ(phases.size(), 2u);
  EXPECT_EQ(phases[0].first, 0u);
  EXPECT_EQ(phases[0].end, 3u);
  EXPECT_FALSE(phases[0].is_open);
  EXPECT_EQ(phases[1].name, "flow");
  EXPECT_TRUE(phases[1].is_open);
  EXPECT_EQ(phases[1].first, 2u);
  EXPECT_EQ(phases[1].end, 5u);
  EXPECT_THROW(recorded_phases({0, 3}, scene), core::FileError);
}

TEST(BetweenFrames, OfARunAreThoseOfItsRecords) {
  const tests::Scratch scratch;
  const RunReader run(tests::gated_run(scratch, {"output.observables_every=0.005"}));
  const BetweenFrames found = *between_frames(run);
  EXPECT_EQ(found.motion.time, run.series("kinetic_energy")->time);
  EXPECT_GT(found.motion.time.size(), 10u * run.times().size());
  ASSERT_EQ(found.open.size(), 2u);
  EXPECT_EQ(found.open[0].phase.name, "flow");
  EXPECT_FALSE(found.open[0].spectra);  // shorter than 20 s
  // By hand, in the last record before the outlet opens: momentum over mass, energy over m g r of mean balls.
  const std::size_t at = found.open[0].phase.first;
  const core::State start = run.state(0);
  double radius = 0.0;
  for (std::size_t i = 0; i < start.size(); ++i)
    if (start.kind[i] == core::Kind::content) radius += start.radius[i] / 72.0;
  const double mass = 1250.0 * 4.0 / 3.0 * std::numbers::pi * std::pow(radius, 3);
  EXPECT_NEAR(found.motion.sinking_speed[at], -run.series("momentum")->values[3 * at + 2] / (72.0 * mass), 1e-12);  // rounding
  EXPECT_NEAR(found.motion.energy[at], run.series("kinetic_energy")->values[at] / (72.0 * mass * 9.81 * radius), 1e-12);
  // The hammer: the phase "shut", against the mean over "settle".
  ASSERT_TRUE(found.hammer);
  EXPECT_EQ(found.hammer->place.back(), "wall");
  const Recorded force = *run.series(kWallForceByLayer), phase = *run.series("phase");
  double at_rest = 0.0, highest = 0.0;
  int records = 0;
  for (std::size_t k = 0; k < force.time.size(); ++k) {
    double sum = 0.0;
    for (std::size_t layer = 0; layer < force.width; ++layer) sum += force.values[k * force.width + layer];
    const bool starts_hammer = phase.values[k] == 1.0 && k + 1 < phase.values.size() && phase.values[k + 1] == 2.0;
    if (phase.values[k] == 0.0) at_rest += sum, ++records;
    if (phase.values[k] == 2.0 || starts_hammer) highest = std::max(highest, sum);
  }
  EXPECT_NEAR(found.hammer->over_rest.back().highest, highest / (at_rest / records), 1e-9);  // rounding of sums
}

TEST(BetweenFrames, SidewaysForceOfOneFrequencyIsFoundThere) {
  // A run of 41 s with records each 0.02 s whose wall is pushed with 6 Hz along x, and 20 kN at layer 1 with 9 Hz along y.
  const tests::Scratch scratch;
  core::State start;
  start.add(0, core::Kind::content, core::Vec3(0, 0, 1), core::Vec3::Zero(), 0.2);
  core::Scene scene;
  scene.text = "[material]\ndensity = 1250.0\n[[phase]]\noutlet = 'closed'\n[[phase]]\noutlet = 'open'\n";
  {
    RunFile file(scratch.path(), start, {scene, 1, {0.0, 1.0, 2.0}});
    for (int k = 0; k <= 2050; ++k) {
      const double t = 0.02 * k, w = kTwoPi * 6.0;
      file.add(Record{t, k, {{"kinetic_energy", "J", {}, {1.0}}, {"momentum", "kg m s-1", {3}, {0, 0, 0}}, {"discharged", "", {}, {0.0}},
                             {"wall_impulse", "N s", {3}, {1e5 * std::sin(w * t) / w, 0, 0}}, {"phase", "", {}, {k == 0 ? 0.0 : 1.0}},
                             {kLateralForceByLayer, "N", {2, 2}, {0, 0, 0, 2e4 * std::cos(kTwoPi * 9.0 * t)}}}});
      if (k == 0) file.add(Frame{t, k, start, {{"contacts", "", {}, {0.0}}}});
    }
    file.flush();
  }
  const BetweenFrames found = *between_frames(RunReader(scratch.path()));
  ASSERT_EQ(found.open.size(), 1u);
  const BetweenFrames::Spectra& spectra = *found.open[0].spectra;
  const auto strongest = [&](const std::vector<double>& density) { return Spectrum{spectra.frequency, density}.strongest(); };
  const auto power = [&](const std::vector<double>& density) { return Spectrum{spectra.frequency, density}.power(); };
  EXPECT_NEAR(spectra.frequency.back(), 25.0, 0.1);  // half the records' rate, to a step of the spectrum
  EXPECT_NEAR(strongest(spectra.lateral_x), 6.0, 0.1);
  EXPECT_NEAR(strongest(spectra.by_layer[1]), 9.0, 0.1);
  // Power of a wave of amplitude A is A^2 / 2; a mean over an interval h takes sin(w h / 2) / (w h / 2) of A. Hann's window weighs the
  // phases of the pieces unevenly: a part in a thousand.
  const double half = 0.01 * kTwoPi * 6.0, left = std::sin(half) / half;
  EXPECT_NEAR(power(spectra.lateral_x) / (0.5e10 * left * left), 1.0, 1e-3);
  EXPECT_NEAR(power(spectra.by_layer[1]) / 2e8, 1.0, 1e-3);
  EXPECT_EQ(power(spectra.lateral_y), 0.0);
  EXPECT_EQ(power(spectra.by_layer[0]), 0.0);
  EXPECT_TRUE(spectra.patch_pressure.empty());
}

TEST(BetweenFrames, OlderRunsHaveNone) {
  const tests::Scratch scratch;
  core::State start;
  start.add(0, core::Kind::content, core::Vec3(0, 0, 1), core::Vec3::Zero(), 0.2);
  core::Scene scene;
  RunFile file(scratch.path(), start, {scene, 1, {}});
  file.add(Frame{0.0, 0, start, {{"kinetic_energy", "J", {}, {1.0}}}});
  file.flush();
  EXPECT_FALSE(between_frames(RunReader(scratch.path())));
}

}  // namespace
}  // namespace grainclock::silo
