#include "dynamics/mesh/read/words.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace espalier::dynamics {

bool Words::next(std::string_view& word) {
  if (again_) {
    again_ = false;
    word = word_;
    return true;
  }
  while (true) {
    rest_ = trim(rest_);
    if (!rest_.empty() && rest_.front() != '#') break;
    if (!reader_.next(rest_)) return false;
  }
  const std::size_t end = std::min(rest_.find_first_of(" \t\r"), rest_.size());
  word = word_ = rest_.substr(0, end);
  rest_.remove_prefix(end);
  return true;
}

std::string_view Words::need(const char* what) {
  std::string_view word;
  if (!next(word)) fail(fmt::format("the file ends before {}", what));
  return word;
}

double Words::real(const char* what) { return Fields(reader_, need(what), ' ').real(what); }
std::int64_t Words::integer(const char* what) { return Fields(reader_, need(what), ' ').integer(what); }

std::int64_t Words::count(const char* what) {
  const std::int64_t n = integer(what);
  const std::size_t left = (reader_.remaining() + rest_.size() + 1) / 2;
  if (n < 0 || static_cast<std::uint64_t>(n) > left)
    fail(fmt::format("{}: {} entries are announced, {} bytes are left", what, n, reader_.remaining() + rest_.size()));
  return n;
}

std::string_view Words::line() {
  std::string_view found = rest_;
  rest_ = {};
  while (trim(found).empty())
    if (!reader_.next(found)) fail("the file ends too early");
  return trim(found);
}

}  // namespace espalier::dynamics
