#include "silo/energy_watch.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace grainclock::silo {

EnergyWatch::EnergyWatch(const core::Energies& start, const core::Energies& now, const core::Ledger& ledger, double scale)
    : start_(start), scale_(std::max(scale, now.elastic)), first_(mark(now, ledger)), last_(first_) {}

EnergyWatch::Mark EnergyWatch::mark(const core::Energies& now, const core::Ledger& ledger) const {
  return {created_energy(start_, now, ledger), ledger.dissipated + ledger.first_impact, now.kinetic, now.elastic};
}

std::optional<CreatedEnergy> EnergyWatch::excess(const Mark& from, const Mark& to) const {
  const double created = to.created - from.created, dissipated = to.dissipated - from.dissipated;
  const double unaccounted = created - kCreatedShare * std::max(0.0, dissipated) - std::max(from.kinetic, to.kinetic);
  if (unaccounted <= kRounding * scale_) return std::nullopt;
  return CreatedEnergy{fmt::format("{:.3g} J came from nowhere while dashpots took away {:.3g} J (kinetic energy {:.3g} J, in springs {:.3g} J)",
                                   created, dissipated, to.kinetic, to.elastic),
                       unaccounted > kSpoiling * scale_};
}

std::optional<CreatedEnergy> EnergyWatch::look(const core::Energies& now, const core::Ledger& ledger) {
  const Mark here = mark(now, ledger);
  std::optional<CreatedEnergy> found = excess(last_, here);
  const std::optional<CreatedEnergy> in_all = excess(first_, here);
  if (!found || (in_all && in_all->spoils && !found->spoils)) found = in_all;
  last_ = here;
  return found;
}

}  // namespace grainclock::silo
