/// \file
/// Fixed-width Fortran fields, as far as matrix files use them.
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "matrix/text.hpp"

namespace espalier::matrix {

/// One repeated edit descriptor: "(26I3)", "(1P,4D20.13)", "(5E16.8E3)", "(3(1PE25.16))", "(10F8.2)".
struct FortranFormat {
  int per_line = 0;   ///< fields in a full line
  int width = 0;      ///< characters of a field
  int decimals = 0;   ///< digits behind the point that a field without a point implies
  int scale = 0;      ///< kP: a field without exponent is divided by 10^k
  bool real = false;  ///< D, E, F or G; otherwise I
};

/// The format, or nothing when the text is not of the forms above.
std::optional<FortranFormat> parse_fortran_format(std::string_view text);

/// Value of one field (blanks within it are ignored, a blank field is 0, as Fortran reads it).
ScanError scan_field(std::string_view field, const FortranFormat& format, double& value);
ScanError scan_field(std::string_view field, std::int64_t& value);

}  // namespace espalier::matrix
