// A small block of balls that fills space when it is repeated: the material of the large silos.
//
// Cut out of a filled silo, its faces do not match. They are made to by minimising the
// elastic energy with periodic boundaries, at one pressure after the other.
#pragma once

#include "core/state.hpp"

#include <vector>

namespace grainclock::scale {

using core::Vec3;

/// Balls in a periodic box. Positions may lie outside it: they are continuous from one relaxation to the next.
struct Packing {
  Vec3 box;                    // m, edge lengths
  std::vector<Vec3> position;  // m
  std::vector<double> radius;  // m
};

/// What a relaxed packing carries.
struct Balance {
  double pressure = 0.0;           // Pa
  double contacts_per_ball = 0.0;  // pairs that overlap, over balls
  double residual = 0.0;           // rms force on a ball over the mean contact force
};

/// The content with centres in [low, low + box). Throws InputError if there are fewer than 100 of them.
Packing cut(const core::State& state, const Vec3& low, const Vec3& box);

/// Moves the balls to a minimum of their elastic energy for contacts of stiffness k [N/m].
Balance relax(Packing& packing, double k);

/// Scales the box until the relaxed packing is under about this pressure [Pa].
/// Throws NumericsError if that cannot be reached.
Balance relax_to_pressure(Packing& packing, double k, double pressure);

/// One packing under increasing pressures: what lies above a ball decides how close it is to its neighbours.
class PressureLadder {
 public:
  /// From about `lowest` to about `highest` [Pa] in even ratios. Contacts of stiffness k [N/m].
  PressureLadder(Packing packing, double k, double lowest, double highest);

  /// The box's edges under a pressure [Pa], between the rungs interpolated, beyond them those of the ends.
  Vec3 box(double pressure) const;
  /// A ball's place under a pressure in shares of the box; may lie outside [0, 1).
  Vec3 share(std::size_t ball, double pressure) const;
  const std::vector<double>& radius() const { return radius_; }
  /// Balls per cubic metre under a pressure.
  double number_density(double pressure) const;

 private:
  struct Between {
    std::size_t rung;
    double weight;  // of the next rung
  };
  Between between(double pressure) const;

  std::vector<double> pressure_;            // Pa, of the rungs
  std::vector<Vec3> box_;                   // m
  std::vector<std::vector<Vec3>> share_;
  std::vector<double> radius_;              // m
};

}  // namespace grainclock::scale
