#include "solver/session/complex_results.hpp"

#include <utility>

#include "solver/solution/solution.hpp"

namespace espalier::solver {

using Value = std::complex<double>;

std::vector<Value> numbers_of(const std::vector<double>& parts) {
  const Value* first = base::as_complex(parts.data());
  return {first, first + parts.size() / 2};
}

namespace {

// A^T of a Hermitian matrix is its conjugate, and so are the vectors of its left null space.
std::vector<Value> left_null_vectors(const Analysis& a, const std::vector<double>& null,
                                     const std::vector<double>& left) {
  if (a.kind() == Kind::lu || a.system->numbers() != base::Numbers::hermitian) return numbers_of(left);
  std::vector<double> turned(null);
  conjugate(turned.data(), static_cast<Offset>(turned.size() / 2));
  return numbers_of(turned);
}

}  // namespace

ComplexFactorResult complex_result(FactorResult from, const Factor& factor) {
  ComplexFactorResult r;
  const std::vector<double> null = std::move(from.null_vectors), left = std::move(from.left_null_vectors);
  const Value phase = from.determinant_sign == 0 ? 0 : factor.determinant_phase();
  static_cast<FactorReport&>(r) = std::move(from);
  r.determinant_phase = phase;
  r.null_vectors = numbers_of(null);
  r.left_null_vectors = left_null_vectors(*factor.analysis(), null, left);
  return r;
}

}  // namespace espalier::solver
