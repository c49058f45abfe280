// Entries of an inverse in the C interface. Of a matrix by rows the solver holds the transpose, whose inverse is the
// transposed one; a pattern by rows is the transposed pattern.
#include "espalier/inverse.hpp"

#include <complex>
#include <span>
#include <type_traits>
#include <utility>

#include "c/handle.hpp"
#include "c/matrix.hpp"
#include "espalier/espalier.h"

namespace {

using espalier::Index;
using espalier::InverseResult;
using espalier::Status;
using espalier::Transpose;
using espalier::solver::CMatrix;
using espalier::solver::guarded;
using espalier::solver::require;
using espalier::solver::with_factorized;

template <class Solver>
using ValueOf = std::conditional_t<std::is_same_v<Solver, espalier::Solver>, double, std::complex<double>>;

template <class Solver>
auto span_of(const Solver&, double* x, int64_t count) {
  return std::span(reinterpret_cast<ValueOf<Solver>*>(x), static_cast<std::size_t>(count));
}

}  // namespace

namespace espalier {

// Found by hand_out().
static espalier_inverse_info to_c(const InverseResult& r) {
  espalier_inverse_info info{};
  info.seconds = r.seconds;
  info.error = r.error;
  info.entry_error = r.entry_error;
  info.checked = r.checked;
  info.solved = r.solved;
  return info;
}

template <class Value>
static espalier_inverse_info to_c(const TraceResultOf<Value>& r) {
  espalier_inverse_info info = to_c(static_cast<const InverseResult&>(r));
  info.trace_error = r.trace_error;
  return info;
}

}  // namespace espalier

namespace {

// The numbers of a pattern without values do not matter; those of B must be those of A.
template <class Solver, class Matrix, class Use>
auto with_view(const Solver&, const Matrix& a, bool values, const Use& use) {
  const CMatrix matrix(a, values);
  if constexpr (std::is_same_v<Solver, espalier::Solver>) {
    require(!values || !matrix.complex(), "B is complex, the factored matrix is real");
    return use(matrix.view(), matrix.by_rows());
  } else {
    require(!values || matrix.complex(), "B is real, the factored matrix is complex; give its values as pairs");
    const espalier::MatrixView& v = matrix.view();
    return use(matrix.complex() ? matrix.complex_view()
                                : espalier::ComplexMatrixView{v.rows, v.cols, v.col_ptr, v.row_ind, {}, v.storage},
               matrix.by_rows());
  }
}

template <class Matrix>
int selected_inverse(espalier_solver* solver, const Matrix* pattern, double* x, int64_t count, int transpose,
                     espalier_inverse_info* info) {
  return guarded(solver, [&](espalier_solver& s) {
    require(pattern != nullptr && x != nullptr, "the pattern or the place for the entries is null");
    require(transpose >= ESPALIER_NO_TRANSPOSE && transpose <= ESPALIER_CONJUGATE_TRANSPOSE, "transpose is unknown");
    require(count == pattern->nonzeros, "the number of entries is not that of the pattern");
    Matrix shape = *pattern;
    shape.values = nullptr;
    const InverseResult r = with_factorized(s, [&](auto& cpp) {
      return with_view(cpp, shape, false, [&](const auto& view, bool by_rows) {
        const bool turned = (transpose != ESPALIER_NO_TRANSPOSE) != (by_rows != s.by_rows);
        const auto entries = span_of(cpp, x, count);
        InverseResult found = espalier::selected_inverse(cpp, view, entries, turned ? Transpose::yes : Transpose::no);
        if constexpr (!std::is_same_v<std::remove_cvref_t<decltype(entries[0])>, double>) {
          if (transpose == ESPALIER_CONJUGATE_TRANSPOSE)
            for (auto& v : entries) v = std::conj(v);
        }
        return found;
      });
    });
    espalier::solver::hand_out(r, info);
    return r.status;
  });
}

template <class Matrix>
int trace_of_inverse(espalier_solver* solver, const Matrix* b, double* trace, espalier_inverse_info* info) {
  return guarded(solver, [&](espalier_solver& s) {
    require(b != nullptr && trace != nullptr, "B or the place for the trace is null");
    return with_factorized(s, [&](auto& cpp) {
      return with_view(cpp, *b, true, [&](const auto& view, bool by_rows) {
        const auto r = espalier::trace_of_inverse(cpp, view, by_rows != s.by_rows ? Transpose::yes : Transpose::no);
        span_of(cpp, trace, 1)[0] = r.trace;
        espalier::solver::hand_out(r, info);
        return r.status;
      });
    });
  });
}

}  // namespace

int espalier_selected_inverse_i32(espalier_solver* solver, const espalier_matrix_i32* pattern, double* x, int64_t count,
                                  int transpose, espalier_inverse_info* info) {
  return selected_inverse(solver, pattern, x, count, transpose, info);
}

int espalier_selected_inverse_i64(espalier_solver* solver, const espalier_matrix_i64* pattern, double* x, int64_t count,
                                  int transpose, espalier_inverse_info* info) {
  return selected_inverse(solver, pattern, x, count, transpose, info);
}

int espalier_inverse_blocks(espalier_solver* solver, int64_t block, double* x, int64_t count,
                            espalier_inverse_info* info) {
  return guarded(solver, [&](espalier_solver& s) {
    require(x != nullptr, "the place for the blocks is null");
    require(block >= 1 && block <= s.rows && s.rows % block == 0, "the number of rows is no multiple of the block");
    require(count == s.rows * block, "the number of entries is not rows times the block");
    const InverseResult r = with_factorized(s, [&](auto& cpp) {
      const auto blocks = span_of(cpp, x, count);
      InverseResult found = espalier::inverse_blocks(cpp, static_cast<Index>(block), blocks);
      if (s.by_rows)  // those of the transposed inverse
        for (int64_t first = 0; first < count; first += block * block)
          for (int64_t c = 0; c < block; ++c)
            for (int64_t row = c + 1; row < block; ++row)
              std::swap(blocks[static_cast<std::size_t>(first + c * block + row)],
                        blocks[static_cast<std::size_t>(first + row * block + c)]);
      return found;
    });
    espalier::solver::hand_out(r, info);
    return r.status;
  });
}

int espalier_trace_of_inverse_i32(espalier_solver* solver, const espalier_matrix_i32* b, double* trace,
                                  espalier_inverse_info* info) {
  return trace_of_inverse(solver, b, trace, info);
}

int espalier_trace_of_inverse_i64(espalier_solver* solver, const espalier_matrix_i64* b, double* trace,
                                  espalier_inverse_info* info) {
  return trace_of_inverse(solver, b, trace, info);
}
