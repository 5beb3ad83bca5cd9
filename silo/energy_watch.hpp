// Energy from nowhere, looked for during a run.
//
// A step beyond the stability bound of some contacts need not make anything fly apart: where balls part as soon as they
// are pushed, contacts rattle within bounds, and dashpots take away what the steps put in. The ledger shows it.
#pragma once

#include "core/ledger.hpp"

#include <optional>
#include <string>

namespace grainclock::silo {

/// Of what dashpots take away, the share that may come from nowhere. Stable steps stay below 0.03 on the full silo, with
/// selective steps of tolerance 1e-3 as with uniform ones; 1.4 times the bound gives 0.5 in flow and 0.98 at rest.
constexpr double kCreatedShare = 0.25;
/// What is created is rounding below the first share of n m g r (of all content, a ball's weight times its radius), and
/// spoils the run above the second: a few balls that rattle among thousands do not.
constexpr double kRounding = 1e-6, kSpoiling = 5e-3;

/// Energy that nothing accounts for.
struct CreatedEnergy {
  std::string text;
  bool spoils;  // the run
};

class EnergyWatch {
 public:
  /// `start`: energies at the run's start, which the ledger is relative to. `now` is where the watch begins. `scale`: n m g r [J].
  EnergyWatch(const core::Energies& start, const core::Energies& now, const core::Ledger& ledger, double scale);
  /// Looks at what was created since the last look, and since the watch began. Nothing where that is within the share of
  /// what was dissipated meanwhile and all motion together: near the bound the energy of a stable step swings by a part
  /// of what moves.
  std::optional<CreatedEnergy> look(const core::Energies& now, const core::Ledger& ledger);

 private:
  struct Mark {
    double created, dissipated, kinetic, elastic;  // J
  };
  Mark mark(const core::Energies& now, const core::Ledger& ledger) const;
  std::optional<CreatedEnergy> excess(const Mark& from, const Mark& to) const;

  core::Energies start_;
  double scale_;
  Mark first_, last_;
};

}  // namespace grainclock::silo
