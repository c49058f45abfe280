/// \file
/// Espalier's binary matrix format (.esp): what large systems are kept in. Layout, without gaps:
///
///     bytes  0.. 7  magic "ESPALMTX"
///     bytes  8..11  uint32 1 (version)
///     bytes 12..15  uint32 0x01020304 in the writer's byte order; a reader of the other order refuses the file
///     bytes 16..19  int32 rows            bytes 20..23  int32 columns
///     bytes 24..31  int64 entries
///     bytes 32..35  uint32 storage: 0 general, 1 symmetric_lower, 2 symmetric_upper, 3 symmetric_both
///     bytes 36..39  uint32 1 when values are present, 0 for a pattern
///     bytes 40..47  uint64 checksum of everything from byte 48 on
///     bytes 48..55  uint64 checksum of bytes 0..39
///     then          (columns + 1) x int64 column pointers, entries x float64 values (if present), entries x int32 rows
///
/// Indices are 0-based. The checksum of bytes w: h = 0xcbf29ce484222325; for every 8 bytes as uint64 x (the last padded
/// by zeros) h = rotl(h ^ x, 29) * 0x9e3779b97f4a7c15, modulo 2^64; finally h ^= number of bytes.
#pragma once

#include <string>
#include <string_view>

#include "espalier/matrix.hpp"

namespace espalier::matrix {

/// True when the bytes begin with the magic.
bool is_binary_matrix(std::string_view bytes);

/// Reads a matrix out of bytes in memory; every index is checked. @param name for messages
/// @throws Error(invalid_input) when the bytes are of another version or byte order, truncated or damaged
SparseMatrix parse_binary(std::string_view bytes, const std::string& name);

/// Writes the format. @throws Error(invalid_input) when the file cannot be written
void write_binary(const std::string& path, const MatrixView& a);

}  // namespace espalier::matrix
