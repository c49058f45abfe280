#include "mumps/instance.hpp"

#include <algorithm>
#include <climits>
#include <cmath>

#include "common/log.hpp"
#include "common/real_library.hpp"

namespace espalier::hosts::mumps {

namespace {

std::int64_t entries_of(const DMUMPS_STRUC_C& id) { return id.nnz > 0 ? id.nnz : id.nz; }

// Refinement as ICNTL(10) asks for it: a negative number is one of steps without a test.
int steps_of(const DMUMPS_STRUC_C& id, int columns) {
  const int asked = std::min(std::abs(std::max(icntl(id, kRefinement), -1000)), 1000);
  if (icntl(id, kErrors) > 0) return std::max(asked, 1);
  return columns == 1 ? asked : 0;
}

}  // namespace

void set_info(DMUMPS_STRUC_C& id, int place, std::int64_t value) {
  // What is too large for an integer is given in millions, negative.
  id.info[place - 1] = id.infog[place - 1] =
      static_cast<int>(value <= INT_MAX ? std::max<std::int64_t>(value, INT_MIN) : -(value / 1000000));
}

void report(DMUMPS_STRUC_C& id, int error, std::int64_t detail) {
  set_info(id, 1, error);
  set_info(id, 2, detail);
}

bool Instance::small(const DMUMPS_STRUC_C& id) {
  constexpr std::int64_t kFewestEntries = 15000;
  return id.sym != 2 && entries_of(id) < kFewestEntries && !takes_small_systems();
}

bool Instance::takes(const DMUMPS_STRUC_C& id) {
  for (const Control off :
       {kElements, kBlocks, kDistributed, kSchur, kNullPivots, kDiscardFactors, kForwardInFactorization})
    if (icntl(id, off) != 0) return false;
  return id.par == 1 && id.sym >= 0 && id.sym <= 2 && id.n >= 1 && entries_of(id) >= 1 && entries_of(id) <= INT_MAX &&
         id.irn != nullptr && id.jcn != nullptr;
}

// The order is found with the values of the first factorization, which say which unknowns pair.
bool Instance::analyze(DMUMPS_STRUC_C& id) {
  factorized_ = false;
  indefinite_ = nullptr;
  plain_ = nullptr;
  report(id, kOk);
  sym_ = id.sym;
  pattern_ = std::make_shared<const HostPattern>(
      HostPattern::from_coordinates(id.n, static_cast<int>(entries_of(id)), id.irn, id.jcn, sym_ != 0));
  for (const int place : {3, 4, 5, 6, 7, 8, 9, 20}) set_info(id, place, 0);
  if (pattern_->left_out() > 0) report(id, kEntriesLeftOut, pattern_->left_out());
  return true;
}

const HostSolver* Instance::solver() const {
  return plain_ != nullptr ? plain_.get() : indefinite_ != nullptr ? &indefinite_->solver() : nullptr;
}

int Instance::make_plain(const char* kind, const double* values) {
  plain_ = std::make_unique<HostSolver>("mumps");
  plain_->insist("kind", kind);
  plain_->set_default("required_backward_error", "inf");  // HostSolver looks
  plain_->set_default("rescale", "off");
  return plain_->analyze(pattern_->matrix(values));
}

// @returns an espalier_status
int Instance::factorize_values(const double* given, double threshold) {
  if (indefinite_ == nullptr && sym_ != 2) {
    const double* values = pattern_->gather(given, values_);
    int status = ESPALIER_OK;
    for (bool afresh = plain_ == nullptr;; afresh = true) {
      if (afresh) status = make_plain(sym_ == 1 ? "llt" : "lu", values);
      if (status == ESPALIER_OK) status = plain_->factorize(values, pattern_->entries());
      // The scaling may be that of other values.
      const bool weak = status == ESPALIER_SINGULAR || (status == ESPALIER_OK && plain_->factor().perturbed > 0);
      if (!weak || afresh) break;
    }
    if (sym_ != 1 || status != ESPALIER_NOT_POSITIVE_DEFINITE) return status;
    plain_ = nullptr;  // MUMPS takes such a matrix without pivoting
  }
  if (indefinite_ == nullptr) indefinite_ = std::make_unique<InertiaSolver>("mumps", pattern_);
  PivotWish wish;
  if (threshold > 0) wish.threshold = std::min(threshold, 0.5);
  const Inertia inertia = indefinite_->factorize(given, wish);
  return inertia.status == ESPALIER_OK && inertia.singular ? int{ESPALIER_SINGULAR} : inertia.status;
}

void Instance::say_factor(DMUMPS_STRUC_C& id, std::int64_t negative) const {
  const espalier_analysis_info& a = solver()->analysis();
  const espalier_factor_info& f = solver()->factor();
  for (const int place : {3, 9, 20, 29}) set_info(id, place, a.nonzeros_factor);
  set_info(id, 5, a.largest_front);
  set_info(id, 11, a.largest_front);
  set_info(id, 12, negative);
  set_info(id, 13, f.delayed);
  set_info(id, 14, 0);
  set_info(id, 25, f.perturbed);
  set_info(id, 28, 0);
  for (const int place : {16, 17, 18, 19, 21, 22}) set_info(id, place, (f.peak_host_bytes >> 20) + 1);
  for (const int k : {0, 1, 2}) id.rinfo[k] = id.rinfog[k] = a.flops;
  if (icntl(id, kDeterminant) == 0) return;
  // RINFOG(12) 2^INFOG(34)
  const double bits = f.determinant_log / std::log(2.0), whole = std::floor(bits);
  id.rinfog[11] = f.determinant_sign * std::exp2(bits - whole);
  set_info(id, 34, static_cast<std::int64_t>(whole));
}

bool Instance::factorize(DMUMPS_STRUC_C& id) {
  report(id, kOk);
  factorized_ = false;
  if (pattern_ == nullptr || pattern_->n() != id.n) return report(id, kBadJob, id.job), false;
  if (id.a == nullptr) return report(id, kBadPointer, kValues), false;
  const int status = factorize_values(id.a, id.cntl[0]);
  if (solver() != nullptr && (status == ESPALIER_OK || status == ESPALIER_SINGULAR))
    say_factor(id, indefinite_ != nullptr ? solver()->factor().negative : 0);
  switch (status) {
    case ESPALIER_OK:
      if (pattern_->left_out() > 0) report(id, kEntriesLeftOut, pattern_->left_out());
      factorized_ = true;
      return true;
    case ESPALIER_SINGULAR:
      report(id, kSingular, solver() == nullptr ? 0 : std::clamp<std::int64_t>(solver()->factor().rank, 0, id.n - 1));
      return false;
    case ESPALIER_OUT_OF_MEMORY:
      return report(id, kNoMemory), false;
    default:
      complain("mumps", solver() == nullptr ? "no solver" : solver()->message());
      return report(id, kNotOffered, status), false;
  }
}

bool Instance::solve_dense(DMUMPS_STRUC_C& id, double* x, int columns, int stride) {
  const int steps = steps_of(id, columns);
  if (indefinite_ != nullptr)
    indefinite_->set_refinement(steps);
  else
    plain_->set_refinement(steps);
  int status = ESPALIER_OK;
  if (indefinite_ != nullptr) {
    status = indefinite_->solve(x, columns, stride);
  } else {
    const int transposed = icntl(id, kTranspose) != 1 ? ESPALIER_TRANSPOSE : ESPALIER_NO_TRANSPOSE;
    for (int k = 0; k < columns && status == ESPALIER_OK; k += stride == id.n ? columns : 1) {
      double* at = x + std::ptrdiff_t{k} * stride;
      status = plain_->solve(at, at, stride == id.n ? columns : 1, transposed);
    }
  }
  if (status == ESPALIER_ACCURACY_NOT_REACHED) return report(id, kSingular, id.n - 1), false;
  if (status != ESPALIER_OK)
    return report(id, status == ESPALIER_OUT_OF_MEMORY ? kNoMemory : kNotOffered, status), false;
  const espalier_solve_info& done = solver()->solution();
  set_info(id, 15, done.refinement_steps);
  if (icntl(id, kErrors) > 0) {
    id.rinfog[5] = done.backward_error;
    id.rinfog[6] = done.componentwise_error;
    id.rinfog[7] = 0;
  }
  return true;
}

// A right-hand side given by its entries.
bool Instance::expand_right_hand_sides(DMUMPS_STRUC_C& id, int columns, int stride) {
  if (id.irhs_ptr == nullptr || id.irhs_sparse == nullptr || id.rhs_sparse == nullptr)
    return report(id, kBadPointer, kSparse), false;
  for (int c = 0; c < columns; ++c) {
    double* column = id.rhs + std::ptrdiff_t{c} * stride;
    std::fill_n(column, id.n, 0.0);
    for (int k = id.irhs_ptr[c] - 1; k < id.irhs_ptr[c + 1] - 1; ++k) {
      const int row = id.irhs_sparse[k];
      if (k < 0 || k >= id.nz_rhs || row < 1 || row > id.n) return report(id, kBadPointer, kSparse), false;
      column[row - 1] += id.rhs_sparse[k];
    }
  }
  return true;
}

// Entries of the inverse (ICNTL(30)): those that the sparse right-hand side names.
bool Instance::solve_inverse(DMUMPS_STRUC_C& id) {
  if (id.irhs_ptr == nullptr || id.irhs_sparse == nullptr || id.rhs_sparse == nullptr)
    return report(id, kBadPointer, kSparse), false;
  std::vector<double> column(static_cast<std::size_t>(id.n));
  for (int c = 0; c < id.n; ++c) {
    const int begin = id.irhs_ptr[c] - 1, end = id.irhs_ptr[c + 1] - 1;
    if (begin < 0 || end > id.nz_rhs) return report(id, kBadPointer, kSparse), false;
    if (begin >= end) continue;
    std::fill(column.begin(), column.end(), 0.0);
    column[static_cast<std::size_t>(c)] = 1;
    if (!solve_dense(id, column.data(), 1, id.n)) return false;
    for (int k = begin; k < end; ++k) {
      const int row = id.irhs_sparse[k];
      if (row < 1 || row > id.n) return report(id, kBadPointer, kSparse), false;
      id.rhs_sparse[k] = column[static_cast<std::size_t>(row - 1)];
    }
  }
  return true;
}

bool Instance::solve(DMUMPS_STRUC_C& id) {
  report(id, kOk);
  if (!factorized_ || pattern_->n() != id.n) return report(id, kBadJob, id.job), false;
  if (icntl(id, kInverse) != 0) return solve_inverse(id);
  const int form = icntl(id, kRightHandSide);
  if (form < 0 || form > 3 || icntl(id, kDistributedSolution) != 0) {
    complain("mumps", "right-hand sides and solutions that are distributed are not offered (ICNTL(20), ICNTL(21))");
    return report(id, kNotOffered), false;
  }
  const int columns = id.nrhs == 0 ? 1 : id.nrhs, stride = columns == 1 ? id.n : id.lrhs;
  if (columns < 0) return report(id, kBadColumns, columns), false;
  if (stride < id.n) return report(id, kBadStride, stride), false;
  if (id.rhs == nullptr) return report(id, kBadPointer, kRightHandSides), false;
  if (form != 0 && !expand_right_hand_sides(id, columns, stride)) return false;
  return solve_dense(id, id.rhs, columns, stride);
}

}  // namespace espalier::hosts::mumps
