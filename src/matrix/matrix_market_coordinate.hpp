/// \file
/// The parallel parser of coordinate entries. Used by the readers in this folder only.
#pragma once

#include "matrix/matrix_market_header.hpp"

namespace espalier::matrix {

/// Parses the entries behind the header, in blocks of whole lines of about 1 MiB, on options.pool. Of several errors
/// the first in the file is reported. Memory: 16 bytes per line (8 for a pattern).
/// @throws Error(invalid_input) with the line
RawEntries parse_coordinate_entries(const Source& source, const MatrixMarketHeader& header, const ReadOptions& options);

/// Where the k-th entry stands in the text (its end when there is none).
const char* locate_coordinate_entry(const Source& source, const MatrixMarketHeader& header, Offset k);

}  // namespace espalier::matrix
