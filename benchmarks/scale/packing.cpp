#include "benchmarks/scale/packing.hpp"

#include "core/check.hpp"

#include <algorithm>
#include <cmath>

namespace grainclock::scale {

namespace {

constexpr double kResidual = 1e-2;      // rms force over mean contact force at which a packing counts as relaxed
constexpr double kPressureError = 0.2;  // of the wanted pressure; what is reached is measured and kept
constexpr int kMostIterations = 20000;
constexpr double kSkin = 0.1;           // of the mean diameter, of the pair list
constexpr double kLargestStrain = 6e-3; // of an edge, in one change of the box
constexpr double kRung = 4.0;           // at most, from one pressure of a ladder to the next

/// A difference of two points within the box, of the nearest images.
double nearest(double d, double edge) { return d > 0.5 * edge ? d - edge : d < -0.5 * edge ? d + edge : d; }

double mean_diameter(const Packing& packing) {
  double sum = 0.0;
  for (const double r : packing.radius) sum += 2.0 * r;
  return sum / static_cast<double>(packing.radius.size());
}

/// Pairs within a skin, by testing all: a block has a few thousand balls and its list is made a few times.
class Pairs {
 public:
  explicit Pairs(const Packing& packing) : skin_(kSkin * mean_diameter(packing)) {}

  /// Calls visit(i, j, x_i - x_j of the nearest images).
  template <class Visit>
  void each(const Packing& packing, Visit visit) {
    if (is_worn(packing)) build(packing);
    for (const Pair& pair : pairs_) visit(pair.i, pair.j, packing.position[pair.i] - packing.position[pair.j] - pair.shift);
  }

 private:
  bool is_worn(const Packing& packing) const {
    if (built_at_.empty()) return true;
    for (std::size_t i = 0; i < built_at_.size(); ++i) {
      if ((packing.position[i] - built_at_[i]).squaredNorm() > 0.25 * skin_ * skin_) return true;
    }
    return false;
  }
  void build(const Packing& packing) {
    pairs_.clear();
    built_at_ = packing.position;
    std::vector<Vec3> inside = packing.position;
    for (Vec3& x : inside) x -= x.cwiseQuotient(packing.box).array().floor().matrix().cwiseProduct(packing.box);
    const Vec3 box = packing.box;
    for (std::uint32_t i = 0; i < inside.size(); ++i) {
      for (std::uint32_t j = i + 1; j < inside.size(); ++j) {
        const double range = packing.radius[i] + packing.radius[j] + skin_;
        const double z = nearest(inside[i].z() - inside[j].z(), box.z());
        if (std::abs(z) >= range) continue;
        const Vec3 d(nearest(inside[i].x() - inside[j].x(), box.x()), nearest(inside[i].y() - inside[j].y(), box.y()), z);
        if (d.squaredNorm() < range * range) pairs_.push_back({i, j, packing.position[i] - packing.position[j] - d});
      }
    }
  }

  struct Pair {
    std::uint32_t i, j;
    Vec3 shift;  // m
  };
  double skin_;  // m
  std::vector<Vec3> built_at_;
  std::vector<Pair> pairs_;
};

/// Forces [N] on all balls, and what they add up to.
Balance elastic_forces(const Packing& packing, double k, Pairs& pairs, std::vector<Vec3>& force) {
  std::fill(force.begin(), force.end(), Vec3::Zero());
  double virial = 0.0, magnitude = 0.0;
  std::size_t contacts = 0;
  pairs.each(packing, [&](std::uint32_t i, std::uint32_t j, const Vec3& d) {
    const double distance = d.norm(), overlap = packing.radius[i] + packing.radius[j] - distance;
    if (overlap <= 0.0 || distance == 0.0) return;
    const Vec3 f = (k * overlap / distance) * d;
    force[i] += f;
    force[j] -= f;
    virial += k * overlap * distance;
    magnitude += k * overlap;
    ++contacts;
  });
  double squares = 0.0;
  for (const Vec3& f : force) squares += f.squaredNorm();
  const auto n = static_cast<double>(force.size());
  Balance balance;
  balance.pressure = virial / (3.0 * packing.box.prod());
  balance.contacts_per_ball = static_cast<double>(contacts) / n;
  balance.residual = contacts == 0 ? 0.0 : std::sqrt(squares / n) / (magnitude / static_cast<double>(contacts));
  return balance;
}

void scale_box(Packing& packing, double factor) {
  packing.box *= factor;
  for (Vec3& x : packing.position) x *= factor;
}

}  // namespace

Packing cut(const core::State& state, const Vec3& low, const Vec3& box) {
  Packing packing{box, {}, {}};
  for (std::size_t i = 0; i < state.size(); ++i) {
    const Vec3 x = state.position[i] - low;
    if (state.kind[i] != core::Kind::content || (x.array() < 0.0).any() || (x.array() >= box.array()).any()) continue;
    packing.position.push_back(x);
    packing.radius.push_back(state.radius[i]);
  }
  GC_REQUIRE(packing.radius.size() >= 100, "the block holds {} balls only, too few for a packing: take a larger one",
             packing.radius.size());
  return packing;
}

// FIRE (Bitzek et al., Phys. Rev. Lett. 97, 170201): a damped motion that is steered down the slope and
// stopped when it goes up. Unit mass and stiffness, so that times have no unit.
Balance relax(Packing& packing, double k) {
  constexpr double kFirstStep = 0.1, kLargestStep = 0.4, kSteer = 0.1;
  const std::size_t n = packing.position.size();
  std::vector<Vec3> velocity(n, Vec3::Zero()), force(n);
  Pairs pairs(packing);
  double step = kFirstStep, steer = kSteer;
  int downhill = 0;
  Balance balance = elastic_forces(packing, k, pairs, force);
  for (int iteration = 0; iteration < kMostIterations && balance.residual > kResidual; ++iteration) {
    double power = 0.0, speed2 = 0.0, force2 = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
      force[i] /= k;
      power += force[i].dot(velocity[i]);
      speed2 += velocity[i].squaredNorm();
      force2 += force[i].squaredNorm();
    }
    double keep = 0.0, turn = 0.0;
    if (power > 0.0) {
      keep = 1.0 - steer;
      turn = steer * std::sqrt(speed2 / force2);
      if (++downhill > 5) {
        step = std::min(1.1 * step, kLargestStep);
        steer *= 0.99;
      }
    } else {
      downhill = 0;
      step = std::max(0.5 * step, 0.01 * kFirstStep);
      steer = kSteer;
    }
    for (std::size_t i = 0; i < n; ++i) {
      velocity[i] = keep * velocity[i] + (turn + step) * force[i];
      packing.position[i] += step * velocity[i];
    }
    balance = elastic_forces(packing, k, pairs, force);
  }
  return balance;
}

