#include "schur/dense.hpp"

#include <limits>
#include <utility>

#include "base/at.hpp"

namespace espalier::schur {

namespace {

SparseMatrix as_sparse(std::span<const double> s, Index size, bool symmetric) {
  SparseMatrix a;
  a.rows = a.cols = size;
  a.storage = symmetric ? Storage::symmetric_lower : Storage::general;
  a.col_ptr.push_back(0);
  for (Index c = 0; c < size; ++c) {
    for (Index r = symmetric ? c : 0; r < size; ++r) {
      a.row_ind.push_back(r);
      a.values.push_back(s[at(c) * at(size) + at(r)]);
    }
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  return a;
}

// The caller refines with the whole system.
Options options_for(Options o, bool symmetric) {
  o.kind = symmetric ? Kind::automatic : Kind::lu;
  o.singular = SingularMatrix::report;
  o.refinement_steps = 1;
  o.required_backward_error = std::numeric_limits<double>::infinity();
  o.permutation.clear();
  o.rescale = Rescale::off;
  o.record_timeline = false;
  return o;
}

}  // namespace

DenseFactor::DenseFactor(std::span<const double> s, Index size, bool symmetric, Options options)
    : solver_(options_for(std::move(options), symmetric)) {
  const SparseMatrix a = as_sparse(s, size, symmetric);
  if (AnalysisResult analysis = solver_.analyze(a); !analysis.status.ok()) {
    factor_.status = std::move(analysis.status);
    return;
  }
  factor_ = solver_.factorize(a);
}

Status DenseFactor::solve(std::span<double> x, Index columns, Transpose transpose) {
  return solver_.solve(x, x, columns, transpose).status;
}

}  // namespace espalier::schur
