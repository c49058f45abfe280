#include "common/input.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <chrono>
#include <complex>
#include <sstream>
#include <string_view>

#include "common/checked_options.hpp"
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
    any = matrix::read_any_matrix(
        file_, {&pool, false, [&record](const std::string& notice) { record.notices.push_back(notice); }});
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

RealColumns read_columns(const std::string& path, Index rows, base::ThreadPool& pool) {
  matrix::AnyVectors any = matrix::read_any_vectors(path, {&pool, false});
  if (auto* real = std::get_if<matrix::DenseVectors>(&any))
    return {checked_columns(std::move(*real), path, rows), false};
  const matrix::ComplexVectors given = checked_columns(std::get<matrix::ComplexVectors>(std::move(any)), path, rows);
  RealColumns out{{rows, 2 * given.cols, {}}, true};
  out.values.reserve(2 * given.values.size());
  const auto n = static_cast<std::size_t>(rows);
  for (std::size_t begin = 0; begin < given.values.size(); begin += n) {
    for (std::size_t i = 0; i < n; ++i) out.values.push_back(given.values[begin + i].real());
    for (std::size_t i = 0; i < n; ++i) out.values.push_back(given.values[begin + i].imag());
  }
  return out;
}

void write_columns(const std::string& path, const RealColumns& v, const std::string& comment) {
  if (!v.complex) return matrix::write_matrix_market_vectors(path, v.rows, v.cols, v.values, comment);
  const auto n = static_cast<std::size_t>(v.rows);
  ComplexColumns joined{{v.rows, v.given(), {}}};
  joined.values.reserve(v.values.size() / 2);
  for (std::size_t begin = 0; begin < v.values.size(); begin += 2 * n)
    for (std::size_t i = begin; i < begin + n; ++i) joined.values.emplace_back(v.values[i], v.values[i + n]);
  write_columns(path, joined, comment);
}

void write_columns(const std::string& path, const ComplexColumns& v, const std::string& comment) {
  matrix::write_matrix_market_vectors(path, v.rows, v.cols, std::span<const std::complex<double>>(v.values), comment);
}

ComplexColumns read_complex_columns(const std::string& path, Index rows, base::ThreadPool& pool) {
  return {checked_columns(matrix::read_complex_vectors(path, {&pool, false}), path, rows)};
}

namespace {

// What is shown of a word from a file, which may be of any length and hold any bytes.
std::string shown(std::string_view word) {
  constexpr std::size_t kMost = 40;
  std::string text(word.substr(0, kMost));
  std::replace_if(
      text.begin(), text.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return word.size() > kMost ? text + "..." : text;
}

Index number_in_list(std::string_view word, Index n) {
  std::int64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  if (error != std::errc{} || end != word.data() + word.size())
    throw Error(StatusCode::invalid_input,
                fmt::format("'{}' in the list of unknowns is no index: give numbers from 0, or ranges such as 10-20",
                            shown(word)));
  if (value < 0 || value >= n)
    throw Error(StatusCode::invalid_input,
                fmt::format("'{}' in the list is none of the {} unknowns, which are counted from 0", shown(word), n));
  return static_cast<Index>(value);
}

}  // namespace

std::vector<Index> parse_unknowns(std::string text, Index n) {
  std::replace(text.begin(), text.end(), ',', ' ');
  std::istringstream stream(text);
  std::vector<Index> list;
  const auto check_length = [&] {
    if (list.size() > static_cast<std::size_t>(n))
      throw Error(StatusCode::invalid_input,
                  fmt::format("the list of unknowns is longer than the {} that there are: name each once", n));
  };
  for (std::string word; stream >> word;) {
    const std::size_t dash = word.find('-', 1);
    if (dash == std::string::npos) {
      list.push_back(number_in_list(word, n));
      continue;
    }
    const Index first = number_in_list(std::string_view(word).substr(0, dash), n);
    const Index last = number_in_list(std::string_view(word).substr(dash + 1), n);
    if (last < first)
      throw Error(StatusCode::invalid_input, fmt::format("the range {} in the list of unknowns falls", shown(word)));
    for (Index v = first; v <= last; ++v) list.push_back(v);
    check_length();
  }
  check_length();
  return list;
}

}  // namespace espalier::cli
