#include "input.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <chrono>
#include <sstream>
#include <string_view>

#include "checked_options.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/read.hpp"

namespace espalier::cli {

namespace {

/// A solver needs a square matrix with at least one row, and its values.
template <class Matrix>
void check_solvable(const Matrix& a, const std::string& name) {
  if (a.rows != a.cols) {
    throw Error(StatusCode::invalid_input,
                fmt::format("{}: the matrix is {} x {}; a linear system needs a square one", name, a.rows, a.cols));
  }
  if (a.rows == 0) throw Error(StatusCode::invalid_input, fmt::format("{}: the matrix is empty (0 x 0)", name));
}

std::vector<std::string> split(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

}  // namespace

void MatrixSource::add_to(CLI::App& command) {
  CLI::Option* file = add_file(command, "matrix", file_, "matrix file: Matrix Market or Rutherford-Boeing, also .gz");
  command.add_option("--generate", generator_, "generate the matrix instead (see below)")
      ->type_name("\"SPEC\"")
      ->excludes(file);
  command.footer("Systems for --generate, for instance \"elasticity 20 20 20\":\n" + matrix::generator_usage());
}

matrix::AnyMatrix MatrixSource::load(RunRecord& record, base::ThreadPool& pool) const {
  if (file_.empty() == generator_.empty()) {
    throw Error(StatusCode::invalid_input, "give a matrix file or --generate \"SPEC\" (see --help)");
  }
  const auto start = std::chrono::steady_clock::now();
  matrix::AnyMatrix any;
  if (file_.empty()) {
    const auto spec = matrix::parse_generator(split(generator_));
    record.input = matrix::describe(spec);
    any = matrix::generate(spec, &pool);
  } else {
    record.input = file_;
    any = matrix::read_any_matrix(file_, {&pool, false});
  }
  record.read_seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::visit(
      [&](const auto& a) {
        check_solvable(a, record.input);
        record.rows = a.rows;
        record.nonzeros = a.nonzeros();
        record.storage = a.storage;
      },
      any);
  record.complex = std::holds_alternative<ComplexSparseMatrix>(any);
  return any;
}

SparseMatrix MatrixSource::load_real(RunRecord& record, base::ThreadPool& pool) const {
  matrix::AnyMatrix any = load(record, pool);
  if (record.complex)
    throw Error(StatusCode::invalid_input,
                fmt::format("{}: the matrix is complex; this command takes real ones", record.input));
  return std::get<SparseMatrix>(std::move(any));
}

namespace {

template <class Vectors>
Vectors checked_columns(Vectors vectors, const std::string& path, Index rows) {
  if (vectors.rows != rows || vectors.cols < 1) {
    throw Error(StatusCode::invalid_input, fmt::format("{}: the right-hand side is {} x {}; the matrix has {} rows",
                                                       path, vectors.rows, vectors.cols, rows));
  }
  return vectors;
}

}  // namespace

matrix::DenseVectors read_columns(const std::string& path, Index rows, base::ThreadPool& pool) {
  return checked_columns(matrix::read_vectors(path, {&pool, false}), path, rows);
}

matrix::ComplexVectors read_complex_columns(const std::string& path, Index rows, base::ThreadPool& pool) {
  return checked_columns(matrix::read_complex_vectors(path, {&pool, false}), path, rows);
}

namespace {

Index number_in_list(std::string_view word) {
  Index value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size())
    throw Error(
        StatusCode::invalid_input,
        fmt::format("'{}' in the list of unknowns is no index: give numbers from 0, or ranges such as 10-20", word));
  return value;
}

}  // namespace

std::vector<Index> parse_unknowns(std::string text) {
  std::replace(text.begin(), text.end(), ',', ' ');
  std::istringstream stream(text);
  std::vector<Index> list;
  for (std::string word; stream >> word;) {
    const std::size_t dash = word.find('-', 1);
    if (dash == std::string::npos) {
      list.push_back(number_in_list(word));
      continue;
    }
    const Index first = number_in_list(std::string_view(word).substr(0, dash));
    const Index last = number_in_list(std::string_view(word).substr(dash + 1));
    if (last < first)
      throw Error(StatusCode::invalid_input, fmt::format("the range {} in the list of unknowns falls", word));
    for (Index v = first;; ++v) {
      list.push_back(v);
      if (v == last) break;
    }
  }
  return list;
}

}  // namespace espalier::cli
