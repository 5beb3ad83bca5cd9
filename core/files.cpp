#include "core/files.hpp"

#include "core/check.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
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

AsideFile::AsideFile(fs::path final_path) : final_path_(std::move(final_path)) {
  part_ = final_path_;
  part_.replace_filename(fmt::format(".{}{}", final_path_.filename().string(), kPart));
}

AsideFile::~AsideFile() {
  std::error_code ignored;
  if (!committed_) fs::remove(part_, ignored);
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

void write_text(const fs::path& path, std::string_view text) {
  AsideFile aside(path);
  std::ofstream out(aside.part(), std::ios::binary);
  if (!out) throw FileError(fmt::format("{}: cannot be written: {}", path.string(), std::strerror(errno)));
  out << text;
  out.close();
  if (!out) throw FileError(fmt::format("{}: cannot be written in full: is the disk full?", path.string()));
  aside.commit();
}

std::string read_text(const fs::path& path, std::uint64_t most) {
  std::error_code trouble;
  const fs::file_status status = fs::status(path, trouble);
  const auto refuse = [&](const std::string& what) { throw FileError(fmt::format("{}: {}", path.string(), what)); };
  if (fs::is_directory(status)) refuse("is a directory; a file is wanted");
  if (fs::is_character_file(status) || fs::is_block_file(status)) refuse("is a device; a file is wanted");
  std::ifstream in(path, std::ios::binary);
  if (!in) refuse(fmt::format("cannot be read: {}", std::strerror(errno)));
  const std::uintmax_t size = fs::is_regular_file(status) ? fs::file_size(path, trouble) : 0;
  const std::string too_long = fmt::format("is longer than the {} bytes that are read of such a file; give a smaller one", most);
  if (!trouble && size > most) refuse(too_long);

  std::string text(trouble ? 0 : size, '\0');
  in.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<std::size_t>(in.gcount()));
  constexpr std::size_t kPiece = std::size_t{1} << 16;  // of what has no length beforehand
  for (std::string piece(kPiece, '\0'); in.good(); text.append(piece, 0, static_cast<std::size_t>(in.gcount()))) {
    if (text.size() > most) refuse(too_long);
    in.read(piece.data(), kPiece);
  }
  if (in.bad()) refuse(fmt::format("reading failed: {}", std::strerror(errno)));
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";  // some editors and spreadsheets begin a file with it
  if (text.starts_with(kByteOrderMark)) text.erase(0, kByteOrderMark.size());
  return text;
}

}  // namespace grainclock::core
