#include "silo/pressure_theory.hpp"

#include "core/check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace grainclock::silo {
namespace {

using core::Contact;
using core::Kind;
using core::State;

constexpr double kPi = std::numbers::pi;
constexpr double kG = 9.81;

/// Hopper from (1, 0) to (5, 5), shaft to 25 m; or a flat bottom.
Meridian walls(double hopper_height = 5.0, double height = 20.0) {
  SiloShape shape;
  shape.hopper_height = hopper_height;
  shape.height = height;
  return meridian(shape);
}

/// The wall of a silo alone.
State wall_of(const SiloShape& shape) {
  State state;
  for (const FixedBall& ball : build_walls(shape, 1).wall)
    state.add(std::ssize(state.id), Kind::wall, ball.at, Vec3::Zero(), ball.radius);
  return state;
}

/// Vertical stress at z by the slices' equation with tiny steps of fourth order, from the surface down.
double sliced(const Heap& heap, double mu, double lateral, double b, double z) {
  const auto slope = [&](double at, double stress) {  // d(stress)/d(depth)
    const double weight = heap.density * heap.gravity;
    if (at > 5.0) return weight - mu * lateral * stress / 2.5;
    const double tangent = 0.8, x = at + 1.25, perimeter_over_area = 2.0 / (x * tangent);
    const double mu_h = std::min(mu, (1.0 - lateral) / (2.0 * tangent)), f = 1.0 - b / (1.0 + tangent / mu_h);
    // d(stress x^2)/dx: weight down, wall normal and shear up.
    return weight - f * stress * (tangent + mu_h) * perimeter_over_area + 2.0 * stress / x;
  };
  double stress = 0.0;
  const auto fall = [&](double from, double to, int steps, double offset) {
    const double h = (from - to) / steps;
    for (int i = 0; i < steps; ++i) {
      const double at = from - i * h + offset;
      const double k1 = slope(at, stress), k2 = slope(at - 0.5 * h, stress + 0.5 * h * k1);
      const double k3 = slope(at - 0.5 * h, stress + 0.5 * h * k2), k4 = slope(at - h, stress + h * k3);
      stress += h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4);
    }
  };
  const double joint = std::min(heap.surface, 5.0);
  if (heap.surface > 5.0) fall(heap.surface, std::max(z, 5.0), 2000, 1e-12);  // stays on the shaft's side of the joint
  if (z < joint) fall(joint, z, 2000, -1e-12);
  return stress;
}

TEST(PressureTheory, DeepShaftsSaturate) {
  const Heap heap{780.0, 1000.0};
  const WallStress deep = janssen(walls(0.0, 1e3), heap, {0.4, 0.5}, 10.0);
  // R = radius/2; 990 m are 79 decay lengths: rounding.
  EXPECT_NEAR(deep.vertical / (780.0 * kG * 2.5 / (0.4 * 0.5)), 1.0, 1e-14);
  EXPECT_NEAR(deep.horizontal / (780.0 * kG * 2.5 / 0.4), 1.0, 1e-14);
  EXPECT_NEAR(deep.shear / (780.0 * kG * 2.5), 1.0, 1e-14);  // the wall carries it all
}

TEST(PressureTheory, ShallowShaftsAreHydrostatic) {
  const Heap heap{780.0, 20.0};
  const double decay = 2.5 / (0.4 * 0.5);
  for (const double depth : {1e-6, 1e-3, 0.1}) {
    const WallStress stress = janssen(walls(), heap, {0.4, 0.5}, 20.0 - depth);
    const double series = 780.0 * kG * depth * (1.0 - 0.5 * depth / decay);
    // Next term of the exponential's series, and rounding of the depth.
    EXPECT_NEAR(stress.vertical / series, 1.0, depth * depth / (6.0 * decay * decay) * 1.01 + 1e-14 / depth) << depth;
    EXPECT_DOUBLE_EQ(stress.normal, 0.5 * stress.vertical);
  }
}

