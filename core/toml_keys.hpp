// Typed reading of one TOML table: every key that nobody asked for is an error.
//
// Each reader notes the key as known; finish() then complains about the others.
// Messages read "scene.toml:12: [silo] radius = -5: must be above 0 m".
#pragma once

#include "core/state.hpp"

#include <toml++/toml.h>

#include <initializer_list>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace grainclock::core {

class TomlKeys {
 public:
  /// `table` must outlive this; `name` as in "[silo]", empty for the root; `file` as the user wrote it.
  /// `original`: the same table of the user's file where `table` is a resolved copy: lines come from it.
  TomlKeys(const toml::table& table, std::string name, std::string file, const toml::table* original = nullptr);

  /// Readers: nothing if the key is absent; InputError if its type is wrong (or a number not finite).
  std::optional<double> number(std::string_view key);
  std::optional<std::int64_t> integer(std::string_view key);
  std::optional<bool> boolean(std::string_view key);
  std::optional<std::string> string(std::string_view key);
  std::optional<Vec3> vec3(std::string_view key);
  /// One of `allowed`, or InputError listing them.
  std::optional<std::string> choice(std::string_view key, std::initializer_list<std::string_view> allowed);
  /// A sub-table, or the tables of an array of tables ([[key]]).
  std::optional<TomlKeys> table(std::string_view key);
  std::vector<TomlKeys> tables(std::string_view key);

  /// A number above zero, or InputError; `unit` for the message.
  std::optional<double> positive(std::string_view key, std::string_view unit);

  bool has(std::string_view key) const { return table_->contains(key); }
  /// Notes a key as known without reading it.
  void allow(std::string_view key) { known_.emplace(key); }
  /// "scene.toml:12": the key's place, or the table's where the key is absent; "--set key=value" for such keys.
  std::string where(std::string_view key = {}) const;
  /// Throws InputError "place: [table] key = value: remedy".
  [[noreturn]] void fail(std::string_view key, std::string_view remedy) const;
  /// fail() unless `condition`.
  void require(bool condition, std::string_view key, std::string_view remedy) const {
    if (!condition) fail(key, remedy);
  }
  /// Throws InputError for the first key that no reader asked for, with the known ones and the closest of them.
  void finish() const;

 private:
  const toml::node* find(std::string_view key);

  const toml::table* table_;
  const toml::table* original_;
  std::string name_;
  std::string file_;
  std::set<std::string, std::less<>> known_;
};

inline constexpr std::uint64_t kMostToml = std::uint64_t{1} << 20;  // bytes of a scene or study

/// A TOML text; `source` is its file as the user wrote it, for messages. Throws InputError "file:line:column: ..." where it
/// is not TOML, or nested or long beyond what a scene or study can mean.
toml::table parse_toml(std::string_view text, const std::string& source);
/// The same of a file. Throws FileError too.
toml::table parse_toml_file(const std::string& path);

/// The shortest TOML that reads back to the same value, bit for bit, on one line (tables inline).
std::string toml_text(double value);
std::string toml_text(const toml::node& node);
/// The same of a table with its header: [name] and a line per key.
std::string toml_text(const toml::table& table, std::string_view name);

}  // namespace grainclock::core
