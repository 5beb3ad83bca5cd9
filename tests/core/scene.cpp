#include "core/scene.hpp"

#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "tests/support/scratch.hpp"

#include <toml++/toml.h>

#include <cmath>

namespace grainclock::core {
namespace {

using tests::message_of;
using tests::Scratch;

constexpr const char* kState = "id,kind,x,y,z,vx,vy,vz,radius\n0,content,0,0,1,0,0,0,0.2\n1,content,0,0,2,0,0,0,0.3\n";
constexpr const char* kInitial = "[initial]\nstate = 'state.csv'\n";
constexpr const char* kPhase = "[[phase]]\nduration = 1.0\n";

class SceneFile : public ::testing::Test {
 protected:
  SceneFile() { scratch_.file("state.csv", kState); }
  Scene read(const std::string& text, const std::vector<std::string>& overrides = {}) {
    return read_scene(scratch_.file("scene.toml", text), overrides);
  }
  /// The scene with only what it must have, after `head`.
  Scene read_after(const std::string& head, const std::vector<std::string>& overrides = {}) {
    return read(head + kInitial + kPhase, overrides);
  }
  std::string message(const std::string& text, const std::vector<std::string>& overrides = {}) {
    return message_of<InputError>([&] { read(text, overrides); });
  }
  Scratch scratch_;
};

void expect_same(const Stepping& a, const Stepping& b) {
  EXPECT_EQ(a.method, b.method);
  EXPECT_EQ(a.integrator, b.integrator);
  EXPECT_EQ(a.events, b.events);
  EXPECT_EQ(a.dashpot, b.dashpot);
  EXPECT_EQ(a.step, b.step);
  EXPECT_EQ(a.tolerance, b.tolerance);
  EXPECT_EQ(a.interface, b.interface);
  EXPECT_EQ(a.levels, b.levels);
  EXPECT_EQ(a.limiter, b.limiter);
  EXPECT_EQ(a.fallback, b.fallback);
}

void expect_same(const Materials& a, const Materials& b) {
  EXPECT_EQ(a.density, b.density);
  EXPECT_EQ(a.ball.k, b.ball.k);
  EXPECT_EQ(a.ball.c, b.ball.c);
  EXPECT_EQ(a.wall.k, b.wall.k);
  EXPECT_EQ(a.wall.c, b.wall.c);
  EXPECT_EQ(a.tension, b.tension);
  EXPECT_EQ(a.cohesion, b.cohesion);
}

void expect_same(const Scene& a, const Scene& b) {
  EXPECT_EQ(a.text, b.text);
  EXPECT_EQ(a.gravity, b.gravity);
  EXPECT_EQ(a.seed, b.seed);
  expect_same(a.materials, b.materials);
  EXPECT_EQ(a.initial_state, b.initial_state);
  EXPECT_EQ(a.has_silo, b.has_silo);
  EXPECT_EQ(a.domain.outlet_z, b.domain.outlet_z);
  EXPECT_EQ(a.domain.lower, b.domain.lower);
  EXPECT_EQ(a.domain.upper, b.domain.upper);
  ASSERT_EQ(a.phases.size(), b.phases.size());
  for (std::size_t i = 0; i < a.phases.size(); ++i) {
    const Phase &p = a.phases[i], &q = b.phases[i];
    EXPECT_EQ(p.name, q.name);
    EXPECT_EQ(p.until, q.until);
    EXPECT_EQ(p.duration, q.duration);
    EXPECT_EQ(p.fraction, q.fraction);
    EXPECT_EQ(p.outlet_open, q.outlet_open);
    EXPECT_EQ(p.first_impact, q.first_impact);
    EXPECT_EQ(p.every, q.every);
    EXPECT_EQ(p.observables_every, q.observables_every);
    expect_same(p.stepping, q.stepping);
    expect_same(p.materials, q.materials);
  }
}

constexpr const char* kFull = R"(
gravity = [0.1, 0.0, -9.81]
seed = 42
[material]
density = 1300
[contact]
k_ball = 2e7
c_wall = 3.3333333333333333e5
restitution_ball = 0.3
tension = true
cohesion = 12.5
[initial]
state = "state.csv"
[domain]
outlet_z = -0.1
lower = [-10, -10, -1]
upper = [10, 10, 30]
[stepping]
method = "uniform"
step = 1e-5
dashpot = "relaxed"
[output]
every = 0.01
[[phase]]
name = "fill \"it\""
duration = 1.0
first_impact = true
step = 1e-4
contact = {k_wall = 1e8, restitution_wall = 0.5}
[[phase]]
name = "discharge"
until = "discharged:0.22"
max_duration = 30
outlet = "open"
method = "multirate"
tolerance = 3e-5
interface = "extrapolate"
levels = 5
limiter = 1
every = 0.5
fallback = true
integrator = "pece"
events = false
)";

TEST_F(SceneFile, OnlyInitialStateAndPhasesAreNeeded) {
  const Scene scene = read_after("");
  EXPECT_EQ(scene.gravity, Vec3(0.0, 0.0, -9.81));
  EXPECT_EQ(scene.seed, 1u);
  expect_same(scene.materials, Materials{});
  ASSERT_EQ(scene.phases.size(), 1u);
  EXPECT_EQ(scene.phases[0].name, "phase 0");
  EXPECT_EQ(scene.phases[0].every, 1.0);
  EXPECT_FALSE(scene.phases[0].outlet_open);
  expect_same(scene.phases[0].stepping, Stepping{});
  EXPECT_EQ(scene.initial_state, scratch_ / "state.csv");
  EXPECT_FALSE(scene.has_silo);
}

TEST_F(SceneFile, EveryKeyIsRead) {
  const Scene scene = read(kFull);
  EXPECT_EQ(scene.gravity, Vec3(0.1, 0.0, -9.81));
  EXPECT_EQ(scene.seed, 42u);
  EXPECT_EQ(scene.materials.density, 1300.0);
  EXPECT_EQ(scene.materials.ball.k, 2e7);
  EXPECT_EQ(scene.materials.wall.k, 1e9);
  EXPECT_EQ(scene.materials.wall.c, 3.3333333333333333e5);
  EXPECT_TRUE(scene.materials.tension);
  EXPECT_EQ(scene.materials.cohesion, 12.5);
  EXPECT_EQ(scene.domain.outlet_z, -0.1);
  EXPECT_EQ(scene.domain.upper, Vec3(10, 10, 30));
  ASSERT_EQ(scene.phases.size(), 2u);

  const Phase& fill = scene.phases[0];
  EXPECT_EQ(fill.name, "fill \"it\"");
  EXPECT_EQ(fill.until, Until::duration);
  EXPECT_TRUE(fill.first_impact);
  EXPECT_EQ(fill.every, 0.01);
  EXPECT_EQ(fill.stepping.method, Method::uniform);
  EXPECT_EQ(fill.stepping.step, 1e-4);
  EXPECT_EQ(fill.stepping.dashpot, Dashpot::relaxed);
  EXPECT_EQ(fill.materials.wall.k, 1e8);
  EXPECT_EQ(fill.materials.ball.c, scene.materials.ball.c);

  const Phase& discharge = scene.phases[1];
  EXPECT_EQ(discharge.until, Until::discharged);
  EXPECT_EQ(discharge.fraction, 0.22);
  EXPECT_EQ(discharge.duration, 30.0);
  EXPECT_TRUE(discharge.outlet_open);
  EXPECT_EQ(discharge.every, 0.5);
  EXPECT_EQ(discharge.stepping.method, Method::multirate);
  EXPECT_EQ(discharge.stepping.step, 1e-5);
  EXPECT_EQ(discharge.stepping.tolerance, 3e-5);
  EXPECT_EQ(discharge.stepping.interface, Interface::extrapolate);
  EXPECT_EQ(discharge.stepping.levels, 5);
  EXPECT_EQ(discharge.stepping.limiter, 1);
  EXPECT_TRUE(discharge.stepping.fallback);
  EXPECT_EQ(discharge.stepping.integrator, Integrator::pece);
  EXPECT_FALSE(discharge.stepping.events);
  expect_same(discharge.materials, scene.materials);
}

TEST_F(SceneFile, ResolvedTextReadsBackToTheSameScene) {
  for (const std::string& text : {std::string(kFull), std::string(kInitial) + kPhase}) {
    const Scene scene = read(text);
    // From another directory, since the echo stands in the output directory.
    const Scratch elsewhere;
    expect_same(read_scene(elsewhere.file("scene.toml", scene.text)), scene);
  }
}

TEST_F(SceneFile, ResolvedTextKeepsTheSiloTable) {
  const Scene scene = read("[silo]\nr_min = 0.215\nr_max = 0.22500000000000003\nshape = 'round'\n[silo.wall]\nthird = 0.3333333333333333\n"
                           "[contact]\nrestitution_ball = 0.3\n[[phase]]\nduration = 1.0\n");
  EXPECT_TRUE(scene.has_silo);
  ASSERT_TRUE(scene.silo);
  const Scratch elsewhere;
  const Scene again = read_scene(elsewhere.file("scene.toml", scene.text));
  expect_same(again, scene);
  EXPECT_EQ((*again.silo)["r_max"].value<double>(), 0.22500000000000003);
  EXPECT_EQ((*again.silo)["wall"]["third"].value<double>(), 0.3333333333333333);
  EXPECT_EQ((*scene.silo)["r_max"].node()->source().begin.line, 3u);  // silo/ can name the line
}

TEST_F(SceneFile, RestitutionIsThatOfAPairOfMeanBalls) {
  const Scene scene = read_after("[contact]\nrestitution_ball = 0.3\nrestitution_wall = 0.5\n");
  const double m = scene.materials.mass(0.25);  // mean of 0.2 and 0.3
  // Closed forms invert each other to rounding amplified by the root finding, well below 1e-9.
  EXPECT_NEAR(restitution(scene.materials.ball, 0.5 * m, false), 0.3, 1e-9);
  EXPECT_NEAR(restitution(scene.materials.wall, m, false), 0.5, 1e-9);
}

TEST_F(SceneFile, OverridesReachTablesAndListsOfTables) {
  const Scene scene = read(kFull, {"seed=7", "phase.0.step=2e-4", "phase.discharge.contact.k_wall=5e8", "stepping.tolerance=1e-3",
                                   "gravity=[0, 0, -1]", "stepping.integrator=lagged", "output.every=0.1"});
  EXPECT_EQ(scene.seed, 7u);
  EXPECT_EQ(scene.gravity, Vec3(0, 0, -1));
  EXPECT_EQ(scene.phases[0].stepping.step, 2e-4);
  EXPECT_EQ(scene.phases[0].stepping.tolerance, 1e-3);
  EXPECT_EQ(scene.phases[0].stepping.integrator, Integrator::lagged);
  EXPECT_EQ(scene.phases[0].every, 0.1);
  EXPECT_EQ(scene.phases[1].materials.wall.k, 5e8);
  EXPECT_EQ(read_after("", {"stepping.levels=3"}).phases[0].stepping.levels, 3);  // a table that was not there
}

struct Bad {
  const char* text;
  const char* expected;
};

TEST_F(SceneFile, ErrorsNameFileLineValueAndRemedy) {
  const Bad cases[] = {
      {"[stepping]\nstpe = 1\n", "scene.toml:2: unknown key `stpe` in [stepping]; known keys: "},
      {"[stepping]\nstpe = 1\n", "did you mean `step`?"},
      {"colour = 1\n", "scene.toml:1: unknown key `colour` at the top level"},
      {"gravity = 9.81\n", "scene.toml:1: gravity = 9.81: must be three numbers"},
      {"gravity = [0, 0, inf]\n", "must be finite"},
      {"seed = -1\n", "scene.toml:1: seed = -1: must be at least 0"},
      {"seed = 1.5\n", "must be a whole number"},
      {"[material]\ndensity = 0\n", "scene.toml:2: [material] density = 0: must be above 0 kg/m3"},
      {"[contact]\nk_ball = -1\n", "must be above 0 N/m"},
      {"[contact]\nc_wall = -1\n", "must be at least 0 N s/m"},
      {"[contact]\nk_ball = '1e7'\n", "must be a number"},
      {"[contact]\ntension = 1\n", "must be true or false"},
      {"[contact]\nc_ball = 1\nrestitution_ball = 0.5\n", "give either c_ball or restitution_ball, not both"},
      {"[contact]\nrestitution_wall = 1.5\n", "must be above 0 and at most 1"},
      {"[stepping]\nmethod = 'fast'\n", "scene.toml:2: [stepping] method = 'fast': must be \"uniform\" or \"multirate\""},
      {"[stepping]\nintegrator = 'euler'\n", "\"lagged\" or \"predicted\" or \"pece\""},
      {"[stepping]\nlevels = 13\n", "must be 1 to 12"},
      {"[stepping]\nlimiter = 0\n", "must be 1 to 11"},
      {"[stepping]\nstep = 0.0\n", "must be above 0 s"},
      {"[stepping]\ntolerance = nan\n", "must be finite"},
      {"[domain]\nlower = [0, 0, 0]\nupper = [1, 0, 1]\n", "must be above `lower`"},
      {"[domain]\nlower = [0, 0, 0]\noutlet_z = -1\n", "must not lie below the z of `lower`"},
      {"[output]\nevery = -0.1\n", "scene.toml:2: [output] every = -0.1: must be above 0 s"},
      {"[silo]\nx = 1\n", "give either [initial] state or [silo], not both"},
      {"seed = = 1\n", "scene.toml:1:"},
  };
  for (const Bad& bad : cases) {
    const std::string text = message(std::string(bad.text) + kInitial + kPhase);
    EXPECT_NE(text.find(bad.expected), std::string::npos) << bad.text << "gives\n" << text;
  }
}

TEST_F(SceneFile, PhaseErrorsNameTheRemedy) {
  const Bad cases[] = {
      {"", "a scene needs at least one [[phase]]"},
      {"[phase]\nduration = 1\n", "must be tables, each headed [[phase]]"},
      {"[[phase]]\n", "give the phase a duration in s"},
      {"[[phase]]\nduration = 0\n", "must be above 0 s"},
      {"[[phase]]\nduration = 1\ncolour = 2\n", "scene.toml:5: unknown key `colour` in [[phase]]"},
      {"[[phase]]\nduration = 1\nmax_duration = 2\n", "write duration instead"},
      {"[[phase]]\nuntil = 'rest'\n", "needs the longest time it may take"},
      {"[[phase]]\nuntil = 'rest'\nmax_duration = 1\nduration = 1\n", "not both"},
      {"[[phase]]\nuntil = 'full'\nmax_duration = 1\n", "\"empty\" or \"rest\" or \"discharged:0.22\""},
      {"[domain]\noutlet_z = 0\n[[phase]]\nuntil = 'discharged:1.2'\nmax_duration = 1\noutlet = 'open'\n", "at most 1"},
      {"[domain]\noutlet_z = 0\n[[phase]]\nuntil = 'discharged:'\nmax_duration = 1\noutlet = 'open'\n", "discharged fraction"},
      {"[domain]\noutlet_z = 0\n[[phase]]\nuntil = 'empty'\nmax_duration = 1\n", "write outlet = \"open\""},
      {"[[phase]]\nuntil = 'empty'\nmax_duration = 1\noutlet = 'open'\n", "without [domain] outlet_z"},
      {"[[phase]]\nduration = 1\noutlet = 'ajar'\n", "must be \"open\" or \"closed\""},
      {"[[phase]]\nduration = 1\n[phase.contact]\nk_bal = 1\n", "did you mean `k_ball`?"},
      {"[output]\nevery = 0.3\n[[phase]]\nduration = 1\n", "scene.toml:6: [[phase]] duration = 1: must be a whole multiple of every = 0.3 s; nearest: 0.9 or 1.2 s"},
      {"[output]\nevery = 0.3\n[[phase]]\nduration = 0.1\n", "nearest: 0.3 s"},
      {"[output]\nevery = 1\nobservables_every = 0.3\n[[phase]]\nduration = 1\n", "scene.toml:5: [output] observables_every = 0.3: must divide every = 1 s; nearest: 0.25 or 0.333333333333 s"},
      {"[[phase]]\nduration = 1\nobservables_every = 2\n", "scene.toml:5: [[phase]] observables_every = 2: must divide every = 1 s; nearest: 1 s"},
      {"[output]\nobservables_every = 0.3\n[[phase]]\nduration = 1\nevery = 0.5\n", "scene.toml:7: [[phase]] every = 0.5: must be a whole multiple of observables_every = 0.3 s; nearest: 0.3 or 0.6 s"},
      {"[output]\nobservables_every = 0.3\n[[phase]]\nduration = 1\n", "[[phase]] duration = 1: must be a whole multiple of observables_every = 0.3 s"},
      {"[[phase]]\nduration = 1\nobservables_every = 0\n", "must be above 0 s"},
  };
  for (const Bad& bad : cases) {
    const std::string text = message(std::string(kInitial) + bad.text);
    EXPECT_NE(text.find(bad.expected), std::string::npos) << bad.text << "gives\n" << text;
  }
  EXPECT_NE(message(kPhase).find("[silo] table that builds one"), std::string::npos);
}

TEST_F(SceneFile, RecordsComeWithFramesUnlessAskedForBetween) {
  const Scene scene = read(std::string("[output]\nevery = 0.5\nobservables_every = 0.1\n") + kInitial + kPhase +
                           "[[phase]]\nduration = 2\nevery = 0.2\n[[phase]]\nduration = 1\nobservables_every = 0.05\n");
  EXPECT_EQ(scene.phases[0].observables_every, 0.1);
  EXPECT_EQ(scene.phases[1].observables_every, 0.1);
  EXPECT_EQ(scene.phases[2].observables_every, 0.05);
  EXPECT_EQ(read_after("[output]\nevery = 0.25\n").phases[0].observables_every, 0.25);
  EXPECT_EQ(read_after("").phases[0].observables_every, 1.0);
}

TEST_F(SceneFile, DecimalMultiplesAreMultiples) {
  // 0.3 / 0.1 is 2.9999999999999996 in binary.
  for (const char* text : {"[output]\nevery = 0.1\n[[phase]]\nduration = 0.3\n", "[output]\nevery = 0.01\n[[phase]]\nduration = 0.29\n",
                           "[output]\nevery = 1e-5\n[[phase]]\nduration = 300\n"})
    EXPECT_NO_THROW(read(std::string(kInitial) + text));
}

TEST_F(SceneFile, ErrorsInOverridesNameTheAssignment) {
  const Bad cases[] = {
      {"stepping.step=0", "--set stepping.step=0: [stepping] step = 0: must be above 0 s"},
      {"stepping.stpe=1", "--set stepping.stpe=1: unknown key `stpe`"},
      {"stepping.step", "write it as key=value"},
      {"stepping.step=[1", "`[1` is not a TOML value"},
      {"phase.3.step=1", "there is no phase `3`; there are 1, counted from 0"},
      {"phase.none.step=1", "there is no phase `none`"},
      {"phase.step=1", "name one and its key"},
      {"seed.x=1", "`seed` is a value, not a table"},
      {"stepping..step=1", "empty name"},
  };
  for (const Bad& bad : cases) {
    const std::string text = message(std::string("seed = 1\n") + kInitial + kPhase, {bad.text});
    EXPECT_NE(text.find(bad.expected), std::string::npos) << bad.text << " gives\n" << text;
  }
}

TEST_F(SceneFile, MissingFilesAreFileErrors) {
  EXPECT_THROW(read_scene(scratch_ / "none.toml"), FileError);
  EXPECT_THROW(read_scene(scratch_.path().string()), FileError);
  const auto text = message_of<FileError>([&] { read(std::string("[initial]\nstate = 'gone.csv'\n") + kPhase); });
  EXPECT_NE(text.find("scene.toml:2: there is no state file \"gone.csv\""), std::string::npos) << text;
}

TEST_F(SceneFile, RestitutionWithoutAMeanRadiusIsRefused) {
  EXPECT_NE(message(std::string("[silo]\n[contact]\nrestitution_ball = 0.3\n") + kPhase).find("give [silo] r_min and r_max"),
            std::string::npos);
}

TEST(StepFor, IsTheSmallestCountThatRespectsTheWantedStep) {
  EXPECT_EQ(step_for(1.0, 0.3).n, 4);
  EXPECT_EQ(step_for(1.0, 0.3).step, 0.25);
  EXPECT_EQ(step_for(1.0, 2.0).n, 1);
  EXPECT_EQ(step_for(1.0, 1.0).n, 1);
  EXPECT_EQ(step_for(0.01, 1e-5).n, 1000);
  EXPECT_EQ(step_for(1e-5, 1e-5).n, 1);
}

TEST(StepFor, RoundingOfDecimalFractionsAddsNoStep) {
  for (int n = 1; n <= 100000; ++n) {
    EXPECT_EQ(step_for(n * 1e-5, 1e-5).n, n);       // the product is rounded either way
    EXPECT_EQ(step_for(0.01, 0.01 / n).n, n);       // and so is the quotient
  }
}

TEST(StepFor, RefusesWhatCannotBeStepped) {
  EXPECT_THROW(step_for(0.0, 1.0), InputError);
  EXPECT_THROW(step_for(1.0, 0.0), InputError);
  EXPECT_THROW(step_for(1.0, 1e-18), InputError);
}

}  // namespace
}  // namespace grainclock::core
