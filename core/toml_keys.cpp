#include "core/toml_keys.hpp"

#include "core/check.hpp"
#include "core/files.hpp"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <sstream>
#include <utility>

namespace grainclock::core {
namespace {

constexpr double kLargest = 1e30;                            // number of a scene or study
constexpr int kDeepest = 32;                                 // names in one dotted key

/// The value for a message: on one line, and not too long.
std::string text_of(const toml::node& node) {
  std::string text = toml_text(node);
  std::replace(text.begin(), text.end(), '\n', ' ');
  return excerpt(text);
}

/// toml++ 3.3 makes a table within a table of every name in a dotted key, and takes such a nest down by recursion: a key of
/// ten thousand names overflows the stack. (Values within values it limits itself.)
void require_flat(std::string_view text, const std::string& source) {
  int line = 1, points = 0;
  char before = 0;
  for (const char letter : text) {
    if (letter == '.') points = before == '.' ? 0 : points + 1;  // dots in a row are for ornament
    if (std::string_view(",=[]{}\n").find(letter) != std::string_view::npos) points = 0;
    if (letter == '\n') ++line;
    before = letter;
    GC_REQUIRE(points < kDeepest, "{}:{}: more than {} points in one key or text: write fewer", source, line, kDeepest);
  }
}

std::string key_text(std::string_view key) {
  constexpr std::string_view kBare = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-";
  const bool is_bare = !key.empty() && key.find_first_not_of(kBare) == std::string_view::npos;
  return is_bare ? std::string(key) : toml_text(toml::value<std::string>(key));
}

/// Number of letters to insert, remove or replace to come from one word to the other.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = row[0]++;
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = row[j + 1];
      row[j + 1] = std::min({replaced, row[j] + 1, row[j + 1] + 1});
    }
  }
  return row.back();
}

/// The known word closest in spelling; empty if none is near.
std::string_view closest(std::string_view word, const std::set<std::string, std::less<>>& words) {
  std::string_view best;
  if (word.size() > 80) return best;
  std::size_t least = word.size() / 2 + 1;
  for (const std::string& candidate : words) {
    const std::size_t distance = edit_distance(word, candidate);
    if (distance < least) {
      least = distance;
      best = candidate;
    }
  }
  return best;
}

}  // namespace

toml::table parse_toml(std::string_view text, const std::string& source) {
  GC_REQUIRE(text.size() <= kMostToml, "{}: is {} bytes long; a scene or study has at most {}", source, text.size(), kMostToml);
  require_flat(text, source);
  try {
    return toml::parse(text, source);
  } catch (const toml::parse_error& error) {
    throw InputError(fmt::format("{}:{}:{}: this is not TOML: {}", source, error.source().begin.line, error.source().begin.column,
                                 error.description()));
  }
}

toml::table parse_toml_file(const std::string& path) { return parse_toml(read_text(path, kMostToml), path); }

std::string toml_text(double value) {
  std::string text = fmt::format("{}", value);
  if (text.find_first_not_of("-0123456789") == std::string::npos) text += ".0";
  return text;
}

std::string toml_text(const toml::node& node) {
  // toml++ prints 17 digits; the shortest text that reads back to the same number is what people wrote.
  if (const auto* number = node.as_floating_point()) return toml_text(number->get());
  std::vector<std::string> items;
  if (const toml::array* array = node.as_array()) {
    for (const toml::node& item : *array) items.push_back(toml_text(item));
    return fmt::format("[{}]", fmt::join(items, ", "));
  }
  if (const toml::table* table = node.as_table()) {
    for (const auto& [key, value] : *table) items.push_back(fmt::format("{} = {}", key_text(key.str()), toml_text(value)));
    return fmt::format("{{{}}}", fmt::join(items, ", "));
  }
  std::ostringstream out;
  node.visit([&out](const auto& value) { out << value; });
  return out.str();
}

std::string toml_text(const toml::table& table, std::string_view name) {
  std::string text = fmt::format("[{}]\n", name);
  for (const auto& [key, value] : table) text += fmt::format("{} = {}\n", key_text(key.str()), toml_text(value));
  return text;
}

TomlKeys::TomlKeys(const toml::table& table, std::string name, std::string file, const toml::table* original)
    : table_(&table), original_(original), name_(std::move(name)), file_(std::move(file)) {}

const toml::node* TomlKeys::find(std::string_view key) {
  allow(key);
  return table_->get(key);
}

std::string TomlKeys::where(std::string_view key) const {
  // A resolved copy has lines of its own: only the user's file counts then.
  const toml::table& source = original_ ? *original_ : *table_;
  const toml::node* node = key.empty() ? nullptr : source.get(key);
  if (node && original_) {
    const toml::node* resolved = table_->get(key);
    if (resolved && text_of(*resolved) != text_of(*node)) return file_ + " with --set";
  }
  if (!node && !key.empty() && table_->contains(key)) return file_ + " with --set";
  const toml::source_region& region = node ? node->source() : source.source();
  if (region.path && region.path->starts_with("--set ")) return *region.path;
  const auto line = region.begin.line;
  if (line == 0) return node ? file_ + " with --set" : file_;
  return fmt::format("{}:{}", file_, line);
}

