/// \file
/// Keyword lines and data lines of .inp files.
#pragma once

#include <map>
#include <string>
#include <string_view>

#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics {

/// "*NSET, NSET=Fix, GENERATE": the keyword without blanks, and its parameters by upper-case name without blanks.
struct InpKeyword {
  std::string name;
  std::map<std::string, std::string> parameters;
  [[nodiscard]] bool has(const char* key) const { return parameters.contains(key); }
  /// Empty where it is not given.
  [[nodiscard]] std::string get(const char* key) const;
  /// @throws Error naming the keyword and the parameter where it is not given
  [[nodiscard]] std::string need(const LineReader& reader, const char* key) const;
};

/// A blank line or one that starts with **.
[[nodiscard]] bool is_inp_comment(std::string_view line);
/// The keyword of line `first`, and of the lines that continue it.
[[nodiscard]] InpKeyword read_inp_keyword(LineReader& reader, std::string_view first);
/// The next data line. @return false at a keyword or at the end
bool next_inp_data(LineReader& reader, std::string_view& line);
/// Without quotation marks around it.
[[nodiscard]] std::string inp_unquoted(std::string_view text);
/// The next fields as numbers, so many as `count`; those that are missing or empty are 0. @return how many were given
int read_inp_reals(Fields& fields, double* values, int count);
/// The next field as a whole number; `otherwise` where it is missing or empty.
std::int64_t read_inp_integer(Fields& fields, const char* what, std::int64_t otherwise);

}  // namespace espalier::dynamics
