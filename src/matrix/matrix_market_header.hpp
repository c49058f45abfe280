/// \file
/// The head of a Matrix Market file: banner, comments, size line. Used by the readers in this folder only.
#pragma once

#include "matrix/entries.hpp"

namespace espalier::matrix {

/// What banner and size line say.
struct MatrixMarketHeader {
  bool array = false;    ///< array format, else coordinate
  bool pattern = false;  ///< no values
  bool complex = false;  ///< two numbers for each value
  Symmetry symmetry = Symmetry::general;
  Index rows = 0;
  Index cols = 0;
  Offset count = 0;             ///< lines with an entry (coordinate), values (array)
  const char* sizes = nullptr;  ///< begin of the size line in the text
  const char* data = nullptr;   ///< begin of the line after the size line

  /// The numbers of an array.
  [[nodiscard]] Offset numbers() const { return complex ? 2 * count : count; }
};

/// @throws Error(invalid_input) with the line
MatrixMarketHeader parse_matrix_market_header(const Source& source);
/// Refuses a complex file. @param needed  what is asked for, for the message: "a real matrix"
void expect_real(const MatrixMarketHeader& header, const Source& source, const char* needed);

/// Moves `p` to the first character of the next line that is neither blank nor a comment, or to `end`.
const char* skip_to_data(const char* p, const char* end);

}  // namespace espalier::matrix
