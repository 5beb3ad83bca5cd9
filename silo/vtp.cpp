#include "silo/vtp.hpp"

#include "core/check.hpp"

#include <bit>
#include <numeric>

namespace grainclock::silo {

using core::Vec3;

namespace {

std::vector<double> flat(const std::vector<Vec3>& vectors) {
  std::vector<double> values;
  values.reserve(3 * vectors.size());
  for (const Vec3& v : vectors) values.insert(values.end(), v.data(), v.data() + 3);
  return values;
}

}  // namespace

Vtp::Vtp(Cells cells, double time, const std::vector<Vec3>& points)
    : cells_(cells), count_(cells == Cells::lines ? points.size() / 2 : points.size()) {
  GC_REQUIRE(cells == Cells::vertices || points.size() % 2 == 0, "{} points for lines: give two for each", points.size());
  std::vector<std::int64_t> connectivity(points.size()), offsets(count_);
  std::iota(connectivity.begin(), connectivity.end(), 0);
  for (std::size_t cell = 0; cell < count_; ++cell)  // where the next cell begins
    offsets[cell] = static_cast<std::int64_t>((cell + 1) * (cells == Cells::lines ? 2 : 1));
  time_ = element("Float64", "TimeValue", 1, std::vector{time});
  points_ = element("Float64", "position", 3, flat(points));
  connectivity_ = element("Int64", "connectivity", 1, connectivity);
  connectivity_ += element("Int64", "offsets", 1, offsets);
}

template <class T>
std::string Vtp::element(const char* type, const std::string& name, int components, const std::vector<T>& values) {
  std::string xml =
      fmt::format("<DataArray type=\"{}\" Name=\"{}\" NumberOfComponents=\"{}\" format=\"appended\" offset=\"{}\"{}/>\n", type, name, components,
                  bytes_.size(), name == "TimeValue" ? " NumberOfTuples=\"1\"" : "");  // of field data no count is said elsewhere
  const std::uint64_t length = values.size() * sizeof(T);
  bytes_.append(reinterpret_cast<const char*>(&length), sizeof length);
  bytes_.append(reinterpret_cast<const char*>(values.data()), length);
  return xml;
}

template <class T>
void Vtp::add_array(const char* type, const std::string& name, int components, const std::vector<T>& values) {
  GC_REQUIRE(values.size() == count_ * static_cast<std::size_t>(components), "{} values of {} for {} {}: give one each",
             values.size() / static_cast<std::size_t>(components), name, count_, cells_ == Cells::lines ? "lines" : "points");
  arrays_ += element(type, name, components, values);
}

void Vtp::add(const std::string& name, const std::vector<double>& values) { add_array("Float64", name, 1, values); }
void Vtp::add(const std::string& name, const std::vector<std::int64_t>& values) { add_array("Int64", name, 1, values); }
void Vtp::add(const std::string& name, const std::vector<std::uint8_t>& values) { add_array("UInt8", name, 1, values); }
void Vtp::add(const std::string& name, const std::vector<Vec3>& values) { add_array("Float64", name, 3, flat(values)); }

std::string Vtp::text() const {
  const bool lines = cells_ == Cells::lines;
  const char *of_cells = lines ? "Lines" : "Verts", *data = lines ? "CellData" : "PointData";
  std::string text = fmt::format("<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"{}\" header_type=\"UInt64\">\n",
                                 std::endian::native == std::endian::little ? "LittleEndian" : "BigEndian");
  text += "<PolyData>\n<FieldData>\n" + time_ + "</FieldData>\n";
  text += fmt::format("<Piece NumberOfPoints=\"{}\" NumberOf{}=\"{}\">\n", lines ? 2 * count_ : count_, of_cells, count_);
  text += fmt::format("<{0}>\n{1}</{0}>\n<Points>\n{2}</Points>\n<{3}>\n{4}</{3}>\n", data, arrays_, points_, of_cells, connectivity_);
  return text + "</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_" + bytes_ + "\n</AppendedData>\n</VTKFile>\n";
}

std::string pvd_text(const std::vector<std::pair<double, std::string>>& files) {
  std::string text = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n";
  for (const auto& [time, file] : files) text += fmt::format("<DataSet timestep=\"{:.17g}\" file=\"{}\"/>\n", time, file);
  return text + "</Collection>\n</VTKFile>\n";
}

}  // namespace grainclock::silo
