#include "silo/measure.hpp"

#include "core/check.hpp"
#include "core/files.hpp"
#include "core/scene.hpp"
#include "core/share_work.hpp"
#include "core/toml_keys.hpp"
#include "silo/between_frames.hpp"
#include "silo/frame_contacts.hpp"
#include "silo/observables.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <exception>
#include <filesystem>

namespace grainclock::silo {
namespace {

using core::State;

/// One frame, and what is measured of it.
struct Moment {
  double time = 0.0;  // s
  State state;
  std::vector<core::Contact> contacts;
  Reading reading;
  std::exception_ptr trouble;
};

SiloShape shape_of(const RunReader& run, const std::string& path, const MeasureOptions& options) {
  if (!options.silo.empty()) return read_silo(core::read_scene(options.silo, {}));
  const toml::table scene = run.scene();
  const toml::table* silo = scene["silo"].as_table();
  GC_REQUIRE(silo, "{}: its scene has no [silo] table; name a scene that has the wall's with --silo SCENE", path);
  return parse_silo(core::TomlKeys(*silo, "[silo]", path));
}

MeasuredSilo silo_of(const RunReader& run, const std::string& path, const MeasureOptions& options) {
  const std::optional<Layers> layers = layers_of(run.state(0));
  GC_REQUIRE(layers, "{}: there are no wall balls to measure pressures on", path);
  return {shape_of(run, path, options), *layers,
          run.scene()["material"]["density"].value_or(core::Materials{}.density)};
}

std::vector<std::int64_t> chosen_frames(const RunReader& run, std::optional<double> every) {
  std::vector<std::int64_t> frames;
  for (std::int64_t frame = 0; frame < run.frames(); ++frame) {
    const auto time_of = [&](std::int64_t f) { return run.times()[static_cast<std::size_t>(f)]; };
    // Recorded times have roundings that a wanted interval need not have.
    constexpr double kRounding = 1.0 - 1e-9;
    if (frames.empty() || !every || time_of(frame) - time_of(frames.back()) >= kRounding * *every) frames.push_back(frame);
  }
  return frames;
}

/// Where the file goes. Throws FileError now rather than after all the work.
std::filesystem::path output_of(const std::filesystem::path& run, const MeasureOptions& options) {
  if (options.output.empty()) return (std::filesystem::is_directory(run) ? run : run.parent_path()) / "measures.h5";
  std::filesystem::path output = options.output;
  if (output.has_parent_path() && !std::filesystem::is_directory(output.parent_path()))
    throw core::FileError(fmt::format("{}: there is no directory {} to write it to", output.string(), output.parent_path().string()));
  return output;
}

/// Tables that grow by one row per frame.
class Tables {
 public:
  void add(const Moment& moment) {
    const Reading& reading = moment.reading;
    time_.push_back(moment.time);
    if (columns_.empty()) columns_ = reading.series;
    for (std::size_t k = 0; k < columns_.size() && time_.size() > 1; ++k) {
      const std::vector<double>& values = reading.series[k].values;
      columns_[k].values.insert(columns_[k].values.end(), values.begin(), values.end());
    }
    wall_ = reading.wall;
    for (const WallLoad& load : reading.wall) pressure_.push_back(load.pressure());
    for (const auto& [a, b] : reading.bonds) bonds_.insert(bonds_.end(), {static_cast<std::int64_t>(a), static_cast<std::int64_t>(b)});
    bonds_begin_.push_back(static_cast<std::int64_t>(bonds_.size() / 2));
  }

  void write(const std::filesystem::path& path, const MeasuredSilo& silo, const std::optional<BetweenFrames>& between) const {
    core::AsideFile aside(path);
    core::Hdf5File file = core::Hdf5File::create(aside.part());
    file.write_attribute(".", "kind", std::string("measures"));
    write_column(file, {"time", "s", {}, time_});
    core::Hdf5Group series = file.create_group("series");
    for (const Observable& column : columns_) write_column(series, column);
    series.write_attribute(".", "layer_edges", edges(silo.layers));
    series.write_attribute(".", "force_edges", force_edges());
    core::Hdf5Group wall = file.create_group("wall");
    write_wall(wall);
    core::Hdf5Group bridges = file.create_group("bridges");
    bridges.write("bonds", bonds_, {bonds_.size() / 2, 2});
    bridges.write("begin", bonds_begin_);
    bridges.write_attribute(".", "least", std::vector<std::int64_t>{kLargeBridge});
    if (between) {
      core::Hdf5Group group = file.create_group("between_frames");
      silo::write(group, *between);
    }
    file.close();
    aside.commit();
  }

