/// \file
/// Where matrices and vectors of the command line come from and go to: files and generators.
#pragma once

#include <string>
#include <vector>

#include "base/thread_pool.hpp"
#include "espalier/matrix.hpp"
#include "matrix/read.hpp"
#include "solve/report.hpp"

namespace CLI {
class App;
}

namespace espalier::cli {

/// The positional file or --generate "SPEC" of a command; exactly one of them must be given.
class MatrixSource {
 public:
  void add_to(CLI::App& command);
  /// Reads or makes the matrix and notes its name, size and the time taken in `record`.
  /// @throws Error(invalid_input) for a file or generator text that cannot be understood, a matrix that is not square,
  /// is empty, or has no values
  [[nodiscard]] matrix::AnyMatrix load(RunRecord& record, base::ThreadPool& pool) const;
  /// The same of a command that takes real matrices alone. @throws Error(invalid_input) for a complex one
  [[nodiscard]] SparseMatrix load_real(RunRecord& record, base::ThreadPool& pool) const;

  [[nodiscard]] bool given() const { return !file_.empty() || !generator_.empty(); }
  /// The file; empty for a generator.
  [[nodiscard]] const std::string& file() const { return file_; }

 private:
  std::string file_;
  std::string generator_;
};

/// Right-hand sides of a real matrix, or what came of them. Of complex ones the real and the imaginary part of each
/// stand side by side, as two columns.
struct RealColumns : matrix::DenseVectors {
  bool complex = false;
  [[nodiscard]] Index given() const { return complex ? cols / 2 : cols; }  ///< columns of the file
};
/// Right-hand sides of a complex matrix.
struct ComplexColumns : matrix::ComplexVectors {
  [[nodiscard]] Index given() const { return cols; }
};
/// Reads dense columns of `rows` values each from a Matrix Market file (array, or coordinate: absent entries are zero).
/// @throws Error(invalid_input) naming the file and what is wrong
RealColumns read_columns(const std::string& path, Index rows, base::ThreadPool& pool);
/// The same of a real or complex file.
ComplexColumns read_complex_columns(const std::string& path, Index rows, base::ThreadPool& pool);
/// Writes them as Matrix Market array, complex where they were. @throws Error(invalid_input) with the system's reason
void write_columns(const std::string& path, const RealColumns& v, const std::string& comment);
void write_columns(const std::string& path, const ComplexColumns& v, const std::string& comment);

/// "0,5,10-20", or the same with blanks and lines between.
/// @throws Error(invalid_input) naming the word, also where it is none of `n` unknowns
std::vector<Index> parse_unknowns(std::string text, Index n);

}  // namespace espalier::cli
