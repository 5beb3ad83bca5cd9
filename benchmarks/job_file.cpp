#include "benchmarks/job_file.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "silo/provenance.hpp"

#include <cmath>
#include <limits>

namespace grainclock::benchmarks {
namespace {

constexpr const char* kGroup = "job";

}  // namespace

void FieldWriter::add_unit(const char* name, const char* unit) {
  if (*unit) group_.write_attribute(name, "unit", std::string(unit));
}
void FieldWriter::operator()(const char* name, const char* unit, double number) {
  group_.write(name, std::vector{number}, {});
  add_unit(name, unit);
}
void FieldWriter::operator()(const char* name, const char* unit, std::uint64_t number) {
  group_.write(name, std::vector{number}, {});
  add_unit(name, unit);
}
void FieldWriter::operator()(const char* name, const char* unit, const std::optional<double>& number) {
  (*this)(name, unit, number.value_or(std::numeric_limits<double>::quiet_NaN()));
}
void FieldWriter::operator()(const char* name, const char*, const std::string& text) { group_.write_text(name, text); }
void FieldWriter::operator()(const char* name, const char* unit, const std::vector<double>& numbers) {
  group_.write(name, numbers);
  add_unit(name, unit);
}

template <class Number>
Number FieldReader::scalar(const char* name) const {
  return group_.read_one<Number>(name);
}
void FieldReader::operator()(const char* name, const char*, double& number) { number = scalar<double>(name); }
void FieldReader::operator()(const char* name, const char*, std::uint64_t& number) { number = scalar<std::uint64_t>(name); }
void FieldReader::operator()(const char* name, const char*, std::optional<double>& number) {
  const double read = scalar<double>(name);
  number = std::isnan(read) ? std::nullopt : std::optional(read);
}
void FieldReader::operator()(const char* name, const char*, std::string& text) { text = group_.read_text(name); }
void FieldReader::operator()(const char* name, const char*, std::vector<double>& numbers) {
  numbers = group_.read<double>(name);
}

void write_job_file(const std::filesystem::path& path, const JobOrigin& origin,
                    const std::function<void(FieldWriter&)>& fields) {
  core::AsideFile aside(path);
  core::Hdf5File file = core::Hdf5File::create(aside.part());
  {
    FieldWriter writer(file.create_group(kGroup));
    fields(writer);
  }  // the group must be closed before its file
  silo::write_provenance(file, origin.threads, origin.scene.seed, origin.scene.text);
  file.close();
  aside.commit();
}

JobMaker read_job_file(const std::filesystem::path& path, const std::function<void(FieldReader&)>& fields) {
  const core::Hdf5File file = core::Hdf5File::open(path);
  FieldReader reader(file.group(kGroup));
  fields(reader);
  const core::Hdf5Group origin = file.group("provenance");
  const std::string host = origin.read_text("host");
  return {host.substr(0, host.find(' ')),  // the rest is its system
          origin.read_text("git_revision"), origin.read_one<std::int64_t>("threads")};
}

}  // namespace grainclock::benchmarks
