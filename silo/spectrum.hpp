// Power spectrum of a time series, such as the lateral resultant on the wall or the kinetic energy (conclusions 2 and 4 of
// the paper).
#pragma once

#include <vector>

namespace grainclock::silo {

/// What the samples are weighted with before they are transformed: nothing (an exact period is known), or Hann's
/// window, 1 - cos, which keeps a strong line from leaking over the whole spectrum and widens it to four frequencies.
enum class Taper { none, hann };

/// One-sided power spectral density, from frequency 0 to half the sampling's, in steps of one over the length of the series.
struct Spectrum {
  std::vector<double> frequency;  // Hz
  std::vector<double> density;    // squared unit of the series / Hz
  double step() const { return frequency[1]; }
  /// Sum of density times step: without a taper the variance of the series (Parseval).
  double power() const;
  /// Frequency of the largest density [Hz], at the frequencies that the series resolves; 0 where nothing varies.
  double strongest() const;
};

/// Spectrum of the departures from the mean; `time` [s] is evenly spaced. The length of the series is n times the
/// spacing. Any number of samples goes, fastest with small prime factors. Throws InputError below four samples, for uneven
/// times (by a hundredth of the spacing, which shifts phases by 0.03 at the highest frequency), and values that are not finite.
Spectrum power_spectrum(const std::vector<double>& time, const std::vector<double>& values, Taper taper);

/// Mean of the spectra of so many pieces of equal length, each overlapping the next by half, under Hann's window (Welch): a density
/// whose scatter is smaller by about the root of their number, in steps of one over the length of a piece. Throws InputError as
/// power_spectrum, and unless pieces >= 1 with four samples each.
Spectrum mean_spectrum(const std::vector<double>& time, const std::vector<double>& values, int pieces);

}  // namespace grainclock::silo
