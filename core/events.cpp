#include "core/events.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace grainclock::core {

namespace {

/// A cubic on the unit interval.
struct Cubic {
  double c0, c1, c2, c3;
  double operator()(double u) const { return ((c3 * u + c2) * u + c1) * u + c0; }
  Cubic derivative() const { return {c1, 2.0 * c2, 3.0 * c3, 0.0}; }
  /// No sign change on the unit interval for sure: it lies between its Bernstein coefficients.
  bool keeps_sign() const {
    const double b[4] = {c0, c0 + c1 / 3.0, c0 + (2.0 * c1 + c2) / 3.0, c0 + c1 + c2 + c3};
    return (b[0] > 0.0 && b[1] > 0.0 && b[2] > 0.0 && b[3] > 0.0) || (b[0] < 0.0 && b[1] < 0.0 && b[2] < 0.0 && b[3] < 0.0);
  }
};

/// Branch changes of one step: at most 3 roots for each of 4 functions, and the ends.
struct Splits {
  std::array<double, 14> at{};
  int n = 0;
  void add(double u) { at[n++] = u; }
};

/// Real roots of a quadratic c0 + c1 u + c2 u2 inside (0, 1), in order.
int quadratic_roots(double c0, double c1, double c2, double* out) {
  int n = 0;
  const auto keep = [&](double u) {
    if (u > 0.0 && u < 1.0) out[n++] = u;
  };
  const double discriminant = c1 * c1 - 4.0 * c2 * c0;
  if (discriminant < 0.0) return 0;
  const double q = -0.5 * (c1 + std::copysign(std::sqrt(discriminant), c1));
  if (c2 != 0.0) keep(q / c2);
  if (q != 0.0) keep(c0 / q);
  if (n == 2 && out[0] > out[1]) std::swap(out[0], out[1]);
  return n;
}

/// Where a cubic changes sign in (low, high), on which it is monotone: Newton's steps, halves where these lead out.
double root_between(const Cubic& f, double low, double high) {
  const Cubic slope = f.derivative();
  const bool sign = f(low) > 0.0;
  double u = 0.5 * (low + high);
  for (int k = 0; k < 60 && high - low > 1e-15; ++k) {
    const double value = f(u);
    ((value > 0.0) == sign ? low : high) = u;
    const double next = u - value / slope(u);
    const double to = next > low && next < high ? next : 0.5 * (low + high);
    if (std::abs(to - u) <= 1e-16) break;
    u = to;
  }
  return u;
}

/// Adds the sign changes of a cubic inside (0, 1) that `matters`.
template <class Matters>
void add_roots(const Cubic& f, Splits& splits, Matters matters) {
  if (f.keeps_sign()) return;
  std::array<double, 4> bound{0.0, 0.0, 0.0, 1.0};
  double turning[2];
  const int turns = quadratic_roots(f.c1, 2.0 * f.c2, 3.0 * f.c3, turning);
  for (int k = 0; k < turns; ++k) bound[k + 1] = turning[k];
  bound[turns + 1] = 1.0;
  for (int piece = 0; piece <= turns; ++piece) {
    const double low = bound[piece], high = bound[piece + 1];
    if ((f(low) > 0.0) == (f(high) > 0.0)) continue;
    const double root = root_between(f, low, high);
    if (matters(root)) splits.add(root);
  }
}

constexpr double kGaussPoint[2] = {0.339981043584856264803, 0.861136311594052575224};
constexpr double kGaussWeight[2] = {0.652145154862546142627, 0.347854845137453857373};

}  // namespace

