#include "silo/import.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "core/snapshot.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <string_view>

namespace grainclock::silo {
namespace {

using core::InputError;
using core::State;
using core::Vec3;

/// Reads a text line by line and word by word, and knows where it is.
class Reader {
 public:
  Reader(const std::string& path, const std::string& text) : path_(path), text_(text) {}

  bool next() {
    if (from_ >= text_.size()) return false;
    const std::size_t end = std::min(text_.find('\n', from_), text_.size());
    line_ = text_.substr(from_, end - from_);
    from_ = end + 1;
    ++number_;
    words_.clear();
    const std::string_view content = line_.substr(0, line_.find('#'));
    for (std::size_t at = content.find_first_not_of(" \t\r"); at != std::string_view::npos && words_.size() < kMostWords;) {
      const std::size_t stop = std::min(content.find_first_of(" \t\r", at), content.size());
      words_.push_back(content.substr(at, stop - at));
      at = content.find_first_not_of(" \t\r", stop);
    }
    return true;
  }
  /// The next line, which must be there.
  void demand(const char* what) {
    if (!next()) throw InputError(fmt::format("{}:{}: the file ends; {} is missing", path_, number_, what));
  }

  std::string_view line() const { return line_; }
  const std::vector<std::string_view>& words() const { return words_; }

  [[noreturn]] void fail(const std::string& what) const { throw InputError(fmt::format("{}:{}: `{}`: {}", path_, number_, core::excerpt(line_), what)); }
  void require(bool condition, const std::string& what) const {
    if (!condition) fail(what);
  }
  template <class T>
  T number(std::size_t word) const {
    T value{};
    require(word < words_.size(), fmt::format("has {} values; more are wanted", words_.size()));
    const std::string_view text = words_[word];
    const auto [end, trouble] = std::from_chars(text.data(), text.data() + text.size(), value);
    bool is_good = trouble == std::errc() && end == text.data() + text.size();
    if constexpr (std::is_same_v<T, double>) is_good = is_good && std::isfinite(value);
    if (!is_good) fail(fmt::format("`{}` must be a {}", core::excerpt(text), std::is_same_v<T, double> ? "finite number" : "whole number"));
    return value;
  }

 private:
  static constexpr std::size_t kMostWords = 1000;  // of a line; a dump has a few dozen columns