Balance relax_to_pressure(Packing& packing, double k, double pressure) {
  constexpr int kMostChanges = 100;
  // Bulk modulus of a packing that deforms affinely; soon replaced by what is seen.
  const double d = mean_diameter(packing);
  double modulus = static_cast<double>(packing.radius.size()) / packing.box.prod() * k * d * d / 3.0;
  Balance now = relax(packing, k);
  for (int change = 0; std::abs(now.pressure - pressure) > kPressureError * pressure; ++change) {
    if (change == kMostChanges) {
      throw core::NumericsError(fmt::format("the packing's pressure is {:.4g} Pa after {} changes of its box, wanted {:.4g} Pa; "
                                            "take a larger block or a higher pressure",
                                            now.pressure, change, pressure));
    }
    const double strain = std::clamp((now.pressure - pressure) / (3.0 * modulus), -kLargestStrain, kLargestStrain);
    scale_box(packing, 1.0 + strain);
    const Balance next = relax(packing, k);
    const double seen = (now.pressure - next.pressure) / (3.0 * strain);
    if (seen > 0.1 * modulus && seen < 10.0 * modulus) modulus = seen;
    now = next;
  }
  return now;
}

PressureLadder::PressureLadder(Packing packing, double k, double lowest, double highest) : radius_(packing.radius) {
  GC_REQUIRE(lowest > 0.0 && highest > lowest, "pressures from {} to {} Pa: give a range above 0", lowest, highest);
  const int steps = std::max(1, static_cast<int>(std::ceil(std::log(highest / lowest) / std::log(kRung))));
  for (int step = 0; step <= steps; ++step) {
    const double wanted = lowest * std::pow(highest / lowest, static_cast<double>(step) / steps);
    pressure_.push_back(relax_to_pressure(packing, k, wanted).pressure);
    box_.push_back(packing.box);
    std::vector<Vec3>& shares = share_.emplace_back();
    for (const Vec3& x : packing.position) shares.push_back(x.cwiseQuotient(packing.box));
  }
}

PressureLadder::Between PressureLadder::between(double pressure) const {
  if (pressure <= pressure_.front()) return {0, 0.0};
  const auto above = std::upper_bound(pressure_.begin(), pressure_.end(), pressure);
  if (above == pressure_.end()) return {pressure_.size() - 2, 1.0};
  const auto rung = static_cast<std::size_t>(above - pressure_.begin()) - 1;
  return {rung, (pressure - pressure_[rung]) / (pressure_[rung + 1] - pressure_[rung])};
}

Vec3 PressureLadder::box(double pressure) const {
  const auto [rung, weight] = between(pressure);
  if (weight == 0.0) return box_[rung];
  return (1.0 - weight) * box_[rung] + weight * box_[rung + 1];
}

Vec3 PressureLadder::share(std::size_t ball, double pressure) const {
  const auto [rung, weight] = between(pressure);
  if (weight == 0.0) return share_[rung][ball];
  return (1.0 - weight) * share_[rung][ball] + weight * share_[rung + 1][ball];
}

double PressureLadder::number_density(double pressure) const {
  return static_cast<double>(radius_.size()) / box(pressure).prod();
}

}  // namespace grainclock::scale
