#include "dynamics/output/csv.hpp"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>

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

CsvWriter::CsvWriter(std::string path, std::vector<CsvColumn> columns, double keep_until)
    : path_(std::move(path)), columns_(std::move(columns)) {
  std::string header = "time";
  for (const CsvColumn& column : columns_) header += ',' + quoted(column.name);
  std::string kept;
  if (!std::isnan(keep_until)) {
    std::ifstream in(path_);
    std::string line;
    if (std::getline(in, line) && line != header)
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}: the file has other columns than this run; give another folder", path_));
    while (std::getline(in, line)) {
      const double t = std::strtod(line.c_str(), nullptr);
      if (t > keep_until) break;
      kept += line + '\n';
      kept_ = t;
      ++lines_;
    }
  }
  out_.open(path_, std::ios::trunc);
  out_ << header << '\n' << kept << std::flush;
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
