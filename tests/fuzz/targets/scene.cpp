// TOML scenes, with the silo built where it is small. Lines "#--set key=value" at the top are given as options.
#include "core/scene.hpp"
#include "silo/phases.hpp"
#include "tests/fuzz/fuzz.hpp"

#include <toml++/toml.h>

#include <vector>

namespace grainclock::fuzz {
namespace {

constexpr std::string_view kSet = "#--set ";
constexpr std::size_t kSmall = 2000;  // balls; larger silos take too long for a fuzzer

std::vector<std::string> options(std::string_view text) {
  std::vector<std::string> found;
  while (text.starts_with(kSet)) {
    const std::size_t end = text.find('\n');
    found.emplace_back(text.substr(kSet.size(), end - kSet.size()));
    text = end == std::string_view::npos ? std::string_view() : text.substr(end + 1);
  }
  return found;
}

bool is_small(const core::Scene& scene) {
  const toml::value<std::int64_t>* balls = scene.has_silo ? (*scene.silo)["balls"].as_integer() : nullptr;
  return !scene.has_silo || (balls && balls->get() <= static_cast<std::int64_t>(kSmall));
}

}  // namespace

void fuzz(std::string_view bytes) {
  static const std::string state =
      place().file("state.csv", "id,kind,x,y,z,vx,vy,vz,radius\n0,content,0,0,1,0,0,0,0.22\n1,wall,0,0,0,0,0,0,0.22\n");
  expect_answer([&] {
    const core::Scene scene = core::read_scene(place().file("scene.toml", bytes), options(bytes));
    const core::Scene again = core::read_scene(place().file("again.toml", scene.text));
    require(again.text == scene.text, "the resolved scene reads back as another scene");
    if (!is_small(scene)) return;
    const silo::Start start = silo::start_of(scene);
    for (const core::Phase& phase : scene.phases) silo::phase_setup(scene, phase, start.state, 1);
  });
}

}  // namespace grainclock::fuzz
