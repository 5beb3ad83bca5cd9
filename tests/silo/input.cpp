// Every field that is read from a file: what a bad value of it is answered with. A message names the file, the line or the
// dataset, the value, and what would be right; the exit code is 2 for content and 4 for files.
//
// The tables below are complete: the readers list their keys in the message about an unknown one, and each must stand here.
#include "benchmarks/study_kind.hpp"
#include "core/check.hpp"
#include "core/snapshot.hpp"
#include "core/toml_keys.hpp"
#include "silo/checkpoint.hpp"
#include "silo/import.hpp"
#include "silo/phases.hpp"
#include "silo/run_file.hpp"
#include "tests/support/scratch.hpp"

#include <hdf5.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <set>

namespace grainclock::silo {
namespace {

using core::ExitCode;
using core::Hdf5Handle;
using core::State;
using core::Vec3;
using tests::replaced;
using tests::Scratch;

struct Answer {
  ExitCode code = ExitCode::done;
  std::string text;
};

Answer answer_of(const std::function<void()>& read) {
  try {
    read();
  } catch (const core::Error& error) {
    return {error.code(), error.what()};
  }
  return {};
}

/// The answer has this code and holds all of these texts.
void expect(const Answer& answer, ExitCode code, const std::vector<std::string>& wanted, const std::string& input) {
  EXPECT_EQ(answer.code, code) << input << "\ngives\n" << answer.text;
  for (const std::string& text : wanted) EXPECT_NE(answer.text.find(text), std::string::npos) << input << "\ngives\n" << answer.text;
}

constexpr const char* kHeader = "id,kind,x,y,z,vx,vy,vz,radius\n";
constexpr const char* kBalls = "0,content,0,0,1,0,0,0,0.22\n1,wall,0,0,0,0,0,0,0.22\n";

// ---------------------------------------------------------------- TOML

struct BadKey {
  const char* key;
  const char* value;
  const char* remedy;
};
/// One table of a file: `before` is the text above the key, with the table's header last.
struct KeyTable {
  const char* name;
  const char* before;
  const char* after;
  std::vector<BadKey> keys;
};

constexpr const char* kInitial = "[initial]\nstate = 'state.csv'\n";
constexpr const char* kRest = "[initial]\nstate = 'state.csv'\n[[phase]]\nduration = 1.0\n";
constexpr const char* kPhase = "[[phase]]\nduration = 1.0\n";

const std::vector<BadKey> kContact{
    {"k_ball", "0", "must be above 0 N/m"},
    {"k_ball", "1e31", "must be at most 1e+30 in size"},
    {"k_wall", "-1e9", "must be above 0 N/m"},
    {"c_ball", "-1", "must be at least 0 N s/m"},
    {"c_wall", "nan", "must be finite"},
    {"restitution_ball", "0", "above 0 and at most 1"},
    {"restitution_wall", "2", "above 0 and at most 1"},
    {"tension", "1", "must be true or false"},
    {"cohesion", "-3", "must be at least 0 N"},
};

std::vector<BadKey> operator+(std::vector<BadKey> a, const std::vector<BadKey>& b) {
  a.insert(a.end(), b.begin(), b.end());
  return a;
}

const std::vector<BadKey> kStepping{
    {"method", "'fast'", "must be \"uniform\" or \"multirate\""},
    {"integrator", "'euler'", "\"lagged\" or \"predicted\" or \"pece\""},
    {"events", "'yes'", "must be true or false"},
    {"dashpot", "'stiff'", "\"explicit\" or \"relaxed\" or \"pairwise\" or \"solve\""},
    {"step", "-1e-5", "must be above 0 s"},
    {"step", "1e-31", "must be at least 1e-30 s"},
    {"step", "inf", "must be finite"},
    {"tolerance", "0", "must be above 0"},
    {"interface", "'none'", "\"accumulate\" or \"impulse\" or \"extrapolate\" or \"frozen\""},
    {"levels", "0", "must be 1 to 12"},
    {"levels", "1e3", "must be a whole number"},
    {"limiter", "12", "must be 1 to 11"},
    {"fallback", "0", "must be true or false"},
};

const std::vector<KeyTable> kScene{
    {"root", "", kRest,
     {{"gravity", "9.81", "must be three numbers"},
      {"gravity", "[0, 0, -1e300]", "must be at most 1e+30 in size"},
      {"gravity", "[0, 0, nan]", "must be finite"},
      {"seed", "-1", "must be at least 0"},
      {"seed", "'x'", "must be a whole number"},
      {"material", "1", "must be a table"},
      {"contact", "1", "must be a table"},
      {"domain", "1", "must be a table"},
      {"stepping", "1", "must be a table"},
      {"output", "1", "must be a table"}}},
    {"root", "", kPhase, {{"initial", "1", "must be a table"}, {"silo", "1", "must be a table"}}},
    {"root", "", kInitial, {{"phase", "1", "must be tables, each headed [[phase]]"}}},
    {"[initial]", "[initial]\n", kPhase, {{"state", "1", "must be a text in quotes"}}},
    {"[material]", "[material]\n", kRest,
     {{"density", "0", "must be above 0 kg/m3"}, {"density", "'heavy'", "must be a number"}, {"density", "1e-40", "must be at least 1e-30 kg/m3"}}},
    {"[contact]", "[contact]\n", kRest, kContact},
    {"[domain]", "[domain]\n", kRest,
     {{"outlet_z", "'low'", "must be a number"}, {"lower", "[1, 2]", "must be three numbers"}, {"upper", "[0, 0, inf]", "must be finite"}}},
    {"[stepping]", "[stepping]\n", kRest, kStepping},
    {"[output]", "[output]\n", kRest, {{"every", "0", "must be above 0 s"}, {"observables_every", "-1", "must be above 0 s"}}},
    {"[[phase]]", "[initial]\nstate = 'state.csv'\n[[phase]]\n", "",
     {{"name", "1", "must be a text in quotes"},
      {"duration", "-1", "must be above 0 s"},
      {"max_duration", "0", "must be above 0 s"},
      {"until", "1", "must be a text in quotes"}}},
    {"[[phase]]", "[initial]\nstate = 'state.csv'\n[[phase]]\nduration = 1.0\n", "",
     kStepping + std::vector<BadKey>{{"every", "-0.1", "must be above 0 s"},
                                     {"observables_every", "0", "must be above 0 s"},
                                     {"observables_every", "1e-12", "frames or records; at most 1e+09"},
                                     {"contact", "1", "must be a table"},
                                     {"outlet", "'ajar'", "must be \"open\" or \"closed\""},
                                     {"first_impact", "1", "must be true or false"}}},
    {"[[phase]]", "[initial]\nstate = 'state.csv'\n[[phase]]\nmax_duration = 1.0\n", "",
     {{"until", "'full'", "\"empty\" or \"rest\" or \"discharged:0.22\""}, {"until", "'discharged:nan'", "above 0 and at most 1"}}},
    {"[[phase]]", "[initial]\nstate = 'state.csv'\n[[phase]]\nevery = 1e-9\n", "", {{"duration", "1e3", "makes 1e+12 frames or records; at most 1e+09"}}},
    {"[silo]", "[silo]\n", kPhase,
     {{"shape", "'oval'", "must be \"round\" or \"square\""},
      {"radius", "0", "must be above 0 m"},
      {"radius", "1e6", "would take"},
      {"height", "-1", "must be above 0 m"},
      {"height", "1e12", "would take"},
      {"hopper_height", "-1", "must be 0 m (flat bottom) or above"},
      {"outlet", "0.5", "the clear outlet is"},
      {"outlet", "11", "narrower than the silo"},
      {"balls", "0", "must be at least 1"},
      {"balls", "1.5", "must be a whole number"},
      {"r_min", "0", "must be above 0 m"},
      {"r_max", "0.1", "must not exceed r_max"},
      {"surface", "'outer'", "must be \"centres\" or \"inner\""},
      {"coverage", "-1", "must be above 0"},
      {"coverage", "0.1", "raise the coverage"},
      {"collar", "-1", "must be 0 m (none) or above"}}},
    {"[silo]", "[silo]\nshape = 'square'\n", kPhase, {{"width", "0", "must be above 0 m"}, {"radius", "5", "write width instead"}}},
};

constexpr const char* kSceneAndStart = "scene = 'scene.toml'\nstart = 'state.csv'\n";
constexpr const char* kTrajectories = "horizon = 0.1\n[reference]\nstep = 1e-5\n[[method]]\nstep = 1e-4\n";
const std::vector<KeyTable> kStudy{
    {"root", kSceneAndStart, "[reference]\nstep = 1e-5\n[[method]]\n",
     {{"horizon", "0", "must be above 0 s"}, {"kind", "'quick'", "\"trajectories\" or \"statistics\" or \"stability\""}}},
    {"root", kSceneAndStart, kTrajectories, {{"repeat", "0", "must be 1 to 1000"}}},
    {"root", "start = 'state.csv'\n", kTrajectories, {{"scene", "1", "must be a text in quotes"}}},
    {"root", "scene = 'scene.toml'\n", kTrajectories, {{"start", "1", "must be a path, or a list of paths"}, {"start", "[]", "at least one"}}},
    {"root", "scene = 'scene.toml'\nstart = 'state.csv'\nhorizon = 0.1\n", "[[method]]\nstep = 1e-4\n", {{"reference", "1", "must be a table"}}},
    {"root", "scene = 'scene.toml'\nstart = 'state.csv'\nhorizon = 0.1\n", "[reference]\nstep = 1e-5\n",
     {{"method", "1", "must be tables, each headed [[method]]"}}},
    {"root", "scene = 'scene.toml'\nstart = 'state.csv'\n", kTrajectories, {{"divergence", "1", "must be a table"}}},
    {"[reference]", "scene = 'scene.toml'\nstart = 'state.csv'\nhorizon = 0.1\n[reference]\nmethod = 'cvode'\n", "[[method]]\n",
     {{"rtol", "2", "between 0 and 1"}, {"rtol", "0.5", "give at most 0.01"}, {"variant", "'erk'", "must be \"adams\" or \"bdf\""}}},
    {"[divergence]", "scene = 'scene.toml'\nstart = 'state.csv'\nhorizon = 0.1\n[reference]\nstep = 1e-5\n[[method]]\n[divergence]\nstep = 1e-5\n", "",
     {{"perturbation", "0", "must be above 0 m"}, {"horizon", "-1", "must be above 0 s"}, {"samples", "1e9", "whole number"},
      {"samples", "1000000000", "must be 4 to 100000"}}},
    {"[divergence]", "scene = 'scene.toml'\nstart = 'state.csv'\nhorizon = 0.1\n[reference]\nstep = 1e-5\n[[method]]\n[divergence]\n", "",
     {{"step", "0", "must be above 0 s"}}},
    {"[[method]]", "scene = 'scene.toml'\nstart = 'state.csv'\nhorizon = 0.1\n[reference]\nstep = 1e-5\n[[method]]\n", "",
     std::vector<BadKey>{{"name", "1", "must be a text in quotes"},
                         {"repeat", "1001", "must be 1 to 1000"},
                         {"method", "'rk4'", "\"uniform\" or \"multirate\" or \"cvode\" or \"arkode\""},
                         {"step", "-1e-4", "must be above 0 s"},
                         {"step", "[]", "an empty list sweeps nothing"},
                         {"integrator", "'euler'", "\"lagged\" or \"predicted\" or \"pece\""},
                         {"events", "'yes'", "must be true or false"},
                         {"dashpot", "'stiff'", "\"explicit\""},
                         {"tolerance", "0", "must be above 0"},
                         {"interface", "'none'", "\"accumulate\""},
                         {"levels", "0", "must be 1 to 12"},
                         {"limiter", "12", "must be 1 to 11"},
                         {"fallback", "0", "must be true or false"}}},
    {"[[method]]", "scene = 'scene.toml'\nstart = 'state.csv'\nhorizon = 0.1\n[reference]\nstep = 1e-5\n[[method]]\nmethod = 'arkode'\nrtol = 1e-3\n", "",
     {{"variant", "'adams'", "\"erk\" or \"implicit\""}, {"roots", "1", "must be true or false"}, {"step", "1e-4", "only variant = \"mri\""}}},
    {"root", "kind = 'statistics'\nscene = 'scene.toml'\nstart = 'state.csv'\n", "[[method]]\nname = 'a'\n",
     {{"duration", "0", "must be above 0 s"}}},
    {"root", "kind = 'statistics'\nscene = 'scene.toml'\nstart = 'state.csv'\nduration = 1\n", "[[method]]\nname = 'a'\n",
     {{"every", "0", "must be above 0 s"}, {"every", "1e-9", "samples of a run"}}},
    {"root", "kind = 'statistics'\nscene = 'scene.toml'\nstart = 'state.csv'\nduration = 1\nevery = 0.1\n", "[[method]]\nname = 'a'\n",
     {{"settle", "2", "must be from 0 to"}, {"stop", "0.01", "must not be below every"}}},
    {"root", "kind = 'statistics'\nscene = 'scene.toml'\nstart = 'state.csv'\nduration = 1\nevery = 0.1\nstop = 0.2\n", "[[method]]\nname = 'a'\n",
     {{"layer", "0", "must be above 0 m"}, {"baseline", "1", "must be a text in quotes"}, {"baseline", "'b'", "is no method here; there are \"a\""}}},
    {"root", "kind = 'stability'\n", "",
     {{"systems", "['moon']", "\"pair\" or \"wall\" or \"chain\" or \"packing\""}}},
    {"root", "kind = 'stability'\nsystems = ['packing']\n", "", {{"packing", "1", "must be a text in quotes"}, {"integrators", "[]", "give a list"}}},
    {"root", "kind = 'stability'\nsystems = ['pair']\nintegrators = ['pece']\n", "", {{"dashpots", "['solve']", "each must be \"explicit\""}}},
    {"root", "kind = 'stability'\nsystems = ['pair']\nintegrators = ['pece']\ndashpots = ['explicit']\n", "",
     {{"damping_ratios", "[11]", "from 0 to 10"}, {"damping_ratios", "[0, 0]", "give each value once"}}},
    {"root", "kind = 'stability'\nsystems = ['pair']\nintegrators = ['pece']\ndashpots = ['explicit']\ndamping_ratios = [0]\n", "",
     {{"step_ratios", "[0]", "above 0 and at most 2"}}},
    {"root", "kind = 'stability'\nsystems = ['pair']\nintegrators = ['pece']\ndashpots = ['explicit']\ndamping_ratios = [0]\nstep_ratios = [1]\n", "",
     {{"steps", "99", "must be 100 to 1000000"}, {"growth", "1", "must be a table"}}},
    {"[growth]", "kind = 'stability'\nsystems = ['pair']\nintegrators = ['pece']\ndashpots = ['explicit']\ndamping_ratios = [0]\nstep_ratios = [1]\n[growth]\n", "",
     {{"ratios", "[3]", "1, 2, 4, 8 or 16"}}},
};

/// Writes the files that scenes and studies name.
class Files {
 public:
  Files() {
    scratch_.file("state.csv", std::string(kHeader) + kBalls);
    scratch_.file("scene.toml", kRest);
  }
  Answer scene(const std::string& text) const {
    const std::string path = scratch_.file("bad.toml", text);
    return answer_of([&] { start_of(core::read_scene(path)); });
  }
  Answer study(const std::string& text) const {
    const std::string path = scratch_.file("bad.toml", text);
    return answer_of([&] { benchmarks::make_study(path, 1); });
  }
  const Scratch& scratch() const { return scratch_; }

