// Named results, as lines for people or as JSON for programs.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace grainclock::silo {

class Report {
 public:
  /// `key` for JSON, `label` and `unit` for the line. Numbers that are not finite are null in JSON.
  void add(const std::string& key, const std::string& label, double value, const std::string& unit = "");
  void add(const std::string& key, const std::string& label, std::int64_t value, const std::string& unit = "");
  void add(const std::string& key, const std::string& label, const std::string& value);
  void add(const std::string& key, const std::string& label, const std::vector<double>& values, const std::string& unit = "");
  /// A report within the report, under a heading of its own.
  void add(const std::string& key, const std::string& heading, const Report& part);
  void warn(const std::string& text) { warnings_.push_back(text); }

  const std::vector<std::string>& warnings() const { return warnings_; }
  /// Lines "label: value unit", then the warnings.
  std::string text(int indent = 0) const;
  std::string json(int indent = 0) const;

 private:
  struct Entry {
    std::string key, line, json;
    std::vector<Report> part;  // at most one
  };
  std::vector<Entry> entries_;
  std::vector<std::string> warnings_;
};

}  // namespace grainclock::silo
