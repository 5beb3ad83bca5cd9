#include "core/files.hpp"

#include "core/check.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>

namespace grainclock::core {

namespace fs = std::filesystem;

AsideFile::AsideFile(fs::path final_path) : final_path_(std::move(final_path)) {
  part_ = final_path_;
  part_.replace_filename(fmt::format(".{}.part", final_path_.filename().string()));
}

AsideFile::~AsideFile() {
  std::error_code ignored;
  if (!committed_) fs::remove(part_, ignored);
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
  fs::rename(part_, final_path_, trouble);
  if (trouble) throw FileError(fmt::format("{}: cannot be written: {}", final_path_.string(), trouble.message()));
  committed_ = true;
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
