#include "core/hdf5.hpp"

#include "core/check.hpp"

#include <hdf5.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>
#include <optional>
#include <string_view>
#include <utility>

namespace grainclock::core {

static_assert(std::is_same_v<hid_t, Hdf5Handle::Id> && std::is_same_v<herr_t, int>);

Hdf5Handle::~Hdf5Handle() { close(); }

Hdf5Handle::Hdf5Handle(Hdf5Handle&& other) noexcept : id_(std::exchange(other.id_, -1)), closer_(other.closer_) {}

Hdf5Handle& Hdf5Handle::operator=(Hdf5Handle&& other) noexcept {
  if (this != &other) {
    close();
    id_ = std::exchange(other.id_, -1);
    closer_ = other.closer_;
  }
  return *this;
}

bool Hdf5Handle::close() {
  const Id id = std::exchange(id_, -1);
  return id < 0 || closer_(id) >= 0;
}

namespace {

using Shape = Hdf5Group::Shape;

/// The innermost reason that HDF5 noted; of a failed system call only what the system says.
std::string reason() {
  std::string text = "HDF5 gives no reason";
  const auto note = [](unsigned, const H5E_error2_t* error, void* out) -> herr_t {
    if (error->desc) *static_cast<std::string*>(out) = error->desc;
    return 0;
  };
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_DOWNWARD, note, &text);
  constexpr std::string_view kSystem = "error message = '";
  const std::size_t at = text.find(kSystem);
  if (at == std::string::npos) return text;
  text.erase(0, at + kSystem.size());
  return text.substr(0, text.find('\''));
}

template <class T> hid_t type_of();
template <> hid_t type_of<double>() { return H5T_NATIVE_DOUBLE; }
template <> hid_t type_of<std::int64_t>() { return H5T_NATIVE_INT64; }
template <> hid_t type_of<std::uint64_t>() { return H5T_NATIVE_UINT64; }
template <> hid_t type_of<std::uint8_t>() { return H5T_NATIVE_UINT8; }

std::uint64_t product(const Shape& shape) {
  std::uint64_t n = 1;
  for (const std::uint64_t extent : shape)
    if (__builtin_mul_overflow(n, extent, &n)) return std::numeric_limits<std::uint64_t>::max();
  return n;
}

Hdf5Handle space_of(const Shape& shape) {
  const std::vector<hsize_t> extents(shape.begin(), shape.end());
  return {shape.empty() ? H5Screate(H5S_SCALAR) : H5Screate_simple(static_cast<int>(extents.size()), extents.data(), nullptr),
          H5Sclose};
}

/// `count` rows from `first` on of an array of this shape.
Hdf5Handle rows_of(const Shape& shape, std::uint64_t first, std::uint64_t count) {
  Hdf5Handle space = space_of(shape);
  std::vector<hsize_t> start(shape.size(), 0), extents(shape.begin(), shape.end());
  start[0] = first;
  extents[0] = count;
  if (count == 0)
    H5Sselect_none(space.id());
  else if (H5Sselect_hyperslab(space.id(), H5S_SELECT_SET, start.data(), nullptr, extents.data(), nullptr) < 0)
    return {-1, H5Sclose};
  return space;
}

Shape shape_of_space(hid_t space) {
  const int rank = H5Sget_simple_extent_ndims(space);
  std::vector<hsize_t> extents(rank > 0 ? static_cast<std::size_t>(rank) : 0);
  if (rank > 0) H5Sget_simple_extent_dims(space, extents.data(), nullptr);
  return {extents.begin(), extents.end()};
}

Hdf5Handle text_type() {
  Hdf5Handle type(H5Tcopy(H5T_C_S1), H5Tclose);
  H5Tset_size(type.id(), H5T_VARIABLE);
  H5Tset_cset(type.id(), H5T_CSET_UTF8);
  return type;
}

/// Whole numbers read as whole numbers, floats as floats: a silent conversion between them would lose digits, as would one
/// from numbers wider than ours.
bool converts(hid_t stored, hid_t wanted) {
  return H5Tget_class(stored) == H5Tget_class(wanted) && H5Tget_size(stored) <= sizeof(std::uint64_t);
}

/// Reads one text, of fixed or variable length, with `read(memory type, buffer)`.
template <class Read>
bool read_string(hid_t stored, std::string& text, Read read) {
  constexpr std::size_t kLongest = std::size_t{1} << 28;
  if (H5Tget_class(stored) != H5T_STRING) return false;
  if (H5Tis_variable_str(stored) > 0) {
    Hdf5Handle type = text_type();
    H5Tset_cset(type.id(), H5Tget_cset(stored));
    char* raw = nullptr;
    if (read(type.id(), static_cast<void*>(&raw)) < 0) return false;
    text = raw ? raw : "";
    H5free_memory(raw);
    return true;
  }
  const std::size_t length = H5Tget_size(stored);
  if (length > kLongest) return false;
  text.assign(length, '\0');
  if (read(stored, static_cast<void*>(text.data())) < 0) return false;
  text.resize(std::strlen(text.c_str()));
  return true;
}

}  // namespace