 private:
  Scratch scratch_;
};

/// Every bad value of the tables is answered with file, line, key, value and remedy.
void expect_answers(const std::vector<KeyTable>& tables, const std::function<Answer(const std::string&)>& read) {
  for (const KeyTable& table : tables) {
    const auto line = std::count(table.before, table.before + std::string(table.before).size(), '\n') + 1;
    for (const BadKey& bad : table.keys) {
      const std::string text = fmt::format("{}{} = {}\n{}", table.before, bad.key, bad.value, table.after);
      const std::string place = fmt::format("bad.toml:{}: ", line);
      const toml::table value = toml::parse(fmt::format("value = {}", bad.value));  // messages write 1e6 as 1000000.0
      const std::string shown = core::excerpt(core::toml_text(*value.get("value")));
      expect(read(text), ExitCode::bad_input, {place, bad.key, shown, bad.remedy}, text);
    }
  }
}

TEST(Input, EveryKeyOfASceneIsChecked) {
  const Files files;
  expect_answers(kScene, [&](const std::string& text) { return files.scene(text); });
}

TEST(Input, EveryKeyOfAStudyIsChecked) {
  const Files files;
  expect_answers(kStudy, [&](const std::string& text) { return files.study(text); });
}

/// The keys that a reader says it knows, for a text with the key `colour` in the table asked about.
std::set<std::string> known_keys(const std::string& message) {
  constexpr std::string_view kBefore = "known keys: ";
  const std::size_t begin = message.find(kBefore);
  EXPECT_NE(begin, std::string::npos) << message;
  std::set<std::string> keys;
  std::istringstream list(message.substr(begin + kBefore.size(), message.find(';', begin + kBefore.size()) - begin - kBefore.size()));
  for (std::string key; std::getline(list >> std::ws, key, ',');) keys.insert(key);
  return keys;
}

/// The tables hold every key of the table `name`; `skipped` are tested elsewhere.
void expect_complete(const std::vector<KeyTable>& tables, const std::string& name, const std::string& message) {
  std::set<std::string> tested;
  for (const KeyTable& table : tables)
    if (table.name == name)
      for (const BadKey& bad : table.keys) tested.insert(bad.key);
  for (const std::string& key : known_keys(message)) EXPECT_TRUE(tested.contains(key)) << name << " has the key " << key << ", and no bad value is tried";
}

TEST(Input, NoKeyIsForgotten) {
  const Files files;
  expect_complete(kScene, "root", files.scene(std::string("colour = 1\n") + kRest).text);
  expect_complete(kScene, "[initial]", files.scene("[initial]\nstate = 'state.csv'\ncolour = 1\n").text);
  for (const char* table : {"[material]", "[contact]", "[domain]", "[stepping]", "[output]"})
    expect_complete(kScene, table, files.scene(fmt::format("{}\ncolour = 1\n{}", table, kRest)).text);
  expect_complete(kScene, "[[phase]]", files.scene(std::string(kRest) + "colour = 1\n").text);
  expect_complete(kScene, "[silo]", files.scene(std::string("[silo]\ncolour = 1\n") + kPhase).text);
  expect_complete(kScene, "[silo]", files.scene(std::string("[silo]\nshape = 'square'\ncolour = 1\n") + kPhase).text);

  const std::string head = std::string("scene = 'scene.toml'\nstart = 'state.csv'\nhorizon = 0.1\n");
  expect_complete(kStudy, "root", files.study(head + "colour = 1\n[reference]\nstep = 1e-5\n[[method]]\n").text);
  expect_complete(kStudy, "[divergence]", files.study(head + "[reference]\nstep = 1e-5\n[[method]]\n[divergence]\nstep = 1\ncolour = 1\n").text);
  expect_complete(kStudy, "[[method]]", files.study(head + "[reference]\nstep = 1e-5\n[[method]]\ncolour = 1\n").text);
  expect_complete(kStudy, "[reference]",
                  replaced(files.study(head + "[reference]\nmethod = 'cvode'\nrtol = 1e-9\ncolour = 1\n[[method]]\n").text, "method, roots, ", ""));
  expect_complete(kStudy, "root", files.study("kind = 'statistics'\nscene = 'scene.toml'\nstart = 'state.csv'\nduration = 1\nevery = 0.1\nstop = 0.2\n"
                                              "baseline = 'a'\ncolour = 1\n[[method]]\nname = 'a'\n").text);
  expect_complete(kStudy, "root", files.study("kind = 'stability'\nsystems = ['pair']\nintegrators = ['pece']\ndashpots = ['explicit']\n"
                                              "damping_ratios = [0]\nstep_ratios = [1]\ncolour = 1\n").text);
}

TEST(Input, TextsThatAreNoSceneAreAnswered) {
  const Files files;
  std::string deep = "a";
  for (int k = 0; k < 100000; ++k) deep += ".a";
  const std::vector<std::pair<std::string, std::string>> cases{
      {"", "bad.toml:1: initial is missing"},
      {std::string("\x00\x01\x02", 3), "bad.toml:1:1: this is not TOML"},
      {"seed = 1\nseed = 2\n", "bad.toml:2:"},
      {"[initial\n", "bad.toml:1:"},
      {"seed = \"\xff\"\n", "bad.toml:1:"},
      {deep + " = 1\n", "bad.toml:1: more than 32 points in one key"},
      {"x = " + std::string(100000, '[') + "\n", "bad.toml:1:"},
      {std::string(2 << 20, '#'), "is longer than the 1048576 bytes"},
      {"[initial]\nstate = \"" + std::string(5000, 'a') + ".csv\"\n[[phase]]\nduration = 1\n", "bad.toml:2: there is no state file"},
      {"[initial]\nstate = \"bad.toml\"\n[[phase]]\nduration = 1\n", "ends with .csv or .h5"},
  };
  for (const auto& [text, expected] : cases) {
    const Answer answer = files.scene(text);
    EXPECT_NE(answer.code, ExitCode::done);
    EXPECT_NE(answer.text.find(expected), std::string::npos) << text.substr(0, 100) << "\ngives\n" << answer.text;
    EXPECT_LT(answer.text.size(), 8000u);
  }
  // What can be read is read: a byte order mark, and lines that end as on Windows.
  EXPECT_EQ(files.scene("\xEF\xBB\xBF# ...........................................\r\n[initial]\r\nstate = 'state.csv'\r\n[[phase]]\r\nduration = 1.0\r\n").text, "");
  expect(answer_of([] { core::read_scene("/dev/zero"); }), ExitCode::file_trouble, {"/dev/zero: is a device"}, "/dev/zero");
}

TEST(Input, ControlCharactersDoNotReachTheTerminal) {
  const Files files;
  const Answer answer = files.scene(std::string("\"\\u001b[31m\" = 1\n") + kRest);
  EXPECT_NE(answer.text.find("unknown key `?[31m`"), std::string::npos) << answer.text;
  EXPECT_EQ(answer.text.find('\x1b'), std::string::npos);
}

TEST(Input, SweepsThatExplodeAreRefused) {
  const Files files;
  std::string list = "[1e-4";
  for (int k = 0; k < 200; ++k) list += ", 1e-4";
  const std::string head = std::string(kSceneAndStart) + "horizon = 0.1\n[reference]\nstep = 1e-5\n";
  const std::string swept = fmt::format("{}[[method]]\nstep = {}]\ntolerance = {}]\n", head, list, list);
  expect(files.study(swept), ExitCode::bad_input, {"bad.toml:", "at most 1000 points"}, "a sweep of 201 by 201");
  std::string many = head;
  for (int k = 0; k < 1001; ++k) many += "[[method]]\n";
  expect(files.study(many), ExitCode::bad_input, {"bad.toml:", "at most 1000"}, "1001 methods");
}

// ---------------------------------------------------------------- states as text

struct BadLine {
  const char* line;      // the third
  const char* expected;  // place and value
  const char* remedy;
};

TEST(Input, EveryFieldOfACsvStateIsChecked) {
  const Scratch scratch;
  const BadLine cases[] = {
      {"x,content,0,0,1,0,0,0,0.2", ":3:1: `x`", "must be a whole number"},
      {"-1,content,0,0,1,0,0,0,0.2", ":3:1: `-1`", "must be from 0 to 9007199254740991"},
      {"9223372036854775807,content,0,0,1,0,0,0,0.2", ":3:1: `9223372036854775807`", "must be from 0 to"},
      {"99999999999999999999,content,0,0,1,0,0,0,0.2", ":3:1: `99999999999999999999`", "must be a whole number"},
      {"0,content,0,0,1,0,0,0,0.2", ":3:1: `0`", "must be above the id before it, 0"},
      {"1,Content,0,0,1,0,0,0,0.2", ":3:3: `Content`", "must be content, wall or plug"},
      {"1,content,nan,0,1,0,0,0,0.2", ":3:11: `nan`", "must be a finite number"},
      {"1,content,0,inf,1,0,0,0,0.2", ":3:13: `inf`", "must be a finite number"},
      {"1,content,0,0,1e300,0,0,0,0.2", ":3:15: `1e300`", "must be at most 1e+09 m in size; is it in SI units?"},
      {"1,content,0,0,1,1e10,0,0,0.2", ":3:17: `1e10`", "must be at most 1e+09 m/s in size"},
      {"1,content,0,0,1,0,--1,0,0.2", ":3:19: `--1`", "must be a finite number"},
      {"1,wall,0,0,1,0,0,1,0.2", ":3:18: `1`", "must be 0: wall and plug balls do not move"},
      {"1,content,0,0,1,0,0,0,-0.2", ":3:23: `-0.2`", "must be above 0 m"},
      {"1,content,0,0,1,0,0,0,1e-20", ":3:23: `1e-20`", "must be at least 1e-09 m; is it in SI units?"},
      {"1,content,0,0,1,0,0,0,1e10", ":3:23: `1e10`", "must be at most 1e+09 m"},
      {"1,content,0,0,1,0,0,0", ":3: `1,content,0,0,1,0,0,0`", "8 values; a line has 9"},
      {"1,content,0,0,1,0,0,0,0,22", ":3: `1,content,0,0,1,0,0,0,0,22`", "10 values; a line has 9"},
      {"1;content;0;0;1;0;0;0;0.2", ":3: `1;content", "1 values; a line has 9"},
  };
  for (const BadLine& bad : cases) {
    const std::string path = scratch.file("bad.csv", fmt::format("{}0,content,0,0,0,0,0,0,0.2\n{}\n", kHeader, bad.line));
    expect(answer_of([&] { core::read_state(path); }), ExitCode::bad_input, {path + bad.expected, bad.remedy}, bad.line);
  }
}

TEST(Input, CsvFilesOfAnotherMakeAreAnswered) {
  const Scratch scratch;
  const auto answer = [&](const std::string& text) {
    const std::string path = scratch.file("bad.csv", text);
    return answer_of([&] { core::read_state(path); });
  };
  const std::string good = std::string(kHeader) + kBalls;
  expect(answer(""), ExitCode::bad_input, {"bad.csv: has no balls", "give the header"}, "an empty file");
  expect(answer(kHeader), ExitCode::bad_input, {"bad.csv: has no balls"}, "a header");
  expect(answer(kBalls), ExitCode::bad_input, {"bad.csv:1: ", "the balls begin on the second line"}, "no header");
  std::string semicolons = good, tabs = good;
  std::replace(semicolons.begin(), semicolons.end(), ',', ';');
  std::replace(tabs.begin(), tabs.end(), ',', '\t');
  expect(answer(semicolons), ExitCode::bad_input, {"bad.csv:1: ", "separate values by commas, and write numbers with a decimal point"}, "semicolons");
  expect(answer(tabs), ExitCode::bad_input, {"bad.csv:1: ", "separate values by commas"}, "tabs");
  expect(answer(good.substr(0, good.size() - 12)), ExitCode::bad_input, {"bad.csv:3: ", "a line has 9"}, "a truncated file");
  // One line of a hundred million commas: its values are counted, not kept.
  const Answer commas = answer(kHeader + std::string(100'000'000, ','));
  expect(commas, ExitCode::bad_input, {"bad.csv:2: ", "100000001 values; a line has 9"}, "a long line");
  EXPECT_LT(commas.text.size(), 500u);
  // What can be read is read: a byte order mark, and lines that end as on Windows.
  EXPECT_EQ(answer("\xEF\xBB\xBF" + replaced(good, "\n", "\r\n")).text, "");
}

TEST(Input, NumbersDoNotDependOnTheLocale) {
  const Scratch scratch;
  const std::string path = scratch.file("state.csv", std::string(kHeader) + kBalls);
  // German and French numbers have a comma; where neither is installed the test says nothing.
  const char* found = nullptr;
  for (const char* name : {"de_DE.UTF-8", "fr_FR.UTF-8", "de_DE", "fr_FR"})
    if (!found) found = std::setlocale(LC_ALL, name);
  const State state = core::read_state(path);
  core::write_state(scratch / "copy.csv", state);
  std::setlocale(LC_ALL, "C");
  EXPECT_EQ(state.radius[0], 0.22);
  EXPECT_EQ(core::checksum(core::read_state(scratch / "copy.csv")), core::checksum(state));
  if (!found) GTEST_SKIP() << "no locale with a decimal comma is installed";
}

TEST(Input, EveryFieldOfLammpsFilesIsChecked) {
  const Scratch scratch;
  const std::string data = "title, units si, time 1.5 s\n\n2 atoms\n\nAtoms # sphere\n\n1 1 0.4 1250 0 0 1\n2 2 0.4 1250 0 0 0\n\nVelocities\n\n1 0 0 -1\n2 0 0 0\n";
  const std::string dump =
      "ITEM: UNITS\nsi\nITEM: TIME\n1.5\nITEM: NUMBER OF ATOMS\n1\nITEM: ATOMS id type x y z vx vy vz radius\n1 1 0 0 1 0 0 -1 0.2\n";
  struct Case {
    const std::string& good;
    const char *from, *to, *expected, *remedy;
  };
  const Case cases[] = {
      {data, "units si", "units lj", ":1: ", "must be in SI units"},
      {data, "2 atoms", "1000000000000000 atoms", ":9: ", "has 0 values; more are wanted"},
      {data, "2 atoms", "3 atoms", ":9: ", "has 0 values; more are wanted"},
      {data, "2 atoms", "x atoms", ":3: `x atoms`", "must be a whole number"},
      {data, "2 atoms\n", "\n", ":5: ", "a line such as `100 atoms` must stand above"},
      {data, "# sphere", "# atomic", ":5: ", "only atom_style sphere has radii"},
      {data, "sphere\n\n", "sphere\n", ":6: `1 1 0.4", "an empty line must stand between"},
      {data, "1 1 0.4", "0 1 0.4", ":7: ", "id 0 must be from 1 to"},
      {data, "1 1 0.4", "2 1 0.4", "ball 1 appears twice", "give each ball an id of its own"},
      {data, "1 1 0.4", "1 7 0.4", ":7: ", "type 7 is none of ours: 1 content, 2 wall, 3 plug"},
      {data, "1 1 0.4", "1 1 -0.4", ":7: ", "the diameter must be above 0"},
      {data, "1 1 0.4", "1 1 1e-20", "has radius 5e-21 m", "is it in SI units?"},
      {data, "0 0 1\n", "0 0 nan\n", ":7: ", "`nan` must be a finite number"},
      {data, "0 0 1\n", "0 0 1e300\n", "ball 0 has position", "is it in SI units?"},
      {data, "1 0 0 -1", "1 0 0 inf", ":12: ", "`inf` must be a finite number"},
      {data, "2 0 0 0\n", "2 0 0 1\n", "wall ball 1", "fixed balls must be at rest"},
      {data, "time 1.5", "time nan", "time is nan s", "must be finite"},
      {data, "\n2 0 0 0\n", "\n", ":12: the file ends", "a velocity is missing"},
      {data, "Atoms # sphere", "Bonds", ": has no Atoms section", "atom_style sphere"},
      {dump, "\nsi\n", "\nreal\n", ":2: `real`", "must be in SI units"},
      {dump, "1.5", "nan", ":4: `nan`", "must be a finite number"},
      {dump, "ATOMS\n1\n", "ATOMS\n-\n", ":6: `-`", "must be a whole number"},
      {dump, "ATOMS\n1\n", "ATOMS\n1000000000000000\n", ":8: the file ends", "an atom is missing"},
      {dump, " radius", " colour", ":7: ", "there is no column radius or diameter"},
      {dump, " type x", " type xs", ":7: ", "there is no column x"},
      {dump, "1 1 0 0 1", "1 9 0 0 1", ":8: ", "type 9 is none of ours"},
      {dump, "-1 0.2", "-1 0", ":8: ", "the radius must be above 0"},
      {dump, "-1 0.2", "-1", ":8: ", "has 8 values; more are wanted"},
  };
  EXPECT_NO_THROW(import_file(scratch.file("good", data)));
  EXPECT_NO_THROW(import_file(scratch.file("good", dump)));
  for (const Case& bad : cases) {
    const std::string path = scratch.file("bad", replaced(bad.good, bad.from, bad.to));
    expect(answer_of([&] { import_file(path); }), ExitCode::bad_input, {"bad", bad.expected, bad.remedy}, bad.to);
  }
}

TEST(Input, BallsInOnePlaceAreNamed) {
  const Scratch scratch;
  scratch.file("state.csv", std::string(kHeader) + "0,content,0,0,1,0,0,0,0.2\n5,content,0,0,1,0,0,0,0.2\n");
  const std::string scene = scratch.file("scene.toml", kRest);
  expect(answer_of([&] { start_of(core::read_scene(scene)); }), ExitCode::bad_input,
         {"state.csv: ", "ball", "0", "5", "by 0.4 m of 0.4 m", "move them apart, to at most 0.1 m"}, "two balls in one place");
  // An overlap of a quarter of the radii's sum is the limit; 1e-9 of it is far above rounding.
  const auto start = [&](double z) {
    scratch.file("state.csv", fmt::format("{}0,content,0,0,0,0,0,0,0.2\n5,content,0,0,{},0,0,0,0.2\n", kHeader, z));
    return answer_of([&] { start_of(core::read_scene(scene)); }).code;
  };
  EXPECT_EQ(start(0.3 * (1.0 + 1e-9)), ExitCode::done);
  EXPECT_EQ(start(0.3 * (1.0 - 1e-9)), ExitCode::bad_input);
}

// ---------------------------------------------------------------- HDF5

State some_state() {
  State state;
  for (core::BallId id = 0; id < 4; ++id)
    state.add(id, id < 3 ? core::Kind::content : core::Kind::wall, Vec3(0.0, 0.0, static_cast<double>(id)), Vec3::Zero(), 0.2);
  state.evaluated_position = state.position;
  state.evaluated_velocity = state.velocity;
  state.level.assign(4, 0);
  state.impacted.assign(4, 0);
  state.dashpot_i = {0};
  state.dashpot_j = {1};
  state.dashpot_force = {1.0};
  return state;
}

/// A file opened for changes through the library itself.
Hdf5Handle changed(const std::string& path) { return {H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT), H5Fclose}; }

using Change = std::function<void(hid_t file, const std::string& dataset)>;

void replace(hid_t file, const std::string& dataset, hid_t type, const std::vector<hsize_t>& shape, hid_t properties = H5P_DEFAULT) {
  if (H5Lexists(file, dataset.c_str(), H5P_DEFAULT) > 0) H5Ldelete(file, dataset.c_str(), H5P_DEFAULT);
  const Hdf5Handle space(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr), H5Sclose);
  H5Dclose(H5Dcreate2(file, dataset.c_str(), type, space.id(), H5P_DEFAULT, properties, H5P_DEFAULT));
}

