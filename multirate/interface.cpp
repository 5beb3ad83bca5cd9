#include "multirate/interface.hpp"

#include "core/check.hpp"

namespace grainclock::multirate {

namespace {

struct Offer {
  core::Interface interface;
  std::unique_ptr<InterfaceStrategy> (*make)(const InterfaceSetup&);
  bool takes_events;     // stepping.events
  double least_damping;  // see least_damping_ratio()
};
constexpr Offer kOffers[] = {{core::Interface::accumulate, make_accumulate, true, 0.02},
                             {core::Interface::frozen, make_frozen, false, 0.02},
                             {core::Interface::impulse, make_impulse, false, 0.3},
                             {core::Interface::extrapolate, make_extrapolate, true, 0.1}};

const Offer& offer_of(core::Interface interface) {
  for (const Offer& offer : kOffers) {
    if (offer.interface == interface) return offer;
  }
  throw core::InputError(fmt::format("stepping.interface = \"{}\" is not offered", name(interface)));
}

}  // namespace

double least_damping_ratio(core::Interface interface) { return offer_of(interface).least_damping; }

std::unique_ptr<InterfaceStrategy> make_interface(const core::Stepping& stepping, const InterfaceSetup& setup) {
  const Offer& offer = offer_of(stepping.interface);
  GC_REQUIRE(offer.takes_events || !stepping.events,
             "stepping.events = true does not go with stepping.interface = \"{}\"; set events = false, or use "
             "\"accumulate\" or \"extrapolate\"",
             name(stepping.interface));
  return offer.make(setup);
}

}  // namespace grainclock::multirate
