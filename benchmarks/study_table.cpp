#include "benchmarks/study_table.hpp"

#include "core/files.hpp"
#include "core/hdf5.hpp"
#include "silo/provenance.hpp"

#include <fmt/format.h>

#include <limits>

namespace grainclock::benchmarks {
namespace {

std::string quoted(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"') out += '"';
    out += c;
  }
  return out + '"';
}

std::string cell(const Row& row, const Column& column) {
  if (const auto* text = std::get_if<std::string Row::*>(&column.field)) return quoted(row.**text);
  const Row::Number& number = row.*std::get<Row::Number Row::*>(column.field);
  return number ? fmt::format("{}", *number) : "";
}

}  // namespace

const std::vector<Column>& columns() {
  static const std::vector<Column> all = {
      {"name", "", &Row::name},
      {"method", "", &Row::method},
      {"method_used", "", &Row::method_used},
      {"integrator", "", &Row::integrator},
      {"events", "", &Row::events},
      {"dashpot", "", &Row::dashpot},
      {"interface", "", &Row::interface},
      {"step", "s", &Row::step},
      {"tolerance", "", &Row::tolerance},
      {"levels", "", &Row::levels},
      {"error_rms", "", &Row::error_rms},
      {"error_median", "", &Row::error_median},
      {"error_p99", "", &Row::error_p99},
      {"error_wall_force", "", &Row::error_wall_force},
      {"momentum_residual", "", &Row::momentum_residual},
      {"energy_residual", "", &Row::energy_residual},
      {"contact_evaluations", "", &Row::contact_evaluations},
      {"ball_updates", "", &Row::ball_updates},
      {"wall_s", "s", &Row::wall_s},
      {"ideal_gain", "", &Row::ideal_gain},
      {"counted_gain", "", &Row::counted_gain},
      {"measured_gain", "", &Row::measured_gain},
      {"gain_events_counted", "", &Row::gain_events_counted},
      {"gain_events_measured", "", &Row::gain_events_measured},
      {"sweeps", "", &Row::sweeps},
      {"missed_contacts", "", &Row::missed_contacts},
      {"events_count", "", &Row::events_count},
      {"missing_balls", "", &Row::missing_balls},
      {"velocity_error_rms", "", &Row::velocity_error_rms},
      {"rtol", "", &Row::rtol},
      {"start", "", &Row::start},
      {"status", "", &Row::status},
  };
  return all;
}

std::string csv(const std::vector<Row>& rows) {
  std::string text;
  for (const Column& column : columns()) text += fmt::format("{}{}", text.empty() ? "" : ",", column.name);
  text += '\n';
  for (const Row& row : rows) {
    bool first = true;
    for (const Column& column : columns()) {
      if (!first) text += ',';
      text += cell(row, column);
      first = false;
    }
    text += '\n';
  }
  return text;
}

void write_table(const std::filesystem::path& path, const std::vector<Row>& rows, const std::string& study_text,
                 const core::Scene& scene, int threads) {
  core::AsideFile aside(path);
  core::Hdf5File file = core::Hdf5File::create(aside.part());
  core::Hdf5Group study = file.create_group("study");
  for (const Column& column : columns()) {
    const std::string name(column.name);
    if (const auto* field = std::get_if<std::string Row::*>(&column.field)) {
      std::vector<std::string> texts;
      for (const Row& row : rows) texts.push_back(row.**field);
      study.write_texts(name, texts);
    } else {
      std::vector<double> numbers;
      for (const Row& row : rows) {
        numbers.push_back((row.*std::get<Row::Number Row::*>(column.field)).value_or(std::numeric_limits<double>::quiet_NaN()));
      }
      study.write(name, numbers);
      if (!column.unit.empty()) study.write_attribute(name, "unit", std::string(column.unit));
    }
  }
  silo::write_provenance(file, threads, scene.seed, scene.text);
  file.group("provenance").write_text("study", study_text);
  file.close();
  aside.commit();
}

}  // namespace grainclock::benchmarks
