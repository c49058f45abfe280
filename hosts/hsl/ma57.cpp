/// \file
/// The Fortran interface of MA57 in double precision. Its arrays KEEP and IFACT hold a KeptMatrix of ours, FACT the
/// values that were factorized: they are copied and freed like those of the original.
#include <algorithm>
#include <climits>

#include "hsl/cached_factors.hpp"
#include "hsl/fortran.hpp"

namespace espalier::hosts::ma57 {

namespace {

constexpr int kInfos = 40, kReals = 20;

// INFO(1): errors and the one warning that Ipopt knows.
enum Flag : int {
  kOk = 0,
  kBadOrder = -1,
  kBadEntries = -2,
  kSmallFact = -3,
  kSmallIfact = -4,
  kZeroPivot = -5,  // where ICNTL(7) = 2 asks for an end
  kOtherSign = -6,  // where ICNTL(7) = 3 asks for a definite matrix
  kSmallNew = -7,
  kNotAccurate = -8,  // refinement does not converge
  kBadPivoting = -10,
  kSmallRightHandSides = -11,
  kBadJob = -12,
  kSmallKeep = -15,
  kBadColumns = -16,
  kSmallWork = -17,
  kBadMatrix = -99,  // not in the original: arrays that are none of ours, entries that are not finite, no memory
  kEntriesLeftOut = 1,
  kRankDeficient = 4,
};

// Index of INFO and CNTL, from 0, by what stands there.
enum Place : int {
  kOutOfRange = 2,
  kFactorEntries = 13,
  kNeedFact = 16,
  kNeedIfact = 17,
  kLargestFront = 20,
  kTwoByTwo = 21,
  kDelayed = 22,
  kNegative = 23,
  kRank = 24,
};

template <class Body>
void answer(int* info, double* rinfo, Body&& body) noexcept {
  answer_in_info(info, kInfos, kBadMatrix, [&] {
    if (rinfo != nullptr) std::fill_n(rinfo, kReals, 0.0);
    return body();
  });
}

int analyse(int n, int entries, const int* rows, const int* columns, int length, int* keep_array, int* info) {
  if (n < 1) return fail(info, kBadOrder, n);
  if (entries < 0) return fail(info, kBadEntries, entries);
  if (kept_length(entries) > INT_MAX) return fail(info, kBadEntries, entries);
  // What the original asks for; ours fits in.
  const std::int64_t needed = 5 * std::int64_t{n} + entries + std::max(n, entries) + 42;
  if (length < needed) return fail(info, kSmallKeep, needed);
  if (keep_array == nullptr || (entries > 0 && (rows == nullptr || columns == nullptr))) return kBadMatrix;
  KeptMatrix m;
  m.n = n;
  m.entries = entries;
  m.rows = rows;
  m.columns = columns;
  keep(m, keep_array);
  info[kOutOfRange] = count_outside(n, entries, rows, columns);
  info[8] = std::max(entries, 1);                    // INFO(9): what FACT needs
  info[9] = static_cast<int>(kept_length(entries));  // INFO(10): IFACT
  return info[kOutOfRange] > 0 ? kEntriesLeftOut : kOk;
}

int verdict(int pivoting, const Inertia& inertia, int n, int* info) {
  const auto negative = static_cast<int>(inertia.negative), rank = static_cast<int>(inertia.rank);
  info[kNegative] = negative;
  info[kRank] = rank;
  info[kTwoByTwo] = static_cast<int>(inertia.two_by_two);
  info[kDelayed] = static_cast<int>(inertia.delayed);
  if (pivoting == 2 && inertia.singular) return fail(info, kZeroPivot, n);
  if (pivoting == 3 && negative > 0 && negative < rank) return fail(info, kOtherSign, n);
  if (!inertia.singular) return kOk;
  info[kRank] = std::min(rank, n - 1);
  return kRankDeficient;
}

struct Arrays {
  double* fact;
  std::int64_t fact_length;
  int* ifact;
  std::int64_t ifact_length;
};

int factorize(int n, int entries, const double* values, const Arrays& to, const int* keep_array, std::int64_t length,
              const int* icntl, const double* cntl, int* info) {
  std::optional<KeptMatrix> m = kept(keep_array, length);
  if (!m || m->n != n || m->entries != entries || icntl == nullptr || cntl == nullptr) return kBadMatrix;
  const int pivoting = icntl[6];
  if (pivoting < 1 || pivoting > 3) return fail(info, kBadPivoting, pivoting);
  info[kNeedFact] = std::max(entries, 1);
  info[kNeedIfact] = static_cast<int>(kept_length(entries));
  if (to.fact_length < entries) return fail(info, kSmallFact, to.fact_length);
  if (to.ifact_length < kept_length(entries)) return fail(info, kSmallIfact, to.ifact_length);
  if (to.ifact == nullptr || (entries > 0 && (to.fact == nullptr || values == nullptr))) return kBadMatrix;
  set_wish(cntl[0], cntl[1], m->wish);
  m->id = cached_id(*m, to.ifact, to.ifact_length);
  const Inertia inertia = factorize_cached("ma57", *m, values);
  if (inertia.status != ESPALIER_OK) return kBadMatrix;
  keep(*m, to.ifact);
  std::copy_n(values, entries, to.fact);
  if (const auto analysis = cached_analysis(*m)) {
    info[kFactorEntries] = static_cast<int>(std::min<std::int64_t>(analysis->nonzeros_factor, INT_MAX));
    info[kLargestFront] = static_cast<int>(analysis->largest_front);
  }
  return verdict(pivoting, inertia, n, info);
}

int solve(int job, int n, const Arrays& with, int columns, double* x, int stride, int work_length, int* info) {
  if (n < 1) return fail(info, kBadOrder, n);
  if (job != 1) return fail(info, kBadJob, job);
  if (columns < 1) return fail(info, kBadColumns, columns);
  if (stride < n) return fail(info, kSmallRightHandSides, stride);
  if (work_length < std::int64_t{n} * columns) return fail(info, kSmallWork, std::int64_t{n} * columns);
  const std::optional<KeptMatrix> m = kept(with.ifact, with.ifact_length);
  if (!m || m->n != n || with.fact_length < m->entries || x == nullptr) return kBadMatrix;
  const int status = solve_cached("ma57", *m, with.fact, x, columns, stride);
  if (status == ESPALIER_ACCURACY_NOT_REACHED) return kNotAccurate;
  return status == ESPALIER_OK ? kOk : kBadMatrix;
}

template <class T>
int enlarge(const T* from, int length, T* to, int new_length, int* info) {
  if (new_length < length) return fail(info, kSmallNew, length);
  if (from == nullptr || to == nullptr) return kBadMatrix;
  std::copy_n(from, std::max(length, 0), to);
  return kOk;
}

}  // namespace

ESPALIER_HOST_CALL void ma57id_(double* cntl, int* icntl) {
  if (cntl == nullptr || icntl == nullptr) return;
  const double reals[5] = {0.01, 1e-20, 0.5, 0, 0};
  const int integers[20] = {6, 6, 6, -1, 2, 5, 1, 0, 10, 0, 16, 16, 10, 100, 1};
  std::copy_n(reals, 5, cntl);
  std::copy_n(integers, 20, icntl);
}

ESPALIER_HOST_CALL void ma57ad_(const int* n, const int* entries, const int* rows, const int* columns,
                                const int* length, int* keep_array, int*, const int*, int* info, double* rinfo) {
  answer(info, rinfo, [&] {
    if (n == nullptr || entries == nullptr || length == nullptr) return int{kBadMatrix};
    return analyse(*n, *entries, rows, columns, *length, keep_array, info);
  });
}

ESPALIER_HOST_CALL void ma57bd_(const int* n, const int* entries, const double* values, double* fact,
                                const int* fact_length, int* ifact, const int* ifact_length, const int* length,
                                const int* keep_array, int*, const int* icntl, const double* cntl, int* info,
                                double* rinfo) {
  answer(info, rinfo, [&] {
    if (n == nullptr || entries == nullptr || fact_length == nullptr || ifact_length == nullptr || length == nullptr)
      return int{kBadMatrix};
    return factorize(*n, *entries, values, {fact, *fact_length, ifact, *ifact_length}, keep_array, *length, icntl, cntl,
                     info);
  });
}

ESPALIER_HOST_CALL void ma57cd_(const int* job, const int* n, double* fact, const int* fact_length, int* ifact,
                                const int* ifact_length, const int* columns, double* x, const int* stride, double*,
                                const int* work_length, int*, const int*, int* info) {
  answer(info, nullptr, [&] {
    if (job == nullptr || n == nullptr || fact_length == nullptr || ifact_length == nullptr || columns == nullptr ||
        stride == nullptr || work_length == nullptr)
      return int{kBadMatrix};
    return solve(*job, *n, {fact, *fact_length, ifact, *ifact_length}, *columns, x, *stride, *work_length, info);
  });
}

// FACT (IC = 0) or IFACT to a longer array.
ESPALIER_HOST_CALL void ma57ed_(const int*, const int* which, int*, const double* fact, const int* fact_length,
                                double* new_fact, const int* new_fact_length, const int* ifact, const int* ifact_length,
                                int* new_ifact, const int* new_ifact_length, int* info) {
  if (info == nullptr || which == nullptr) return;
  if (*which <= 0 && fact_length != nullptr && new_fact_length != nullptr) {
    info[kInfoFlag] = enlarge(fact, *fact_length, new_fact, *new_fact_length, info);
  } else if (*which > 0 && ifact_length != nullptr && new_ifact_length != nullptr) {
    info[kInfoFlag] = enlarge(ifact, *ifact_length, new_ifact, *new_ifact_length, info);
  } else {
    info[kInfoFlag] = kBadMatrix;
  }
}

}  // namespace espalier::hosts::ma57
