/// \file
/// Matrix Market files (R. Boisvert, R. Pozo, K. Remington, "The Matrix Market exchange formats", NISTIR 5935, 1996).
///
/// Read: object matrix; coordinate and array; real (also called double), complex, integer, pattern; general, symmetric,
/// skew-symmetric, hermitian. Readers of real matrices refuse complex files. Where the standard is silent or files
/// break it:
/// - Pattern files get the value 1 everywhere (ReadOptions::keep_pattern leaves the values out). The ones are a
///   convention, not a matrix that anybody computed with: such a matrix is often singular.
/// - Repeated entries are summed; repeated entries of a pattern are taken once. Explicit zeros stay in the pattern.
/// - Symmetric files give Storage::symmetric_lower. Entries above the diagonal are mirrored; where both (i, j) and
///   (j, i) are present, equal values are taken once and different values are an error with the line.
/// - Hermitian files give Storage::hermitian_lower; an imaginary part on the diagonal is an error.
/// - Skew-symmetric files are expanded to Storage::general; nonzeros on their diagonal are an error.
/// - Array files hold every entry; exact zeros of an array file do not enter the pattern.
/// - Comment lines and blank lines may stand anywhere; lines may end in CR LF; exponents may be Fortran's D.
/// - Rectangular matrices are read (the solver refuses them, the tools need not).
/// NaN, infinite and overflowing values, indices outside the matrix, wrong counts and truncated files are errors that
/// name the line. Nothing large is allocated before the sizes have been compared with the length of the text.
#pragma once

#include <complex>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "matrix/entries.hpp"

namespace espalier::matrix {

/// Dense column vectors, stored column by column.
struct DenseVectors {
  Index rows = 0;
  Index cols = 0;
  std::vector<double> values;  ///< rows * cols, column after column
};

/// The same, complex.
struct ComplexVectors {
  Index rows = 0;
  Index cols = 0;
  std::vector<std::complex<double>> values;  ///< rows * cols, column after column
};

/// True when the text begins like a Matrix Market file.
bool is_matrix_market(std::string_view text);
/// Whether it declares complex values. @throws Error(invalid_input) with name and line
bool is_complex_matrix_market(std::string_view text, const std::string& name);

/// Reads a matrix from a text in memory. @param name for messages, usually the path
/// @throws Error(invalid_input) with name and line
SparseMatrix parse_matrix_market(std::string_view text, const std::string& name, const ReadOptions& options = {});

/// Reads a dense block of vectors: an array file (any symmetry), or a coordinate file whose absent entries are zero.
/// @throws Error(invalid_input) with name and line
DenseVectors parse_matrix_market_vectors(std::string_view text, const std::string& name,
                                         const ReadOptions& options = {});

/// The same of complex files, and of real ones.
ComplexSparseMatrix parse_complex_matrix_market(std::string_view text, const std::string& name,
                                                const ReadOptions& options = {});
ComplexVectors parse_complex_matrix_market_vectors(std::string_view text, const std::string& name,
                                                   const ReadOptions& options = {});

/// Writes coordinate format; symmetric storage of any kind as one lower triangle, a matrix without values as pattern.
/// Values are the shortest decimal numbers (17 digits at most) that read back to the same bits. ".gz" is compressed.
/// @param comment lines for the file's head, without '%'; may be empty
/// @throws Error(invalid_input) when the file cannot be written
void write_matrix_market(const std::string& path, const MatrixView& a, const std::string& comment = {},
                         base::ThreadPool* pool = nullptr);

void write_matrix_market(const std::string& path, const ComplexMatrixView& a, const std::string& comment = {},
                         base::ThreadPool* pool = nullptr);

/// Writes array format; `values` holds rows * cols numbers column after column.
void write_matrix_market_vectors(const std::string& path, Index rows, Index cols, std::span<const double> values,
                                 const std::string& comment = {}, base::ThreadPool* pool = nullptr);

void write_matrix_market_vectors(const std::string& path, Index rows, Index cols,
                                 std::span<const std::complex<double>> values, const std::string& comment = {},
                                 base::ThreadPool* pool = nullptr);

}  // namespace espalier::matrix
