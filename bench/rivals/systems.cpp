#include "rivals/systems.hpp"

#include <algorithm>
#include <complex>
#include <filesystem>
#include <iterator>
#include <numbers>
#include <random>
#include <sstream>
#include <variant>
#include <vector>

#include "base/thread_pool.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/read.hpp"

namespace espalier::bench {

SparseMatrix make_system(const std::string& words) {
  if (std::filesystem::is_regular_file(words)) return matrix::read_matrix(words);
  std::istringstream stream(words);
  const std::vector<std::string> tokens{std::istream_iterator<std::string>(stream), {}};
  base::ThreadPool pool(base::available_cores());
  return matrix::generate(matrix::parse_generator(tokens), &pool);
}

namespace {

SparseMatrix with_parts(const ComplexSparseMatrix& a) {
  const auto* first = reinterpret_cast<const double*>(a.values.data());
  return {a.rows, a.cols, a.col_ptr, a.row_ind, {first, first + 2 * a.values.size()}, a.storage};
}

/// Calls give(entry, row, column, value) for each entry and takes the complex numbers that it gives for them.
template <typename Give>
void make_complex(SparseMatrix& a, Give&& give) {
  std::vector<double> values;
  values.reserve(2 * a.values.size());
  for (Index column = 0; column < a.cols; ++column)
    for (Offset k = a.col_ptr[column]; k < a.col_ptr[column + 1]; ++k) {
      const std::complex<double> value = give(a.row_ind[k], column, a.values[k]);
      values.push_back(value.real());
      values.push_back(value.imag());
    }
  a.values = std::move(values);
}

System damped(SparseMatrix a) {
  const std::complex<double> stiffness(1, 0.02), mass(-0.01, 0.001);
  make_complex(a, [&](Index row, Index column, double value) {
    return stiffness * value + (row == column ? mass * std::max(value, 0.0) : 0.0);
  });
  return {std::move(a), Numbers::complex};
}

System hermitian(SparseMatrix a, const std::string& words) {
  if (a.storage != Storage::symmetric_lower)
    throw Error(StatusCode::invalid_input, words + ": a Hermitian system is made of a symmetric one only");
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> angle(0, 2 * std::numbers::pi);
  std::vector<std::complex<double>> phases(static_cast<std::size_t>(a.cols));
  for (auto& phase : phases) phase = std::polar(1.0, angle(random));
  make_complex(a, [&](Index row, Index column, double value) {
    return row == column ? value : value * phases[row] * std::conj(phases[column]);
  });
  a.storage = Storage::hermitian_lower;
  return {std::move(a), Numbers::hermitian};
}

}  // namespace

System make_any_system(const std::string& words) {
  if (std::filesystem::is_regular_file(words)) {
    matrix::AnyMatrix any = matrix::read_any_matrix(words);
    if (auto* real = std::get_if<SparseMatrix>(&any)) return {std::move(*real)};
    const auto& a = std::get<ComplexSparseMatrix>(any);
    return {with_parts(a), a.view().hermitian() ? Numbers::hermitian : Numbers::complex};
  }
  const std::string first = words.substr(0, words.find(' '));
  if (first != "damped" && first != "hermitian") return {make_system(words)};
  SparseMatrix a = make_system(words.substr(std::min(first.size() + 1, words.size())));
  return first == "damped" ? damped(std::move(a)) : hermitian(std::move(a), words);
}

Kind automatic_kind(const SystemView& a) {
  if (!a.symmetric()) return Kind::lu;
  if (a.numbers == Numbers::complex) return Kind::ldlt;
  std::vector<double> diagonal(static_cast<std::size_t>(a.cols), 0);
  for (Index column = 0; column < a.cols; ++column)
    for (Offset k = a.col_ptr[column]; k < a.col_ptr[column + 1]; ++k)
      if (a.row_ind[k] == column) diagonal[column] += a.values[a.parts() * k];
  for (const double value : diagonal)
    if (!(value > 0)) return Kind::ldlt;
  return Kind::llt;
}

}  // namespace espalier::bench
