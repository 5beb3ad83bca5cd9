#include "core/files.hpp"

#include "core/check.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>
#include <vector>

namespace grainclock::core {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kPart = ".part";

/// Has a file or directory written to the disk; 0, or the reason why not.
int sync(const fs::path& path) {
  const int descriptor = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return errno;
  const int reason = ::fsync(descriptor) == 0 ? 0 : errno;
  ::close(descriptor);
  return reason;
}

}  // namespace

AsideFile::AsideFile(std::filesystem::path final_path) : final_path_(std::move(final_path)) {
  part_ = final_path_;
  part_.replace_filename(fmt::format(".{}{}", final_path_.filename().string(), kPart));
}

AsideFile::~AsideFile() {
  std::error_code ignored;
  if (!committed_) std::filesystem::remove(part_, ignored);
}

void AsideFile::commit() {
  const auto require = [this](int reason) {
    if (reason != 0) throw FileError(fmt::format("{}: cannot be written: {}", final_path_.string(), std::strerror(reason)));
  };
  // The content must be on the disk before the name is, or a power cut could leave an empty file; and the name before
  // anything that relies on it, such as the removal of what it replaces.
  require(sync(part_));
  std::error_code trouble;
  fs::rename(part_, final_path_, trouble);
  require(trouble.value());
  committed_ = true;
  const int reason = sync(final_path_.has_parent_path() ? final_path_.parent_path() : ".");
  require(reason == EINVAL || reason == EACCES ? 0 : reason);  // some directories cannot be flushed, or not be read by us
}

void remove_parts(const fs::path& directory) {
  std::error_code trouble;
  std::vector<fs::path> parts;
  for (const auto& entry : fs::directory_iterator(directory, trouble))
    if (const std::string name = entry.path().filename().string(); name.starts_with('.') && name.ends_with(kPart)) parts.push_back(entry.path());
  for (const fs::path& part : parts)
    if (!trouble) fs::remove(part, trouble);
  if (trouble) throw FileError(fmt::format("{}: cannot be tidied: {}", directory.string(), trouble.message()));
}

DirectoryLock::DirectoryLock(const fs::path& directory, const std::string& if_taken)
    : descriptor_(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC)) {
  const bool is_taken = descriptor_ >= 0 && ::flock(descriptor_, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
  if (!is_taken) return;
  ::close(descriptor_);
  throw InputError(if_taken);
}

DirectoryLock::~DirectoryLock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void write_text(const std::filesystem::path& path, std::string_view text) {
  AsideFile aside(path);
  std::ofstream out(aside.part(), std::ios::binary);
  if (!out) throw FileError(fmt::format("{}: cannot be written: {}", path.string(), std::strerror(errno)));
  out << text;
  out.close();
  if (!out) throw FileError(fmt::format("{}: cannot be written in full: is the disk full?", path.string()));
  aside.commit();
}

std::string read_text(const std::filesystem::path& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored))
    throw FileError(fmt::format("{}: is a directory; a file is wanted", path.string()));
  std::ifstream in(path, std::ios::binary);
  if (!in) throw FileError(fmt::format("{}: cannot be read: {}", path.string(), std::strerror(errno)));
  std::ostringstream text;
  text << in.rdbuf();
  if (in.bad()) throw FileError(fmt::format("{}: reading failed: {}", path.string(), std::strerror(errno)));
  return std::move(text).str();
}

}  // namespace grainclock::core
