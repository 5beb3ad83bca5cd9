// The network of contact forces: how forces are distributed, which balls bear next to none, and compression chains.
//
// Chains after J. F. Peters, M. Muthuswamy, J. Wibowo, A. Tordesillas, Phys. Rev. E 72 (2005) 041307: balls whose largest
// principal stress (compression) is above the mean, linked where they touch and the principal directions of both lie
// within 45 degrees of the line of centres; three linked balls at least. A chain may branch.
#pragma once

#include "core/state.hpp"
#include "core/stepper.hpp"

#include <cstdint>
#include <vector>

namespace grainclock::silo {

using core::Vec3;

/// Normal forces of the contacts that push [N], all above zero, in the order of the contacts.
/// Throws InputError if a contact names a ball that the state does not hold (as all functions here do).
std::vector<double> pushing_forces(const core::State& state, const std::vector<core::Contact>& contacts);

struct ForceDistribution {
  double mean = 0.0;            // N
  std::vector<double> density;  // of (force over mean), one per bin; its integral over the bins is 1 - outside
  double outside = 0.0;         // share of the forces that no bin holds
};

/// Distribution of forces [N] over their mean. Bins lie between neighbouring edges (in means, increasing, two at least); each
/// holds its lower edge, the last one also its upper. Zeros without forces. Throws InputError for other edges.
ForceDistribution force_distribution(const std::vector<double>& forces, const std::vector<double>& edges);

/// Share of the content balls whose largest pushing force is below `fraction` of the mean over all pushing contacts of the
/// content (with the wall too); balls that nothing pushes count. 0 without content.
double unloaded_share(const core::State& state, const std::vector<core::Contact>& contacts, double fraction);

/// Largest principal stress of a ball.
struct Load {
  double stress = 0.0;              // Pa, compression above zero; 0 for fixed balls and those without contacts
  Vec3 direction = Vec3::Zero();    // unit vector, one of the two; zero if the stress is
};

/// Of each ball of the state, in its order: the largest eigenvalue of sum r_i N n n^T over its own volume, with its radius r_i
/// and the normal forces N (a pulling one counts below zero) in the directions n of its contacts.
std::vector<Load> largest_compression(const core::State& state, const std::vector<core::Contact>& contacts);

struct Chain {
  std::vector<core::BallId> members;  // increasing, three at least
  int links = 0;                      // members - 1 without loops
  bool branches = false;              // some member has more than two links
  double length = 0.0;                // m, largest distance between centres of two members
};

/// The compression chains of the content, in the order of their smallest members; the mean is over all content balls.
std::vector<Chain> compression_chains(const core::State& state, const std::vector<core::Contact>& contacts);

/// Share of the content balls that are in chains; 0 without content.
double share_in_chains(const core::State& state, const std::vector<Chain>& chains);

}  // namespace grainclock::silo