TEST(PressureTheory, SatisfiesTheSlicesEquation) {
  for (const double surface : {4.0, 5.0, 12.0, 24.0})
    for (const auto& law :
         {WallLaw{0.05, 0.6}, WallLaw{0.3, 0.5}, WallLaw{0.3, 0.5, 1.0}, WallLaw{0.3, 0.9, 0.0}, WallLaw{0.5, 0.2, 0.0}})
      for (const double z : {0.0, 0.7, 3.0, 4.999, 5.001, 9.0, 11.5}) {
        const Heap heap{800.0, surface};
        const double expected = z < surface ? sliced(heap, law.friction, law.lateral, law.hopper_deficit, z) : 0.0;
        // Rounding of 4,000 steps and 1e-12 m between the branches: 1e-13 found; the fourth-order error is below that.
        const double found = janssen(walls(), heap, law, z).vertical;
        EXPECT_NEAR(found, expected, 1e-11 * 800.0 * kG * 24.0) << surface << " " << z << " " << law.friction;
      }
}

TEST(PressureTheory, HopperIsSmoothThroughTheExponentOne) {
  // n = 2 (1 - b) mu / tan(beta) = 1 at mu = 0.4, b = 0; the shear limit (1 - K)/(2 tan) = 0.5 is beyond it.
  const Heap heap{800.0, 12.0};
  const auto at = [&](double mu) { return janssen(walls(), heap, {mu, 0.2, 0.0}, 2.0).vertical; };
  // Central value of a smooth function: second differences of 1e-5 are below 1e-9 of it.
  EXPECT_NEAR(0.5 * (at(0.4 - 1e-5) + at(0.4 + 1e-5)) / at(0.4), 1.0, 1e-9);
  const double top = 6.25, x = 3.25, load = janssen(walls(), heap, {0.4, 0.2, 0.0}, 5.0).vertical;
  EXPECT_NEAR(at(0.4) / (800.0 * kG * x * std::log(top / x) + load * x / top), 1.0, 1e-12);  // rounding
}

TEST(PressureTheory, WithoutFrictionItIsALiquid) {
  const Heap heap{650.0, 18.0};
  for (const double z : {0.0, 1.0, 4.9, 5.0, 10.0, 17.99, 18.0, 30.0}) {
    const WallStress limit = janssen(walls(), heap, {0.0, 1.0}, z), liquid = frictionless(walls(), heap, z);
    const double pressure = 650.0 * kG * std::max(0.0, 18.0 - z);
    // Rounding.
    EXPECT_NEAR(liquid.vertical, pressure, 1e-9);
    EXPECT_NEAR(limit.vertical, pressure, 1e-8) << z;
    EXPECT_NEAR(limit.normal, liquid.normal, 1e-8);
    EXPECT_NEAR(limit.horizontal, liquid.horizontal, 1e-8);
    EXPECT_EQ(limit.shear, 0.0);
  }
  // In the hopper only cos(beta) = 5/sqrt(41) of the pressure on the wall is horizontal.
  EXPECT_DOUBLE_EQ(frictionless(walls(), heap, 2.0).horizontal, 650.0 * kG * 16.0 * 5.0 / std::sqrt(41.0));
  EXPECT_DOUBLE_EQ(frictionless(walls(), {kWaterDensity, 18.0}, 8.0).horizontal, 98100.0);
}

TEST(PressureTheory, WallsAndOutletCarryTheWeight) {
  // Shear, pressure on the hopper and the stress left at the outlet, summed over a round silo, hold the heap's weight.
  const Heap heap{800.0, 22.0};
  const WallLaw law{0.3, 0.5};
  const auto carried = [&](double from, double to, double half_width_at_0, double tangent) {
    const int n = 4000;
    double sum = 0.0;
    for (int i = 0; i < n; ++i) {
      const double z = from + (to - from) * (i + 0.5) / n;
      const WallStress stress = janssen(walls(), heap, law, z);
      sum += 2.0 * kPi * (half_width_at_0 + tangent * z) * (stress.normal * tangent + stress.shear) * (to - from) / n;
    }
    return sum;
  };
  const double on_outlet = kPi * janssen(walls(), heap, law, 0.0).vertical;
  const double held = carried(0.0, 5.0, 1.0, 0.8) + carried(5.0, 22.0, 5.0, 0.0) + on_outlet;
  const double weight = 800.0 * kG * (kPi * 25.0 * 17.0 + kPi * 5.0 * (25.0 + 5.0 + 1.0) / 3.0);
  EXPECT_NEAR(held / weight, 1.0, 1e-6);  // midpoint rule, 4,000 slices
}

