#include "dynamics/mesh/text_file.hpp"

#include <fmt/format.h>

#include <charconv>
#include <filesystem>
#include <utility>

#include "dynamics/mesh/file_source.hpp"
#include "matrix/file.hpp"

namespace espalier::dynamics {
namespace {

thread_local FileSource* source_of_thread = nullptr;

}  // namespace

FileSource::Scope::Scope(FileSource& source) : before_(std::exchange(source_of_thread, &source)) {}
FileSource::Scope::~Scope() { source_of_thread = before_; }

std::string read_from_disk(const std::string& path) {
  const matrix::FileBytes file(path);
  return matrix::is_gzip(file.bytes()) ? matrix::gunzip(file.bytes(), path) : std::string(file.bytes());
}

std::string read_whole_file(const std::string& path) {
  return source_of_thread != nullptr ? source_of_thread->read(path) : read_from_disk(path);
}

bool file_exists(const std::string& path) {
  std::error_code unreadable;
  return source_of_thread != nullptr ? source_of_thread->exists(path) : std::filesystem::exists(path, unreadable);
}

std::string_view trim(std::string_view text) {
  const auto blank = [](char c) { return c >= '\0' && c <= ' '; };  // some programs end names by control characters
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  return text;
}

std::string upper(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  return result;
}

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return result;
}

bool LineReader::next(std::string_view& line) {
  if (at_ >= content_.size()) return false;
  const std::size_t end = content_.find('\n', at_);
  const std::size_t stop = end == std::string::npos ? content_.size() : end;
  line = std::string_view(content_).substr(at_, stop - at_);
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  before_ = at_;
  at_ = end == std::string::npos ? stop : stop + 1;
  ++line_;
  return true;
}

void LineReader::back() {
  at_ = before_;
  --line_;
}

std::span<const char> LineReader::bytes(std::size_t size) {
  if (size > content_.size() - at_)
    fail(fmt::format("the binary section is cut off: {} bytes expected, {} left", size, content_.size() - at_));
  const std::span<const char> result(content_.data() + at_, size);
  at_ += size;
  return result;
}

void LineReader::fail(const std::string& message) const {
  throw Error(StatusCode::invalid_input, fmt::format("{}:{}: {}", path_, line_, message));
}

bool Fields::next(std::string_view& field) {
  if (separator_ == ',') {
    if (rest_.data() == nullptr) return false;
    const std::size_t comma = rest_.find(',');
    field = trim(rest_.substr(0, comma));
    rest_ = comma == std::string_view::npos ? std::string_view() : rest_.substr(comma + 1);
    return true;
  }
  rest_ = trim(rest_);
  if (rest_.empty()) return false;
  const std::size_t end = std::min(rest_.find_first_of(" \t"), rest_.size());
  field = rest_.substr(0, end);
  rest_.remove_prefix(end);
  return true;
}

double Fields::real(const char* what) {
  std::string_view field;
  if (!next(field) || field.empty()) reader_->fail(fmt::format("{} is missing", what));
  std::string text(field);
  for (char& c : text)  // Fortran exponents
    if (c == 'd' || c == 'D') c = 'e';
  const char* begin = text.c_str() + (text.front() == '+' ? 1 : 0);
  double value = 0;
  const auto [end, error] = std::from_chars(begin, text.c_str() + text.size(), value);
  if (error != std::errc() || end != text.c_str() + text.size())
    reader_->fail(fmt::format("{}: '{}' is not a number", what, field));
  return value;
}

std::int64_t Fields::integer(const char* what) {
  std::string_view field;
  if (!next(field) || field.empty()) reader_->fail(fmt::format("{} is missing", what));
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
  if (error != std::errc() || end != field.data() + field.size())
    reader_->fail(fmt::format("{}: '{}' is not a whole number", what, field));
  return value;
}

}  // namespace espalier::dynamics