EventCorrection event_correction(const ContactLaw& law, const Approach& start, const Approach& end, double h) {
  const double d0 = start.overlap, d1 = end.overlap, s0 = h * start.rate, s1 = h * end.rate;
  const Cubic overlap{d0, s0, 3.0 * (d1 - d0) - 2.0 * s0 - s1, 2.0 * (d0 - d1) + s0 + s1};
  const Cubic slope = overlap.derivative();  // h times the rate

  Splits splits;
  splits.add(0.0);
  const auto always = [](double) { return true; };
  add_roots(overlap, splits, always);
  if (!law.tension) {
    const double k = law.k, c = law.c / h;
    add_roots({k * overlap.c0 + c * slope.c0, k * overlap.c1 + c * slope.c1, k * overlap.c2 + c * slope.c2, k * overlap.c3},
              splits, [&](double u) { return overlap(u) > 0.0; });
  }
  if (law.reach > 0.0) {
    add_roots({overlap.c0 + law.reach, overlap.c1, overlap.c2, overlap.c3}, splits, always);
    add_roots(slope, splits, [&](double u) { return overlap(u) <= 0.0 && overlap(u) >= -law.reach; });
  }
  EventCorrection out;
  if (splits.n == 1) return out;
  std::sort(splits.at.begin(), splits.at.begin() + splits.n);
  splits.add(1.0);

  const auto power = [&](double d, double rate, double force) { return (force - (d > 0.0 ? law.k * d : 0.0)) * rate; };
  double impulse = 0.0, moment = 0.0, work = 0.0;  // integrals of F, (1 - u) F, power over u
  double busiest = 0.0;
  for (int piece = 0; piece + 1 < splits.n; ++piece) {
    const double half = 0.5 * (splits.at[piece + 1] - splits.at[piece]);
    const double middle = 0.5 * (splits.at[piece + 1] + splits.at[piece]);
    for (int g = 0; g < 4; ++g) {
      const double u = middle + (g % 2 == 0 ? -half : half) * kGaussPoint[g / 2];
      const double weight = half * kGaussWeight[g / 2];
      const double d = overlap(u), rate = slope(u) / h;
      const double force = contact_force(law, d, rate);
      impulse += weight * force;
      moment += weight * (1.0 - u) * force;
      work += weight * power(d, rate, force);
      busiest = std::max(busiest, std::abs(force));
    }
  }
  const double f0 = contact_force(law, d0, start.rate), f1 = contact_force(law, d1, end.rate);
  if (busiest == 0.0 && f0 == 0.0 && f1 == 0.0) return out;  // clamped or apart throughout
  out.is_event = true;
  out.impulse = h * (impulse - 0.5 * (f0 + f1));
  out.displacement = h * h * (moment - 0.5 * f0);
  out.dissipated = h * (work - 0.5 * (power(d0, start.rate, f0) + power(d1, end.rate, f1)));
  return out;
}

EventBook::EventBook(const ForceScale& scale, double half_tick) : scale_(scale), half_tick_(half_tick) {}

void EventBook::examine_pair(const BallRow& a, const BallRow& b, std::uint32_t i, std::uint32_t j, const Vec3& a_i,
                             const Vec3& a_j, const SweepLaw& law, double h) {
  const double radii = a.r + b.r;
  const Vec3 x = position(a) - position(b), v = velocity(a) - velocity(b), bend = a_i - a_j;
  const auto approach = [radii](const Vec3& dx, const Vec3& dv) {
    const double distance = dx.norm();
    return Approach{radii - distance, -dv.dot(dx) / distance};
  };
  // Both balls have come along parabolas, so the start of the step is known without having been stored.
  const Approach start = approach(x - h * v + (0.5 * h * h) * bend, v - h * bend);
  const Approach end = approach(x, v);
  const EventCorrection found = event_correction(law.law, start, end, h);
  if (!found.is_event) return;
  const double damping = contact_force(law.law, end.overlap, end.rate) - std::max(0.0, law.law.k * end.overlap);
  const Vec3 normal = x / x.norm();
  Entry entry{};
  entry.i = i;
  entry.j = j;
  entry.both = law.both;
  for (int k = 0; k < 3; ++k) {
    entry.impulse[k] = std::llround(found.impulse * normal[k] / impulse_unit());
    entry.displacement[k] = std::llround(found.displacement * normal[k] / displacement_unit());
    entry.damping[k] = std::llround(damping * normal[k] / scale_.unit);
  }
  entry.dissipated = std::llround(found.dissipated / energy_unit());
  entry.magnitude = std::llround(std::abs(found.impulse) / energy_unit());
  entries_.push_back(entry);
}

std::vector<Shift> shifts(const std::vector<EventBook::Entry>& entries) {
  std::vector<Shift> sums;
  for (const EventBook::Entry& e : entries) {
    sums.push_back({e.i, {e.displacement[0], e.displacement[1], e.displacement[2]}, {e.damping[0], e.damping[1], e.damping[2]}});
    if (!e.both) continue;
    sums.push_back({e.j, {-e.displacement[0], -e.displacement[1], -e.displacement[2]}, {-e.damping[0], -e.damping[1], -e.damping[2]}});
  }
  std::sort(sums.begin(), sums.end(), [](const Shift& a, const Shift& b) { return a.row < b.row; });
  std::size_t last = 0;
  for (std::size_t k = 1; k < sums.size(); ++k) {
    if (sums[k].row == sums[last].row) {
      for (int axis = 0; axis < 3; ++axis) {
        sums[last].displacement[axis] += sums[k].displacement[axis];
        sums[last].damping[axis] += sums[k].damping[axis];
      }
    } else {
      sums[++last] = sums[k];
    }
  }
  if (!sums.empty()) sums.resize(last + 1);
  return sums;
}

}  // namespace grainclock::core
