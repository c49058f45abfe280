#include "dynamics/output/csv.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <system_error>

#include "base/output_file.hpp"
#include "base/strtod.hpp"
#include "base/text_stream.hpp"
#include "matrix/file.hpp"

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
  header += '\n';
  if (!std::isnan(keep_until)) resume(header, keep_until);
  if (!later_.empty()) return;
  if (kept_bytes_ == 0) {
    base::OutputFile file(path_);
    file.write(header);
    file.commit();
  } else {
    std::error_code error;
    std::filesystem::resize_file(path_, kept_bytes_, error);  // without a line that was cut off
    if (error) throw Error(StatusCode::invalid_input, fmt::format("{}: {}", path_, error.message()));
  }
  open_to_append();
}

void CsvWriter::resume(const std::string& header, double keep_until) {
  if (std::error_code absent; !std::filesystem::exists(path_, absent)) return;
  base::TextReader in{std::string(matrix::FileBytes(path_).bytes())};  // one that cannot be read is no empty one
  std::string text;
  if (!std::getline(in, text) || in.eof()) return;  // not even a header
  if (text + '\n' != header)
    throw Error(StatusCode::invalid_input,
                fmt::format("{}: the file has other columns than this run; give another folder", path_));
  kept_bytes_ = header.size();
  while (std::getline(in, text) && !in.eof()) {
    Line line = read_line(std::move(text), lines_ + static_cast<std::int64_t>(later_.size()) + 2);
    if (line.time > keep_until) {
      later_.push_back(std::move(line));
    } else {
      kept_bytes_ += line.text.size();
      kept_ = line.time;
      ++lines_;
    }
  }
}

CsvWriter::Line CsvWriter::read_line(std::string text, std::int64_t number) const {
  char* end = nullptr;
  const double time = base::strtod(text.c_str(), &end);
  const double last = later_.empty() ? kept_ : later_.back().time;
  const bool good = end != text.c_str() && (*end == ',' || *end == '\0') && !(time <= last) && std::isfinite(time) &&
                    static_cast<std::size_t>(std::count(text.begin(), text.end(), ',')) == columns_.size();
  if (!good)
    throw Error(StatusCode::invalid_input,
                fmt::format("{}:{}: this line is not a time and {} numbers, or its time does not follow; repair the "
                            "file, or give another folder",
                            path_, number, columns_.size()));
  text += '\n';
  return {time, std::move(text)};
}

void CsvWriter::open_to_append() {
  out_.open(path_, std::ios::app | std::ios::binary);
  if (!out_)
    throw Error(StatusCode::invalid_input, fmt::format("{}: cannot write the file (does its folder exist?)", path_));
}

void CsvWriter::rewrite() {
  std::string kept(kept_bytes_, '\0');
  std::ifstream in(path_, std::ios::binary);
  if (!in.read(kept.data(), static_cast<std::streamsize>(kept_bytes_)))
    throw Error(StatusCode::invalid_input, path_ + ": somebody else has shortened the file");
  base::OutputFile file(path_);
  file.write(kept);
  file.write(fresh_);
  for (std::size_t k = first_later_; k < later_.size(); ++k) file.write(later_[k].text);
  file.commit();
  kept_bytes_ += fresh_.size();
  fresh_.clear();
  if (first_later_ == later_.size()) open_to_append();
}

void CsvWriter::write(const StateView& state) {
  std::string line = fmt::format("{}", state.t);
  for (const CsvColumn& column : columns_) line += fmt::format(",{}", column.value(state));
  line += '\n';
  ++lines_;
  if (out_.is_open()) {
    out_ << line << std::flush;
    if (!out_) throw Error(StatusCode::invalid_input, fmt::format("{}: writing failed (is the disk full?)", path_));
    return;
  }
  fresh_ += line;
  while (first_later_ < later_.size() && later_[first_later_].time <= state.t) ++first_later_;
  if (first_later_ == later_.size()) rewrite();
}

void CsvWriter::catch_up() {
  if (!fresh_.empty()) rewrite();
}

void CsvWriter::finish() {
  if (out_.is_open()) return;
  first_later_ = later_.size();
  rewrite();
}

}  // namespace espalier::dynamics