 private:
  void write_column(core::Hdf5Group& group, const Observable& column) const {
    core::Hdf5Group::Shape shape{time_.size()};
    shape.insert(shape.end(), column.shape.begin(), column.shape.end());
    group.write(column.name, column.values, shape);
    group.write_attribute(column.name, "unit", column.unit);
  }

  void write_wall(core::Hdf5Group& group) const {
    std::vector<std::int64_t> id;
    for (const WallLoad& load : wall_) id.push_back(static_cast<std::int64_t>(load.id));
    group.write("id", id);
    const auto write = [&](const char* name, const char* unit, auto value) {
      std::vector<double> values;
      for (const WallLoad& load : wall_) values.push_back(value(load));
      group.write(name, values);
      group.write_attribute(name, "unit", std::string(unit));
    };
    write("angle", "rad", [](const WallLoad& load) { return load.angle; });
    write("around", "m", [](const WallLoad& load) { return load.around; });
    write("along", "m", [](const WallLoad& load) { return load.along; });
    write("z", "m", [](const WallLoad& load) { return load.position.z(); });
    write("area", "m2", [](const WallLoad& load) { return load.area; });
    write_column(group, {"pressure", "Pa", {wall_.size()}, pressure_});
  }

  std::vector<double> time_, pressure_;
  std::vector<std::int64_t> bonds_, bonds_begin_{0};
  std::vector<Observable> columns_;
  std::vector<WallLoad> wall_;
};

/// Lines now and then, and at the end.
class MeasureProgress {
 public:
  explicit MeasureProgress(std::size_t frames) : frames_(frames) {}

  void note(std::size_t done) {
    constexpr double kBetween = 2.0;  // s
    const double now = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
    if (done < frames_ && now - last_ < kBetween) return;
    last_ = now;
    const double rate = static_cast<double>(done) / now;
    fmt::print("{} of {} frames measured, {:.2g} frames/s, about {:.0f} s left\n", done, frames_, rate,
               static_cast<double>(frames_ - done) / rate);
    std::fflush(stdout);
  }

 private:
  std::size_t frames_;
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
  double last_ = 0.0;  // s
};

}  // namespace

void measure_run(const std::string& path, const MeasureOptions& options) {
  const RunReader run(path);
  GC_REQUIRE(run.frames() > 0, "{}: holds no frames yet", path);
  const std::filesystem::path output = output_of(path, options);
  const ContactFinder finder(run);
  const MeasuredSilo silo = silo_of(run, path, options);
  const std::vector<std::int64_t> frames = chosen_frames(run, options.every);
  MeasureProgress progress(frames.size());
  Tables tables;
  std::optional<State> before;
  std::vector<Moment> some;
  for (std::size_t first = 0; first < frames.size(); first += some.size()) {
    some.clear();
    // HDF5 is read by one thread only.
    for (std::size_t k = first; k < std::min(frames.size(), first + static_cast<std::size_t>(options.threads)); ++k) {
      Moment moment;
      moment.time = run.times()[static_cast<std::size_t>(frames[k])];
      moment.state = run.state(frames[k]);
      moment.contacts = finder.contacts(frames[k], moment.state).contacts;
      some.push_back(std::move(moment));
    }
    core::share_work(static_cast<int>(some.size()), [&](int t) {
      Moment& moment = some[static_cast<std::size_t>(t)];
      const State* its_before = t > 0 ? &some[static_cast<std::size_t>(t) - 1].state : before ? &*before : nullptr;
      try {
        moment.reading = moment_of(moment.state, moment.contacts, its_before, silo);
      } catch (...) {
        moment.trouble = std::current_exception();
      }
    });
    for (const Moment& moment : some) {
      if (moment.trouble) std::rethrow_exception(moment.trouble);
      tables.add(moment);
    }
    before = some.back().state;
    progress.note(first + some.size());
  }
  tables.write(output, silo, between_frames(run));
  fmt::print("written: {}\n", output.string());
}

}  // namespace grainclock::silo
