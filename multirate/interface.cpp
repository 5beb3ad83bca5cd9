#include "multirate/interface.hpp"

#include "core/check.hpp"

namespace grainclock::multirate {

namespace {

struct Offer {
  core::Interface interface;
  std::unique_ptr<InterfaceStrategy> (*make)(const InterfaceSetup&);
  bool takes_events;  // stepping.events
};
constexpr Offer kOffers[] = {{core::Interface::accumulate, make_accumulate, true},
                             {core::Interface::frozen, make_frozen, false},
                             {core::Interface::impulse, make_impulse, false},
                             {core::Interface::extrapolate, make_extrapolate, true}};

}  // namespace

std::unique_ptr<InterfaceStrategy> make_interface(const core::Stepping& stepping, const InterfaceSetup& setup) {
  for (const Offer& offer : kOffers) {
    if (offer.interface != stepping.interface) continue;
    GC_REQUIRE(offer.takes_events || !stepping.events,
               "stepping.events = true does not go with stepping.interface = \"{}\"; set events = false, or use "
               "\"accumulate\" or \"extrapolate\"",
               name(stepping.interface));
    return offer.make(setup);
  }
  throw core::InputError(fmt::format("stepping.interface = \"{}\" is not offered", name(stepping.interface)));
}

}  // namespace grainclock::multirate