void Hdf5Group::fail(const std::string& name, const std::string& what) const {
  throw FileError(fmt::format("{}: {}{}: {}", file_, path_, name, what));
}

// ---------------------------------------------------------------- links

namespace {

/// Whether there is a hard link: others lead out of the file, in circles, or nowhere.
bool is_plain_link(hid_t group, const std::string& path) {
  H5L_info_t info{};
  return H5Lexists(group, path.c_str(), H5P_DEFAULT) > 0 && H5Lget_info(group, path.c_str(), &info, H5P_DEFAULT) >= 0 &&
         info.type == H5L_TYPE_HARD;
}

}  // namespace

bool Hdf5Group::has(const std::string& name) const {
  for (std::size_t slash = name.find('/'); slash != std::string::npos; slash = name.find('/', slash + 1))
    if (!is_plain_link(handle_.id(), name.substr(0, slash))) return false;
  return is_plain_link(handle_.id(), name);
}

bool Hdf5Group::is_group(const std::string& name) const {
  if (!has(name)) return false;
  const Hdf5Handle object(H5Oopen(handle_.id(), name.c_str(), H5P_DEFAULT), H5Oclose);
  return object.is_valid() && H5Iget_type(object.id()) == H5I_GROUP;
}

std::vector<std::string> Hdf5Group::names() const {
  std::vector<std::string> found;
  const auto note = [](hid_t, const char* name, const H5L_info_t*, void* out) -> herr_t {
    constexpr std::size_t kMost = 100000;  // a damaged index may go in circles
    auto& names = *static_cast<std::vector<std::string>*>(out);
    names.emplace_back(name);
    return names.size() < kMost ? 0 : -1;
  };
  if (H5Literate(handle_.id(), H5_INDEX_NAME, H5_ITER_INC, nullptr, note, &found) < 0) fail("", "cannot be listed: " + reason());
  return found;
}

Hdf5Group Hdf5Group::group(const std::string& name) const {
  if (!has(name)) fail(name, "this group is missing");
  Hdf5Handle handle(H5Gopen2(handle_.id(), name.c_str(), H5P_DEFAULT), H5Gclose);
  if (!handle.is_valid()) fail(name, "this group cannot be opened: " + reason());
  return {std::move(handle), file_, path_ + name + "/", sums_};
}

