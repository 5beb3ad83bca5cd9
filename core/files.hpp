// Files that never stand half-written under their final name.
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
  /// Flushes the part to the disk and renames it. Throws FileError.
  void commit();

 private:
  std::filesystem::path final_path_, part_;
  bool committed_ = false;
};

/// Writes a whole text file aside and renames it. Throws FileError.
void write_text(const std::filesystem::path& path, std::string_view text);
/// The whole file, or all that a pipe gives, without a UTF-8 byte order mark. Throws FileError where it cannot be read, is
/// a device, or is longer than `most` bytes (known before any memory is taken for it).
inline constexpr std::uint64_t kMostText = std::uint64_t{4} << 30;
std::string read_text(const std::filesystem::path& path, std::uint64_t most = kMostText);

}  // namespace grainclock::core
