#include "core/snapshot.hpp"

#include "core/check.hpp"
#include "core/files.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <span>
#include <tuple>

namespace grainclock::core {
namespace {

// ---------------------------------------------------------------- the one field table

/// A field of the file: how it is called, in which unit, what it means, and which member holds it.
template <class Member>
struct Field {
  const char* name;
  const char* unit;
  const char* text;
  bool is_optional;
  Member State::*member;
};

const auto kFields = std::make_tuple(
    Field<std::vector<BallId>>{"id", "", "unique, increasing", false, &State::id},
    Field<std::vector<Kind>>{"kind", "", "0 content, 1 wall, 2 plug", false, &State::kind},
    Field<std::vector<Vec3>>{"position", "m", "of the centre", false, &State::position},
    Field<std::vector<Vec3>>{"velocity", "m s-1", "of the centre", false, &State::velocity},
    Field<std::vector<double>>{"radius", "m", "of the ball", false, &State::radius},
    Field<std::vector<Vec3>>{"evaluated_position", "m", "where the last forces were evaluated", true, &State::evaluated_position},
    Field<std::vector<Vec3>>{"evaluated_velocity", "m s-1", "with which the last forces were evaluated", true,
                             &State::evaluated_velocity},
    Field<std::vector<std::uint8_t>>{"level", "", "step level, 0 is the finest", true, &State::level},
    Field<std::vector<std::uint8_t>>{"impacted", "", "1 after the ball's first impact", true, &State::impacted},
    Field<std::vector<BallId>>{"dashpot_i", "", "content ball of a pair whose dashpot remembers its force", true, &State::dashpot_i},
    Field<std::vector<BallId>>{"dashpot_j", "", "the pair's other ball", true, &State::dashpot_j},
    Field<std::vector<double>>{"dashpot_force", "N", "last force of the pair's dashpot", true, &State::dashpot_force});

constexpr const char* kGroup = "state";
constexpr const char* kChecksum = "checksum";
constexpr std::uint64_t kFnvStart = 14695981039346656037u;
constexpr std::uint64_t kFnvPrime = 1099511628211u;

std::uint64_t add_bytes(std::uint64_t sum, const void* data, std::size_t bytes) {
  for (const unsigned char byte : std::span(static_cast<const unsigned char*>(data), bytes)) sum = (sum ^ byte) * kFnvPrime;
  return sum;
}

void write_field(Hdf5Group& group, const char* name, const std::vector<Vec3>& values) { group.write_vectors(name, values); }
void write_field(Hdf5Group& group, const char* name, const std::vector<Kind>& values) {
  std::vector<std::uint8_t> numbers(values.size());
  std::transform(values.begin(), values.end(), numbers.begin(), [](Kind kind) { return static_cast<std::uint8_t>(kind); });
  group.write(name, numbers);
}
template <class T>
void write_field(Hdf5Group& group, const char* name, const std::vector<T>& values) {
  group.write(name, values);
}

void read_field(const Hdf5Group& group, const char* name, std::vector<Vec3>& values) { values = group.read_vectors(name); }
void read_field(const Hdf5Group& group, const char* name, std::vector<Kind>& values) {
  const auto numbers = group.read<std::uint8_t>(name);
  values.resize(numbers.size());
  std::transform(numbers.begin(), numbers.end(), values.begin(), [](std::uint8_t number) { return static_cast<Kind>(number); });
}
template <class T>
void read_field(const Hdf5Group& group, const char* name, std::vector<T>& values) {
  values = group.read<T>(name);
}

// ---------------------------------------------------------------- CSV

constexpr std::string_view kHeader = "id,kind,x,y,z,vx,vy,vz,radius";
constexpr std::size_t kColumns = 9;

/// One line of a CSV file, cut at the commas, with its place for messages.
struct CsvLine {
  const std::string& path;
  std::size_t number;
  std::vector<std::string_view> cells;
  const char* begin;

