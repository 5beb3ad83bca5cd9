// A table by columns, as CSV and as HDF5: what every study leaves.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace grainclock::benchmarks {

/// A column of numbers (nan: unknown) or of texts.
struct TableColumn {
  std::string name;
  std::string unit;  // empty: a pure number or a text
  std::variant<std::vector<double>, std::vector<std::string>> values;
};

/// Columns of equal length.
struct Table {
  std::string name;  // of its file (NAME.csv) and of its HDF5 group (/NAME)
  std::vector<TableColumn> columns;
};

inline std::string cell(std::string_view text) { return std::string(text); }
inline double cell(const std::optional<double>& number) { return number.value_or(std::numeric_limits<double>::quiet_NaN()); }

/// A column of what `value` gives of each row, a text or a number: a member of the row, or a function of it.
template <class Row, class Value>
TableColumn column(const std::vector<Row>& rows, std::string name, std::string unit, Value value) {
  std::vector<decltype(cell(std::invoke(value, rows.front())))> values;
  for (const Row& row : rows) values.push_back(cell(std::invoke(value, row)));
  return {std::move(name), std::move(unit), std::move(values)};
}

/// The values of the column of this name. Throws InputError unless the table has it, of this type.
const std::vector<double>& numbers(const Table& table, std::string_view column);
const std::vector<std::string>& texts(const Table& table, std::string_view column);

/// The table as CSV (RFC 4180) with a header line; numbers to the last bit, unknown ones empty.
std::string csv(const Table& table);

/// Where the tables come from; the texts go into /provenance.
struct TableOrigin {
  std::string study_text, scene_text;
  std::uint64_t seed = 0;
  int threads = 1;
};

/// All tables as one HDF5 file, written aside and renamed: /NAME/COLUMN one dataset per column with its unit,
/// unknown numbers nan; /provenance. Throws FileError.
void write_tables(const std::filesystem::path& path, const std::vector<Table>& tables, const TableOrigin& origin);

}  // namespace grainclock::benchmarks
