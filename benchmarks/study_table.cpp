#include "benchmarks/study_table.hpp"

#include <limits>
#include <string_view>
#include <variant>

namespace grainclock::benchmarks {
namespace {

struct Column {
  std::string_view name;
  std::string_view unit;  // empty: a pure number or a text
  std::variant<std::string Row::*, Row::Number Row::*> field;
};

/// Every column, in the order of the file.
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
      {"variant", "", &Row::variant},
      {"roots", "", &Row::roots},
      {"steps", "", &Row::steps},
      {"restarts", "", &Row::restarts},
      {"branch_changes", "", &Row::branch_changes},
      {"scene", "", &Row::scene},
      {"start", "", &Row::start},
      {"status", "", &Row::status},
      {"host", "", &Row::host},
      {"threads", "", &Row::threads},
      {"revision", "", &Row::revision},
  };
  return all;
}

}  // namespace

Table study_table(const std::vector<Row>& rows) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  Table table{"study", {}};
  for (const Column& column : columns()) {
    TableColumn made{std::string(column.name), std::string(column.unit), {}};
    if (const auto* text = std::get_if<std::string Row::*>(&column.field)) {
      auto& values = made.values.emplace<std::vector<std::string>>();
      for (const Row& row : rows) values.push_back(row.**text);
    } else {
      auto& values = made.values.emplace<std::vector<double>>();
      for (const Row& row : rows) values.push_back((row.*std::get<Row::Number Row::*>(column.field)).value_or(kUnknown));
    }
    table.columns.push_back(std::move(made));
  }
  return table;
}

}  // namespace grainclock::benchmarks
