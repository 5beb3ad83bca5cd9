#include "silo/report.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>

namespace grainclock::silo {
namespace {

std::string json_text(const std::string& text) {
  std::string out = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\')
      out += fmt::format("\\{}", c);
    else if (static_cast<unsigned char>(c) < 0x20)
      out += fmt::format("\\u{:04x}", static_cast<unsigned>(c));
    else
      out += c;
  }
  return out + "\"";
}

std::string json_number(double value) { return std::isfinite(value) ? fmt::format("{}", value) : "null"; }

std::string line(const std::string& label, const std::string& value, const std::string& unit) {
  return fmt::format("{}: {}{}{}", label, value, unit.empty() ? "" : " ", unit);
}

}  // namespace

void Report::add(const std::string& key, const std::string& label, double value, const std::string& unit) {
  entries_.push_back({key, line(label, fmt::format("{:.5g}", value), unit), json_number(value), {}});
}

void Report::add(const std::string& key, const std::string& label, std::int64_t value, const std::string& unit) {
  entries_.push_back({key, line(label, fmt::format("{}", value), unit), fmt::format("{}", value), {}});
}

void Report::add(const std::string& key, const std::string& label, const std::string& value) {
  entries_.push_back({key, line(label, value, ""), json_text(value), {}});
}

void Report::add(const std::string& key, const std::string& label, const std::vector<double>& values, const std::string& unit) {
  std::vector<std::string> shown, exact;
  for (const double value : values) {
    shown.push_back(fmt::format("{:.5g}", value));
    exact.push_back(json_number(value));
  }
  entries_.push_back({key, line(label, fmt::format("{}", fmt::join(shown, " ")), unit), fmt::format("[{}]", fmt::join(exact, ", ")), {}});
}

void Report::add(const std::string& key, const std::string& heading, const Report& part) {
  entries_.push_back({key, heading, "", {part}});
}

std::string Report::text(int indent) const {
  const std::string margin(static_cast<std::size_t>(indent), ' ');
  std::string out;
  for (const Entry& entry : entries_) {
    out += margin + entry.line + "\n";
    for (const Report& part : entry.part) out += part.text(indent + 2);
  }
  for (const std::string& warning : warnings_) out += fmt::format("{}warning: {}\n", margin, warning);
  return out;
}

std::string Report::json(int indent) const {
  const std::string margin(static_cast<std::size_t>(indent) + 2, ' ');
  std::vector<std::string> fields;
  for (const Entry& entry : entries_)
    fields.push_back(fmt::format("{}{}: {}", margin, json_text(entry.key), entry.part.empty() ? entry.json : entry.part[0].json(indent + 2)));
  if (!warnings_.empty()) {
    std::vector<std::string> texts;
    for (const std::string& warning : warnings_) texts.push_back(json_text(warning));
    fields.push_back(fmt::format("{}\"warnings\": [{}]", margin, fmt::join(texts, ", ")));
  }
  return fmt::format("{{\n{}\n{}}}", fmt::join(fields, ",\n"), std::string(static_cast<std::size_t>(indent), ' '));
}

}  // namespace grainclock::silo
