// TOML studies of every kind, with the list of their jobs.
#include "benchmarks/study_kind.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace grainclock::fuzz {

void fuzz(std::string_view bytes) {
  static const std::string state =
      place().file("state.csv", "id,kind,x,y,z,vx,vy,vz,radius\n0,content,0,0,1,0,0,0,0.22\n1,wall,0,0,0,0,0,0,0.22\n");
  static const std::string scene = place().file("scene.toml", "[initial]\nstate = 'state.csv'\n[[phase]]\nduration = 1.0\n");
  expect_answer([&] {
    const auto study = benchmarks::make_study(place().file("study.toml", bytes), 1);
    for (const benchmarks::Job& job : study->jobs())
      require(!job.id.empty() && job.id.find_first_of("/ \n") == std::string::npos, "a job's id does not fit a file name");
  });
}

}  // namespace grainclock::fuzz