TEST(PressureTheory, NothingAboveTheHeapNorBelowTheSilo) {
  const Heap heap{800.0, 12.0};
  EXPECT_EQ(janssen(walls(), heap, {0.3, 0.5}, 12.0).vertical, 0.0);
  EXPECT_EQ(janssen(walls(), heap, {0.3, 0.5}, 20.0).horizontal, 0.0);
  EXPECT_EQ(janssen(walls(), {800.0, 3.0}, {0.3, 0.5}, 4.0).normal, 0.0);   // in the hopper
  EXPECT_EQ(janssen(walls(), heap, {0.3, 0.5}, -1.25).vertical, 0.0);       // the apex
  EXPECT_EQ(janssen(walls(0.0), heap, {0.3, 0.5}, -0.1).vertical, 0.0);     // below a flat bottom
  EXPECT_GT(janssen(walls(0.0), heap, {0.3, 0.5}, 0.0).vertical, 0.0);
}

TEST(PressureTheory, ImpossibleParametersAreRejected) {
  EXPECT_THROW(janssen(walls(), {0.0, 12.0}, {0.3, 0.5}, 1.0), core::InputError);
  EXPECT_THROW(janssen(walls(), {800.0, 12.0, -9.81}, {0.3, 0.5}, 1.0), core::InputError);
  EXPECT_THROW(janssen(walls(), {800.0, 12.0}, {-0.1, 0.5}, 1.0), core::InputError);
  EXPECT_THROW(janssen(walls(), {800.0, 12.0}, {0.3, 0.0}, 1.0), core::InputError);
  EXPECT_THROW(janssen(walls(), {800.0, 12.0}, {0.3, 0.5, 1.1}, 1.0), core::InputError);
  EXPECT_THROW(janssen(walls(), {800.0, 12.0}, {std::nan(""), 0.5}, 1.0), core::InputError);
  EXPECT_THROW(frictionless(walls(), {std::nan(""), 12.0}, 1.0), core::InputError);
}

TEST(PressureTheory, HydrostaticColumnOnHandMadeContactsIsFrictionless) {
  // Every wall ball of the silo is pushed along its normal by rho g depth on its square.
  const SiloShape shape;
  const Meridian wall = meridian(shape);
  const Heap heap{kWaterDensity, 21.0};
  State state = wall_of(shape);
  const core::BallId content = std::ssize(state.id);
  state.add(content, Kind::content, {0.0, 0.0, 10.0}, Vec3::Zero(), 0.22);
  std::vector<Contact> contacts;
  for (const WallLoad& load : wall_loads(state, {}, shape)) {
    const double push = kWaterDensity * kG * std::max(0.0, 21.0 - load.position[2]) * load.area;
    contacts.push_back({content, load.id, Kind::wall, 0.0, 0.0, -push * load.normal});
  }
  const auto loads = wall_loads(state, contacts, shape);
  const Layers layers{0.0, 25.0, 25};
  std::vector<double> theory;
  for (const WallLoad& load : loads) theory.push_back(frictionless(wall, heap, load.position[2]).horizontal);
  const auto expected = mean_by_layer(loads, theory, layers), found = pressure_by_layer(loads, layers);
  for (std::size_t k = 0; k < found.size(); ++k) EXPECT_NEAR(found[k], expected[k], 1e-8) << k;  // rounding of 2e5 Pa
  EXPECT_EQ(found[24], 0.0);  // above the surface
  const auto ratios = ratios_by_layer(loads, stress_by_layer(state, contacts, shape, layers), layers);
  for (std::size_t k = 0; k < 21; ++k) EXPECT_NEAR(ratios[k].friction, 0.0, 1e-12) << k;  // rounding
}

