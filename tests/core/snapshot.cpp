#include "core/snapshot.hpp"

#include "core/check.hpp"
#include "tests/support/balls.hpp"
#include "tests/support/scratch.hpp"

#include <cmath>
#include <limits>

namespace grainclock::core {
namespace {

using tests::message_of;
using tests::same_bits;
using tests::Scratch;
using tests::text_of;

/// Three balls whose numbers have no short decimal form.
State some_state() {
  State state;
  state.time = 1.0 / 3.0;
  state.add(3, Kind::content, Vec3(0.1, -2.0 / 3.0, 1e-300), Vec3(std::sqrt(2.0), -0.0, 5e-324), 0.22);
  state.add(5, Kind::wall, Vec3(1.0, 2.0, 3.0), Vec3::Zero(), 1.0 / 7.0);
  state.add(9, Kind::plug, Vec3(-1e9 / 7.0, 0.3, 0.7), Vec3::Zero(), std::nextafter(0.22, 1.0));
  return state;
}

State with_restart(State state) {
  state.length_scale = 0.43999999999999995;
  state.evaluated_position = {Vec3(1.0 / 3.0, 2, 3), Vec3::Zero(), Vec3::Zero()};
  state.evaluated_velocity = {Vec3(3, 2, 1.0 / 7.0), Vec3::Zero(), Vec3::Zero()};
  state.level = {3, 0, 0};
  state.impacted = {1, 0, 0};
  return state;
}

void expect_same_bits(const State& a, const State& b) {
  EXPECT_EQ(a.time, b.time);
  EXPECT_EQ(a.length_scale, b.length_scale);
  EXPECT_EQ(a.id, b.id);
  EXPECT_EQ(a.kind, b.kind);
  EXPECT_TRUE(same_bits(a.position, b.position));
  EXPECT_TRUE(same_bits(a.velocity, b.velocity));
  EXPECT_TRUE(same_bits(a.radius, b.radius));
  EXPECT_TRUE(same_bits(a.evaluated_position, b.evaluated_position));
  EXPECT_TRUE(same_bits(a.evaluated_velocity, b.evaluated_velocity));
  EXPECT_EQ(a.level, b.level);
  EXPECT_EQ(a.impacted, b.impacted);
}

TEST(Snapshot, Hdf5KeepsEveryBit) {
  const Scratch scratch;
  for (const State& state : {some_state(), with_restart(some_state())}) {
    write_state(scratch / "state.h5", state);
    expect_same_bits(read_state(scratch / "state.h5"), state);
  }
}

TEST(Snapshot, CsvKeepsEveryBitOfWhatItHolds) {
  const Scratch scratch;
  State state = some_state();
  state.time = 0.0;  // CSV has no time
  write_state(scratch / "state.csv", state);
  expect_same_bits(read_state(scratch / "state.csv"), state);
  EXPECT_TRUE(text_of(scratch / "state.csv").starts_with("id,kind,x,y,z,vx,vy,vz,radius\n3,content,0.10000000000000001,"));
}

TEST(Snapshot, NothingIsLeftBesideTheFile) {
  const Scratch scratch;
  write_state(scratch / "state.h5", some_state());
  std::size_t files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(scratch.path())) ++files;
  EXPECT_EQ(files, 1u);
}

TEST(Snapshot, ChecksumDependsOnEveryField) {
  const State state = with_restart(some_state());
  const auto changed = [&](auto change) {
    State other = state;
    change(other);
    return checksum(other);
  };
  EXPECT_EQ(checksum(State(state)), checksum(state));
  EXPECT_NE(changed([](State& s) { s.time = 0.0; }), checksum(state));
  EXPECT_NE(changed([](State& s) { s.length_scale = 0.0; }), checksum(state));
  EXPECT_NE(changed([](State& s) { s.id[2] = 10; }), checksum(state));
  EXPECT_NE(changed([](State& s) { s.kind[1] = Kind::plug; }), checksum(state));
  EXPECT_NE(changed([](State& s) { s.position[0][2] = 0.0; }), checksum(state));
  EXPECT_NE(changed([](State& s) { s.velocity[0][1] = 0.0; }), checksum(state));  // was -0.0
  EXPECT_NE(changed([](State& s) { s.radius[0] = std::nextafter(s.radius[0], 1.0); }), checksum(state));
  EXPECT_NE(changed([](State& s) { s.evaluated_position[0][0] = 0.0; }), checksum(state));
  EXPECT_NE(changed([](State& s) { s.evaluated_velocity[0][0] = 0.0; }), checksum(state));
  EXPECT_NE(changed([](State& s) { s.level[0] = 2; }), checksum(state));
  EXPECT_NE(changed([](State& s) { s.impacted[0] = 0; }), checksum(state));
}

TEST(Snapshot, EveryDamagedByteOfTheDataIsFound) {
  const Scratch scratch;
  const State state = with_restart(some_state());
  write_state(scratch / "state.h5", state);
  const std::string intact = text_of(scratch / "state.h5");
  // The bytes of the first radius stand in the file as they are in memory.
  const std::string radius(reinterpret_cast<const char*>(&state.radius[2]), sizeof(double));
  const std::size_t at = intact.find(radius);
  ASSERT_NE(at, std::string::npos);
  for (std::size_t byte = 0; byte < sizeof(double); ++byte) {
    std::string damaged = intact;
    damaged[at + byte] = static_cast<char>(damaged[at + byte] ^ 1);
    const std::string path = scratch.file("damaged.h5", damaged);
    EXPECT_NE(message_of<FileError>([&] { read_state(path); }).find("damaged"), std::string::npos);
  }
}

TEST(Snapshot, CutFileIsRefused) {
  const Scratch scratch;
  write_state(scratch / "state.h5", some_state());
  const std::string intact = text_of(scratch / "state.h5");
  for (const std::size_t length : {std::size_t{0}, std::size_t{100}, intact.size() / 2, intact.size() - 1})
    EXPECT_THROW(read_state(scratch.file("cut.h5", intact.substr(0, length))), FileError) << length;
}

TEST(Snapshot, UnknownExtensionAndMissingFileAreNamed) {
  const Scratch scratch;
  EXPECT_NE(message_of<InputError>([&] { read_state(scratch / "state.txt"); }).find(".csv or .h5"), std::string::npos);
  EXPECT_NE(message_of<FileError>([&] { read_state(scratch / "none.csv"); }).find("none.csv"), std::string::npos);
  EXPECT_NE(message_of<FileError>([&] { read_state(scratch / "none.h5"); }).find("none.h5"), std::string::npos);
  EXPECT_THROW(write_state(scratch / "no/such/directory.csv", some_state()), FileError);
  EXPECT_THROW(write_state(scratch / "no/such/directory.h5", some_state()), FileError);
}

struct BadCsv {
  const char* line;      // of the second ball
  const char* expected;  // in the message
};

TEST(Snapshot, CsvErrorsNameLineColumnValueAndRemedy) {
  const Scratch scratch;
  const BadCsv cases[] = {
      {"2,content,1,2,x,0,0,0,0.2", ":3:15: `x`: must be a finite number"},
      {"2,content,1,2,nan,0,0,0,0.2", ":3:15: `nan`: must be a finite number"},
      {"2,content,1,2,1e999,0,0,0,0.2", ":3:15: `1e999`: must be a finite number"},
      {"2,ball,1,2,3,0,0,0,0.2", ":3:3: `ball`: must be content, wall or plug"},
      {"2,content,1,2,3,0,0,0,0", ":3:23: `0`: must be above 0 m"},
      {"2,content,1,2,3,0,0,0", ":3: `2,content,1,2,3,0,0,0`: 8 values; a line has 9"},
      {"1,content,1,2,3,0,0,0,0.2", ":3:1: `1`: must be above the id before it, 1"},
      {"1.5,content,1,2,3,0,0,0,0.2", ":3:1: `1.5`: must be a whole number"},
      {"2,wall,1,2,3,0,-1,0,0.2", ":3:16: `-1`: must be 0"},
      {"2,content,,2,3,0,0,0,0.2", ":3:11: ``: must be a finite number"},
  };
  for (const BadCsv& bad : cases) {
    const std::string path =
        scratch.file("bad.csv", fmt::format("id,kind,x,y,z,vx,vy,vz,radius\n1,content,0,0,0,0,0,0,0.2\n{}\n", bad.line));
    const std::string text = message_of<InputError>([&] { read_state(path); });
    EXPECT_NE(text.find(path + bad.expected), std::string::npos) << text;
  }
}

TEST(Snapshot, CsvHeaderMustBeTheContract) {
  const Scratch scratch;
  const std::string path = scratch.file("bad.csv", "id,x,y,z\n1,0,0,0\n");
  EXPECT_NE(message_of<InputError>([&] { read_state(path); }).find("bad.csv:1: the header is `id,x,y,z`"), std::string::npos);
  EXPECT_THROW(read_state(scratch.file("empty.csv", "id,kind,x,y,z,vx,vy,vz,radius\n")), InputError);
  EXPECT_THROW(read_state(scratch.file("nothing.csv", "")), InputError);
}

TEST(Snapshot, CsvWithCarriageReturnsAndSpacesIsRead) {
  const Scratch scratch;
  const State state = read_state(scratch.file("dos.csv", "id,kind,x,y,z,vx,vy,vz,radius\r\n1, content, 1, 2, 3, 4, 5, 6, 0.2\r\n"));
  ASSERT_EQ(state.size(), 1u);
  EXPECT_EQ(state.velocity[0], Vec3(4, 5, 6));
}

}  // namespace
}  // namespace grainclock::core
