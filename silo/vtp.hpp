// VTK's files of points and lines (.vtp), and their collections over time (.pvd), as ParaView reads them.
//
// Arrays stand behind the XML as raw bytes, each with its length before it, so that a file is hardly larger than its data.
// Written by hand: it is a page of code, where VTK's own library would add hundreds of megabytes of packages to every build.
// Format: https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html
#pragma once

#include "core/state.hpp"

#include <cstdint>
#include <string>
#include <utility>
#include <vector>

namespace grainclock::silo {

class Vtp {
 public:
  enum class Cells {
    vertices,  // each point is one; arrays belong to the points
    lines,     // the points are the ends of lines, two by two; arrays belong to the lines
  };
  /// `time` [s], `points` [m].
  Vtp(Cells cells, double time, const std::vector<core::Vec3>& points);

  /// Adds an array, one value (or vector) per vertex or line. Throws InputError if there are more or fewer.
  void add(const std::string& name, const std::vector<double>& values);
  void add(const std::string& name, const std::vector<std::int64_t>& values);
  void add(const std::string& name, const std::vector<std::uint8_t>& values);
  void add(const std::string& name, const std::vector<core::Vec3>& values);

  /// The whole file.
  std::string text() const;

 private:
  template <class T>
  std::string element(const char* type, const std::string& name, int components, const std::vector<T>& values);
  template <class T>
  void add_array(const char* type, const std::string& name, int components, const std::vector<T>& values);

  Cells cells_;
  std::size_t count_;  // of vertices or lines
  std::string time_, points_, connectivity_, arrays_;  // XML elements
  std::string bytes_;                                  // what they refer to
};

/// A collection: times [s] and the files that show them, as seen from the collection's own directory.
std::string pvd_text(const std::vector<std::pair<double, std::string>>& files);

}  // namespace grainclock::silo
