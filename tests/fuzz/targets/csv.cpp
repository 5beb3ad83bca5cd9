// CSV states. What is accepted is valid, and comes back bit for bit.
#include "core/snapshot.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace grainclock::fuzz {

void fuzz(std::string_view bytes) {
  expect_answer([&] {
    const core::State state = core::read_state(place().file("state.csv", bytes));
    validate(state, "accepted");
    const std::string copy = place() / "copy.csv";
    core::write_state(copy, state);
    require(core::checksum(core::read_state(copy)) == core::checksum(state), "a state that was read does not come back from CSV");
  });
}

}  // namespace grainclock::fuzz
