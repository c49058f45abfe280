/// \file
/// CHOLMOD's functions that make, use or end a factor, for real symmetric matrices of which one triangle is given. The
/// analysis stays the real library's, so that a host finds in the factor's object what it expects (its order, its
/// counts); matrices for which it pays are factorized and solved here. Whatever else is asked of a factor, the real
/// library makes and does.
#include <fmt/format.h>

#include <chrono>
#include <cmath>

#include "cholmod/attached.hpp"
#include "common/border.hpp"
#include "common/call_sites.hpp"
#include "common/handles.hpp"
#include "common/log.hpp"

namespace espalier::hosts::cholmod {

namespace {

// Below it the real library says what it thinks of the matrix, so that its warnings stay: hosts warn at about 1e-16.
constexpr double kNearlySingular = 1e-13;

constexpr int kWhole = 0;  // CHOLMOD_A: A x = b

template <class Int>
Handles<Attached<Int>>& all() {
  static auto& live = *new Handles<Attached<Int>>;
  return live;
}

// Octave's chol(), for instance.
CallSites& wants_factors() {
  static auto& sites = *new CallSites;
  return sites;
}

// A library whose structs are others is left alone.
bool known_version() {
  static const bool known = [] {
    int version[3] = {0, 0, 0};
    auto* ask = real_library().function<int(int*)>("cholmod_version");
    if (ask != nullptr) ask(version);
    if (version[0] != CHOLMOD_MAIN_VERSION && ask != nullptr)
      complain("cholmod", fmt::format("left to the program's own CHOLMOD {}: ours was built for version {}", version[0],
                                      CHOLMOD_MAIN_VERSION));
    return version[0] == CHOLMOD_MAIN_VERSION;
  }();
  return known;
}

template <class Answer, class Body>
Answer answer(cholmod_common* common, Answer failed, Body&& body) noexcept {
  Answer result = failed;
  const auto set = [&](int status) {
    result = failed;
    if (common != nullptr) common->status = status;
  };
  guarded([&] { result = body(); }, [&] { set(CHOLMOD_OUT_OF_MEMORY); }, [&] { set(CHOLMOD_INVALID); });
  return result;
}

// What we know of a factor; null inside of the real library, which works with the real one.
template <class Int>
std::shared_ptr<Attached<Int>> find(const cholmod_factor* factor) {
  return InsideReal::now() || factor == nullptr ? nullptr : all<Int>().find(factor);
}

// From now on the factor is the real library's alone: it gets its entries, if ours has any.
template <class Int>
void hand_over(cholmod_factor* factor, cholmod_common* common) {
  const auto found = find<Int>(factor);
  if (found == nullptr) return;
  const std::lock_guard lock(found->mutex);
  if (!found->factorized) return;  // it is so already
  all<Int>().end(factor);
  wants_factors().add(found->site);
  cholmod_sparse a = found->matrix();
  ask_real<Int>("factorize", 0, &a, factor, common);
}

// `ask`: the real library's analysis. With several orders to try its default (AMD, then METIS) would cost as much as
// our own analysis; AMD alone serves whoever wants to see an order.
template <class Int, class Ask>
cholmod_factor* analyze(cholmod_sparse* a, cholmod_common* common, Ask&& ask) {
  if (InsideReal::now() || a == nullptr || common == nullptr || !known_version() ||
      wants_factors().has(Caller::current()) || a->stype == 0 || a->nrow != a->ncol)
    return ask();
  const bool by_default = common->nmethods == 0;
  const int ordering = common->method[0].ordering;
  if (by_default) {
    common->nmethods = 1;
    common->method[0].ordering = CHOLMOD_AMD;
  }
  cholmod_factor* factor = ask();
  if (by_default) {
    common->nmethods = 0;
    common->method[0].ordering = ordering;
  }
  if (factor != nullptr) all<Int>().add(factor, std::make_shared<Attached<Int>>(common->fl, common->anz));
  return factor;
}

template <class Int>
int factorize(cholmod_sparse* a, cholmod_factor* factor, cholmod_common* common) {
  const auto real = [&] { return ask_real<Int>("factorize", 0, a, factor, common); };
  const auto found = find<Int>(factor);
  if (found == nullptr) return real();
  if (a == nullptr || common == nullptr || !Attached<Int>::takes(*a) || a->nrow != factor->n) {
    all<Int>().end(factor);
    return real();
  }
  const std::lock_guard lock(found->mutex);
  if (!found->pays()) {
    const auto begin = std::chrono::steady_clock::now();
    const int done = real();
    found->note_real(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    return done;
  }
  const int status = found->factorize(*a);
  if (status != ESPALIER_OK) {  // the real one says which column failed, or takes it as L D L^T
    if (status == ESPALIER_OUT_OF_MEMORY) all<Int>().end(factor);
    return real();
  }
  if (factor->xtype != CHOLMOD_PATTERN)  // what the real library made of it before is the past
    ask_real<Int>("change_factor", 0, int{CHOLMOD_PATTERN}, factor->is_ll, factor->is_super, 1, 1, factor, common);
  factor->minor = factor->n;
  common->status = CHOLMOD_OK;
  common->lnz = static_cast<double>(found->analysis().nonzeros_factor);
  common->fl = found->analysis().flops;
  return 1;
}

// The solution of a right-hand side that is not ours to solve for: null.
template <class Int>
std::shared_ptr<Attached<Int>> solver_for(int system, const cholmod_factor* factor, const cholmod_dense* b,
                                          const cholmod_common* common) {
  auto found = find<Int>(factor);
  const bool ours = found != nullptr && found->factorized && system == kWhole && b != nullptr && common != nullptr &&
                    b->xtype == CHOLMOD_REAL && b->dtype == CHOLMOD_DOUBLE && b->nrow == factor->n && b->d >= b->nrow &&
                    (b->x != nullptr || b->ncol == 0);
  return ours ? found : nullptr;
}

// False: what accuracy the real library reaches, the host shall hear from it.
template <class Int>
bool solve_into(Attached<Int>& with, const cholmod_dense& b, cholmod_dense& x, cholmod_common& common) {
  const std::lock_guard lock(with.mutex);
  common.status = with.solve(b, x) == ESPALIER_OK ? CHOLMOD_OK : CHOLMOD_INVALID;
  return common.status == CHOLMOD_OK;
}

template <class Int>
cholmod_dense* solve(int system, cholmod_factor* factor, cholmod_dense* b, cholmod_common* common) {
  const auto found = solver_for<Int>(system, factor, b, common);
  cholmod_dense* none = nullptr;
  if (found != nullptr) {
    cholmod_dense* x = ask_real<Int>("allocate_dense", none, b->nrow, b->ncol, b->nrow, int{CHOLMOD_REAL}, common);
    if (x == nullptr || solve_into(*found, *b, *x, *common)) return x;
    ask_real<Int>("free_dense", 0, &x, common);
  }
  hand_over<Int>(factor, common);
  return ask_real<Int>("solve", none, system, factor, b, common);
}

template <class Int>
int solve2(int system, cholmod_factor* factor, cholmod_dense* b, cholmod_sparse* b_set, cholmod_dense** x,
           cholmod_sparse** x_set, cholmod_dense** y, cholmod_dense** e, cholmod_common* common) {
  const auto found = solver_for<Int>(system, factor, b, common);
  if (found != nullptr && b_set == nullptr && x != nullptr) {
    cholmod_dense* none = nullptr;
    cholmod_dense* room = ask_real<Int>("ensure_dense", none, x, b->nrow, b->ncol, b->nrow, int{CHOLMOD_REAL}, common);
    if (room == nullptr) return 0;
    if (solve_into(*found, *b, *room, *common)) return 1;
  }
  hand_over<Int>(factor, common);
  return ask_real<Int>("solve2", 0, system, factor, b, b_set, x, x_set, y, e, common);
}

// By way of a dense one: the solution is dense in any case.
template <class Int>
cholmod_sparse* solve_sparse(int system, cholmod_factor* factor, cholmod_sparse* b, cholmod_common* common) {
  constexpr std::size_t kMostColumns = 64;
  cholmod_sparse* none = nullptr;
  cholmod_dense *no_dense = nullptr, *dense = nullptr;
  if (b != nullptr && b->ncol <= kMostColumns && b->xtype == CHOLMOD_REAL && find<Int>(factor) != nullptr)
    dense = ask_real<Int>("sparse_to_dense", no_dense, b, common);
  if (solver_for<Int>(system, factor, dense, common) == nullptr) {
    if (dense != nullptr) ask_real<Int>("free_dense", 0, &dense, common);
    hand_over<Int>(factor, common);
    return ask_real<Int>("spsolve", none, system, factor, b, common);
  }
  cholmod_dense* x = solve<Int>(system, factor, dense, common);
  cholmod_sparse* result = x == nullptr ? nullptr : ask_real<Int>("dense_to_sparse", none, x, 1, common);
  ask_real<Int>("free_dense", 0, &dense, common);
  if (x != nullptr) ask_real<Int>("free_dense", 0, &x, common);
  return result;
}

template <class Int>
double rcond(cholmod_factor* factor, cholmod_common* common) {
  if (const auto found = find<Int>(factor); found != nullptr && found->factorized) {
    const std::unique_lock lock(found->mutex);
    const double estimate = found->reciprocal_condition();
    if (estimate >= kNearlySingular) return estimate;
  }
  hand_over<Int>(factor, common);
  return ask_real<Int>("rcond", -1.0, factor, common);
}

template <class Int>
int end(cholmod_factor** factor, cholmod_common* common) {
  if (factor != nullptr) all<Int>().end(*factor);
  return ask_real<Int>("free_factor", 1, factor, common);
}

// Whatever else is done with a factor.
template <class Int, class Answer, class... Arguments>
Answer with_real(const char* what, Answer otherwise, cholmod_factor* factor, cholmod_common* common,
                 Arguments... arguments) {
  return answer(common, otherwise, [&] {
    hand_over<Int>(factor, common);
    return ask_real<Int>(what, otherwise, arguments...);
  });
}

}  // namespace

using Factor = cholmod_factor;
using Sparse = cholmod_sparse;
using Dense = cholmod_dense;
using Common = cholmod_common;

// All functions for integers I under the prefix P.
// NOLINTBEGIN(bugprone-macro-parentheses): I is a type
#define ESPALIER_CHOLMOD(P, I)                                                                                         \
  ESPALIER_HOST_CALL Factor* P##analyze(Sparse* a, Common* c) {                                                        \
    ESPALIER_NOTE_CALLER;                                                                                              \
    Factor* none = nullptr;                                                                                            \
    const auto real = [&] { return ask_real<I>("analyze", none, a, c); };                                              \
    return answer(c, none, [&] { return analyze<I>(a, c, real); });                                                    \
  }                                                                                                                    \
  ESPALIER_HOST_CALL Factor* P##analyze_p(Sparse* a, I* perm, I* set, size_t length, Common* c) {                      \
    ESPALIER_NOTE_CALLER;                                                                                              \
    Factor* none = nullptr;                                                                                            \
    const auto real = [&] { return ask_real<I>("analyze_p", none, a, perm, set, length, c); };                         \
    return answer(c, none, [&] { return set != nullptr ? real() : analyze<I>(a, c, real); });                          \
  }                                                                                                                    \
  ESPALIER_HOST_CALL int P##factorize(Sparse* a, Factor* f, Common* c) {                                               \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(c, 0, [&] { return factorize<I>(a, f, c); });                                                        \
  }                                                                                                                    \
  ESPALIER_HOST_CALL int P##factorize_p(Sparse* a, double* beta, I* set, size_t length, Factor* f, Common* c) {        \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(c, 0, [&] {                                                                                          \
      const bool plain = set == nullptr && (beta == nullptr || (beta[0] == 0 && beta[1] == 0));                        \
      if (plain && find<I>(f) != nullptr) return factorize<I>(a, f, c);                                                \
      if (!InsideReal::now()) all<I>().end(f);                                                                         \
      return ask_real<I>("factorize_p", 0, a, beta, set, length, f, c);                                                \
    });                                                                                                                \
  }                                                                                                                    \
  ESPALIER_HOST_CALL Dense* P##solve(int sys, Factor* f, Dense* b, Common* c) {                                        \
    ESPALIER_NOTE_CALLER;                                                                                              \
    Dense* none = nullptr;                                                                                             \
    return answer(c, none, [&] { return solve<I>(sys, f, b, c); });                                                    \
  }                                                                                                                    \
  ESPALIER_HOST_CALL int P##solve2(int sys, Factor* f, Dense* b, Sparse* b_set, Dense** x, Sparse** x_set, Dense** y,  \
                                   Dense** e, Common* c) {                                                             \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(c, 0, [&] { return solve2<I>(sys, f, b, b_set, x, x_set, y, e, c); });                               \
  }                                                                                                                    \
  ESPALIER_HOST_CALL Sparse* P##spsolve(int sys, Factor* f, Sparse* b, Common* c) {                                    \
    ESPALIER_NOTE_CALLER;                                                                                              \
    Sparse* none = nullptr;                                                                                            \
    return answer(c, none, [&] { return solve_sparse<I>(sys, f, b, c); });                                             \
  }                                                                                                                    \
  ESPALIER_HOST_CALL double P##rcond(Factor* f, Common* c) {                                                           \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(c, -1.0, [&] { return rcond<I>(f, c); });                                                            \
  }                                                                                                                    \
  ESPALIER_HOST_CALL int P##free_factor(Factor** f, Common* c) {                                                       \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(c, 0, [&] { return end<I>(f, c); });                                                                 \
  }                                                                                                                    \
  ESPALIER_HOST_CALL Sparse* P##factor_to_sparse(Factor* f, Common* c) {                                               \
    ESPALIER_NOTE_CALLER;                                                                                              \
    Sparse* none = nullptr;                                                                                            \
    return with_real<I>("factor_to_sparse", none, f, c, f, c);                                                         \
  }                                                                                                                    \
  ESPALIER_HOST_CALL Factor* P##copy_factor(Factor* f, Common* c) {                                                    \
    ESPALIER_NOTE_CALLER;                                                                                              \
    Factor* none = nullptr;                                                                                            \
    return with_real<I>("copy_factor", none, f, c, f, c);                                                              \
  }                                                                                                                    \
  ESPALIER_HOST_CALL int P##change_factor(int x, int ll, int super, int pack, int mono, Factor* f, Common* c) {        \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return with_real<I>("change_factor", 0, f, c, x, ll, super, pack, mono, f, c);                                     \
  }                                                                                                                    \
  ESPALIER_HOST_CALL int P##pack_factor(Factor* f, Common* c) {                                                        \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return with_real<I>("pack_factor", 0, f, c, f, c);                                                                 \
  }                                                                                                                    \
  ESPALIER_HOST_CALL int P##factor_xtype(int x, Factor* f, Common* c) {                                                \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return with_real<I>("factor_xtype", 0, f, c, x, f, c);                                                             \
  }                                                                                                                    \
  ESPALIER_HOST_CALL int P##resymbol(Sparse* a, I* set, size_t n, int pack, Factor* f, Common* c) {                    \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return with_real<I>("resymbol", 0, f, c, a, set, n, pack, f, c);                                                   \
  }                                                                                                                    \
  ESPALIER_HOST_CALL int P##rowfac(Sparse* a, Sparse* t, double* beta, size_t from, size_t to, Factor* f, Common* c) { \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return with_real<I>("rowfac", 0, f, c, a, t, beta, from, to, f, c);                                                \
  }                                                                                                                    \
  ESPALIER_HOST_CALL int P##updown(int up, Sparse* u, Factor* f, Common* c) {                                          \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return with_real<I>("updown", 0, f, c, up, u, f, c);                                                               \
  }                                                                                                                    \
  ESPALIER_HOST_CALL int P##updown_solve(int up, Sparse* u, Factor* f, Dense* x, Dense* b, Common* c) {                \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return with_real<I>("updown_solve", 0, f, c, up, u, f, x, b, c);                                                   \
  }                                                                                                                    \
  ESPALIER_HOST_CALL int P##rowadd(size_t k, Sparse* r, Factor* f, Common* c) {                                        \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return with_real<I>("rowadd", 0, f, c, k, r, f, c);                                                                \
  }                                                                                                                    \
  ESPALIER_HOST_CALL int P##rowdel(size_t k, Sparse* r, Factor* f, Common* c) {                                        \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return with_real<I>("rowdel", 0, f, c, k, r, f, c);                                                                \
  }

// NOLINTEND(bugprone-macro-parentheses)
ESPALIER_CHOLMOD(cholmod_, int)
ESPALIER_CHOLMOD(cholmod_l_, Long)

}  // namespace espalier::hosts::cholmod
