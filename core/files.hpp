// Files that never stand half-written under their final name, and directories that one process works in.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

namespace grainclock::core {

/// Write to part(), then commit() renames it to the final name. Without commit() the part is removed.
/// The part stands in the directory of the final file, so that the rename is atomic.
class AsideFile {
 public:
  explicit AsideFile(std::filesystem::path final_path);
  ~AsideFile();
  AsideFile(const AsideFile&) = delete;
  AsideFile& operator=(const AsideFile&) = delete;

  const std::filesystem::path& part() const { return part_; }
  /// Flushes the part to the disk, renames it, and flushes the name too. Throws FileError.
  void commit();

 private:
  std::filesystem::path final_path_, part_;
  bool committed_ = false;
};

/// Removes the parts that killed processes left in a directory. Throws FileError.
void remove_parts(const std::filesystem::path& directory);

/// Keeps other holders of such a lock out of a directory while it lives. It leaves no file, and the kernel lets go of it
/// whatever happens to us. Without effect where the directory cannot be opened or the file system knows no locks.
class DirectoryLock {
 public:
  /// Throws InputError with this text where the directory is taken.
  DirectoryLock(const std::filesystem::path& directory, const std::string& if_taken);
  ~DirectoryLock();
  DirectoryLock(const DirectoryLock&) = delete;
  DirectoryLock& operator=(const DirectoryLock&) = delete;

 private:
  int descriptor_;
};

/// Writes a whole text file aside and renames it. Throws FileError.
void write_text(const std::filesystem::path& path, std::string_view text);
/// The whole file, or all that a pipe gives, without a UTF-8 byte order mark. Throws FileError where it cannot be read, is
/// a device, or is longer than `most` bytes (known before any memory is taken for it).
inline constexpr std::uint64_t kMostText = std::uint64_t{4} << 30;
std::string read_text(const std::filesystem::path& path, std::uint64_t most = kMostText);

}  // namespace grainclock::core