/// The dataset's own type.
hid_t type_of(hid_t file, const std::string& dataset) {
  const Hdf5Handle its(H5Dopen2(file, dataset.c_str(), H5P_DEFAULT), H5Dclose);
  return H5Dget_type(its.id());
}

constexpr hsize_t kHuge = 1'000'000'000'000;

struct BadDataset {
  const char* what;
  Change change;
  const char* expected;
};
const std::vector<BadDataset> kDatasetFaults{
    {"missing", [](hid_t file, const std::string& name) { H5Ldelete(file, name.c_str(), H5P_DEFAULT); }, "missing"},
    {"a text", [](hid_t file, const std::string& name) { replace(file, name, H5T_C_S1, {4, 3}); }, "another"},
    {"1e12 rows without storage",
     [](hid_t file, const std::string& name) {
       const Hdf5Handle type(type_of(file, name), H5Tclose);
       replace(file, name, type.id(), {kHuge, 3});
     },
     ""},
    {"chunks of 2 GB",
     [](hid_t file, const std::string& name) {
       const Hdf5Handle type(type_of(file, name), H5Tclose), properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
       const hsize_t chunk[2] = {hsize_t{1} << 28, 3};
       H5Pset_chunk(properties.id(), 2, chunk);
       H5Pset_deflate(properties.id(), 1);
       replace(file, name, type.id(), {kHuge, 3}, properties.id());
     },
     ""},
    {"a link in a circle",
     [](hid_t file, const std::string& name) {
       H5Ldelete(file, name.c_str(), H5P_DEFAULT);
       H5Lcreate_soft(("/" + name).c_str(), file, name.c_str(), H5P_DEFAULT, H5P_DEFAULT);
     },
     "missing"},
    {"data of another file",
     [](hid_t file, const std::string& name) {
       const Hdf5Handle type(type_of(file, name), H5Tclose), properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
       H5Pset_external(properties.id(), "/etc/passwd", 0, H5F_UNLIMITED);
       replace(file, name, type.id(), {4}, properties.id());
     },
     ""},
};

