#include "core/force_scale.hpp"

#include <algorithm>
#include <bit>
#include <cmath>

namespace grainclock::core {

ForceScale force_scale(const Materials& materials, double gravity, double length, int weight_bits, std::size_t balls,
                       double limit) {
  if (limit <= 0.0) {
    const double speed = std::sqrt(2.0 * std::max(gravity, 9.81) * 100.0 * length);
    const auto largest = [&](const PairLaw& law) { return law.k * length / 8.0 + law.c * speed; };
    limit = std::max(largest(materials.ball), largest(materials.wall));
  }
  ForceScale scale;
  scale.limit = std::exp2(std::ceil(std::log2(limit)));
  // 62 bits hold weight * sum over at most 16 contacts of one ball.
  scale.unit = scale.limit * std::exp2(weight_bits + 4 - 62);
  scale.total = scale.limit * std::exp2(static_cast<double>(std::bit_width(16 * balls)) - 62.0 + 6.0);
  return scale;
}

SweepLaw sweep_law(const Materials& materials, bool fixed, const ForceScale& scale, double step) {
  const PairLaw& pair = fixed ? materials.wall : materials.ball;
  SweepLaw law;
  law.law = {pair.k, pair.c, materials.cohesion > 0.0 ? materials.cohesion / pair.k : 0.0, materials.tension};
  law.per_unit = 1.0 / scale.unit;
  law.per_total = 1.0 / scale.total;
  law.force_limit = scale.limit;
  law.step = step;
  law.both = !fixed;
  return law;
}

}  // namespace grainclock::core
