#include "benchmarks/table.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "core/hdf5.hpp"
#include "silo/provenance.hpp"

#include <cmath>

namespace grainclock::benchmarks {
namespace {

using Numbers = std::vector<double>;
using Texts = std::vector<std::string>;

std::string quoted(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  out += '"';
  return out;
}

std::size_t length(const TableColumn& column) {
  return std::visit([](const auto& values) { return values.size(); }, column.values);
}

std::string text_of(const TableColumn& column, std::size_t row) {
  if (const auto* texts = std::get_if<Texts>(&column.values)) return quoted((*texts)[row]);
  const double number = std::get<Numbers>(column.values)[row];
  return std::isnan(number) ? "" : fmt::format("{}", number);
}

template <class Values>
const Values& values_of(const Table& table, std::string_view column) {
  for (const TableColumn& one : table.columns) {
    if (one.name != column) continue;
    if (const auto* values = std::get_if<Values>(&one.values)) return *values;
  }
  throw core::InputError(fmt::format("table {} has no column {} of {}; see its header", table.name, column,
                                     std::is_same_v<Values, Texts> ? "texts" : "numbers"));
}

}  // namespace

const Numbers& numbers(const Table& table, std::string_view column) { return values_of<Numbers>(table, column); }
const Texts& texts(const Table& table, std::string_view column) { return values_of<Texts>(table, column); }

std::string csv(const Table& table) {
  std::string text;
  const auto add_line = [&](const auto& cell_of) {
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
      if (c > 0) text += ',';
      text += cell_of(table.columns[c]);
    }
    text += '\n';
  };
  add_line([](const TableColumn& column) { return quoted(column.name); });
  const std::size_t rows = table.columns.empty() ? 0 : length(table.columns.front());
  for (std::size_t row = 0; row < rows; ++row) {
    add_line([row](const TableColumn& column) { return text_of(column, row); });
  }
  return text;
}

void write_tables(const std::filesystem::path& path, const std::vector<Table>& tables, const TableOrigin& origin) {
  core::AsideFile aside(path);
  core::Hdf5File file = core::Hdf5File::create(aside.part());
  for (const Table& table : tables) {
    core::Hdf5Group group = file.create_group(table.name);
    for (const TableColumn& column : table.columns) {
      if (const auto* texts = std::get_if<Texts>(&column.values)) {
        group.write_texts(column.name, *texts);
      } else {
        group.write(column.name, std::get<Numbers>(column.values));
      }
      if (!column.unit.empty()) group.write_attribute(column.name, "unit", column.unit);
    }
  }
  silo::write_provenance(file, origin.threads, origin.seed, origin.scene_text);
  file.group("provenance").write_text("study", origin.study_text);
  file.close();
  aside.commit();
}

}  // namespace grainclock::benchmarks
