// How crystalline the content is: bond-orientational order, and layers along the wall.
//
// A bond is the direction to a near ball of the content; wall balls, which stand in rings, make none. The sixth harmonics of
// a ball's bonds, averaged, give its q6 (Steinhardt, Nelson, Ronchetti, Phys. Rev. B 28, 784, 1983): fcc 0.575, hcp 0.485,
// bcc 0.511, simple cubic 0.354, whatever their orientation. Balls in a crystal are told by bonds alike in orientation (ten
// Wolde, Ruiz-Montero, Frenkel, J. Chem. Phys. 104, 9932, 1996).
#pragma once

#include "core/state.hpp"
#include "silo/geometry.hpp"

#include <cstdint>
#include <vector>

namespace grainclock::silo {

/// Which balls are bonded, and when a ball counts as crystalline.
struct BondRule {
  double reach = 1.3;   // mean diameters of the content between centres: fcc and hcp have 12 balls within 1 and the next at
                        // 1.41, bcc 14 within 1.15 and the next at 1.63, simple cubic 6 within 1 and the next at 1.41
  double alike = 0.7;   // a bond is solid-like if the harmonics of its two balls, made unit vectors, have a larger product
  int solid_bonds = 7;  // a ball is crystalline with at least so many solid-like bonds
};

/// One entry per ball of the state.
struct BondOrder {
  std::vector<double> q6;                 // from 0 to 1; NaN for fixed balls and balls without bonds
  std::vector<std::uint8_t> crystalline;  // 1 or 0; 0 for fixed balls
  double global_q6 = 0.0;                 // of all bonds together, near 0 for many grains or none; NaN without bonds
  double crystalline_share = 0.0;         // of all content balls; NaN without content
};

/// Throws InputError unless rule.reach > 0.
BondOrder bond_order(const core::State& state, const BondRule& rule = {});

/// Centres of the content per volume [1/m3], between two heights, in `n` shells of equal thickness along the wall: from the
/// silo's nominal surface (centres of the wall balls, or their inner points, see Surface) inwards to `depth` [m]. A shell
/// holds its outer edge. Shells of no volume give 0. Throws InputError unless 0 <= z0 < z1, 0 < depth < half width, and n >=
/// 1.
std::vector<double> centres_by_depth(const core::State& state, const SiloShape& shape, double z0, double z1, double depth,
                                     int n);

}  // namespace grainclock::silo
