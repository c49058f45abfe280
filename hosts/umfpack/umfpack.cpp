/// \file
/// UMFPACK's functions that take or give a Symbolic or Numeric object, for real matrices. The host reaches the others
/// where they are. Objects of the real library are told from ours and go to it.
#include "umfpack/umfpack.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "common/border.hpp"
#include "common/call_sites.hpp"
#include "umfpack/objects.hpp"

namespace espalier::hosts::umfpack {

namespace {

// Below it the real library says what it thinks of the matrix, so that its warnings stay: hosts warn at about 1e-16.
constexpr double kNearlySingular = 1e-13;
// Fewer entries are left to the real library: at 5,000 (a Laplacian of 1,000 unknowns) ours took 1.8 times as long.
constexpr std::int64_t kFewestEntries = 15000;

template <class Int>
Handles<Symbolic<Int>>& symbolics() {
  static auto& live = *new Handles<Symbolic<Int>>;
  return live;
}

template <class Int>
Handles<Numeric<Int>>& numerics() {
  static auto& live = *new Handles<Numeric<Int>>;
  return live;
}

// Octave's lu(), for instance.
CallSites& wants_factors() {
  static auto& sites = *new CallSites;
  return sites;
}

template <class Body>
int answer(double* info, Body&& body) noexcept {
  int status = kInternal;
  guarded([&] { status = body(); }, [&] { status = kNoMemory; }, [&] { status = kInternal; });
  if (info != nullptr) info[kStatus] = status;
  return status;
}

int error_of(int status) {
  switch (status) {
    case ESPALIER_OK:
      return kOk;
    case ESPALIER_OUT_OF_MEMORY:
      return kNoMemory;
    case ESPALIER_SINGULAR:
      return kSingular;
    default:
      return kInternal;
  }
}

// As UMFPACK wants it: from 0 on, each column's rows ascending.
template <class Int>
bool valid(Int n, const Int* pointers, const Int* indices) {
  if (pointers[0] != 0 || !std::is_sorted(pointers, pointers + n + 1)) return false;
  for (Int column = 0; column < n; ++column) {
    Int before = -1;
    for (Int k = pointers[column]; k < pointers[column + 1]; ++k) {
      if (indices[k] <= before || indices[k] >= n) return false;
      before = indices[k];
    }
  }
  return true;
}

template <class Int>
void start_info(double* info, const Symbolic<Int>& a) {
  if (info == nullptr) return;
  std::fill_n(info, kInfos, -1.0);
  info[kRows] = info[kColumns] = static_cast<double>(a.n);
  info[kEntries] = static_cast<double>(a.indices.size());
  info[kSizeOfUnit] = info[kSizeOfEntry] = sizeof(double);
  info[kSizeOfInt] = sizeof(int);
  info[kSizeOfLong] = sizeof(long);
  info[kSizeOfPointer] = sizeof(void*);
}

// The real library's analysis is a small part of its work, and says what a factorization would cost it.
template <class Int>
int make_symbolic(Int n, Int columns, const Int* pointers, const Int* indices, const double* values, void** symbolic,
                  const double* control, double* info) {
  double own_info[kInfos];
  double* to = info == nullptr ? own_info : info;
  const auto real = [&](int otherwise) {
    return ask_real<Int>("symbolic", otherwise, n, columns, pointers, indices, values, symbolic, control, to);
  };
  if (InsideReal::now() || n != columns || wants_factors().has(Caller::current())) return real(kBadMatrix);
  if (symbolic == nullptr || pointers == nullptr || indices == nullptr) return kMissing;
  *symbolic = nullptr;
  if (n < 1) return kBadOrder;
  if (!valid(n, pointers, indices)) return kBadMatrix;
  const int status = real(kOk);
  if (status != kOk) return status;
  if (*symbolic != nullptr && pointers[n] < kFewestEntries && !takes_small_systems()) return kOk;
  // Without a symmetric strategy there is an upper bound alone, of some twenty times what is needed.
  double flops = 0;
  if (*symbolic != nullptr) flops = to[kSymmetricFlops] >= 0 ? to[kSymmetricFlops] : to[kFlopsEstimate] / 20;
  auto made = std::make_shared<Symbolic<Int>>(n, pointers, indices, *symbolic, flops);
  if (*symbolic == nullptr) {
    start_info(info, *made);
    if (info != nullptr) info[kSymbolicTime] = info[kSymbolicWallTime] = 0;
  }
  *symbolic = symbolics<Int>().add(std::move(made));
  return kOk;
}

template <class Int>
void fill_info(double* info, const Numeric<Int>& factor, double rcond) {
  if (info == nullptr) return;
  const espalier_analysis_info& a = factor.solver().analysis();
  const espalier_factor_info& f = factor.solver().factor();
  start_info(info, *factor.symbolic);
  const double half = 0.5 * (static_cast<double>(a.nonzeros_factor) + static_cast<double>(factor.symbolic->n));
  info[kLower] = info[kUpper] = info[kAllLower] = info[kAllUpper] = half;
  info[kLowerEstimate] = info[kUpperEstimate] = half;
  info[kFactorEntries] = static_cast<double>(a.nonzeros_factor);
  info[kFlops] = info[kFlopsEstimate] = a.flops;
  info[kSize] = info[kSizeEstimate] = static_cast<double>(a.nonzeros_factor);
  info[kPeak] = info[kPeakEstimate] = static_cast<double>(f.peak_host_bytes) / sizeof(double);
  info[kPivots] = static_cast<double>(factor.symbolic->n);
  info[kNumericTime] = info[kNumericWallTime] = f.seconds;
  info[kRcond] = rcond;
}

template <class Int>
int make_numeric(const Int* pointers, const Int* indices, const double* values, void* symbolic, void** numeric,
                 const double* control, double* info) {
  const auto of = symbolics<Int>().find(symbolic);
  if (of == nullptr || InsideReal::now()) {
    if (symbolic == nullptr) return kBadSymbolic;
    return ask_real<Int>("numeric", kBadSymbolic, pointers, indices, values, symbolic, numeric, control, info);
  }
  if (numeric == nullptr || pointers == nullptr || indices == nullptr || values == nullptr) return kMissing;
  *numeric = nullptr;
  if (!of->same_pattern(pointers, indices)) return kOtherPattern;
  const auto real = [&] {
    const auto begin = std::chrono::steady_clock::now();
    const int done = ask_real<Int>("numeric", kInternal, pointers, indices, values, of->real(), numeric, control, info);
    of->note_real(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
    return done;
  };
  if (!of->pays()) return real();
  auto made = std::make_shared<Numeric<Int>>(of, values, control);
  const int status = made->factorize();
  if (status == ESPALIER_OUT_OF_MEMORY) return kNoMemory;
  const double rcond = status != ESPALIER_OK ? 0 : info != nullptr ? made->reciprocal_condition() : 1;
  if (rcond < kNearlySingular && of->real() != nullptr) return real();
  if (status != ESPALIER_OK && status != ESPALIER_SINGULAR) return error_of(status);
  if (status == ESPALIER_OK) fill_info(info, *made, rcond);
  if (status == ESPALIER_SINGULAR && info != nullptr) info[kRcond] = 0;
  *numeric = numerics<Int>().add(std::move(made));
  return error_of(status);
}

template <class Int>
int solve(Int system, const Int* pointers, const Int* indices, const double* values, double* x, const double* b,
          void* numeric, const double* control, double* info) {
  const auto factor = numerics<Int>().find(numeric);
  const auto real = [&](void* with) {
    if (with == nullptr) return int{kBadNumeric};
    return ask_real<Int>("solve", kBadNumeric, system, pointers, indices, values, x, b, with, control, info);
  };
  if (factor == nullptr || InsideReal::now()) return real(numeric);
  if (x == nullptr || b == nullptr) return kMissing;
  if (system < kA || system > kLastSystem) return kBadSystem;
  if (system > kAat) return real(factor->real());
  const double asked = control == nullptr ? kDefaultSteps : control[kRefinementSteps];
  const int steps = std::isnan(asked) ? kDefaultSteps : static_cast<int>(std::clamp(asked, 0.0, 1000.0));
  auto done = sized<espalier_solve_info>();
  const int status = factor->solve(b, x, system != kA, steps, done);
  // No status says so: what accuracy the real library reaches, the host shall hear from it.
  if (status == ESPALIER_ACCURACY_NOT_REACHED && factor->real() != nullptr) return real(factor->real());
  if (info != nullptr) {
    info[kStepsTaken] = info[kStepsTried] = static_cast<double>(done.refinement_steps);
    info[kOmega1] = done.componentwise_error;
    info[kOmega2] = 0;
    info[kSolveTime] = info[kSolveWallTime] = done.seconds;
  }
  return error_of(status);
}

// det A = *mantissa * 10^*exponent; a null exponent asks for it in one number.
template <class Int>
int determinant(double* mantissa, double* exponent, void* numeric, double* info) {
  const auto factor = numerics<Int>().find(numeric);
  if (factor == nullptr || InsideReal::now()) {
    if (numeric == nullptr) return kBadNumeric;
    return ask_real<Int>("get_determinant", kBadNumeric, mantissa, exponent, numeric, info);
  }
  if (mantissa == nullptr) return kMissing;
  if (!factor->factorized()) {
    *mantissa = 0;
    if (exponent != nullptr) *exponent = 0;
    return kSingular;
  }
  const espalier_factor_info& f = factor->solver().factor();
  const double digits = f.determinant_log / std::log(10.0), whole = std::floor(digits);
  *mantissa = f.determinant_sign * std::pow(10.0, digits - whole);
  if (exponent != nullptr) {
    *exponent = whole;
    return kOk;
  }
  *mantissa = f.determinant_sign * std::exp(f.determinant_log);
  return *mantissa == 0 ? kUnderflow : std::isinf(*mantissa) ? kOverflow : kOk;
}

// A function of the real library that reads the object which stands last, or first, among its arguments. Of a factor of
// ours it is given one of its own.
template <class Int, class... Arguments>
int with_numeric_last(const char* what, void* numeric, Arguments... arguments) {
  const auto factor = numerics<Int>().find(numeric);
  if (factor != nullptr && !InsideReal::now()) {
    wants_factors().add(factor->symbolic->site);
    numeric = factor->real();
  }
  return numeric == nullptr ? int{kBadNumeric} : ask_real<Int>(what, kBadNumeric, arguments..., numeric);
}

template <class Int, class Argument>
int with_numeric_first(const char* what, void* numeric, Argument argument) {
  const auto factor = numerics<Int>().find(numeric);
  if (factor != nullptr && !InsideReal::now()) numeric = factor->real();
  return numeric == nullptr ? int{kBadNumeric} : ask_real<Int>(what, kBadNumeric, numeric, argument);
}

template <class Int, class... Arguments>
int with_symbolic_last(const char* what, void* symbolic, Arguments... arguments) {
  const auto found = symbolics<Int>().find(symbolic);
  if (found != nullptr && !InsideReal::now()) symbolic = found->real();
  return symbolic == nullptr ? int{kBadSymbolic} : ask_real<Int>(what, kBadSymbolic, arguments..., symbolic);
}

template <class Int, class Argument>
int with_symbolic_first(const char* what, void* symbolic, Argument argument) {
  const auto found = symbolics<Int>().find(symbolic);
  if (found != nullptr && !InsideReal::now()) symbolic = found->real();
  return symbolic == nullptr ? int{kBadSymbolic} : ask_real<Int>(what, kBadSymbolic, symbolic, argument);
}

template <class Int, class Object>
void end(Handles<Object>& live, const char* what, void** object) noexcept {
  if (object == nullptr || *object == nullptr) return;
  guarded(
      [&] {
        if (InsideReal::now() || live.find(*object) == nullptr) {
          ask_real<Int>(what, kOk, object);
          return;
        }
        live.end(*object);
        *object = nullptr;
      },
      [] {}, [] {});
}

}  // namespace

// All functions for integers I under the prefix P.
// NOLINTBEGIN(bugprone-macro-parentheses): I is a type
#define ESPALIER_UMFPACK(P, I)                                                                                         \
  ESPALIER_HOST_CALL I P##symbolic(I n, I m, const I* p, const I* i, const double* v, void** s, const double* c,       \
                                   double* info) {                                                                     \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(info, [&] { return make_symbolic<I>(n, m, p, i, v, s, c, info); });                                  \
  }                                                                                                                    \
  ESPALIER_HOST_CALL I P##qsymbolic(I n, I m, const I* p, const I* i, const double* v, const I* q, void** s,           \
                                    const double* c, double* info) {                                                   \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(info, [&] {                                                                                          \
      if (q == nullptr && !InsideReal::now()) return make_symbolic<I>(n, m, p, i, v, s, c, info);                      \
      return ask_real<I>("qsymbolic", kInternal, n, m, p, i, v, q, s, c, info);                                        \
    });                                                                                                                \
  }                                                                                                                    \
  ESPALIER_HOST_CALL I P##numeric(const I* p, const I* i, const double* v, void* s, void** f, const double* c,         \
                                  double* info) {                                                                      \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(info, [&] { return make_numeric<I>(p, i, v, s, f, c, info); });                                      \
  }                                                                                                                    \
  ESPALIER_HOST_CALL I P##solve(I sys, const I* p, const I* i, const double* v, double* x, const double* b, void* f,   \
                                const double* c, double* info) {                                                       \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(info, [&] { return solve<I>(sys, p, i, v, x, b, f, c, info); });                                     \
  }                                                                                                                    \
  ESPALIER_HOST_CALL I P##wsolve(I sys, const I* p, const I* i, const double* v, double* x, const double* b, void* f,  \
                                 const double* c, double* info, I*, double*) {                                         \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(info, [&] { return solve<I>(sys, p, i, v, x, b, f, c, info); });                                     \
  }                                                                                                                    \
  ESPALIER_HOST_CALL void P##free_symbolic(void** s) {                                                                 \
    ESPALIER_NOTE_CALLER;                                                                                              \
    end<I>(symbolics<I>(), "free_symbolic", s);                                                                        \
  }                                                                                                                    \
  ESPALIER_HOST_CALL void P##free_numeric(void** f) {                                                                  \
    ESPALIER_NOTE_CALLER;                                                                                              \
    end<I>(numerics<I>(), "free_numeric", f);                                                                          \
  }                                                                                                                    \
  ESPALIER_HOST_CALL I P##get_determinant(double* m, double* e, void* f, double* info) {                               \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(info, [&] { return determinant<I>(m, e, f, info); });                                                \
  }                                                                                                                    \
  ESPALIER_HOST_CALL I P##get_lunz(I* l, I* u, I* n, I* m, I* d, void* f) {                                            \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(nullptr, [&] { return with_numeric_last<I>("get_lunz", f, l, u, n, m, d); });                        \
  }                                                                                                                    \
  ESPALIER_HOST_CALL I P##get_numeric(I* lp, I* lj, double* lx, I* up, I* ui, double* ux, I* p, I* q, double* d, I* r, \
                                      double* s, void* f) {                                                            \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(nullptr,                                                                                             \
                  [&] { return with_numeric_last<I>("get_numeric", f, lp, lj, lx, up, ui, ux, p, q, d, r, s); });      \
  }                                                                                                                    \
  ESPALIER_HOST_CALL I P##scale(double* x, const double* b, void* f) {                                                 \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(nullptr, [&] { return with_numeric_last<I>("scale", f, x, b); });                                    \
  }                                                                                                                    \
  ESPALIER_HOST_CALL I P##get_symbolic(I* a, I* b, I* c, I* d, I* e, I* f, I* g, I* h, I* i, I* j, I* k, I* l, I* m,   \
                                       I* n, I* o, void* s) {                                                          \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(nullptr, [&] {                                                                                       \
      return with_symbolic_last<I>("get_symbolic", s, a, b, c, d, e, f, g, h, i, j, k, l, m, n, o);                    \
    });                                                                                                                \
  }                                                                                                                    \
  ESPALIER_HOST_CALL I P##report_numeric(void* f, const double* c) {                                                   \
    ESPALIER_NOTE_CALLER;                                                                                              \
    if (numerics<I>().find(f) != nullptr) return kOk;                                                                  \
    return answer(nullptr, [&] { return with_numeric_first<I>("report_numeric", f, c); });                             \
  }                                                                                                                    \
  ESPALIER_HOST_CALL I P##report_symbolic(void* s, const double* c) {                                                  \
    ESPALIER_NOTE_CALLER;                                                                                              \
    if (symbolics<I>().find(s) != nullptr) return kOk;                                                                 \
    return answer(nullptr, [&] { return with_symbolic_first<I>("report_symbolic", s, c); });                           \
  }                                                                                                                    \
  ESPALIER_HOST_CALL I P##save_numeric(void* f, char* file) {                                                          \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(nullptr, [&] { return with_numeric_first<I>("save_numeric", f, file); });                            \
  }                                                                                                                    \
  ESPALIER_HOST_CALL I P##save_symbolic(void* s, char* file) {                                                         \
    ESPALIER_NOTE_CALLER;                                                                                              \
    return answer(nullptr, [&] { return with_symbolic_first<I>("save_symbolic", s, file); });                          \
  }

// NOLINTEND(bugprone-macro-parentheses)
ESPALIER_UMFPACK(umfpack_di_, std::int32_t)
ESPALIER_UMFPACK(umfpack_dl_, std::int64_t)

}  // namespace espalier::hosts::umfpack
