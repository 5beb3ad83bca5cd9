#include "silo/spectrum.hpp"

#include "core/check.hpp"
#include "silo/random.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

namespace grainclock::silo {
namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;
// Some hundred roundings of numbers of order one to ten.
constexpr double kRounding = 1e-12;

struct Series {
  std::vector<double> time, values;
};

/// n samples every `interval` of a function of time, from 5 s on.
template <class Function>
Series sampled(int n, double interval, Function&& function) {
  Series series;
  for (int i = 0; i < n; ++i) {
    series.time.push_back(5.0 + i * interval);
    series.values.push_back(function(i * interval));
  }
  return series;
}

Series noise(int n) {
  Random random(1, static_cast<std::uint32_t>(n));
  return sampled(n, 0.02, [&](double) { return random.between(-1.0, 3.0); });
}

TEST(Spectrum, ASineIsOneLineOfHalfItsSquaredAmplitude) {
  const auto [time, values] = sampled(200, 0.05, [](double t) { return 7.0 + 3.0 * std::sin(kTwoPi * 1.2 * t + 0.4); });
  const Spectrum spectrum = power_spectrum(time, values, Taper::none);
  ASSERT_EQ(spectrum.frequency.size(), 101u);
  EXPECT_NEAR(spectrum.step(), 0.1, kRounding);  // one over 10 s
  EXPECT_NEAR(spectrum.frequency.back(), 10.0, kRounding);
  EXPECT_NEAR(spectrum.strongest(), 1.2, kRounding);
  for (std::size_t k = 0; k < spectrum.density.size(); ++k)
    EXPECT_NEAR(spectrum.density[k] * spectrum.step(), k == 12 ? 4.5 : 0.0, kRounding) << k;
}

TEST(Spectrum, HannsWindowSpreadsALineOverItsNeighboursAndKeepsItsPower) {
  const auto [time, values] = sampled(200, 0.05, [](double t) { return 3.0 * std::cos(kTwoPi * 1.2 * t); });
  const Spectrum spectrum = power_spectrum(time, values, Taper::hann);
  // The window's transform has 1, -1/2, -1/2 at the line and its neighbours: powers 4 : 1 : 1.
  for (const auto& [k, share] : {std::pair{11, 1.0}, {12, 4.0}, {13, 1.0}})
    EXPECT_NEAR(spectrum.density[static_cast<std::size_t>(k)] * spectrum.step(), 4.5 * share / 6.0, kRounding) << k;
  EXPECT_NEAR(spectrum.power(), 4.5, kRounding);
}

TEST(Spectrum, HannsWindowKeepsALineBetweenFrequenciesFromLeaking) {
  const auto [time, values] = sampled(200, 0.05, [](double t) { return std::sin(kTwoPi * 1.25 * t); });
  const Spectrum plain = power_spectrum(time, values, Taper::none), tapered = power_spectrum(time, values, Taper::hann);
  EXPECT_NEAR(tapered.strongest(), 1.25, 0.5 * tapered.step() + kRounding);
  // Far from the line leakage falls with the square of the distance without a taper, with its sixth power with it.
  EXPECT_LT(tapered.density[60], 1e-4 * plain.density[60]);
}

TEST(Spectrum, ItsPowerIsTheVarianceForEvenAndOddLengths) {
  for (const int n : {4, 5, 36, 37, 90, 1000, 1001}) {
    const auto [time, values] = noise(n);
    double mean = 0.0, variance = 0.0;
    for (const double value : values) mean += value / n;
    for (const double value : values) variance += (value - mean) * (value - mean) / n;
    EXPECT_NEAR(power_spectrum(time, values, Taper::none).power() / variance, 1.0, kRounding) << n;
  }
}

TEST(Spectrum, AgreesWithTheTransformWrittenOut) {
  for (const int n : {16, 27, 37}) {
    const auto [time, values] = noise(n);
    const Spectrum spectrum = power_spectrum(time, values, Taper::none);
    for (int k = 1; k <= n / 2; ++k) {
      std::complex<double> sum = 0.0;
      for (int i = 0; i < n; ++i) sum += values[static_cast<std::size_t>(i)] * std::polar(1.0, -kTwoPi * k * i / n);
      const double twins = 2 * k == n ? 1.0 : 2.0;
      EXPECT_NEAR(spectrum.density[static_cast<std::size_t>(k)], twins * std::norm(sum) * 0.02 / n, kRounding)
          << n << " " << k;
      EXPECT_NEAR(spectrum.frequency[static_cast<std::size_t>(k)], k / (0.02 * n),
                  100.0 * kRounding);  // spacing from times of 5 s and more
    }
  }
}

TEST(Spectrum, AConstantHasNone) {
  const auto [time, values] = sampled(50, 0.1, [](double) { return 4.0; });
  const Spectrum spectrum = power_spectrum(time, values, Taper::hann);
  EXPECT_EQ(spectrum.power(), 0.0);
  EXPECT_EQ(spectrum.strongest(), 0.0);
}

TEST(Spectrum, MeanOverPiecesIsTheMeanOfTheirs) {
  const auto [time, values] = noise(100);
  const Spectrum mean = mean_spectrum(time, values, 3);  // pieces of 50, from 0, 25 and 50
  const auto piece = [](const std::vector<double>& all, std::ptrdiff_t first) { return std::vector<double>(all.begin() + first, all.begin() + first + 50); };
  const Spectrum a = power_spectrum(piece(time, 0), piece(values, 0), Taper::hann), b = power_spectrum(piece(time, 25), piece(values, 25), Taper::hann),
                 c = power_spectrum(piece(time, 50), piece(values, 50), Taper::hann);
  ASSERT_EQ(mean.density.size(), a.density.size());
  EXPECT_EQ(mean.frequency, a.frequency);
  for (std::size_t k = 0; k < a.density.size(); ++k)
    EXPECT_NEAR(mean.density[k], (a.density[k] + b.density[k] + c.density[k]) / 3.0, kRounding * (1.0 + mean.density[k]));
  EXPECT_EQ(mean_spectrum(time, values, 1).density, power_spectrum(time, values, Taper::hann).density);
  EXPECT_THROW(mean_spectrum(time, values, 0), core::InputError);
  EXPECT_THROW(mean_spectrum(time, values, 60), core::InputError);  // three samples each
}

TEST(Spectrum, UnevenTimesAndUnknownValuesAreRejected) {
  auto [time, values] = noise(20);
  EXPECT_NO_THROW(power_spectrum(time, values, Taper::none));
  time[7] += 0.02 * 8e-3;
  EXPECT_NO_THROW(power_spectrum(time, values, Taper::none));  // records at the ends of steps
  time[7] += 0.02 * 4e-3;
  EXPECT_THROW(power_spectrum(time, values, Taper::none), core::InputError);
  time[7] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(power_spectrum(time, values, Taper::none), core::InputError);
  const auto [good, others] = noise(20);
  values[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(power_spectrum(good, values, Taper::none), core::InputError);
  EXPECT_THROW(power_spectrum({1.0, 2.0, 3.0}, {1.0, 2.0, 1.0}, Taper::none), core::InputError);
  EXPECT_THROW(power_spectrum(good, {1.0}, Taper::none), core::InputError);
}

}  // namespace
}  // namespace grainclock::silo
