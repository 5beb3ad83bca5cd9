// What the kernels are timed on: a state of balls, from a file or made here, laid out as the steppers hold it.
#pragma once

#include "core/force_scale.hpp"
#include "core/neighbours.hpp"

#include <string>

namespace grainclock::kernel_benchmarks {

constexpr double kGravity = 9.81;  // m/s2
constexpr double kStep = 8e-5;     // s, of uniform steps

/// A state and whether its outlet is open: then plug balls count for nothing.
struct Start {
  core::State state;
  bool open = false;
};

/// The state of a file; without one random_packing(20000). Throws what core::read_state() throws.
Start load(const std::string& path, bool open);

/// About as many balls with Table 1's radii as asked for, packed at random in a box of fixed balls that is open
/// above, still settling: as many contacts per ball as a silo's filling has, and the same for every call.
core::State random_packing(std::size_t balls);

/// `copies` of a state in a square, each behind walls of its own.
core::State side_by_side(const core::State& state, int copies);

/// Balls sorted in space, their pairs, and the units of their forces; Table 1's materials.
struct Scene {
  core::Materials materials;
  core::Balls balls;
  core::NeighbourList list;
  core::ForceScale scale;

  /// `weight_bits`: see core::force_scale().
  Scene(const Start& start, const core::Materials& of, int weight_bits);
  const core::PairList& pairs(bool fixed) const { return fixed ? list.fixed_pairs() : list.ball_pairs(); }
  core::SweepLaw law(bool fixed) const { return core::sweep_law(materials, fixed, scale, kStep); }
};

}  // namespace grainclock::kernel_benchmarks
