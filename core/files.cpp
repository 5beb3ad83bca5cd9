#include "core/files.hpp"

#include "core/check.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <sstream>

namespace grainclock::core {

AsideFile::AsideFile(std::filesystem::path final_path) : final_path_(std::move(final_path)) {
  part_ = final_path_;
  part_.replace_filename(fmt::format(".{}.part", final_path_.filename().string()));
}

AsideFile::~AsideFile() {
  std::error_code ignored;
  if (!committed_) std::filesystem::remove(part_, ignored);
}

void AsideFile::commit() {
  // The content must be on the disk before the name is, or a power cut could leave an empty file.
  const int descriptor = ::open(part_.c_str(), O_RDONLY);
  if (descriptor < 0 || ::fsync(descriptor) != 0) {
    const int reason = errno;
    if (descriptor >= 0) ::close(descriptor);
    throw FileError(fmt::format("{}: cannot be written: {}", final_path_.string(), std::strerror(reason)));
  }
  ::close(descriptor);
  std::error_code trouble;
  std::filesystem::rename(part_, final_path_, trouble);
  if (trouble) throw FileError(fmt::format("{}: cannot be written: {}", final_path_.string(), trouble.message()));
  committed_ = true;
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
