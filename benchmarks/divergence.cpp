#include "benchmarks/divergence.hpp"

#include "silo/random.hpp"

#include <algorithm>
#include <cmath>

namespace grainclock::benchmarks {
namespace {

constexpr double kAboveFloor = 3.0;    // below that much of it the floor itself bends the curve
constexpr double kLeastGrowth = 10.0;  // over the fitted part; less is no exponential to tell from anything else
constexpr double kTrustedShare = 0.1;  // of the smallest error, as for accepting a reference
constexpr std::uint32_t kRandomStream = 0x64697665;  // of its own, so that no scene's numbers are met again

struct Sample {
  double time, separation;
};

/// Slope of log(separation) over time.
double slope(const std::vector<Sample>& samples) {
  double mean_time = 0.0, mean_log = 0.0;
  for (const Sample& s : samples) {
    mean_time += s.time / static_cast<double>(samples.size());
    mean_log += std::log(s.separation) / static_cast<double>(samples.size());
  }
  double covariance = 0.0, variance = 0.0;
  for (const Sample& s : samples) {
    covariance += (s.time - mean_time) * (std::log(s.separation) - mean_log);
    variance += (s.time - mean_time) * (s.time - mean_time);
  }
  return covariance / variance;
}

}  // namespace

Separation separation(const core::State& state, const core::State& other, std::optional<double> outlet_z) {
  Separation found;
  std::size_t compared = 0, k = 0;
  for (std::size_t i = 0; i < state.size(); ++i) {
    while (k < other.size() && other.id[k] < state.id[i]) ++k;  // both ascend
    if (k == other.size()) break;
    if (other.id[k] != state.id[i] || state.kind[i] != core::Kind::content) continue;
    if (outlet_z && state.position[i].z() <= *outlet_z) continue;
    const double squared = (state.position[i] - other.position[k]).squaredNorm();
    found.rms += squared;
    found.max = std::max(found.max, std::sqrt(squared));
    ++compared;
  }
  if (compared > 0) found.rms = std::sqrt(found.rms / static_cast<double>(compared));
  return found;
}

core::State perturbed(core::State state, double length, std::uint64_t seed) {
  silo::Random random(seed, kRandomStream);
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.kind[i] != core::Kind::content) continue;
    for (double& x : state.position[i]) x += random.between(-length, length);
  }
  return state;
}

Growth fitted_growth(const std::vector<double>& time, const std::vector<double>& separation, double ceiling) {
  std::vector<Sample> samples;
  for (std::size_t k = 0; k < time.size(); ++k) {
    if (separation[k] > 0.0) samples.push_back({time[k], separation[k]});
  }
  Growth growth;
  if (samples.empty()) return growth;
  const auto top = std::find_if(samples.begin(), samples.end(), [=](const Sample& s) { return s.separation >= ceiling; });
  samples.erase(top, samples.end());
  if (samples.empty()) return growth;
  growth.floor = std::min_element(samples.begin(), samples.end(), [](const Sample& a, const Sample& b) {
                   return a.separation < b.separation;
                 })->separation;
  const auto low = std::find_if(samples.rbegin(), samples.rend(),
                                [&](const Sample& s) { return s.separation < kAboveFloor * growth.floor; });
  samples.erase(samples.begin(), low.base());
  if (samples.size() < 3 || samples.back().separation < kLeastGrowth * growth.floor) return growth;
  growth.begin = samples.front().time;
  growth.end = samples.back().time;
  const double rate = slope(samples);
  if (rate > 0.0) growth.rate = rate;
  return growth;
}

std::optional<double> trusted_until(double rate, double horizon, double reference_change, double smallest_error) {
  if (!(rate > 0.0 && horizon > 0.0 && reference_change > 0.0 && smallest_error > 0.0)) return std::nullopt;
  return std::max(0.0, horizon + std::log(kTrustedShare * smallest_error / reference_change) / rate);
}

}  // namespace grainclock::benchmarks