/// Each fault of each dataset is answered with the file and the dataset, by a FileError.
void expect_faults(const std::string& intact, const std::vector<std::string>& datasets, const std::function<void(const std::string&)>& read) {
  const Scratch scratch;
  for (const std::string& dataset : datasets)
    for (const BadDataset& bad : kDatasetFaults) {
      const std::string path = scratch.file("bad.h5", intact);
      {
        const Hdf5Handle file = changed(path);
        bad.change(file.id(), dataset);
      }
      const Answer answer = answer_of([&] { read(path); });
      EXPECT_EQ(answer.code, ExitCode::file_trouble) << dataset << ": " << bad.what << "\ngives\n" << answer.text;
      EXPECT_NE(answer.text.find("bad.h5"), std::string::npos) << answer.text;
      EXPECT_NE(answer.text.find(dataset), std::string::npos) << dataset << ": " << bad.what << "\ngives\n" << answer.text;
      EXPECT_NE(answer.text.find(bad.expected), std::string::npos) << dataset << ": " << bad.what << "\ngives\n" << answer.text;
    }
}

TEST(Input, EveryDatasetOfAStateIsChecked) {
  const Scratch scratch;
  core::write_state(scratch / "state.h5", some_state());
  const std::string intact = tests::text_of(scratch / "state.h5");
  std::vector<std::string> needed;
  for (const char* name : {"id", "kind", "position", "velocity", "radius", "checksum"}) needed.push_back(std::string("state/") + name);
  expect_faults(intact, needed, [](const std::string& path) { core::read_state(path); });
}

