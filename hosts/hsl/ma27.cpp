/// \file
/// The Fortran interface of MA27 in double precision. IW holds a KeptMatrix of ours after the factorization, A the
/// values that were factorized, as the host gave them; IKEEP says nothing.
#include <algorithm>
#include <climits>

#include "hsl/cached_factors.hpp"
#include "hsl/fortran.hpp"

namespace espalier::hosts::ma27 {

namespace {

constexpr int kInfos = 20;

// INFO(1).
enum Flag : int {
  kOk = 0,
  kBadOrder = -1,
  kBadEntries = -2,
  kSmallIw = -3,
  kSmallA = -4,
  kSingular = -5,    // so close to it that no solution has a small backward error
  kBadMatrix = -99,  // not in the original: arrays that are none of ours, entries that are not finite, no memory
  kEntriesLeftOut = 1,
  kRankDeficient = 3,
};

// Index of INFO, from 0, by what stands there.
enum Place : int {
  kTotalReals = 2,
  kTotalIntegers,
  kNeededReals,
  kNeededIntegers,
  kFactorEntries = 8,
  kTwoByTwo = 13,
  kNegative = 14,
};

template <class Body>
void answer(int* info, Body&& body) noexcept {
  answer_in_info(info, kInfos, kBadMatrix, body);
}

int check(int n, int entries, int* info) {
  if (n < 1) return fail(info, kBadOrder, n);
  if (entries < 0 || kept_length(entries) > INT_MAX) return fail(info, kBadEntries, entries);
  return kOk;
}

int analyse(int n, int entries, const int* rows, const int* columns, int* info) {
  if (const int flag = check(n, entries, info); flag != kOk) return flag;
  if (entries > 0 && (rows == nullptr || columns == nullptr)) return kBadMatrix;
  const int left_out = count_outside(n, entries, rows, columns);
  info[kTotalReals] = info[kNeededReals] = std::max(entries, 1);
  info[kTotalIntegers] = info[kNeededIntegers] = static_cast<int>(kept_length(entries));
  return left_out > 0 ? fail(info, kEntriesLeftOut, left_out) : int{kOk};
}

int factorize(KeptMatrix m, const double* values, int reals, int* iw, int integers, const double* cntl, int* info) {
  if (const int flag = check(m.n, m.entries, info); flag != kOk) return flag;
  if (integers < kept_length(m.entries)) return fail(info, kSmallIw, kept_length(m.entries));
  if (reals < m.entries) return fail(info, kSmallA, m.entries);
  const bool arrays = m.entries == 0 || (values != nullptr && m.rows != nullptr && m.columns != nullptr);
  if (iw == nullptr || cntl == nullptr || !arrays) return kBadMatrix;
  set_wish(cntl[0], cntl[2], m.wish);
  m.id = cached_id(m, iw, integers);
  const Inertia inertia = factorize_cached("ma27", m, values);
  if (inertia.status != ESPALIER_OK) return kBadMatrix;
  keep(m, iw);
  info[kTwoByTwo] = static_cast<int>(inertia.two_by_two);
  info[kNegative] = static_cast<int>(inertia.negative);
  if (const auto analysis = cached_analysis(m))
    info[kFactorEntries] = static_cast<int>(std::min<std::int64_t>(analysis->nonzeros_factor, INT_MAX));
  return inertia.singular ? fail(info, kRankDeficient, std::min<std::int64_t>(inertia.rank, m.n - 1)) : int{kOk};
}

int solve(int n, const double* values, int reals, const int* iw, int integers, double* x) {
  const std::optional<KeptMatrix> m = kept(iw, integers);
  if (!m || m->n != n || reals < m->entries || x == nullptr) return kBadMatrix;
  const int status = solve_cached("ma27", *m, values, x, 1, n);
  if (status == ESPALIER_ACCURACY_NOT_REACHED) return kSingular;
  return status == ESPALIER_OK ? kOk : kBadMatrix;
}

}  // namespace

ESPALIER_HOST_CALL void ma27id_(int* icntl, double* cntl) {
  if (cntl == nullptr || icntl == nullptr) return;
  std::fill_n(icntl, 30, 0);
  std::fill_n(cntl, 5, 0.0);
  icntl[0] = icntl[1] = 6;
  cntl[0] = 0.1;
  cntl[1] = 1;
}

ESPALIER_HOST_CALL void ma27ad_(const int* n, const int* entries, const int* rows, const int* columns, int*, const int*,
                                int* ikeep, int*, int* steps, const int*, const int*, const double*, int* info,
                                double* operations) {
  answer(info, [&] {
    if (n == nullptr || entries == nullptr || steps == nullptr) return int{kBadMatrix};
    *steps = 1;
    if (operations != nullptr) *operations = 0;
    if (ikeep != nullptr) std::fill_n(ikeep, 3 * std::int64_t{std::max(*n, 0)}, 0);
    return analyse(*n, *entries, rows, columns, info);
  });
}

ESPALIER_HOST_CALL void ma27bd_(const int* n, const int* entries, const int* rows, const int* columns,
                                const double* values, const int* reals, int* iw, const int* integers, const int*,
                                const int*, int* largest_front, int*, const int*, const double* cntl, int* info) {
  answer(info, [&] {
    if (n == nullptr || entries == nullptr || reals == nullptr || integers == nullptr) return int{kBadMatrix};
    if (largest_front != nullptr) *largest_front = 1;
    KeptMatrix m;
    m.n = *n;
    m.entries = *entries;
    m.rows = rows;
    m.columns = columns;
    return factorize(m, values, *reals, iw, *integers, cntl, info);
  });
}

ESPALIER_HOST_CALL void ma27cd_(const int* n, const double* values, const int* reals, const int* iw,
                                const int* integers, double*, const int*, double* x, int*, const int*, const int*,
                                int* info) {
  answer(info, [&] {
    if (n == nullptr || reals == nullptr || integers == nullptr) return int{kBadMatrix};
    return solve(*n, values, *reals, iw, *integers, x);
  });
}

}  // namespace espalier::hosts::ma27
