#include "core/hdf5.hpp"

#include "core/check.hpp"
#include "tests/support/scratch.hpp"

#include <cmath>

namespace grainclock::core {
namespace {

using tests::message_of;
using tests::Scratch;

Hdf5File written(const std::string& path) {
  Hdf5File file = Hdf5File::create(path);
  file.write("numbers", std::vector<double>{0.1, -2.5, 3e300});
  file.create_group("a").write("b", std::vector<std::int64_t>{-1, 2, 3, 4, 5, 6}, {3, 2});
  file.write_vectors("vectors", {Vec3(1, 2, 3), Vec3(4, 5, 6)});
  file.write_text("text", "größer\nals 0");
  file.write_attribute("numbers", "unit", std::string("m"));
  file.write_attribute(".", "pair", std::vector<std::uint64_t>{7, 8});
  file.write("none", std::vector<double>{});
  file.close();
  return Hdf5File::open(path);
}

TEST(Hdf5, WhatIsWrittenReadsBack) {
  const Scratch scratch;
  const Hdf5File file = written(scratch / "a.h5");
  EXPECT_EQ(file.read<double>("numbers"), (std::vector<double>{0.1, -2.5, 3e300}));
  EXPECT_EQ(file.read<std::int64_t>("a/b"), (std::vector<std::int64_t>{-1, 2, 3, 4, 5, 6}));
  EXPECT_EQ(file.shape("a/b"), (Hdf5Group::Shape{3, 2}));
  EXPECT_EQ(file.read_rows<std::int64_t>("a/b", 1, 1), (std::vector<std::int64_t>{3, 4}));
  EXPECT_EQ(file.read_vectors("vectors"), (std::vector<Vec3>{Vec3(1, 2, 3), Vec3(4, 5, 6)}));
  EXPECT_EQ(file.read_text("text"), "größer\nals 0");
  EXPECT_EQ(file.text_attribute("numbers", "unit"), "m");
  EXPECT_EQ(file.attribute<std::uint64_t>(".", "pair"), (std::vector<std::uint64_t>{7, 8}));
  EXPECT_TRUE(file.read<double>("none").empty());
  EXPECT_EQ(file.names(), (std::vector<std::string>{"a", "none", "numbers", "text", "vectors"}));
}

TEST(Hdf5, ClosedFileIsWholeThoughGroupsAreOpen) {
  const Scratch scratch;
  Hdf5File file = Hdf5File::create(scratch / "a.h5");
  Hdf5Group group = file.create_group("a");
  group.write("b", std::vector<double>{1.0, 2.0});
  file.close();
  // As another process sees it: this one would be given what HDF5 still holds in memory.
  std::filesystem::copy_file(scratch / "a.h5", scratch / "b.h5");
  EXPECT_EQ(Hdf5File::open(scratch / "b.h5").read<double>("a/b"), (std::vector<double>{1.0, 2.0}));
}

TEST(Hdf5, MissingThingsAreNamed) {
  const Scratch scratch;
  const Hdf5File file = written(scratch / "a.h5");
  EXPECT_FALSE(file.has("a/c/d"));
  EXPECT_TRUE(file.has("a/b"));
  EXPECT_TRUE(file.is_group("a"));
  EXPECT_FALSE(file.is_group("numbers"));
  const auto text = message_of<FileError>([&] { file.group("a").read<double>("c"); });
  EXPECT_NE(text.find("a.h5: /a/c: "), std::string::npos) << text;
  EXPECT_NE(message_of<FileError>([&] { file.text_attribute("numbers", "units"); }).find("units"), std::string::npos);
  EXPECT_NE(message_of<FileError>([&] { file.read_rows<double>("numbers", 2, 2); }).find("3 rows"), std::string::npos);
}

TEST(Hdf5, ElementsOfAnotherKindAreRefused) {
  const Scratch scratch;
  const Hdf5File file = written(scratch / "a.h5");
  EXPECT_THROW(file.read<std::int64_t>("numbers"), FileError);
  EXPECT_THROW(file.read<double>("text"), FileError);
  EXPECT_THROW(file.read_text("numbers"), FileError);
  EXPECT_THROW(file.read_vectors("a/b"), FileError);
}

TEST(Hdf5, FilesThatAreNotHdf5AreRefused) {
  const Scratch scratch;
  EXPECT_NE(message_of<FileError>([&] { Hdf5File::open(scratch / "none.h5"); }).find("No such file"), std::string::npos);
  const std::string path = scratch.file("text.h5", "this is text");
  EXPECT_NE(message_of<FileError>([&] { Hdf5File::open(path); }).find("is not an HDF5 file"), std::string::npos);
  EXPECT_THROW(Hdf5File::create(scratch / "no/such/directory.h5"), FileError);
}

TEST(Hdf5, SizeThatTheFileCannotHoldIsRefusedBeforeAllocating) {
  const Scratch scratch;
  Hdf5File file = Hdf5File::create(scratch / "big.h5");
  file.create_rows<double>("huge", {std::uint64_t{1} << 50});  // an array without content takes no room
  file.close();
  const Hdf5File opened = Hdf5File::open(scratch / "big.h5");
  EXPECT_NE(message_of<FileError>([&] { opened.read<double>("huge"); }).find("damaged"), std::string::npos);
}

TEST(Hdf5, VirtualDatasetJoinsRowsOfOtherFiles) {
  const Scratch scratch;
  std::filesystem::create_directory(scratch.path() / "parts");
  std::vector<Hdf5Part> parts;
  for (const double value : {1.0, 2.0, 3.0}) {
    const std::string name = fmt::format("parts/{}.h5", value);
    Hdf5File part = Hdf5File::create(scratch / name);
    part.write("x", std::vector<double>{value, value + 0.25, value + 0.5, value + 0.75}, {2, 2});
    part.close();
    parts.push_back({name, "/x", 2});
  }
  Hdf5File whole = Hdf5File::create(scratch / "whole.h5");
  whole.write_virtual<double>("x", {2}, parts);
  whole.write_virtual<double>("empty", {2}, {});
  whole.close();

  std::filesystem::remove(scratch / "parts/2.h5");
  const Hdf5File file = Hdf5File::open(scratch / "whole.h5");
  EXPECT_EQ(file.shape("x"), (Hdf5Group::Shape{6, 2}));
  EXPECT_EQ(file.shape("empty"), (Hdf5Group::Shape{0, 2}));
  EXPECT_EQ(file.read_rows<double>("x", 1, 1), (std::vector<double>{1.5, 1.75}));
  EXPECT_EQ(file.read_rows<double>("x", 4, 1), (std::vector<double>{3.0, 3.25}));
  for (const double value : file.read_rows<double>("x", 2, 2)) EXPECT_TRUE(std::isnan(value));
}

TEST(Hdf5, RowsCanBeWrittenPieceByPiece) {
  const Scratch scratch;
  Hdf5File file = Hdf5File::create(scratch / "a.h5");
  file.create_rows<double>("x", {3, 2});
  file.write_rows<double>("x", 2, {5, 6});
  file.write_rows<double>("x", 0, {1, 2, 3, 4});
  EXPECT_THROW(file.write_rows<double>("x", 0, {1, 2, 3}), FileError);
  file.close();
  EXPECT_EQ(Hdf5File::open(scratch / "a.h5").read<double>("x"), (std::vector<double>{1, 2, 3, 4, 5, 6}));
}

}  // namespace
}  // namespace grainclock::core
