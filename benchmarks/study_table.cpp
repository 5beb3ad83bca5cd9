#include "benchmarks/study_table.hpp"

#include <fmt/format.h>

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

}  // namespace grainclock::benchmarks