TEST(Input, EveryNumberOfAStateIsChecked) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::pair<std::function<void(State&)>, std::string>> cases{
      {[](State& s) { s.time = kNan; }, "time is nan s: must be finite"},
      {[](State& s) { s.time = 1e300; }, "time is 1e+300 s: must be finite, and at most 1e+15 s"},
      {[](State& s) { s.length_scale = -1.0; }, "length_scale is -1 m: must be from 0"},
      {[](State& s) { s.id[0] = -1; }, "ball -1: ids must be from 0 to"},
      {[](State& s) { s.id[3] = std::numeric_limits<core::BallId>::max(); }, "ids must be from 0 to"},
      {[](State& s) { s.id[1] = 0; }, "ball 0 appears twice: give each ball an id of its own"},
      {[](State& s) { s.id[1] = 5; }, "ball 2 follows ball 5: sort the balls by id"},
      {[](State& s) { s.kind[1] = static_cast<core::Kind>(3); }, "ball 1 has kind number 3: use 0 content, 1 wall or 2 plug"},
      {[](State& s) { s.position[1][0] = kNan; }, "ball 1 has position (nan, 0, 1) m: must be finite"},
      {[](State& s) { s.position[1][0] = 1e10; }, "must be at most 1e+09 m in size; is it in SI units?"},
      {[](State& s) { s.velocity[1][0] = 1e10; }, "ball 1 has velocity (10000000000, 0, 0) m/s: must be at most"},
      {[](State& s) { s.velocity[3][0] = 1.0; }, "wall ball 3 has velocity (1, 0, 0) m/s: fixed balls must be at rest"},
      {[](State& s) { s.radius[1] = 0.0; }, "ball 1 has radius 0 m: must be above 0"},
      {[](State& s) { s.radius[1] = 1e-20; }, "ball 1 has radius 1e-20 m: must be from 1e-09 to 1e+09 m; is it in SI units?"},
      {[](State& s) { s.evaluated_position[2][1] = kNan; }, "ball 2 has evaluated_position"},
      {[](State& s) { s.evaluated_velocity[2][1] = kNan; }, "ball 2 has evaluated_velocity"},
      {[](State& s) { s.level.pop_back(); }, "3 values of level for 4 balls: give one per ball"},
      {[](State& s) { s.impacted.push_back(0); }, "5 values of impacted for 4 balls"},
      {[](State& s) { s.radius.pop_back(); }, "3 values of radius for 4 balls"},
      {[](State& s) { s.dashpot_i.push_back(0); }, "give one of each per pair"},
      {[](State& s) { s.dashpot_force[0] = kNan; }, "dashpot_force of balls 0 and 1 is nan: must be finite"},
  };
  const Scratch scratch;
  for (const auto& [spoil, expected] : cases) {
    State state = some_state();
    spoil(state);
    core::write_state(scratch / "bad.h5", state);  // with a checksum that fits
    expect(answer_of([&] { core::read_state(scratch / "bad.h5"); }), ExitCode::bad_input, {"bad.h5: ", expected}, expected);
  }
}