  const std::string& path_;
  std::string_view text_, line_;
  std::size_t from_ = 0, number_ = 0;
  std::vector<std::string_view> words_;
};

/// Throws InputError if the file says that its numbers are in other units than ours.
void require_si(const Reader& in, std::string_view units) {
  in.require(units == "si", fmt::format("the units are `{}`; lengths, speeds and times must be in SI units (LAMMPS: units si)", core::excerpt(units)));
}

struct Atom {
  core::BallId id;
  core::Kind kind;
  Vec3 position, velocity = Vec3::Zero();
  double radius;
};

core::Kind kind_of(const Reader& in, std::int64_t type) {
  if (type < 1 || type > 3) in.fail(fmt::format("type {} is none of ours: 1 content, 2 wall, 3 plug", type));
  return static_cast<core::Kind>(type - 1);
}

core::BallId id_of(const Reader& in, std::int64_t lammps_id) {
  in.require(lammps_id >= 1 && lammps_id <= core::kLargestId + 1, fmt::format("id {} must be from 1 to {}", lammps_id, core::kLargestId + 1));
  return lammps_id - 1;
}

State state_of(std::vector<Atom> atoms, double time) {
  std::sort(atoms.begin(), atoms.end(), [](const Atom& a, const Atom& b) { return a.id < b.id; });
  State state;
  state.time = time;
  for (const Atom& atom : atoms) state.add(atom.id, atom.kind, atom.position, atom.velocity, atom.radius);
  return state;
}

// ---------------------------------------------------------------- data

State read_data(const std::string& path, const std::string& text) {
  Reader in(path, text);
  in.demand("the title");
  double time = 0.0;
  const auto& title = in.words();
  for (auto word = std::find(title.begin(), title.end(), "units"); word != title.end();) {
    if (++word == title.end() || *word == "=") continue;
    require_si(in, word->substr(0, word->find(',')));
    break;
  }
  if (const std::size_t at = in.line().find(" time "); at != std::string_view::npos) {
    const std::string_view rest = in.line().substr(at + 6);
    std::from_chars(rest.data(), rest.data() + rest.size(), time);
  }
  std::int64_t count = -1;
  std::vector<Atom> atoms;
  std::map<std::int64_t, Vec3> velocities;
  while (in.next()) {
    const auto& words = in.words();
    if (words.size() == 2 && words[1] == "atoms") count = in.number<std::int64_t>(0);
    if (words.empty() || (words[0] != "Atoms" && words[0] != "Velocities")) continue;
    const bool is_atoms = words[0] == "Atoms";
    in.require(count > 0, "a line such as `100 atoms` must stand above");
    const std::size_t comment = in.line().find('#');
    in.require(!is_atoms || comment == std::string_view::npos || in.line().find("sphere", comment) != std::string_view::npos,
               "only atom_style sphere has radii; write the data with it");
    in.demand("an empty line");
    in.require(in.words().empty(), "an empty line must stand between a section's name and its first line");
    for (std::int64_t k = 0; k < count; ++k) {
      in.demand(is_atoms ? "an atom" : "a velocity");
      const std::int64_t id = in.number<std::int64_t>(0);
      if (is_atoms) {
        const double diameter = in.number<double>(2);
        in.require(diameter > 0.0, "the diameter must be above 0");
        atoms.push_back({id_of(in, id), kind_of(in, in.number<std::int64_t>(1)),
                         Vec3(in.number<double>(4), in.number<double>(5), in.number<double>(6)), Vec3::Zero(), 0.5 * diameter});
      } else {
        velocities[id_of(in, id)] = Vec3(in.number<double>(1), in.number<double>(2), in.number<double>(3));
      }
    }
  }
  GC_REQUIRE(!atoms.empty(), "{}: has no Atoms section; give LAMMPS data with atom_style sphere", path);
  for (Atom& atom : atoms)
    if (const auto found = velocities.find(atom.id); found != velocities.end()) atom.velocity = found->second;
  return state_of(std::move(atoms), time);
}

// ---------------------------------------------------------------- dump

/// Where the columns of a dump are.
struct Columns {
  std::map<std::string, std::size_t, std::less<>> at;
  Columns(const Reader& in) {
    for (std::size_t k = 2; k < in.words().size(); ++k) at.emplace(in.words()[k], k - 2);
    for (const char* name : {"id", "type", "x", "y", "z"})
      in.require(at.contains(name), fmt::format("there is no column {}; dump custom id type x y z vx vy vz radius", name));
    in.require(at.contains("radius") || at.contains("diameter"), "there is no column radius or diameter");
  }
  std::size_t operator[](std::string_view name) const { return at.find(name)->second; }
  bool has(std::string_view name) const { return at.contains(name); }
};

Atom read_atom(const Reader& in, const Columns& columns) {
  const auto three = [&](const char* x, const char* y, const char* z) {
    return Vec3(in.number<double>(columns[x]), in.number<double>(columns[y]), in.number<double>(columns[z]));
  };
  Atom atom{id_of(in, in.number<std::int64_t>(columns["id"])), kind_of(in, in.number<std::int64_t>(columns["type"])), three("x", "y", "z"),
            Vec3::Zero(), columns.has("radius") ? in.number<double>(columns["radius"]) : 0.5 * in.number<double>(columns["diameter"])};
  in.require(atom.radius > 0.0, "the radius must be above 0");
  if (columns.has("vx") && columns.has("vy") && columns.has("vz")) atom.velocity = three("vx", "vy", "vz");
  return atom;
}

State read_dump(const std::string& path, const std::string& text) {
  Reader in(path, text);
  std::optional<State> last;
  double time = 0.0;
  std::int64_t count = -1;
  while (in.next()) {
    const auto& words = in.words();
    if (words.size() < 2 || words[0] != "ITEM:") continue;
    if (words[1] == "UNITS") {
      in.demand("the units");
      require_si(in, in.words().empty() ? std::string_view() : in.words()[0]);
    } else if (words[1] == "TIME") {
      in.demand("the time");
      time = in.number<double>(0);
    } else if (words[1] == "NUMBER") {
      in.demand("the number of atoms");
      count = in.number<std::int64_t>(0);
    } else if (words[1] == "ATOMS") {
      in.require(count >= 0, "ITEM: NUMBER OF ATOMS must stand above");
      const Columns columns(in);
      std::vector<Atom> atoms;
      for (std::int64_t k = 0; k < count; ++k) {
        in.demand("an atom");
        atoms.push_back(read_atom(in, columns));
      }
      last = state_of(std::move(atoms), time);
    }
  }
  GC_REQUIRE(last && last->size() > 0, "{}: holds no atoms; give a dump with ITEM: ATOMS", path);
  return *last;
}

}  // namespace

State import_file(const std::string& path) {
  const std::string text = core::read_text(path);
  const std::string_view first = std::string_view(text).substr(0, text.find('\n'));
  GC_REQUIRE(!text.empty(), "{}: is empty; give a CSV state, LAMMPS data or a LAMMPS dump", path);
  if (first.starts_with("id,") || path.ends_with(".csv")) return core::read_csv(path);
  State state = first.starts_with("ITEM:") ? read_dump(path, text) : read_data(path, text);
  validate(state, path);
  return state;
}

}  // namespace grainclock::silo
