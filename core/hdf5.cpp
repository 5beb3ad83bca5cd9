#include "core/hdf5.hpp"

#include "core/check.hpp"

#include <hdf5.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <limits>
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

/// Whole numbers read as whole numbers, floats as floats: a silent conversion between them would lose digits.
bool converts(hid_t stored, hid_t wanted) { return H5Tget_class(stored) == H5Tget_class(wanted); }

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

bool Hdf5Group::has(const std::string& name) const {
  for (std::size_t slash = name.find('/'); slash != std::string::npos; slash = name.find('/', slash + 1))
    if (H5Lexists(handle_.id(), name.substr(0, slash).c_str(), H5P_DEFAULT) <= 0) return false;
  return H5Lexists(handle_.id(), name.c_str(), H5P_DEFAULT) > 0;
}

bool Hdf5Group::is_group(const std::string& name) const {
  if (!has(name)) return false;
  const Hdf5Handle object(H5Oopen(handle_.id(), name.c_str(), H5P_DEFAULT), H5Oclose);
  return object.is_valid() && H5Iget_type(object.id()) == H5I_GROUP;
}

std::vector<std::string> Hdf5Group::names() const {
  std::vector<std::string> found;
  const auto note = [](hid_t, const char* name, const H5L_info_t*, void* out) -> herr_t {
    static_cast<std::vector<std::string>*>(out)->emplace_back(name);
    return 0;
  };
  if (H5Literate(handle_.id(), H5_INDEX_NAME, H5_ITER_INC, nullptr, note, &found) < 0) fail("", "cannot be listed: " + reason());
  return found;
}

Hdf5Group Hdf5Group::group(const std::string& name) const {
  Hdf5Handle handle(H5Gopen2(handle_.id(), name.c_str(), H5P_DEFAULT), H5Gclose);
  if (!handle.is_valid()) fail(name, has(name) ? "this group cannot be opened: " + reason() : "this group is missing");
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

/// The most bytes that the file can really hold for the dataset: a damaged header must not ask for more memory.
std::uint64_t believable_bytes(hid_t dataset) {
  constexpr std::uint64_t kBestCompression = 1100;  // of deflate, a little above its limit of 1032
  const Hdf5Handle plist(H5Dget_create_plist(dataset), H5Pclose);
  const H5D_layout_t layout = H5Pget_layout(plist.id());
  if (layout == H5D_VIRTUAL) return std::numeric_limits<std::uint64_t>::max();
  const Hdf5Handle file(H5Iget_file_id(dataset), H5Fclose);
  hsize_t size = 0;
  H5Fget_filesize(file.id(), &size);
  return layout == H5D_CHUNKED ? size * kBestCompression : size;
}

}  // namespace

Hdf5Group::Shape Hdf5Group::shape(const std::string& name) const {
  const Hdf5Handle dataset = open_dataset(handle_.id(), name);
  if (!dataset.is_valid()) fail(name, has(name) ? "this dataset cannot be opened: " + reason() : "this dataset is missing");
  const Hdf5Handle space(H5Dget_space(dataset.id()), H5Sclose);
  return shape_of_space(space.id());
}

template <class T>
std::vector<T> Hdf5Group::read_rows(const std::string& name, std::uint64_t first, std::uint64_t count) const {
  Shape extents = shape(name);
  const Hdf5Handle dataset = open_dataset(handle_.id(), name);
  const Hdf5Handle type(H5Dget_type(dataset.id()), H5Tclose);
  if (!converts(type.id(), type_of<T>())) fail(name, "has elements of another type than wanted");
  if (extents.empty()) extents = {1};
  if (first > extents[0] || count > extents[0] - first)
    fail(name, fmt::format("has {} rows; rows {} to {} are wanted", extents[0], first, first + count));
  Shape wanted = extents;
  wanted[0] = count;
  const std::uint64_t n = product(wanted), all = product(extents);
  if (all > believable_bytes(dataset.id()) / H5Tget_size(type.id()) || n > std::numeric_limits<std::uint32_t>::max())
    fail(name, fmt::format("claims {} elements, more than the file can hold: it is damaged", all));

  std::vector<T> values(n);
  if (n == 0) return values;
  const bool is_scalar = shape(name).empty();
  const Hdf5Handle from = is_scalar ? space_of({}) : rows_of(extents, first, count);
  const Hdf5Handle to = is_scalar ? space_of({}) : space_of(wanted);
  if (!from.is_valid() || H5Dread(dataset.id(), type_of<T>(), to.id(), from.id(), H5P_DEFAULT, values.data()) < 0)
    fail(name, "cannot be read: " + reason());
  return values;
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
  const Hdf5Handle dataset = open_dataset(handle_.id(), name);
  const Hdf5Handle type(H5Dget_type(dataset.id()), H5Tclose);
  std::string text;
  if (!read_string(type.id(), text,
                   [&](hid_t memory, void* out) { return H5Dread(dataset.id(), memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, out); }))
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
  const Hdf5Handle handle(H5Aopen_by_name(handle_.id(), name.c_str(), attribute.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (!handle.is_valid()) fail(name, fmt::format("attribute {} is missing", attribute));
  const Hdf5Handle space(H5Aget_space(handle.id()), H5Sclose), type(H5Aget_type(handle.id()), H5Tclose);
  const std::uint64_t n = product(shape_of_space(space.id()));
  if (!converts(type.id(), type_of<T>()) || n > kMost) fail(name, fmt::format("attribute {} has another type or size than wanted", attribute));
  std::vector<T> values(n);
  if (H5Aread(handle.id(), type_of<T>(), values.data()) < 0) fail(name, fmt::format("attribute {} cannot be read: {}", attribute, reason()));
  return values;
}

std::string Hdf5Group::text_attribute(const std::string& name, const std::string& attribute) const {
  const Hdf5Handle handle(H5Aopen_by_name(handle_.id(), name.c_str(), attribute.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  if (!handle.is_valid()) fail(name, fmt::format("attribute {} is missing", attribute));
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
  if (sums == Hdf5Sums::yes) H5Pset_libver_bounds(access.id(), H5F_LIBVER_V110, H5F_LIBVER_V110);  // has sums over metadata
  Hdf5Handle handle(H5Fcreate(path.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.id()), H5Fclose);
  if (!handle.is_valid()) throw FileError(fmt::format("{}: cannot be created: {}", path.string(), reason()));
  return {std::move(handle), path.string(), "/", sums};
}

Hdf5File Hdf5File::open(const std::filesystem::path& path) {
  set_up_library();
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
