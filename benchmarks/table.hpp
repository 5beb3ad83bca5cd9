// A table by columns, as CSV and as HDF5: what every study leaves.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
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
