#include "core/contact_law.hpp"

#include "tests/support/balls.hpp"

#include <gtest/gtest.h>

#include <limits>

namespace grainclock::core {
namespace {

constexpr double kTiny = std::numeric_limits<double>::denorm_min();

TEST(ContactLaw, SpringForceIsMinusTheSlopeOfElasticEnergy) {
  const ContactLaw law{1e7, 0.0, 0.0, false};
  for (const double overlap : {1e-7, 1e-5, 1e-3, 1e-2}) {
    for (const double rate : {-3.0, 0.0, 3.0}) {
      const double d =
          1e-3 * overlap;  // U is quadratic: the central difference is exact but for rounding of U / d = 1e3 * 1e-16
      const double slope = (elastic_energy(law, overlap + d) - elastic_energy(law, overlap - d)) / (2.0 * d);
      // The overlap falls by as much as the distance grows: F = -dU/dr = dU/d(overlap).
      EXPECT_NEAR(contact_force(law, overlap, rate) / slope, 1.0, 1e-12);
    }
  }
}

TEST(ContactLaw, ApartThereIsNeitherForceNorEnergy) {
  for (const bool tension : {false, true}) {
    const ContactLaw law{1e7, 2e4, 0.0, tension};
    for (const double overlap : {0.0, -kTiny, -1e-9, -1.0}) {
      for (const double rate : {-3.0, 0.0, 3.0}) EXPECT_EQ(contact_force(law, overlap, rate), 0.0);
      EXPECT_EQ(elastic_energy(law, overlap), 0.0);
    }
  }
}

TEST(ContactLaw, DashpotPullsOnlyWithTension) {
  const double k = 1e7, c = 2e4, overlap = 1e-3;
  EXPECT_EQ(contact_force({k, c, 0.0, true}, overlap, -1.0), 1e4 - 2e4);
  EXPECT_EQ(contact_force({k, c, 0.0, false}, overlap, -1.0), 0.0);
  for (const bool tension : {false, true}) {
    EXPECT_EQ(contact_force({k, c, 0.0, tension}, overlap, 1.0), 1e4 + 2e4);
    EXPECT_EQ(contact_force({k, c, 0.0, tension}, overlap, -0.25), 1e4 - 5e3);
  }
}

TEST(ContactLaw, CohesionPullsOnlyWhilePartingWithinReach) {
  const double k = 1e7, reach = 1e-3;  // a pull of 1e4 N at most
  for (const bool tension : {false, true}) {
    const ContactLaw law{k, 2e4, reach, tension};
    EXPECT_EQ(contact_force(law, -0.5e-3, -1.0), -5e3);
    EXPECT_EQ(contact_force(law, -reach, -1.0), -1e4);  // the end belongs to the reach
    EXPECT_EQ(contact_force(law, std::nextafter(-reach, -1.0), -1.0), 0.0);
    for (const double rate : {0.0, 1.0}) EXPECT_EQ(contact_force(law, -0.5e-3, rate), 0.0) << rate;
    EXPECT_EQ(contact_force(law, 0.0, -1.0), 0.0);
    EXPECT_EQ(elastic_energy(law, -0.5e-3), 0.0);
    EXPECT_EQ(contact_force(law, 1e-3, 1.0), 3e4);  // in contact nothing changes
  }
}

}  // namespace
}  // namespace grainclock::core
