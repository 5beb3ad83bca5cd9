#include "silo/spectrum.hpp"

#include "core/check.hpp"

#include <unsupported/Eigen/FFT>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <numeric>

namespace grainclock::silo {
namespace {

/// Spacing of evenly spaced times [s].
double spacing(const std::vector<double>& time) {
  constexpr double kUneven = 1e-2;
  const double interval = (time.back() - time.front()) / static_cast<double>(time.size() - 1);
  for (std::size_t i = 0; i < time.size(); ++i) {
    const double even = time.front() + static_cast<double>(i) * interval;
    GC_REQUIRE(
        std::abs(time[i] - even) <= kUneven * interval,
        "spectrum: sample {} is at {} s, evenly spaced ones have it at {} s; take a part of the series with one spacing", i,
        time[i], even);
  }
  return interval;
}

double weight(Taper taper, std::size_t i, std::size_t n) {
  if (taper == Taper::none) return 1.0;
  return 1.0 - std::cos(2.0 * std::numbers::pi * static_cast<double>(i) / static_cast<double>(n));
}

}  // namespace

double Spectrum::power() const { return std::accumulate(density.begin(), density.end(), 0.0) * step(); }

double Spectrum::strongest() const {
  return frequency[static_cast<std::size_t>(std::max_element(density.begin(), density.end()) - density.begin())];
}

Spectrum power_spectrum(const std::vector<double>& time, const std::vector<double>& values, Taper taper) {
  const std::size_t n = values.size();
  GC_REQUIRE(time.size() == n && n >= 4 && time.front() < time.back(),
             "spectrum: {} times and {} values; give as many of both, at least four, over some time", time.size(), n);
  GC_REQUIRE(std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); }),
             "spectrum: a value is not finite; take a part of the series where all are known");
  const double interval = spacing(time), mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(n);

  std::vector<double> weighted(n);
  double squares = 0.0;  // of the weights
  for (std::size_t i = 0; i < n; ++i) {
    const double its = weight(taper, i, n);
    weighted[i] = its * (values[i] - mean);
    squares += its * its;
  }
  std::vector<std::complex<double>> modes;
  Eigen::FFT<double>().fwd(modes, weighted);

  Spectrum spectrum;
  for (std::size_t k = 0; k <= n / 2; ++k) {
    const bool has_twin = k > 0 && 2 * k < n;  // a negative frequency of the same power
    spectrum.frequency.push_back(static_cast<double>(k) / (static_cast<double>(n) * interval));
    spectrum.density.push_back((has_twin ? 2.0 : 1.0) * std::norm(modes[k]) * interval / squares);
  }
  return spectrum;
}

Spectrum mean_spectrum(const std::vector<double>& time, const std::vector<double>& values, int pieces) {
  GC_REQUIRE(pieces >= 1 && time.size() == values.size(), "spectrum of {} pieces of {} times and {} values: give a piece at least, and as many of both",
             pieces, time.size(), values.size());
  const std::size_t length = 2 * time.size() / (static_cast<std::size_t>(pieces) + 1);
  Spectrum mean;
  for (std::size_t k = 0; k < static_cast<std::size_t>(pieces); ++k) {
    const auto first = static_cast<std::ptrdiff_t>(pieces > 1 ? k * (time.size() - length) / (static_cast<std::size_t>(pieces) - 1) : 0);
    const auto end = first + static_cast<std::ptrdiff_t>(length);
    Spectrum its = power_spectrum({time.begin() + first, time.begin() + end}, {values.begin() + first, values.begin() + end}, Taper::hann);
    if (k == 0) mean = Spectrum{std::move(its.frequency), std::vector<double>(its.density.size(), 0.0)};
    for (std::size_t f = 0; f < mean.density.size(); ++f) mean.density[f] += its.density[f] / pieces;
  }
  return mean;
}

}  // namespace grainclock::silo