TEST(PressureTheory, LevelHeapOfAFlatBottomIsTwiceAsHighAsItsCentre) {
  SiloShape shape;
  shape.hopper_height = 0.0;
  shape.surface = Surface::inner;
  State state;
  state.add(0, Kind::content, {0.0, 0.0, 3.0}, Vec3::Zero(), 0.2);
  state.add(1, Kind::content, {1.0, 0.0, 6.0}, Vec3::Zero(), 0.2);
  state.add(2, Kind::content, {1.0, 0.0, -1.0}, Vec3::Zero(), 0.9);  // has left
  state.add(3, Kind::wall, {1.0, 0.0, 9.0}, Vec3::Zero(), 0.9);
  const Heap heap = level_heap(state, shape, 1250.0);
  EXPECT_NEAR(heap.surface, 9.0, 1e-13);  // rounding
  EXPECT_NEAR(heap.density / (2.0 * 1250.0 * 4.0 / 3.0 * kPi * 0.008 / (kPi * 25.0 * 9.0)), 1.0, 1e-13);
  EXPECT_THROW(level_heap({}, shape, 1250.0), core::InputError);
}

TEST(PressureTheory, LevelHeapFindsTheSurfaceOfAnEvenFill) {
  for (const Section section : {Section::round, Section::square})
    for (const double surface : {3.1, 5.0, 17.3}) {
      SiloShape shape;
      shape.section = section;
      const Meridian inside = inside_of(shape);
      State state;
      const double step = 0.1;
      for (double z = inside.outlet.z + 0.5 * step; z < surface; z += step)
        for (double x = -5.0 + 0.5 * step; x < 5.0; x += step)
          for (double y = -5.0 + 0.5 * step; y < 5.0; y += step)
            if (depth_inside(section, inside, {x, y, z}) > 0.0)
              state.add(std::ssize(state.id), Kind::content, {x, y, z}, Vec3::Zero(), 0.03);
      const Heap heap = level_heap(state, shape, 1000.0);
      // The grid's surface is off by up to half a step (and by all of it between centre and mass, the centre counts twice).
      EXPECT_NEAR(heap.surface, surface, step);
      const double density = 1000.0 * 4.0 / 3.0 * kPi * 2.7e-5 / (step * step * step);
      EXPECT_NEAR(heap.density / density, 1.0, step / surface * 2.0);  // the same over the height, sections widen
    }
}

TEST(PressureTheory, StressOfAChainIsItsForceOverTheSection) {
  SiloShape shape;
  State state;
  std::vector<Contact> contacts;
  for (int i = 0; i < 20; ++i) state.add(i, Kind::content, {0.1 * i, 0.0, 8.0 + 0.4 * i}, Vec3::Zero(), 0.21);
  // A force of 900 N down the chain along its lines (0.1, 0, 0.4): the upper ball is pushed up.
  const Vec3 push = 900.0 / 0.4 * Vec3(0.1, 0.0, 0.4);
  for (int i = 1; i < 20; ++i) contacts.push_back({i, i - 1, Kind::content, 0.0, 0.0, push});
  const double section = kPi * 4.78 * 4.78;
  for (const int n : {1, 3, 50}) {
    const auto stress = stress_by_layer(state, contacts, shape, {9.0, 15.0, n});
    for (const LayerStress& layer : stress) {
      // Rounding.
      EXPECT_NEAR(layer.vertical * section, 900.0, 1e-9);
      EXPECT_NEAR(layer.horizontal * section, 0.5 * 900.0 / 16.0, 1e-9);  // (0.1/0.4)^2 in x, nothing in y
    }
  }
}

