// What is recorded between frames: sums over the wall against the contacts themselves.
#include "silo/observables.hpp"

#include "multirate/stepper.hpp"
#include "tests/support/gated_run.hpp"

#include <cmath>
#include <map>

namespace grainclock::silo {
namespace {

using core::Kind;
using core::State;
using core::Vec3;

/// Half of the tray's rim, seen from its corner.
const Patch kPatch{0.8, 0.2, 0.5, 0.5};

std::vector<double> value_of(const std::vector<Observable>& all, const std::string& name) {
  for (const Observable& one : all)
    if (one.name == name) return one.values;
  return {};
}

std::unique_ptr<core::Stepper> after(double seconds, const State& state) {
  core::StepperSetup setup;
  setup.stepping.method = core::Method::uniform;
  setup.stepping.step = 1e-4;
  auto stepper = core::make_uniform_stepper(state, setup);
  stepper->advance(std::llround(seconds / 1e-4));
  return stepper;
}

TEST(ObserveBetween, WallSumsAreThoseOfTheContacts) {
  // With a plug in the floor, whose forces do not count, and with a floor that is wall.
  for (const State& start : {tests::gated_tray(), tests::tray(5, 8, 1)}) {
    const auto stepper = after(0.5, start);
    const WatchedWall wall = watch_wall(start, kPatch);
    const std::vector<Observable> found = observe_between(*stepper, wall, 3);
    const State now = stepper->state();

    // Straight from the definitions.
    const std::vector<Vec3> force = forces_on_wall(now, stepper->contacts());
    std::vector<double> lateral(2 * static_cast<std::size_t>(wall.layers->n));
    double x = 0.0, y = 0.0, size = 0.0, on_patch = 0.0, patch_area = 0.0;
    for (std::size_t i = 0; i < now.size(); ++i) {
      if (now.kind[i] != Kind::wall) continue;
      const std::size_t layer = *layer_of(*wall.layers, now.position[i].z());
      lateral[2 * layer] += force[i].x();
      lateral[2 * layer + 1] += force[i].y();
      x += force[i].x();
      y += force[i].y();
      size += force[i].norm();
      if (!kPatch.holds(now.position[i])) continue;
      on_patch += std::hypot(force[i].x(), force[i].y());
      patch_area += 4.0 * now.radius[i] * now.radius[i];
    }
    ASSERT_GT(size, 0.0);
    ASSERT_GT(on_patch, 0.0);
    const double rounding = 1e-9 + 1e-13 * size;  // a force unit, 2^-36 N or near it, per contact; sums in doubles
    const auto expect_near = [&](const char* name, const std::vector<double>& wanted, double tolerance) {
      const std::vector<double> its = value_of(found, name);
      ASSERT_EQ(its.size(), wanted.size()) << name;
      for (std::size_t k = 0; k < its.size(); ++k) EXPECT_NEAR(its[k], wanted[k], tolerance) << name << " " << k;
    };
    expect_near("lateral_force", {x, y}, rounding);
    expect_near(kLateralForceByLayer, lateral, rounding);
    expect_near(kWallForceByLayer, wall_force_by_layer(now, stepper->contacts(), *wall.layers), rounding);
    expect_near("patch_pressure", {on_patch / patch_area}, rounding / patch_area);
    expect_near("phase", {3.0}, 0.0);
    expect_near("discharged", {static_cast<double>(stepper->ledger().discharged)}, 0.0);
    expect_near("kinetic_energy", {stepper->kinetic_energy()}, 0.0);
  }
}

TEST(ObserveBetween, WithoutAWallOnlyMotionIsRecorded) {
  State start;
  start.add(0, Kind::content, Vec3(0, 0, 1), Vec3(1, 2, 3), 0.2);
  const auto stepper = after(0.1, start);
  const std::vector<Observable> found = observe_between(*stepper, watch_wall(start, kPatch), 0);
  EXPECT_EQ(found.size(), 5u);
  EXPECT_TRUE(value_of(found, kWallForceByLayer).empty());
  const double mass = core::Materials{}.mass(0.2);
  EXPECT_NEAR(value_of(found, "momentum")[1], 2.0 * mass, 1e-9 * mass);                   // 2^-38 of it
  EXPECT_NEAR(value_of(found, "momentum")[2], (3.0 - 9.81 * 0.1) * mass, 1e-9 * mass);  // after 0.1 s
}

TEST(WatchedWall, PatchAboveTheHopperIsThreeDiametersHighAndWide) {
  SiloShape shape;
  shape.r_min = 0.2;
  shape.r_max = 0.3;
  shape.half_width = 5.0;
  shape.hopper_height = 4.0;
  const Patch patch = patch_above_hopper(shape);
  EXPECT_DOUBLE_EQ(patch.z, 4.75);  // rounding only, as below
  EXPECT_DOUBLE_EQ(patch.half_height, 0.75);
  EXPECT_DOUBLE_EQ(patch.half_angle, 0.15);
  EXPECT_TRUE(patch.holds({5.0, 0.0, 4.1}) && patch.holds({5.0 * std::cos(0.14), -5.0 * std::sin(0.14), 5.4}));
  EXPECT_FALSE(patch.holds({5.0, 0.0, 3.9}) || patch.holds({5.0, 0.8, 4.5}) || patch.holds({-5.0, 0.0, 4.5}));
}

}  // namespace
}  // namespace grainclock::silo
