#include "silo/envelope.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <limits>

namespace grainclock::silo {

Spread spread(const std::vector<double>& values) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  const std::vector<double> left = known(values);
  if (left.empty()) return {kUnknown, kUnknown, mean_interval(left)};
  const auto [min, max] = std::minmax_element(left.begin(), left.end());
  return {*min, *max, mean_interval(left)};
}

std::vector<Spread> envelope(const std::vector<std::vector<double>>& runs) {
  GC_REQUIRE(!runs.empty(), "envelope of no runs: give one at least");
  const std::size_t places = runs.front().size();
  for (std::size_t run = 0; run < runs.size(); ++run)
    GC_REQUIRE(runs[run].size() == places,
               "envelope: run {} has {} values, the first one {}; give them at the same times or layers, nan where unknown",
               run, runs[run].size(), places);
  std::vector<Spread> spreads;
  std::vector<double> values(runs.size());
  for (std::size_t place = 0; place < places; ++place) {
    for (std::size_t run = 0; run < runs.size(); ++run) values[run] = runs[run][place];
    spreads.push_back(spread(values));
  }
  return spreads;
}

}  // namespace grainclock::silo
