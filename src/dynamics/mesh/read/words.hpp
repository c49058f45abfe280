/// \file
/// A text as words between blanks, over line ends: files whose lines mean nothing.
#pragma once

#include <cstdint>
#include <string_view>

#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {

class Words {
 public:
  Words(std::string content, const std::string& path) : reader_(path, std::move(content)) {}

  /// The next word; comments from # to the end of a line are passed over. @return false at the end
  bool next(std::string_view& word);
  /// Makes next() return the last word once more.
  void back() { again_ = true; }
  /// The next word as a number. @throws Error naming `what`
  double real(const char* what);
  std::int64_t integer(const char* what);
  /// The same as a number of things that follow, each of which takes two bytes at least.
  std::int64_t count(const char* what);
  /// The next line, or what is left of it.
  std::string_view line();
  [[noreturn]] void fail(const std::string& message) const { reader_.fail(message); }

 private:
  std::string_view need(const char* what);

  LineReader reader_;
  std::string_view rest_, word_;
  bool again_ = false;
};

}  // namespace espalier::dynamics
