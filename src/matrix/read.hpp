/// \file
/// Matrices and right-hand sides out of files of any supported format.
#pragma once

#include <string>
#include <variant>

#include "matrix/entries.hpp"
#include "matrix/matrix_market.hpp"

namespace espalier::matrix {

/// Reads a matrix. The format is recognised by the content, not by the name: Matrix Market (matrix_market.hpp),
/// Rutherford-Boeing and Harwell-Boeing (rutherford_boeing.hpp), Espalier's binary format (binary.hpp); each also
/// packed by gzip. The result is sorted and free of duplicates; symmetric files give symmetric_lower.
/// @throws Error(invalid_input) "path:line: what is wrong"; Error(out_of_memory)
SparseMatrix read_matrix(const std::string& path, const ReadOptions& options = {});

/// A matrix of either sort of numbers.
using AnyMatrix = std::variant<SparseMatrix, ComplexSparseMatrix>;
/// The same; a complex Matrix Market file gives a complex matrix.
AnyMatrix read_any_matrix(const std::string& path, const ReadOptions& options = {});

/// Vectors of either sort of numbers: those of the file.
using AnyVectors = std::variant<DenseVectors, ComplexVectors>;
/// Reads right-hand sides or solutions, n x k: a Matrix Market array, or a Matrix Market coordinate file whose absent
/// entries are zero; also packed by gzip.
/// @throws Error(invalid_input) "path:line: what is wrong"; Error(out_of_memory)
AnyVectors read_any_vectors(const std::string& path, const ReadOptions& options = {});

/// The same of a complex file or a real one.
ComplexVectors read_complex_vectors(const std::string& path, const ReadOptions& options = {});

}  // namespace espalier::matrix