Hdf5Group Hdf5Group::create_group(const std::string& name) {
  Hdf5Handle handle(H5Gcreate2(handle_.id(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
  if (!handle.is_valid()) fail(name, "this group cannot be created: " + reason());
  return {std::move(handle), file_, path_ + name + "/", sums_};
}

void Hdf5Group::link(const std::string& target, const std::string& name) {
  if (H5Lcreate_hard(handle_.id(), target.c_str(), handle_.id(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT) < 0)
    fail(name, fmt::format("cannot become a link to {}: {}", target, reason()));
}

// ---------------------------------------------------------------- reading

namespace {

Hdf5Handle open_dataset(hid_t group, const std::string& name) {
  return {H5Dopen2(group, name.c_str(), H5P_DEFAULT), H5Dclose};
}

/// Size of a regular file [bytes]; nothing for anything else.
std::optional<std::uint64_t> bytes_of(const std::filesystem::path& path) {
  std::error_code trouble;
  if (!std::filesystem::is_regular_file(path, trouble)) return std::nullopt;
  const std::uintmax_t size = std::filesystem::file_size(path, trouble);
  return trouble ? std::nullopt : std::optional<std::uint64_t>(size);
}

/// What is wrong with a chunked dataset's chunks or filters; empty if nothing is.
std::string chunk_trouble(hid_t plist, std::uint64_t element_bytes) {
  constexpr std::uint64_t kMostChunk = std::uint64_t{1} << 28;  // bytes; a chunk is read as a whole
  hsize_t extents[H5S_MAX_RANK];
  const int rank = H5Pget_chunk(plist, H5S_MAX_RANK, extents);
  if (rank <= 0) return "has chunks that cannot be understood";
  Shape chunk(extents, extents + rank);
  chunk.push_back(element_bytes);
  if (product(chunk) > kMostChunk)
    return fmt::format("has chunks of {} bytes; chunks of at most {} are read", product(chunk), kMostChunk);
  for (int k = 0; k < H5Pget_nfilters(plist); ++k) {
    unsigned flags = 0, config = 0;
    std::size_t values = 0;
    const H5Z_filter_t filter = H5Pget_filter2(plist, static_cast<unsigned>(k), &flags, &values, nullptr, 0, nullptr, &config);
    if (filter != H5Z_FILTER_DEFLATE && filter != H5Z_FILTER_SHUFFLE && filter != H5Z_FILTER_FLETCHER32)
      return fmt::format("is stored with filter {}; write it with gzip or without compression", static_cast<int>(filter));
  }
  return {};
}

/// The files that a virtual dataset takes rows from; `directory` is that of its own file.
std::vector<std::filesystem::path> sources_of(hid_t plist, const std::filesystem::path& directory) {
  std::size_t count = 0;
  H5Pget_virtual_count(plist, &count);
  std::vector<std::filesystem::path> sources;
  for (std::size_t k = 0; k < count; ++k) {
    std::string name(static_cast<std::size_t>(std::max<ssize_t>(0, H5Pget_virtual_filename(plist, k, nullptr, 0))), '\0');
    H5Pget_virtual_filename(plist, k, name.data(), name.size() + 1);
    sources.push_back(directory / name);
  }
  return sources;
}

/// The bytes that such files can hold.
std::uint64_t bytes_of(const std::vector<std::filesystem::path>& sources) {
  constexpr std::uint64_t kMissing = std::uint64_t{1} << 24;  // of a file that is not there: its rows read as nan
  std::uint64_t bytes = 0;
  for (const auto& source : sources) bytes += bytes_of(source).value_or(kMissing);
  return bytes;
}

/// Whether all of them are files, if they are there: opening a pipe would wait forever.
bool are_plain(const std::vector<std::filesystem::path>& sources) {
  std::error_code ignored;
  return std::all_of(sources.begin(), sources.end(), [&](const auto& source) {
    return !std::filesystem::exists(source, ignored) || std::filesystem::is_regular_file(source, ignored);
  });
}

/// The most bytes that a dataset with its storage in this file can have: a damaged header must not ask for more memory.
std::uint64_t believable_bytes(hid_t dataset, hid_t plist, const std::string& file) {
  constexpr std::uint64_t kBestCompression = 1100;  // of deflate, a little above its limit of 1032
  const std::uint64_t stored = std::min<std::uint64_t>(bytes_of(file).value_or(0), H5Dget_storage_size(dataset));
  return H5Pget_layout(plist) == H5D_CHUNKED && H5Pget_nfilters(plist) > 0 ? stored * kBestCompression : stored;
}

}  // namespace

Hdf5Handle Hdf5Group::dataset(const std::string& name) const {
  if (!has(name)) fail(name, "this dataset is missing");
  Hdf5Handle dataset = open_dataset(handle_.id(), name);
  if (!dataset.is_valid()) fail(name, "this dataset cannot be opened: " + reason());
  return dataset;
}

Hdf5Group::Shape Hdf5Group::shape(const std::string& name) const {
  const Hdf5Handle its = dataset(name);
  const Hdf5Handle space(H5Dget_space(its.id()), H5Sclose);
  if (H5Sget_simple_extent_type(space.id()) == H5S_NULL) fail(name, "is empty");
  return shape_of_space(space.id());
}

void Hdf5Group::require_believable(const std::string& name, hid_t dataset, hid_t type) const {
  const Hdf5Handle plist(H5Dget_create_plist(dataset), H5Pclose);
  const H5D_layout_t layout = H5Pget_layout(plist.id());
  if (layout < 0) fail(name, "is stored in a way that cannot be understood");
  if (layout == H5D_CONTIGUOUS && H5Pget_external_count(plist.id()) != 0) fail(name, "lies in another file; write it into this one");
  const std::uint64_t element = H5Tget_size(type);
  if (layout == H5D_CHUNKED)
    if (const std::string trouble = chunk_trouble(plist.id(), element); !trouble.empty()) fail(name, trouble);
  std::uint64_t believable = 0;
  if (layout == H5D_VIRTUAL) {
    const auto sources = sources_of(plist.id(), std::filesystem::path(file_).parent_path());
    if (!are_plain(sources)) fail(name, "takes rows from something that is not a file");
    believable = bytes_of(sources);
  } else {
    believable = believable_bytes(dataset, plist.id(), file_);
  }
  const std::uint64_t all = product(shape(name));
  if (element == 0 || all > believable / element)
    fail(name, fmt::format("claims {} elements, more than the file can hold: it is damaged", all));
}

template <class T>
std::vector<T> Hdf5Group::read_rows(const std::string& name, std::uint64_t first, std::uint64_t count) const {
  const Shape own = shape(name);
  const Hdf5Handle its = dataset(name);
  const Hdf5Handle type(H5Dget_type(its.id()), H5Tclose);
  if (!converts(type.id(), type_of<T>())) fail(name, "has elements of another type than wanted");
  const bool is_scalar = own.empty();
  const Shape extents = is_scalar ? Shape{1} : own;
  if (first > extents[0] || count > extents[0] - first)
    fail(name, fmt::format("has {} rows; rows {} to {} are wanted", extents[0], first, first + count));
  require_believable(name, its.id(), type.id());
  Shape wanted = extents;
  wanted[0] = count;
  const std::uint64_t n = product(wanted);
  if (n > std::numeric_limits<std::uint32_t>::max()) fail(name, fmt::format("has {} elements to be read at once, too many", n));

  std::vector<T> values(n);
  if (n == 0) return values;
  const Hdf5Handle from = is_scalar ? space_of({}) : rows_of(extents, first, count);
  const Hdf5Handle to = is_scalar ? space_of({}) : space_of(wanted);
  if (!from.is_valid() || H5Dread(its.id(), type_of<T>(), to.id(), from.id(), H5P_DEFAULT, values.data()) < 0)
    fail(name, "cannot be read: " + reason());
  return values;
}

template <class T>
T Hdf5Group::read_one(const std::string& name) const {
  const std::vector<T> values = read<T>(name);
  if (values.size() != 1) fail(name, fmt::format("has {} values; one is wanted", values.size()));
  return values.front();
}

template <class T>
std::vector<T> Hdf5Group::read(const std::string& name) const {
  const Shape extents = shape(name);
  return read_rows<T>(name, 0, extents.empty() ? 1 : extents[0]);
}

std::vector<Vec3> Hdf5Group::read_vectors(const std::string& name) const {
  const Shape extents = shape(name);
  if (extents.size() != 2 || extents[1] != 3) fail(name, "must have three columns");
  const std::vector<double> values = read<double>(name);
  std::vector<Vec3> vectors(extents[0]);
  for (std::size_t i = 0; i < vectors.size(); ++i) vectors[i] = Vec3(&values[3 * i]);
  return vectors;
}

std::string Hdf5Group::read_text(const std::string& name) const {
  if (!shape(name).empty()) fail(name, "must be one text");
  const Hdf5Handle its = dataset(name);
  const Hdf5Handle type(H5Dget_type(its.id()), H5Tclose);
  if (H5Tget_class(type.id()) == H5T_STRING) require_believable(name, its.id(), type.id());
  std::string text;
  if (!read_string(type.id(), text,
                   [&](hid_t memory, void* out) { return H5Dread(its.id(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, out); }))
    fail(name, "cannot be read as a text");
  return text;
}

// ---------------------------------------------------------------- writing

namespace {

/// Properties of a dataset whose chunks carry checksums; the default ones for one without.
Hdf5Handle chunks_with_sums(Hdf5Sums sums, const Shape& shape, std::size_t element_bytes) {
  constexpr std::uint64_t kBytes = std::uint64_t{1} << 20;  // of a chunk, at least a row: HDF5's cache holds as much
  Hdf5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  if (sums == Hdf5Sums::no || shape.empty() || product(shape) == 0) return properties;
  std::vector<hsize_t> chunk(shape.begin(), shape.end());
  const std::uint64_t row_bytes = product(shape) / shape[0] * element_bytes;
  chunk[0] = std::clamp<std::uint64_t>(kBytes / row_bytes, 1, shape[0]);
  H5Pset_chunk(properties.id(), static_cast<int>(chunk.size()), chunk.data());
  H5Pset_fletcher32(properties.id());
  return properties;
}

/// Close what it gives, and look whether that succeeds: it may write the dataset's last bytes.
Hdf5Handle create_dataset(hid_t group, const std::string& name, hid_t type, const Shape& shape, hid_t properties = H5P_DEFAULT) {
  const Hdf5Handle space = space_of(shape);
  return {H5Dcreate2(group, name.c_str(), type, space.id(), H5P_DEFAULT, properties, H5P_DEFAULT), H5Dclose};
}

std::vector<double> flat(const std::vector<Vec3>& vectors) {
  std::vector<double> values(3 * vectors.size());
  for (std::size_t i = 0; i < vectors.size(); ++i) Vec3::Map(&values[3 * i]) = vectors[i];
  return values;
}

}  // namespace

template <class T>
void Hdf5Group::create_rows(const std::string& name, const Shape& shape) {
  Hdf5Handle dataset = create_dataset(handle_.id(), name, type_of<T>(), shape, chunks_with_sums(sums_, shape, sizeof(T)).id());
  if (!dataset.is_valid() || !dataset.close()) fail(name, "cannot be created: " + reason());
}

template <class T>
void Hdf5Group::write_rows(const std::string& name, std::uint64_t first, const std::vector<T>& values) {
  const Shape extents = shape(name);
  Shape written = extents;
  written[0] = 1;
  written[0] = values.size() / std::max<std::uint64_t>(1, product(written));
  if (product(written) != values.size()) fail(name, fmt::format("{} values are not whole rows", values.size()));
  const Hdf5Handle from = space_of(written), to = rows_of(extents, first, written[0]);
  Hdf5Handle dataset = open_dataset(handle_.id(), name);
  if (!to.is_valid() || H5Dwrite(dataset.id(), type_of<T>(), from.id(), to.id(), H5P_DEFAULT, values.data()) < 0 || !dataset.close())
    fail(name, "cannot be written: " + reason());
}

template <class T>
void Hdf5Group::write(const std::string& name, const std::vector<T>& values, const Shape& shape) {
  if (product(shape) != values.size()) fail(name, fmt::format("{} values do not fill the shape", values.size()));
  Hdf5Handle dataset = create_dataset(handle_.id(), name, type_of<T>(), shape, chunks_with_sums(sums_, shape, sizeof(T)).id());
  if (!dataset.is_valid() ||
      (!values.empty() && H5Dwrite(dataset.id(), type_of<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) || !dataset.close())
    fail(name, "cannot be written: " + reason());
}

template <class T>
void Hdf5Group::write(const std::string& name, const std::vector<T>& values) {
  write(name, values, {values.size()});
}

void Hdf5Group::write_vectors(const std::string& name, const std::vector<Vec3>& values) {
  write(name, flat(values), {values.size(), 3});
}

void Hdf5Group::write_text(const std::string& name, const std::string& text) {
  const Hdf5Handle type = text_type();
  Hdf5Handle dataset = create_dataset(handle_.id(), name, type.id(), {});
  const char* raw = text.c_str();
  if (!dataset.is_valid() || H5Dwrite(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, &raw) < 0 || !dataset.close())
    fail(name, "cannot be written: " + reason());
}

void Hdf5Group::write_texts(const std::string& name, const std::vector<std::string>& texts) {
  const Hdf5Handle type = text_type();
  Hdf5Handle dataset = create_dataset(handle_.id(), name, type.id(), {texts.size()});
  std::vector<const char*> raw;
  for (const std::string& text : texts) raw.push_back(text.c_str());
  const bool is_written =
      dataset.is_valid() && (raw.empty() || H5Dwrite(dataset.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, raw.data()) >= 0) && dataset.close();
  if (!is_written) fail(name, "cannot be written: " + reason());
}

template <class T>
void Hdf5Group::write_virtual(const std::string& name, const Shape& row, const std::vector<Hdf5Part>& parts) {
  Shape extents = row;
  extents.insert(extents.begin(), 0);
  for (const Hdf5Part& part : parts) extents[0] += part.rows;
  if (parts.empty()) return write<T>(name, {}, extents);

  const Hdf5Handle properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  const T missing = std::numeric_limits<T>::quiet_NaN();  // 0 for integers
  H5Pset_fill_value(properties.id(), type_of<T>(), &missing);
  std::uint64_t first = 0;
  for (const Hdf5Part& part : parts) {
    Shape source = extents;
    source[0] = part.rows;
    const Hdf5Handle to = rows_of(extents, first, part.rows), from = space_of(source);
    if (H5Pset_virtual(properties.id(), to.id(), part.file.c_str(), part.dataset.c_str(), from.id()) < 0)
      fail(name, fmt::format("cannot take rows from {}: {}", part.file, reason()));
    first += part.rows;
  }
  Hdf5Handle dataset = create_dataset(handle_.id(), name, type_of<T>(), extents, properties.id());
  if (!dataset.is_valid() || !dataset.close())
    fail(name, "cannot be created: " + reason());
}

// ---------------------------------------------------------------- attributes

bool Hdf5Group::has_attribute(const std::string& name, const std::string& attribute) const {
  return (name == "." || has(name)) && H5Aexists_by_name(handle_.id(), name.c_str(), attribute.c_str(), H5P_DEFAULT) > 0;
}

template <class T>
std::vector<T> Hdf5Group::attribute(const std::string& name, const std::string& attribute) const {
  constexpr std::uint64_t kMost = 1 << 16;  // HDF5's own limit for attributes, in bytes
  if (!has_attribute(name, attribute)) fail(name, fmt::format("attribute {} is missing", attribute));
  const Hdf5Handle handle(H5Aopen_by_name(handle_.id(), name.c_str(), attribute.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (!handle.is_valid()) fail(name, fmt::format("attribute {} cannot be opened: {}", attribute, reason()));
  const Hdf5Handle space(H5Aget_space(handle.id()), H5Sclose), type(H5Aget_type(handle.id()), H5Tclose);
  const std::uint64_t n = product(shape_of_space(space.id()));
  if (!converts(type.id(), type_of<T>()) || n > kMost) fail(name, fmt::format("attribute {} has another type or size than wanted", attribute));
  std::vector<T> values(n);
  if (n > 0 && H5Aread(handle.id(), type_of<T>(), values.data()) < 0) fail(name, fmt::format("attribute {} cannot be read: {}", attribute, reason()));
  return values;
}

double Hdf5Group::number_attribute(const std::string& name, const std::string& attribute) const {
  const auto values = this->attribute<double>(name, attribute);
  if (values.size() != 1) fail(name, fmt::format("attribute {} has {} values; one is wanted", attribute, values.size()));
  return values.front();
}

std::string Hdf5Group::text_attribute(const std::string& name, const std::string& attribute) const {
  if (!has_attribute(name, attribute)) fail(name, fmt::format("attribute {} is missing", attribute));
  const Hdf5Handle handle(H5Aopen_by_name(handle_.id(), name.c_str(), attribute.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (!handle.is_valid()) fail(name, fmt::format("attribute {} cannot be opened: {}", attribute, reason()));
  const Hdf5Handle type(H5Aget_type(handle.id()), H5Tclose), space(H5Aget_space(handle.id()), H5Sclose);
  std::string text;
  if (product(shape_of_space(space.id())) != 1 ||
      !read_string(type.id(), text, [&](hid_t memory, void* out) { return H5Aread(handle.id(), memory, out); }))
    fail(name, fmt::format("attribute {} cannot be read as a text", attribute));
  return text;
}

template <class T>
void Hdf5Group::write_attribute(const std::string& name, const std::string& attribute, const std::vector<T>& values) {
  const Hdf5Handle space = space_of(values.size() == 1 ? Shape{} : Shape{values.size()});
  const Hdf5Handle handle(H5Acreate_by_name(handle_.id(), name.c_str(), attribute.c_str(), type_of<T>(), space.id(), H5P_DEFAULT,
                                            H5P_DEFAULT, H5P_DEFAULT),
                          H5Aclose);
  if (!handle.is_valid() || H5Awrite(handle.id(), type_of<T>(), values.data()) < 0)
    fail(name, fmt::format("attribute {} cannot be written: {}", attribute, reason()));
}

void Hdf5Group::write_attribute(const std::string& name, const std::string& attribute, const std::string& text) {
  const Hdf5Handle type = text_type(), space = space_of({});
  const Hdf5Handle handle(H5Acreate_by_name(handle_.id(), name.c_str(), attribute.c_str(), type.id(), space.id(), H5P_DEFAULT,
                                            H5P_DEFAULT, H5P_DEFAULT),
                          H5Aclose);
  const char* raw = text.c_str();
  if (!handle.is_valid() || H5Awrite(handle.id(), type.id(), &raw) < 0)
    fail(name, fmt::format("attribute {} cannot be written: {}", attribute, reason()));
}

void Hdf5Group::write_attribute(const std::string& name, const std::string& attribute, const std::vector<std::string>& texts) {
  const Hdf5Handle type = text_type(), space = space_of({texts.size()});
  const Hdf5Handle handle(H5Acreate_by_name(handle_.id(), name.c_str(), attribute.c_str(), type.id(), space.id(), H5P_DEFAULT,
                                            H5P_DEFAULT, H5P_DEFAULT),
                          H5Aclose);
  std::vector<const char*> raw;
  for (const std::string& text : texts) raw.push_back(text.c_str());
  if (!handle.is_valid() || H5Awrite(handle.id(), type.id(), raw.data()) < 0)
    fail(name, fmt::format("attribute {} cannot be written: {}", attribute, reason()));
}

// ---------------------------------------------------------------- files

namespace {

void set_up_library() {
  // Every file is closed by its owner. One that a full disk kept from that must not be tried again at exit: HDF5 crashes.
  static const bool once = H5dont_atexit() >= 0;
  (void)once;
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);  // we report failures ourselves
}

}  // namespace

Hdf5File Hdf5File::create(const std::filesystem::path& path, Hdf5Sums sums) {
  set_up_library();
  // Strong: close() writes everything out even while groups are open; else that would wait for the last of them.
  const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  H5Pset_fclose_degree(access.id(), H5F_CLOSE_STRONG);
  // Since version 1.8 of the format headers carry checksums: the library finds a damaged one, and is not led astray by it.
  // Version 1.10 has them over all metadata.
  if (sums == Hdf5Sums::yes) H5Pset_libver_bounds(access.id(), H5F_LIBVER_V110, H5F_LIBVER_V110);
  else H5Pset_libver_bounds(access.id(), H5F_LIBVER_V18, H5F_LIBVER_LATEST);
  Hdf5Handle handle(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.id()), H5Fclose);
  if (!handle.is_valid()) throw FileError(fmt::format("{}: cannot be created: {}", path.string(), reason()));
  return {std::move(handle), path.string(), "/", sums};
}

Hdf5File Hdf5File::open(const std::filesystem::path& path) {
  set_up_library();
  std::error_code ignored;
  if (std::filesystem::exists(path, ignored) && !std::filesystem::is_regular_file(path, ignored))
    throw FileError(fmt::format("{}: is not a file; an HDF5 file is wanted", path.string()));
  if (std::ifstream readable(path); !readable)
    throw FileError(fmt::format("{}: cannot be read: {}", path.string(), std::strerror(errno)));
  Hdf5Handle handle(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  if (!handle.is_valid()) throw FileError(fmt::format("{}: is not an HDF5 file, or is damaged: {}", path.string(), reason()));
  return {std::move(handle), path.string(), "/", Hdf5Sums::no};
}

void Hdf5File::close() {
  if (!handle_.close()) fail("", "cannot be written in full: " + reason());
}

#define GC_INSTANTIATE(T)                                                                                           \
  template std::vector<T> Hdf5Group::read(const std::string&) const;                                                \
  template std::vector<T> Hdf5Group::read_rows(const std::string&, std::uint64_t, std::uint64_t) const;             \
  template T Hdf5Group::read_one(const std::string&) const;                                                         \
  template void Hdf5Group::write(const std::string&, const std::vector<T>&);                                        \
  template void Hdf5Group::write(const std::string&, const std::vector<T>&, const Shape&);                          \
  template void Hdf5Group::create_rows<T>(const std::string&, const Shape&);                                             \
  template void Hdf5Group::write_rows(const std::string&, std::uint64_t, const std::vector<T>&);                    \
  template void Hdf5Group::write_virtual<T>(const std::string&, const Shape&, const std::vector<Hdf5Part>&);        \
  template std::vector<T> Hdf5Group::attribute(const std::string&, const std::string&) const;                       \
  template void Hdf5Group::write_attribute(const std::string&, const std::string&, const std::vector<T>&);
GC_INSTANTIATE(double)
GC_INSTANTIATE(std::int64_t)
GC_INSTANTIATE(std::uint64_t)
GC_INSTANTIATE(std::uint8_t)
#undef GC_INSTANTIATE

}  // namespace grainclock::core
