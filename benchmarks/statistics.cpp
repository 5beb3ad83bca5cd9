#include "benchmarks/statistics.hpp"

#include "core/check.hpp"
#include "silo/discharge.hpp"

#include <algorithm>
#include <limits>

namespace grainclock::benchmarks {
namespace {
constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
}  // namespace

Interval difference_interval(const std::vector<double>& a, const std::vector<double>& b) {
  const std::vector<double> known_a = silo::known(a), known_b = silo::known(b);
  const std::size_t n = std::min(known_a.size(), known_b.size());
  const double difference = mean(known_a) - mean(known_b);
  if (n < 2) return {n, difference, kUnknown, kUnknown};
  const double error_a = silo::squared_error(known_a), error_b = silo::squared_error(known_b), both = error_a + error_b;
  // Welch and Satterthwaite's freedom, between that of the smaller group and that of both together.
  const double freedom = both * both /
                         (error_a * error_a / static_cast<double>(known_a.size() - 1) +
                          error_b * error_b / static_cast<double>(known_b.size() - 1));
  return silo::interval(n, difference, both, freedom);
}

double discharge_rate(const std::vector<double>& time, const std::vector<double>& discharged) {
  GC_REQUIRE(!time.empty(), "discharge rate of an empty series: give two samples at least");
  return silo::discharge_rate(time, discharged, time.front(), time.back());
}

Stoppages stoppages(const std::vector<double>& time, const std::vector<double>& discharged, double at_least) {
  // However much the content stirs: only the count decides.
  const std::vector<double> calm(time.size(), 0.0);
  Stoppages found;
  double total = 0.0;
  for (const silo::TimeSpan& span : silo::stoppages(time, discharged, calm, {at_least})) {
    ++found.count;
    total += span.length();
  }
  found.mean_length = found.count > 0 ? total / static_cast<double>(found.count) : kUnknown;
  found.share = total / (time.back() - time.front());
  return found;
}

}  // namespace grainclock::benchmarks