TEST(Input, EveryFieldOfACheckpointIsChecked) {
  const Scratch scratch;
  Checkpoint checkpoint{some_state(), {}};
  checkpoint.position.step = 1e-4;
  const std::string intact = tests::text_of(write_checkpoint(scratch.path(), checkpoint));
  EXPECT_NO_THROW(read_checkpoint(scratch.file("good.h5", intact)));
  std::vector<std::string> fields;
  const core::Hdf5File file = core::Hdf5File::open(scratch / "good.h5");
  for (const std::string& name : file.group("position_in_run").names()) fields.push_back("position_in_run/" + name);
  EXPECT_GT(fields.size(), 30u);
  expect_faults(intact, fields, [](const std::string& path) { read_checkpoint(path); });
}

TEST(Input, PositionsThatNoRunCanHaveAreRefused) {
  const std::vector<std::pair<std::function<void(Position&)>, std::string>> cases{
      {[](Position& p) { p.step = 0.0; }, "step: is 0 s; must be above 0"},
      {[](Position& p) { p.step = std::numeric_limits<double>::quiet_NaN(); }, "step: is nan; must be finite"},
      {[](Position& p) { p.phase = -1; }, "must not be negative"},
      {[](Position& p) { p.frames = -7; }, "frames: is -7; must not be negative"},
      {[](Position& p) { p.ledger.wall_impulse[1] = std::numeric_limits<double>::infinity(); }, "wall_impulse: must be finite"},
  };
  for (const auto& [spoil, expected] : cases) {
    const Scratch scratch;
    Checkpoint checkpoint{some_state(), {}};
    checkpoint.position.step = 1e-4;
    spoil(checkpoint.position);
    const std::string path = write_checkpoint(scratch.path(), checkpoint);
    expect(answer_of([&] { read_checkpoint(path); }), ExitCode::file_trouble, {path, "position_in_run/", expected}, expected);
  }
}