void TomlKeys::fail(std::string_view key, std::string_view remedy) const {
  const toml::node* node = table_->get(key);
  const std::string table = name_.empty() ? "" : name_ + " ";
  if (!node) throw InputError(fmt::format("{}: {}{} is missing: {}", where(), table, key, remedy));
  throw InputError(fmt::format("{}: {}{} = {}: {}", where(key), table, key, text_of(*node), remedy));
}

std::optional<double> TomlKeys::number(std::string_view key) {
  const toml::node* node = find(key);
  if (!node) return std::nullopt;
  if (!node->is_number()) fail(key, "must be a number");
  const double value = *node->value<double>();
  require(std::isfinite(value), key, "must be finite");
  // Far beyond any silo in SI units, and near enough that products of a few such numbers stay finite.
  require(std::abs(value) <= kLargest, key, fmt::format("must be at most {:g} in size, in SI units", kLargest));
  return value;
}

std::optional<double> TomlKeys::positive(std::string_view key, std::string_view unit) {
  const auto value = number(key);
  require(!value || *value > 0.0, key, fmt::format("must be above 0 {}", unit));
  require(!value || *value >= 1.0 / kLargest, key, fmt::format("must be at least {:g} {}", 1.0 / kLargest, unit));
  return value;
}

std::optional<std::int64_t> TomlKeys::integer(std::string_view key) {
  const toml::node* node = find(key);
  if (!node) return std::nullopt;
  if (!node->is_integer()) fail(key, "must be a whole number, written without a point");
  return *node->value<std::int64_t>();
}

std::optional<bool> TomlKeys::boolean(std::string_view key) {
  const toml::node* node = find(key);
  if (!node) return std::nullopt;
  if (!node->is_boolean()) fail(key, "must be true or false");
  return *node->value<bool>();
}

std::optional<std::string> TomlKeys::string(std::string_view key) {
  const toml::node* node = find(key);
  if (!node) return std::nullopt;
  if (!node->is_string()) fail(key, "must be a text in quotes");
  return *node->value<std::string>();
}

std::optional<Vec3> TomlKeys::vec3(std::string_view key) {
  const toml::node* node = find(key);
  if (!node) return std::nullopt;
  const toml::array* array = node->as_array();
  if (!array || array->size() != 3) fail(key, "must be three numbers, as in [0.0, 0.0, -9.81]");
  Vec3 value;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const toml::node& item = (*array)[axis];
    if (!item.is_number()) fail(key, "must be three numbers, as in [0.0, 0.0, -9.81]");
    value[static_cast<Eigen::Index>(axis)] = *item.value<double>();
  }
  require(value.allFinite(), key, "must be finite");
  require(value.cwiseAbs().maxCoeff() <= kLargest, key, fmt::format("must be at most {:g} in size, in SI units", kLargest));
  return value;
}

std::optional<std::string> TomlKeys::choice(std::string_view key, std::initializer_list<std::string_view> allowed) {
  auto value = string(key);
  if (value && std::find(allowed.begin(), allowed.end(), *value) == allowed.end())
    fail(key, fmt::format("must be \"{}\"", fmt::join(allowed, "\" or \"")));
  return value;
}

std::optional<TomlKeys> TomlKeys::table(std::string_view key) {
  const toml::node* node = find(key);
  if (!node) return std::nullopt;
  if (!node->is_table()) fail(key, "must be a table");
  const toml::node* original = original_ ? original_->get(key) : nullptr;
  const std::string name = name_.empty() ? fmt::format("[{}]", key) : fmt::format("{} {}", name_, key);
  return TomlKeys(*node->as_table(), name, file_, original ? original->as_table() : nullptr);
}

std::vector<TomlKeys> TomlKeys::tables(std::string_view key) {
  std::vector<TomlKeys> found;
  const toml::node* node = find(key);
  if (!node) return found;
  const toml::array* array = node->as_array();
  const std::string remedy = fmt::format("must be tables, each headed [[{}]]", key);
  if (!array) fail(key, remedy);
  const toml::node* original = original_ ? original_->get(key) : nullptr;
  const toml::array* originals = original ? original->as_array() : nullptr;
  for (std::size_t n = 0; n < array->size(); ++n) {
    const toml::node& item = (*array)[n];
    if (!item.is_table()) fail(key, remedy);
    const toml::node* same = originals && n < originals->size() ? originals->get(n) : nullptr;
    found.emplace_back(*item.as_table(), fmt::format("[[{}]]", key), file_, same ? same->as_table() : nullptr);
  }
  return found;
}

void TomlKeys::finish() const {
  for (const auto& [key, node] : *table_) {
    if (known_.contains(key.str())) continue;
    const std::string_view near = closest(key.str(), known_);
    throw InputError(fmt::format("{}: unknown key `{}`{}; known keys: {}{}", where(key.str()), excerpt(key.str()),
                                 name_.empty() ? " at the top level" : " in " + name_, fmt::join(known_, ", "),
                                 near.empty() ? "" : fmt::format("; did you mean `{}`?", near)));
  }
}

}  // namespace grainclock::core
