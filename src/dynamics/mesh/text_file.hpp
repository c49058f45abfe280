/// \file
/// A text file in memory, read line by line, that knows where it stands.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "espalier/types.hpp"

namespace espalier::dynamics {

/// Whole content of a file; a name that ends in .gz is unpacked. @throws Error(invalid_input) naming the file
std::string read_whole_file(const std::string& path);

/// Trims blanks and line ends.
std::string_view trim(std::string_view text);
/// Capital and small letters (A to Z), for words that are not case-sensitive.
std::string upper(std::string_view text);
std::string lower(std::string_view text);

/// Lines of a text, counted from 1.
class LineReader {
 public:
  LineReader(std::string path, std::string content) : path_(std::move(path)), content_(std::move(content)) {}

  /// The next line without its end. @return false at the end of the file
  bool next(std::string_view& line);
  /// Makes next() return the last line once more.
  void back();
  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] std::int64_t line() const { return line_; }
  /// What has not been read yet.
  [[nodiscard]] std::string_view rest() const { return std::string_view(content_).substr(at_); }
  /// Bytes behind the last line or binary section.
  [[nodiscard]] std::size_t remaining() const { return content_.size() - at_; }

  /// `size` bytes from here, for binary sections. @throws Error when the file ends before
  std::span<const char> bytes(std::size_t size);
  /// @throws Error(invalid_input) "path:line: message"
  [[noreturn]] void fail(const std::string& message) const;

 private:
  std::string path_, content_;
  std::size_t at_ = 0, before_ = 0;
  std::int64_t line_ = 0;
};

/// Numbers of one line, separated by blanks or commas.
class Fields {
 public:
  /// @param separator ' ' for blanks (any number of them), ',' for commas (fields may be empty)
  Fields(const LineReader& reader, std::string_view line, char separator)
      : reader_(&reader), rest_(line), separator_(separator) {}
  /// The next field, trimmed. @return false when there is none
  bool next(std::string_view& field);
  /// The next field as a number. @throws Error naming the field and `what`
  double real(const char* what);
  std::int64_t integer(const char* what);

 private:
  const LineReader* reader_;
  std::string_view rest_;
  char separator_;
};

}  // namespace espalier::dynamics
