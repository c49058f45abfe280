#include "dynamics/output/csv.hpp"

#include <fmt/format.h>

namespace espalier::dynamics {
namespace {

std::string quoted(const std::string& name) {
  if (name.find_first_of(",\"\n") == std::string::npos) return name;
  std::string result = "\"";
  for (const char c : name) {
    if (c == '"') result += '"';
    result += c;
  }
  return result + "\"";
}

}  // namespace

CsvWriter::CsvWriter(std::string path, std::vector<CsvColumn> columns)
    : path_(std::move(path)), columns_(std::move(columns)), out_(path_) {
  out_ << "time";
  for (const CsvColumn& column : columns_) out_ << ',' << quoted(column.name);
  out_ << '\n';
  if (!out_)
    throw Error(StatusCode::invalid_input, fmt::format("{}: cannot write the file (does its folder exist?)", path_));
}

void CsvWriter::write(const StateView& state) {
  out_ << fmt::format("{}", state.t);
  for (const CsvColumn& column : columns_) out_ << fmt::format(",{}", column.value(state));
  out_ << '\n' << std::flush;
  if (!out_) throw Error(StatusCode::invalid_input, fmt::format("{}: writing failed (is the disk full?)", path_));
  ++lines_;
}

}  // namespace espalier::dynamics