TEST(PressureTheory, VerticalStressIsTheMeanForceThroughPlanes) {
  SiloShape shape;
  State state;
  std::vector<Contact> contacts;
  state.add(0, Kind::content, {0.0, 0.0, 10.0}, Vec3::Zero(), 0.2);
  state.add(1, Kind::content, {0.1, 0.0, 10.37}, Vec3::Zero(), 0.2);
  state.add(2, Kind::content, {0.1, 0.2, 10.61}, Vec3::Zero(), 0.2);
  state.add(3, Kind::content, {0.3, 0.2, 10.61}, Vec3::Zero(), 0.2);
  state.add(4, Kind::wall, {0.3, 0.2, 11.01}, Vec3::Zero(), 0.25);
  contacts.push_back({0, 1, Kind::content, 0.0, 0.0, {0.0, 0.0, -100.0}});
  contacts.push_back({2, 1, Kind::content, 0.0, 0.0, {0.0, 10.0, 70.0}});
  contacts.push_back({3, 2, Kind::content, 0.0, 0.0, {50.0, 0.0, 5.0}});  // level: crosses no plane
  contacts.push_back({3, 4, Kind::wall, 0.1, 0.0, {0.0, 0.0, -30.0}});    // ends 0.2 - 0.05 above its ball
  const double section = kPi * 4.78 * 4.78;
  const int planes = 100000;
  double sum = 0.0;
  for (int i = 0; i < planes; ++i) {
    const double z = 10.2 + 0.7 * (i + 0.5) / planes;
    if (z < 10.37) sum += 100.0;
    if (z > 10.37 && z < 10.61) sum += 70.0;
    if (z > 10.61 && z < 10.76) sum += 30.0;
  }
  const auto stress = stress_by_layer(state, contacts, shape, {10.2, 10.9, 1});
  EXPECT_NEAR(stress[0].vertical * section, sum / planes, 100.0 * 3.0 / planes);  // a plane at each of three ends
  EXPECT_NEAR(stress[0].horizontal * section * 0.7, 0.5 * (10.0 * 0.2 + 50.0 * 0.2), 1e-9);  // rounding
  const auto none = stress_by_layer(state, contacts, shape, {-3.0, 0.0, 1});  // no volume below the hopper
  EXPECT_TRUE(std::isnan(none[0].vertical));
  EXPECT_THROW(stress_by_layer(state, {{0, 9, Kind::wall, 0.0, 0.0, Vec3::Zero()}}, shape, {10.2, 10.7, 1}), core::InputError);
}

TEST(PressureTheory, RatiosOfKnownTractionsAreFound) {
  const SiloShape shape;
  const State state = wall_of(shape);
  const Layers layers{1.0, 9.0, 2};
  auto loads = wall_loads(state, {}, shape);
  const double slant = std::sqrt(41.0);
  for (WallLoad& load : loads) {
    const bool in_hopper = load.normal[2] < 0.0;
    const Vec3 flat = Vec3(load.normal[0], load.normal[1], 0.0).normalized();
    const Vec3 down = in_hopper ? Vec3(-flat * 4.0 / slant - Vec3(0.0, 0.0, 5.0 / slant)) : Vec3(0.0, 0.0, -1.0);
    load.force = 2e4 * load.area * (load.normal + (in_hopper ? 0.1 : 0.3) * down);
  }
  const std::vector<LayerStress> stress{{4e4, 1e4}, {5e4, 4e4}};
  const auto ratios = ratios_by_layer(loads, stress, layers);
  // Rounding.
  EXPECT_NEAR(ratios[0].friction, 0.1, 1e-12);
  EXPECT_NEAR(ratios[0].lateral, 0.25, 1e-15);
  EXPECT_NEAR(ratios[0].lateral_at_wall, 0.5, 1e-12);
  EXPECT_NEAR(ratios_by_layer(loads, stress, {6.0, 24.0, 2})[1].friction, 0.3, 1e-12);
  EXPECT_NEAR(ratios_by_layer(loads, stress, {6.0, 24.0, 2})[1].lateral_at_wall, 0.4, 1e-12);
  const std::vector<LayerStress> none{{0.0, 0.0}, {0.0, 0.0}};
  const auto unloaded = ratios_by_layer(wall_loads(state, {}, shape), none, layers);
  EXPECT_TRUE(std::isnan(unloaded[0].friction));
  EXPECT_TRUE(std::isnan(unloaded[0].lateral));
  EXPECT_TRUE(std::isnan(unloaded[0].lateral_at_wall));
  EXPECT_THROW(ratios_by_layer(loads, {}, layers), core::InputError);
}

}  // namespace
}  // namespace grainclock::silo
