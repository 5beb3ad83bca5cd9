// LAMMPS data and dumps. What is accepted is valid, and comes back from our own export with the same balls.
#include "core/snapshot.hpp"
#include "silo/export.hpp"
#include "silo/import.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace grainclock::fuzz {

void fuzz(std::string_view bytes) {
  expect_answer([&] {
    const core::State state = silo::import_file(place().file("import.txt", bytes));
    validate(state, "accepted");
    const core::State copy = silo::import_file(place().file("copy.txt", silo::lammps_dump_text(state, 0)));
    require(copy.id == state.id && copy.kind == state.kind && copy.position == state.position && copy.velocity == state.velocity &&
                copy.radius == state.radius,
            "balls that were read do not come back from a dump");
  });
}

}  // namespace grainclock::fuzz
