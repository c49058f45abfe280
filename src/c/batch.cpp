/// \file
/// The C interface of batches.
#include "espalier/batch.hpp"

#include <cstdint>

#include "c/handle.hpp"
#include "c/matrix.hpp"

namespace {

using espalier::Index;
using espalier::solver::require;

struct Arrays {
  const double* values;
  const double* b;
  double* x;
  std::int64_t count, columns;
  int transpose;
  std::int32_t* statuses;
};

template <class Matrix>
int solve_batch(espalier_solver* solver, const Matrix* a, const Arrays& given) {
  return espalier::solver::guarded(solver, [&](espalier_solver& s) {
    require(a != nullptr, "the matrix is null");
    require(given.count >= 0 && given.count <= INT32_MAX, "the number of systems must lie from 0 to 2^31 - 1");
    require(given.columns >= 1 && given.columns <= INT32_MAX,
            "the number of right-hand sides must lie from 1 to 2^31 - 1");
    require(given.transpose == ESPALIER_NO_TRANSPOSE || given.transpose == ESPALIER_TRANSPOSE,
            "transpose must be 0 or 1");
    require(given.count == 0 || (given.values != nullptr && given.b != nullptr && given.x != nullptr),
            "the values, the right-hand sides or the solutions are null");
    const espalier::Options options = espalier::solver::options_of(s);
    const espalier::solver::CMatrix matrix(*a, false);
    require(!matrix.complex(), "complex systems are solved by espalier_solver alone");
    espalier::Batch batch(options);
    if (espalier::AnalysisResult analysis = batch.analyze(matrix.view()); !analysis.status.ok()) return analysis.status;
    const auto systems = static_cast<std::size_t>(given.count);
    const std::size_t size =
        systems * static_cast<std::size_t>(given.columns) * static_cast<std::size_t>(matrix.view().rows);
    const bool flip = (given.transpose == ESPALIER_TRANSPOSE) != matrix.transposed();
    const espalier::BatchResult result =
        batch.solve({given.values, systems * static_cast<std::size_t>(matrix.view().nonzeros())}, {given.b, size},
                    {given.x, size}, static_cast<Index>(given.count), static_cast<Index>(given.columns),
                    flip ? espalier::Transpose::yes : espalier::Transpose::no);
    for (std::size_t k = 0; given.statuses != nullptr && k < result.systems.size(); ++k)
      given.statuses[k] = static_cast<std::int32_t>(result.systems[k].status.code);
    return result.status;
  });
}

}  // namespace

extern "C" {

int espalier_solve_batch_i32(espalier_solver* solver, const espalier_matrix_i32* a, const double* values,
                             const double* b, double* x, std::int64_t count, std::int64_t columns, int transpose,
                             std::int32_t* statuses) {
  return solve_batch(solver, a, {values, b, x, count, columns, transpose, statuses});
}

int espalier_solve_batch_i64(espalier_solver* solver, const espalier_matrix_i64* a, const double* values,
                             const double* b, double* x, std::int64_t count, std::int64_t columns, int transpose,
                             std::int32_t* statuses) {
  return solve_batch(solver, a, {values, b, x, count, columns, transpose, statuses});
}

}  // extern "C"