  [[noreturn]] void fail(std::size_t cell, const std::string& remedy) const {
    throw InputError(fmt::format("{}:{}:{}: `{}`: {}", path, number, cells[cell].data() - begin + 1, excerpt(cells[cell]), remedy));
  }
};

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r')) text.remove_suffix(1);
  return text;
}

/// The line's values; of too many only the first, but all are counted.
CsvLine cut(const std::string& path, std::size_t number, std::string_view line) {
  CsvLine cells{path, number, {}, line.data()};
  for (std::size_t from = 0; cells.cells.size() < kColumns;) {
    const std::size_t comma = line.find(',', from);
    cells.cells.push_back(trimmed(line.substr(from, comma - from)));
    if (comma == std::string_view::npos) break;
    from = comma + 1;
  }
  const auto values = static_cast<std::size_t>(std::count(line.begin(), line.end(), ',')) + 1;
  GC_REQUIRE(values == kColumns, "{}:{}: `{}`: {} values; a line has {}: {}", path, number, excerpt(line), values, kColumns, kHeader);
  return cells;
}

/// What may be wrong with a first line that is not the header.
std::string_view header_hint(std::string_view line) {
  if (line.find(';') != std::string_view::npos) return "; separate values by commas, and write numbers with a decimal point";
  if (line.find('\t') != std::string_view::npos) return "; separate values by commas";
  const bool is_number = !line.empty() && (line.front() == '-' || (line.front() >= '0' && line.front() <= '9'));
  return is_number ? "; the balls begin on the second line" : "";
}

double number(const CsvLine& line, std::size_t cell) {
  double value = 0.0;
  const std::string_view text = line.cells[cell];
  const auto [end, trouble] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (trouble != std::errc() || end != text.data() + text.size() || !std::isfinite(value))
    line.fail(cell, "must be a finite number with a decimal point, as in -1.5e-3");
  return value;
}

double number_up_to(const CsvLine& line, std::size_t cell, double largest, const char* unit) {
  const double value = number(line, cell);
  if (std::abs(value) > largest) line.fail(cell, fmt::format("must be at most {:g} {} in size; is it in SI units?", largest, unit));
  return value;
}

Kind kind(const CsvLine& line, std::size_t cell) {
  for (const Kind candidate : {Kind::content, Kind::wall, Kind::plug})
    if (name(candidate) == line.cells[cell]) return candidate;
  line.fail(cell, "must be content, wall or plug");
}

void add_ball(State& state, const CsvLine& line) {
  BallId id = 0;
  const std::string_view text = line.cells[0];
  const auto [end, trouble] = std::from_chars(text.data(), text.data() + text.size(), id);
  if (trouble != std::errc() || end != text.data() + text.size()) line.fail(0, "must be a whole number, the ball's id");
  if (id < 0 || id > kLargestId) line.fail(0, fmt::format("must be from 0 to {}", kLargestId));
  if (!state.id.empty() && id <= state.id.back())
    line.fail(0, fmt::format("must be above the id before it, {}: sort the balls by id and give each one of its own", state.id.back()));
  const Kind its_kind = kind(line, 1);
  const auto three = [&](std::size_t cell, const char* unit) {
    Vec3 values;
    for (std::size_t k = 0; k < 3; ++k) values[static_cast<Eigen::Index>(k)] = number_up_to(line, cell + k, kLargestSize, unit);
    return values;
  };
  const Vec3 position = three(2, "m"), velocity = three(5, "m/s");
  if (its_kind != Kind::content)
    for (std::size_t cell = 5; cell < 8; ++cell)
      if (number(line, cell) != 0.0) line.fail(cell, "must be 0: wall and plug balls do not move");
  const double radius = number_up_to(line, 8, kLargestSize, "m");
  if (!(radius > 0.0)) line.fail(8, "must be above 0 m");
  if (radius < kSmallestRadius) line.fail(8, fmt::format("must be at least {:g} m; is it in SI units?", kSmallestRadius));
  state.add(id, its_kind, position, velocity, radius);
}

std::string csv_text(const State& state) {
  std::string text(kHeader);
  text += '\n';
  for (std::size_t i = 0; i < state.size(); ++i) {
    const Vec3 &x = state.position[i], &v = state.velocity[i];
    fmt::format_to(std::back_inserter(text), "{},{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", state.id[i],
                   name(state.kind[i]), x[0], x[1], x[2], v[0], v[1], v[2], state.radius[i]);
  }
  return text;
}

bool is_hdf5(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  GC_REQUIRE(extension == ".csv" || extension == ".h5", "{}: a state file ends with .csv or .h5, not `{}`", path, extension);
  return extension == ".h5";
}

}  // namespace

