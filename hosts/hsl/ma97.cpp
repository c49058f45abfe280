/// \file
/// The interface of MA97: handles, and a function that frees them. `akeep` holds a pattern, `fkeep` a factor.
#include "hsl/ma97.hpp"

#include <algorithm>
#include <climits>
#include <cmath>
#include <memory>
#include <mutex>

#include "common/border.hpp"
#include "common/handles.hpp"
#include "common/inertia_solver.hpp"

namespace espalier::hosts::ma97 {

namespace {

constexpr int kPositiveDefinite = 3, kIndefinite = 4;

struct Analysis {
  std::shared_ptr<const HostPattern> pattern;
  Info info{};
};

struct Factor {
  explicit Factor(const Analysis& analysis) : solver("ma97", analysis.pattern) {}
  InertiaSolver solver;
  Info info{};
  std::mutex mutex;  // several threads may solve with one factor
};

Handles<Analysis>& analyses() {
  static auto& live = *new Handles<Analysis>;
  return live;
}

Handles<Factor>& factors() {
  static auto& live = *new Handles<Factor>;
  return live;
}

template <class T>
std::shared_ptr<T> find(const Handles<T>& among, void* const* handle) {
  return handle == nullptr ? nullptr : among.find(*handle);
}

template <class T>
void end(Handles<T>& among, void** handle) {
  if (handle == nullptr) return;
  among.end(*handle);
  *handle = nullptr;
}

int clamped(std::int64_t number) { return static_cast<int>(std::min<std::int64_t>(number, INT_MAX)); }

bool falls(int n, const int* pointers, int base) {
  if (pointers[0] != base) return true;
  for (int k = 0; k < n; ++k)
    if (pointers[k + 1] < pointers[k]) return true;
  return false;
}

// An index out of range, or above the diagonal.
bool strays(int n, const int* pointers, const int* rows, int base) {
  for (int column = 0; column < n; ++column)
    for (int k = pointers[column] - base; k < pointers[column + 1] - base; ++k)
      if (rows[k] < column + base || rows[k] >= n + base) return true;
  return false;
}

int missing_diagonals(const HostPattern& pattern) {
  const espalier_matrix_i32 a = pattern.matrix(nullptr);
  int missing = 0;
  for (int column = 0; column < pattern.n(); ++column) {
    const int* begin = a.indices + a.pointers[column];
    const int* end = a.indices + a.pointers[column + 1];
    if (std::find(begin, end, column) == end) ++missing;
  }
  return missing;
}

int flag_of(int status) {
  switch (status) {
    case ESPALIER_OK:
      return kOk;
    case ESPALIER_OUT_OF_MEMORY:
      return kNoMemory;
    case ESPALIER_SINGULAR:
    case ESPALIER_ACCURACY_NOT_REACHED:
      return kSingular;
    case ESPALIER_INVALID_INPUT:
      return kNotFinite;
    case ESPALIER_MISUSE:
      return kCallSequence;
    default:
      return kInternal;
  }
}

// Runs `body(info)`, which returns a flag.
template <class Body>
void answer(Info* info, Body&& body) noexcept {
  Info unread{};
  Info& to = info == nullptr ? unread : *info;
  guarded([&] { to.flag = body(to); }, [&] { to.flag = kNoMemory; }, [&] { to.flag = kInternal; });
}

int analyse(const Control* control, int check, int n, const int* pointers, const int* rows, void** akeep, Info& info) {
  info = Info{};
  if (akeep == nullptr || control == nullptr) return kCallSequence;
  end(analyses(), akeep);  // one that a host analyses again
  const int base = control->f_arrays != 0 ? 1 : 0;
  if (n < 0 || n == INT_MAX) return kBadSize;
  if (pointers == nullptr || falls(n, pointers, base)) return kBadPointers;
  if (pointers[n] > base && rows == nullptr) return kBadPointers;
  if (check == 0 && strays(n, pointers, rows, base)) return kBadMatrix;
  auto analysis = std::make_shared<Analysis>();
  analysis->pattern =
      std::make_shared<const HostPattern>(HostPattern::from_columns(n, pointers, rows, base, check != 0));
  info.matrix_rank = n;
  info.matrix_outrange = clamped(analysis->pattern->left_out());
  info.matrix_missing_diag = missing_diagonals(*analysis->pattern);
  info.ordering = 3;  // nested dissection
  analysis->info = info;
  *akeep = analyses().add(std::move(analysis));
  return info.matrix_outrange > 0 ? kEntriesLeftOut : kOk;
}

Info info_of(const Analysis& analysis, const InertiaSolver& solver, const Inertia& inertia) {
  Info info = analysis.info;
  const espalier_analysis_info& a = solver.solver().analysis();
  info.num_factor = static_cast<long>(a.nonzeros_factor);
  info.num_flops = static_cast<long>(std::min(a.flops, 9e18));
  info.maxfront = clamped(a.largest_front);
  info.num_sup = clamped(a.fronts);
  info.maxdepth = clamped(a.tiers);
  info.matrix_rank = clamped(inertia.rank);
  info.num_neg = clamped(inertia.negative);
  info.num_two = clamped(inertia.two_by_two);
  info.num_delay = clamped(inertia.delayed);
  return info;
}

// What the host reads where it asked for scaling factors: none of ours are needed for its solves.
void fill_scaling(const Control& control, int n, double* scaling) {
  if (scaling != nullptr && control.scaling > 0) std::fill_n(scaling, n, 1.0);
}

int factor(int type, const double* values, void** akeep, void** fkeep, const Control* control, Info& info,
           double* scaling) {
  info = Info{};
  const std::shared_ptr<Analysis> analysis = find(analyses(), akeep);
  if (analysis == nullptr || fkeep == nullptr || control == nullptr) return kCallSequence;
  if (type != kPositiveDefinite && type != kIndefinite) return kBadType;
  if (values == nullptr && analysis->pattern->given() > 0) return kNoValues;
  std::shared_ptr<Factor> factor = find(factors(), fkeep);
  if (factor == nullptr || &factor->solver.pattern() != analysis->pattern.get()) {
    end(factors(), fkeep);  // of another analysis
    factor = std::make_shared<Factor>(*analysis);
    *fkeep = factors().add(factor);
  }
  Factor& to = *factor;
  const std::lock_guard lock(to.mutex);
  PivotWish wish;
  if (control->u > 0) wish.threshold = std::min(control->u, 0.5);
  if (control->small > 0) wish.zero_pivot = std::min(control->small, 1.0);
  const Inertia inertia = to.solver.factorize(values, wish);
  if (inertia.status != ESPALIER_OK) return flag_of(inertia.status);
  to.info = info = info_of(*analysis, to.solver, inertia);
  fill_scaling(*control, to.solver.pattern().n(), scaling);
  if (type == kPositiveDefinite && (inertia.singular || inertia.negative > 0)) return kNotPositive;
  if (!inertia.singular) return kOk;
  return control->action != 0 ? kSingularFactor : kSingular;
}

int solve(int job, int columns, double* x, int stride, void** fkeep, Info& info) {
  info = Info{};
  const std::shared_ptr<Factor> factor = find(factors(), fkeep);
  if (factor == nullptr) return kCallSequence;
  Factor& with = *factor;
  const std::lock_guard lock(with.mutex);
  info = with.info;
  if (job != 0) return kBadJob;
  const int n = with.solver.pattern().n();
  if (columns < 1 || stride < n || (x == nullptr && n > 0)) return kBadRightHandSide;
  return n == 0 ? int{kOk} : flag_of(with.solver.solve(x, columns, stride));
}

}  // namespace

ESPALIER_HOST_CALL void ma97_default_control_d(Control* control) {
  if (control == nullptr) return;
  *control = Control{};
  control->action = 1;
  control->nemin = 8;
  control->multiplier = 1.1;
  control->ordering = 5;
  control->small = 1e-20;
  control->u = 0.01;
  control->unit_diagnostics = control->unit_error = control->unit_warning = 6;
  control->factor_min = 20000000;
  control->solve_min = 100000;
  control->consist_tol = 2.2e-16;
}

// `values` and `order` are not read: pairs are found at the first factorization, and the order is ours.
ESPALIER_HOST_CALL void ma97_analyse_d(int check, int n, const int* pointers, const int* rows, double*, void** akeep,
                                       const Control* control, Info* info, int*) {
  answer(info, [&](Info& to) { return analyse(control, check, n, pointers, rows, akeep, to); });
}

ESPALIER_HOST_CALL void ma97_factor_d(int type, const int*, const int*, const double* values, void** akeep,
                                      void** fkeep, const Control* control, Info* info, double* scaling) {
  answer(info, [&](Info& to) { return factor(type, values, akeep, fkeep, control, to, scaling); });
}

ESPALIER_HOST_CALL void ma97_solve_d(int job, int columns, double* x, int stride, void**, void** fkeep, const Control*,
                                     Info* info) {
  answer(info, [&](Info& to) { return solve(job, columns, x, stride, fkeep, to); });
}

ESPALIER_HOST_CALL void ma97_factor_solve_d(int type, const int*, const int*, const double* values, int columns,
                                            double* x, int stride, void** akeep, void** fkeep, const Control* control,
                                            Info* info, double* scaling) {
  answer(info, [&](Info& to) {
    const int flag = factor(type, values, akeep, fkeep, control, to, scaling);
    if (flag < 0) return flag;
    const int solved = solve(0, columns, x, stride, fkeep, to);
    return solved < 0 ? solved : flag;
  });
}

// What a host has never set, or ended before, is left alone.
ESPALIER_HOST_CALL void ma97_free_akeep_d(void** akeep) { end(analyses(), akeep); }

ESPALIER_HOST_CALL void ma97_free_fkeep_d(void** fkeep) { end(factors(), fkeep); }

ESPALIER_HOST_CALL void ma97_finalise_d(void** akeep, void** fkeep) {
  ma97_free_fkeep_d(fkeep);
  ma97_free_akeep_d(akeep);
}

}  // namespace espalier::hosts::ma97
