// Checkpoints keep a run's position to the bit, and show what was damaged.
#include "silo/checkpoint.hpp"

#include "core/check.hpp"
#include "tests/support/scratch.hpp"

#include <gtest/gtest.h>
#include <hdf5.h>

#include <array>
#include <bit>
#include <cstring>
#include <string>
#include <vector>

namespace grainclock::silo {
namespace {

using tests::Scratch;

// A position is nothing but numbers of 8 bytes, of either kind: as words they can be told apart without naming each.
constexpr std::size_t kWords = sizeof(Position) / 8;
using Words = std::array<std::uint64_t, kWords>;

Words words_of(const Position& position) {
  Words words;
  std::memcpy(words.data(), static_cast<const void*>(&position), sizeof(Position));
  return words;
}

/// A position in which no two numbers are the same.
Checkpoint checkpoint() {
  Words words;
  for (std::size_t k = 0; k < kWords; ++k) words[k] = std::bit_cast<std::uint64_t>(1.0 + static_cast<double>(k));
  Checkpoint out;
  std::memcpy(static_cast<void*>(&out.position), words.data(), sizeof(Position));
  out.state.add(0, core::Kind::content, {0.0, 0.0, 1.0}, core::Vec3::Zero(), 0.22);
  out.state.evaluated_position = out.state.position;
  out.state.evaluated_velocity = out.state.velocity;
  out.state.level = {0};
  out.state.impacted = {0};
  return out;
}

/// The datasets of a checkpoint that hold its position, as they are in the file.
class Numbers {
 public:
  explicit Numbers(const std::string& path) : file_(H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT)) {
    const auto name = [](hid_t, const char* its, const H5L_info_t*, void* out) {
      if (std::string(its) != "checksum") static_cast<std::vector<std::string>*>(out)->push_back(std::string("position_in_run/") + its);
      return herr_t{0};
    };
    H5Literate_by_name(file_, "position_in_run", H5_INDEX_NAME, H5_ITER_INC, nullptr, name, &names, H5P_DEFAULT);
  }
  ~Numbers() { H5Fclose(file_); }
  Numbers(const Numbers&) = delete;
  Numbers& operator=(const Numbers&) = delete;

  std::vector<std::uint64_t> read(const std::string& name) const {
    const hid_t set = H5Dopen2(file_, name.c_str(), H5P_DEFAULT), type = H5Dget_type(set);
    std::vector<std::uint64_t> values(H5Dget_storage_size(set) / 8);
    H5Dread(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
    H5Tclose(type);
    H5Dclose(set);
    return values;
  }
  void write(const std::string& name, const std::vector<std::uint64_t>& values) {
    const hid_t set = H5Dopen2(file_, name.c_str(), H5P_DEFAULT), type = H5Dget_type(set);
    H5Dwrite(set, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data());
    H5Tclose(type);
    H5Dclose(set);
  }

  std::vector<std::string> names;

 private:
  hid_t file_;
};

/// Damages a good checkpoint by change(Numbers) and expects that reading it says so.
template <class Change>
void expect_seen(const std::string& path, const std::string& what, Change change) {
  {
    Numbers numbers(path);
    change(numbers);
  }
  EXPECT_NE(tests::message_of<core::FileError>([&] { read_checkpoint(path); }).find("the file is damaged"), std::string::npos) << what;
}

TEST(Checkpoint, KeepsEveryNumberToTheBit) {
  const Scratch scratch;
  const Checkpoint written = checkpoint();
  EXPECT_EQ(words_of(read_checkpoint(write_checkpoint(scratch.path(), written)).position), words_of(written.position));
}

TEST(Checkpoint, EveryDamagedNumberIsSeen) {
  const Scratch scratch;
  const std::string path = write_checkpoint(scratch.path(), checkpoint());
  const std::vector<std::string> names = Numbers(path).names;
  std::size_t damaged = 0;
  for (const std::string& name : names) {
    const std::vector<std::uint64_t> good = Numbers(path).read(name);
    for (std::size_t k = 0; k < good.size(); ++k, ++damaged) {
      expect_seen(path, name, [&](Numbers& numbers) {
        std::vector<std::uint64_t> bad = good;
        bad[k] ^= 1;  // the last bit
        numbers.write(name, bad);
      });
    }
    Numbers(path).write(name, good);
  }
  EXPECT_EQ(damaged, kWords);
  EXPECT_NO_THROW(read_checkpoint(path));
}

TEST(Checkpoint, NumbersThatChangedPlacesAreSeen) {
  const Scratch scratch;
  const std::string path = write_checkpoint(scratch.path(), checkpoint());
  expect_seen(path, "two datasets", [](Numbers& numbers) {
    const std::string a = "position_in_run/dissipated", b = "position_in_run/turned_over";
    const auto of_a = numbers.read(a), of_b = numbers.read(b);
    ASSERT_NE(of_a, of_b);
    numbers.write(a, of_b);
    numbers.write(b, of_a);
  });
}

TEST(Checkpoint, TheNewestThreeAreKeptNewestFirst) {
  const Scratch scratch;
  for (int k = 0; k < 5; ++k) write_checkpoint(scratch.path(), checkpoint());
  std::vector<std::string> names;
  for (const auto& path : checkpoints_in(scratch.path())) names.push_back(path.filename().string());
  EXPECT_EQ(names, (std::vector<std::string>{"000004.h5", "000003.h5", "000002.h5"}));
}

}  // namespace
}  // namespace grainclock::silo