std::uint64_t checksum(const State& state) {
  std::uint64_t sum = add_bytes(kFnvStart, &state.time, sizeof state.time);
  sum = add_bytes(sum, &state.length_scale, sizeof state.length_scale);
  const auto add = [&](const auto& field) {
    const auto& values = state.*field.member;
    sum = add_bytes(sum, values.data(), values.size() * sizeof values[0]);
  };
  std::apply([&](const auto&... field) { (add(field), ...); }, kFields);
  return sum;
}

std::uint64_t checksum(std::string_view text) { return add_bytes(kFnvStart, text.data(), text.size()); }

bool has_state(const Hdf5Group& group) { return group.is_group(kGroup); }

void write_state(Hdf5Group& parent, const State& state) {
  Hdf5Group group = parent.create_group(kGroup);
  group.write_attribute(".", "time", std::vector{state.time});                  // s
  group.write_attribute(".", "length_scale", std::vector{state.length_scale});  // m
  const auto write = [&](const auto& field) {
    const auto& values = state.*field.member;
    if (values.empty() && field.is_optional) return;
    write_field(group, field.name, values);
    group.write_attribute(field.name, "unit", std::string(field.unit));
    group.write_attribute(field.name, "text", std::string(field.text));
  };
  std::apply([&](const auto&... field) { (write(field), ...); }, kFields);
  group.write(kChecksum, std::vector{checksum(state)});
}

State read_state(const Hdf5Group& parent) {
  const Hdf5Group group = parent.group(kGroup);
  State state;
  state.time = group.number_attribute(".", "time");
  state.length_scale = group.number_attribute(".", "length_scale");
  const auto read = [&](const auto& field) {
    if (!field.is_optional || group.has(field.name)) read_field(group, field.name, state.*field.member);
  };
  std::apply([&](const auto&... field) { (read(field), ...); }, kFields);
  if (group.read_one<std::uint64_t>(kChecksum) != checksum(state)) group.fail(kChecksum, "does not match the data: the file is damaged");
  return state;
}

State read_csv(const std::string& path) {
  const std::string text = read_text(path);
  State state;
  std::size_t line_number = 0;
  for (std::size_t from = 0; from < text.size();) {
    const std::size_t end = std::min(text.find('\n', from), text.size());
    const std::string_view line = trimmed(std::string_view(text).substr(from, end - from));
    from = end + 1;
    ++line_number;
    if (line_number == 1)
      GC_REQUIRE(line == kHeader, "{}:1: the header is `{}`; it must be `{}`{}", path, excerpt(line), kHeader, header_hint(line));
    else if (!line.empty())
      add_ball(state, cut(path, line_number, line));
  }
  GC_REQUIRE(state.size() > 0, "{}: has no balls; give the header `{}` and a line per ball", path, kHeader);
  return state;
}

State read_state(const std::string& path) {
  if (!is_hdf5(path)) return read_csv(path);
  const Hdf5File file = Hdf5File::open(path);
  GC_REQUIRE(has_state(file), "{}: holds no state (no group /{}); `grainclock info` says what it holds", path, kGroup);
  State state = read_state(file);
  validate(state, path);
  return state;
}

void write_state(const std::string& path, const State& state) {
  if (!is_hdf5(path)) return write_text(path, csv_text(state));
  AsideFile aside(path);
  Hdf5File file = Hdf5File::create(aside.part());
  write_state(file, state);
  file.close();
  aside.commit();
}

}  // namespace grainclock::core
