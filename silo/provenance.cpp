#include "silo/provenance.hpp"

#include "core/kernels.hpp"

#include <grainclock_provenance.hpp>

#include <Eigen/Core>
#include <fmt/format.h>
#include <hdf5.h>
#include <sys/utsname.h>
#include <toml++/impl/version.h>

namespace grainclock::silo {

std::string version() { return kVersion; }

std::vector<std::pair<std::string, std::string>> provenance() {
  utsname machine{};
  const bool is_known = ::uname(&machine) == 0;
  return {{"version", kVersion},
          {"git_revision", kGitRevision},
          {"compiler", kCompiler},
          {"flags", kFlags},
          {"kernels", core::kernels().name},
          {"host", is_known ? fmt::format("{} ({} {} {})", machine.nodename, machine.sysname, machine.release, machine.machine)
                            : std::string("unknown")},
          {"libraries", fmt::format("Eigen {}.{}.{}, HDF5 {}.{}.{}, fmt {}.{}.{}, toml++ {}.{}.{}", EIGEN_WORLD_VERSION, EIGEN_MAJOR_VERSION,
                                    EIGEN_MINOR_VERSION, H5_VERS_MAJOR, H5_VERS_MINOR, H5_VERS_RELEASE, FMT_VERSION / 10000, FMT_VERSION / 100 % 100, FMT_VERSION % 100,
                                    TOML_LIB_MAJOR, TOML_LIB_MINOR, TOML_LIB_PATCH)}};
}

void write_provenance(core::Hdf5Group& file, int threads, std::uint64_t seed, const std::string& scene_text) {
  core::Hdf5Group group = file.create_group("provenance");
  for (const auto& [name, value] : provenance()) group.write_text(name, value);
  group.write("threads", std::vector<std::int64_t>{threads}, {});
  group.write("seed", std::vector<std::uint64_t>{seed}, {});
  group.write_text("scene", scene_text);
}

}  // namespace grainclock::silo