TEST(Input, EveryDatasetOfARunIsChecked) {
  const Scratch scratch;
  const core::Scene scene = core::read_scene(
      (scratch.file("state.csv", std::string(kHeader) + kBalls), scratch.file("scene.toml", kRest)));
  RunFile run(scratch.path(), some_state(), {scene, 1, {0.0, 1.0}});
  for (int k = 0; k < 2; ++k) run.add({0.5 * k, k, some_state(), {{"kinetic_energy", "J", {}, {1.0}}}});
  run.flush();
  const std::string intact = tests::text_of(scratch / "run.h5");
  const auto read = [&](const std::string& path) {
    std::filesystem::copy_file(path, scratch / "bad.h5", std::filesystem::copy_options::overwrite_existing);  // beside its segments
    const RunReader reader(scratch / "bad.h5");
    reader.state(reader.frames() - 1);
    reader.step(0);
    reader.observable("kinetic_energy", 0);
    reader.scene();
  };
  EXPECT_NO_THROW(read(scratch / "run.h5"));
  std::vector<std::string> datasets;
  for (const char* name : {"id", "radius", "position/value", "velocity/value", "level/value"}) datasets.push_back(std::string("particles/content/") + name);
  for (const char* name : {"id", "kind", "radius", "position"}) datasets.push_back(std::string("particles/wall/") + name);
  expect_faults(intact, datasets, read);
}

