#include "silo/discharge.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace grainclock::silo {
namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
// Times are multiples of the sampling; a rounding must not decide.
constexpr double kGuard = 1e-9;

void require_series(const std::vector<double>& time, const std::vector<double>& values) {
  GC_REQUIRE(time.size() == values.size() && time.size() >= 2,
             "discharge: {} times and {} values; give as many of both, at least two", time.size(), values.size());
  const auto late = std::adjacent_find(time.begin(), time.end(), [](double a, double b) { return !(a < b); });
  GC_REQUIRE(late == time.end(), "discharge: the time after {} s is {} s; times must increase", late[0], late[1]);
}

/// The samples of a window, its ends included: [first, end).
struct Samples {
  std::size_t first, end;
};
Samples samples_in(const std::vector<double>& time, double from, double to) {
  const double guard = kGuard * (time.back() - time.front());
  const auto first = std::lower_bound(time.begin(), time.end(), from - guard);
  const auto end = std::upper_bound(first, time.end(), to + guard);
  return {static_cast<std::size_t>(first - time.begin()), static_cast<std::size_t>(end - time.begin())};
}

double rate_of(const std::vector<double>& time, const std::vector<double>& discharged, const Samples& samples) {
  if (samples.end < samples.first + 2) return kUnknown;
  return (discharged[samples.end - 1] - discharged[samples.first]) / (time[samples.end - 1] - time[samples.first]);
}

/// Lowest value from `at` on in the direction `step` (1 or -1), up to the next that is higher.
double base(const std::vector<double>& values, std::size_t at, std::ptrdiff_t step) {
  double lowest = values[at];
  for (auto i = static_cast<std::ptrdiff_t>(at); i >= 0 && i < std::ssize(values); i += step) {
    const double value = values[static_cast<std::size_t>(i)];
    if (value > values[at]) break;
    lowest = std::min(lowest, value);
  }
  return lowest;
}

}  // namespace

double discharge_rate(const std::vector<double>& time, const std::vector<double>& discharged, double from, double to) {
  require_series(time, discharged);
  const double rate = rate_of(time, discharged, samples_in(time, from, to));
  GC_REQUIRE(!std::isnan(rate),
             "discharge rate from {} s to {} s: needs two samples at least; the series goes from {} s to {} s", from, to,
             time.front(), time.back());
  return rate;
}

std::vector<double> sliding_discharge_rate(const std::vector<double>& time, const std::vector<double>& discharged,
                                           double width) {
  require_series(time, discharged);
  GC_REQUIRE(width > 0.0, "discharge rate over windows of {} s: must be above 0 s", width);
  std::vector<double> rates;
  for (const double t : time) rates.push_back(rate_of(time, discharged, samples_in(time, t - 0.5 * width, t + 0.5 * width)));
  return rates;
}

std::vector<double> energy_per_ball(const std::vector<double>& kinetic_energy, const std::vector<double>& discharged,
                                    const EnergyScale& scale) {
  GC_REQUIRE(kinetic_energy.size() == discharged.size() && scale.ball_energy > 0.0,
             "energy per ball: {} energies and {} counts, {} J for a ball; give as many of both, and m g r above 0 J",
             kinetic_energy.size(), discharged.size(), scale.ball_energy);
  std::vector<double> energies;
  for (std::size_t i = 0; i < kinetic_energy.size(); ++i) {
    const double left = scale.balls - discharged[i];
    GC_REQUIRE(left >= 0.0, "energy per ball: {} balls have left of {}", discharged[i], scale.balls);
    energies.push_back(left > 0.0 ? kinetic_energy[i] / (left * scale.ball_energy) : 0.0);
  }
  return energies;
}

std::vector<TimeSpan> stoppages(const std::vector<double>& time, const std::vector<double>& discharged,
                                const std::vector<double>& energies, const StoppageRule& rule) {
  require_series(time, discharged);
  require_series(time, energies);
  GC_REQUIRE(rule.at_least > 0.0, "stoppages of at least {} s: must be above 0 s", rule.at_least);
  std::vector<TimeSpan> found;
  for (std::size_t first = 0, last = 0; first < time.size(); first = last + 1) {
    last = first;
    if (!(energies[first] < rule.energy)) continue;
    while (last + 1 < time.size() && discharged[last + 1] == discharged[first] && energies[last + 1] < rule.energy) ++last;
    const TimeSpan span{time[first], time[last]};
    if (span.length() >= (1.0 - kGuard) * rule.at_least) found.push_back(span);
  }
  return found;
}

std::vector<Beat> beats(const std::vector<double>& time, const std::vector<double>& kinetic_energy, double prominence) {
  require_series(time, kinetic_energy);
  GC_REQUIRE(prominence > 0.0, "beats with a prominence of {}: must be above 0", prominence);
  const std::vector<double>& values = kinetic_energy;
  std::vector<Beat> found;
  for (std::size_t first = 1, last = 1; first + 1 < values.size(); first = last + 1) {
    last = first;
    while (last + 1 < values.size() && values[last + 1] == values[first]) ++last;
    if (last + 1 == values.size() || !(values[first - 1] < values[first]) || !(values[last + 1] < values[first])) continue;
    const double rise = values[first] - std::max(base(values, first, -1), base(values, last, 1));
    if (rise >= prominence) found.push_back({0.5 * (time[first] + time[last]), values[first], rise});
  }
  return found;
}

std::vector<double> beat_intervals(const std::vector<Beat>& beats) {
  std::vector<double> intervals;
  for (std::size_t i = 1; i < beats.size(); ++i) intervals.push_back(beats[i].time - beats[i - 1].time);
  return intervals;
}

Duration discharge_duration(const std::vector<double>& time, const std::vector<double>& discharged, double balls) {
  require_series(time, discharged);
  GC_REQUIRE(balls > 0.0, "duration of a discharge of {} balls: must be above 0", balls);
  const double all = discharged.front() + balls;
  const auto last = std::find_if(discharged.begin(), discharged.end(), [&](double count) { return count >= all; });
  if (last != discharged.end()) return {time[static_cast<std::size_t>(last - discharged.begin())] - time.front(), false};
  const double left = discharged.back() - discharged.front();
  return {left > 0.0 ? balls / left * (time.back() - time.front()) : std::numeric_limits<double>::infinity(), true};
}

double Beverloo::mass_rate() const {
  const double free = outlet - empty_annulus * ball;
  return free > 0.0 ? coefficient * bulk_density * std::sqrt(gravity) * std::pow(free, 2.5) : 0.0;
}

}  // namespace grainclock::silo
