// Stability bound of a step with springs and dashpots, per ball.
#pragma once

#include "core/scene.hpp"
#include "core/state.hpp"

namespace grainclock::core {

/// q of the bound h2 k + q h c <= 4 m: 2 for lagged dashpots, 4 for predicted ones. pece takes longer steps than lagged in
/// any single mode; that it does in coupled ones too is found, not proven (tests/benchmarks/stability_theory.cpp).
double dashpot_factor(Integrator integrator);

struct StepBounds {
  double smallest = 0.0;    // s, over all balls; infinity without contacts
  BallId at = -1;           // the ball that sets it
  double bulk = 0.0;        // s, smallest over balls that touch no fixed ball
  double wall = 0.0;        // s, smallest over balls that touch one
  std::vector<double> per_ball;  // s, one per content ball in order of id; infinity without contacts
};

/// For every content ball the largest h for which the largest eigenvalue of
/// sum_j (h2 k_ij + q h c_ij)(1/m_i + 1/m_j) n n^T over its touching contacts is at most 4
/// (fixed partners: 1/m_j = 0). Never unsafe: the sum bounds the packing's spectrum from above.
StepBounds critical_steps(const State& state, const Materials& materials, bool outlet_open, Integrator integrator);

/// The same for one isolated contact of two balls with these inverse masses [1/kg].
double critical_step_of_pair(const PairLaw& law, double inverse_mass_sum, Integrator integrator);

/// Both for uniform steps with any treatment of the dashpots: those that are not explicit leave the springs' bound
/// alone, h2 k <= 4 m for pairwise and solve, h2 k <= m for relaxed.
StepBounds critical_steps(const State& state, const Materials& materials, bool outlet_open, const Stepping& stepping);
double critical_step_of_pair(const PairLaw& law, double inverse_mass_sum, const Stepping& stepping);

}  // namespace grainclock::core