TEST(Input, NoFlippedByteOfAStateGoesUnnoticed) {
  const Scratch scratch;
  core::write_state(scratch / "state.h5", some_state());
  const std::string intact = tests::text_of(scratch / "state.h5");
  const std::uint64_t sum = core::checksum(some_state());
  std::size_t refused = 0, tried = 0;
  for (std::size_t at = 0; at < intact.size(); at += 7, ++tried) {
    std::string damaged = intact;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x10);
    const std::string path = scratch.file("bad.h5", damaged);
    State state;
    const Answer answer = answer_of([&] { state = core::read_state(path); });
    if (answer.code == ExitCode::done)
      EXPECT_EQ(core::checksum(state), sum) << "byte " << at;  // unused room in the file, or a unit or an explanation
    else
      ++refused;
  }
  EXPECT_GT(refused, tried / 10);
}

TEST(Input, FilesThatAreNoHdf5AreAnswered) {
  const Scratch scratch;
  core::write_state(scratch / "state.h5", some_state());
  const std::string intact = tests::text_of(scratch / "state.h5");
  for (const std::size_t length : {std::size_t{0}, std::size_t{8}, std::size_t{96}, intact.size() / 3, intact.size() - 1}) {
    const std::string path = scratch.file("cut.h5", intact.substr(0, length));
    expect(answer_of([&] { core::read_state(path); }), ExitCode::file_trouble, {"cut.h5", "damaged"}, fmt::format("{} bytes", length));
  }
  expect(answer_of([] { core::read_state("/dev/null/x.h5"); }), ExitCode::file_trouble, {"/dev/null/x.h5: cannot be read"}, "/dev/null/x.h5");
  expect(answer_of([] { core::Hdf5File::open("/dev/null"); }), ExitCode::file_trouble, {"/dev/null: is not a file"}, "/dev/null");
}

}  // namespace
}  // namespace grainclock::silo
