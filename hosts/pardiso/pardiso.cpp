#include "pardiso/pardiso.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

namespace espalier::hosts::pardiso {

namespace {

constexpr std::int64_t kMostRows = std::numeric_limits<std::int32_t>::max() - 1;
constexpr int kMostFactors = 1 << 16;  // of one pattern

int error_of(int status) {
  switch (status) {
    case ESPALIER_OK:
      return kOk;
    case ESPALIER_MISUSE:
    case ESPALIER_INVALID_INPUT:
      return kBadInput;
    case ESPALIER_OUT_OF_MEMORY:
      return kNoMemory;
    case ESPALIER_SINGULAR:
    case ESPALIER_NOT_POSITIVE_DEFINITE:
    case ESPALIER_ACCURACY_NOT_REACHED:
      return kZeroPivot;
    default:
      return kInternal;
  }
}

bool symmetric(int type) { return type == kPositiveDefinite || type == kIndefinite; }

bool offered(int type) { return type == kStructurallySymmetric || type == kUnsymmetric || symmetric(type); }

template <class Int>
auto matrix_of(std::int64_t n, const Int* pointers, const Int* indices, const double* values, int type,
               bool zero_based) {
  std::conditional_t<sizeof(Int) == 4, espalier_matrix_i32, espalier_matrix_i64> a{};
  a.size = sizeof a;
  a.rows = a.cols = n;
  a.index_base = zero_based ? 0 : 1;
  a.pointers = pointers;
  a.indices = indices;
  a.values = values;
  a.nonzeros = std::int64_t{pointers[n]} - a.index_base;
  a.layout = ESPALIER_CSR;
  a.storage = symmetric(type) ? ESPALIER_SYMMETRIC_UPPER : ESPALIER_GENERAL;
  return a;
}

// Whether all is as the original's own checker wants it. @pre pointers do not fall
template <class Int>
bool sorted(const Call<Int>& call) {
  const Int base = call.settings.zero_based ? 0 : 1;
  for (Int row = 0; row < call.n; ++row) {
    Int before = symmetric(static_cast<int>(call.type)) ? row + base - 1 : base - 1;
    for (Int k = call.pointers[row] - base; k < call.pointers[row + 1] - base; ++k) {
      if (call.indices[k] <= before || call.indices[k] >= call.n + base) return false;
      before = call.indices[k];
    }
  }
  return true;
}

template <class Int>
bool rises(const Call<Int>& call) {
  if (call.pointers[0] != (call.settings.zero_based ? 0 : 1)) return false;
  return std::is_sorted(call.pointers, call.pointers + call.n + 1);
}

const char* kind_of(int type) {
  if (type == kPositiveDefinite) return "llt";
  return type == kIndefinite ? "ldlt" : "lu";
}

}  // namespace

Handles<Problem>& problems() {
  static auto& live = *new Handles<Problem>;
  return live;
}

// Floats as doubles; doubles stay where they are.
const double* Problem::as_doubles(const void* from, std::int64_t count, bool single,
                                  std::vector<double>& buffer) const {
  if (!single || from == nullptr) return static_cast<const double*>(from);
  const auto* floats = static_cast<const float*>(from);
  buffer.assign(floats, floats + count);
  return buffer.data();
}

template <class Int>
int Problem::run(const Call<Int>& call, Report& report) {
  const std::lock_guard lock(mutex_);
  const int first = static_cast<int>(call.phase / 10), last = static_cast<int>(call.phase % 10);
  if (first < 1 || last > 3 || first > last) return kBadInput;
  if (call.maxfct < 1 || call.maxfct > kMostFactors || call.mnum < 1 || call.mnum > call.maxfct) return kBadInput;
  if (call.n < 1 || call.n > kMostRows || !offered(static_cast<int>(call.type))) return kBadInput;
  if (slots_.size() < static_cast<std::size_t>(call.maxfct)) slots_.resize(static_cast<std::size_t>(call.maxfct));
  int error = kOk;
  if (first == 1) error = analyze(call, report);
  if (error == kOk && first <= 2 && last >= 2) error = factorize(call, report);
  if (error == kOk && last == 3) error = solve(call, report);
  return error;
}

template <class Int>
int Problem::analyze(const Call<Int>& call, Report& report) {
  for (Slot& slot : slots_) slot = {};
  n_ = -1;
  if (call.pointers == nullptr || !rises(call)) return kBadInput;
  if (call.indices == nullptr && call.pointers[call.n] > call.pointers[0]) return kBadInput;
  if (call.settings.check && !sorted(call)) return kBadInput;
  type_ = static_cast<int>(call.type);
  entries_ = std::int64_t{call.pointers[call.n]} - call.pointers[0];
  const double* values = nullptr;
  if (call.settings.matching) values = as_doubles(call.values, entries_, call.settings.single, values_);
  // Hosts pass arrays of zeros where they have no values yet.
  if (values != nullptr && std::all_of(values, values + entries_, [](double v) { return v == 0; })) values = nullptr;
  values_pending_ = call.settings.matching && values == nullptr;

  auto solver = std::make_unique<HostSolver>(interface_);
  solver->insist("kind", kind_of(type_));
  solver->set_default("required_backward_error", "inf");  // HostSolver looks
  // The interface lets us stop where an accuracy is satisfactory; interior-point methods solve dozens of times a
  // factor.
  solver->set_default("refinement_target", "1e-12");
  if (call.settings.threads > 0)
    solver->set_default("threads", fmt::format("{}", std::min(call.settings.threads, 4096)));
  solver->set_default("analyze_values", values != nullptr ? "on" : "off");
  if (type_ != kPositiveDefinite) {
    solver->insist("singular", "report");
    solver->set_default("perturbation", fmt::format("1e-{}", std::clamp(call.settings.perturbation, 0, 300)));
    // What was not scaled by the analysis is scaled by each factorization.
    solver->set_default("rescale", values != nullptr ? "off" : "equilibration");
  }
  const int status =
      solver->analyze(matrix_of(call.n, call.pointers, call.indices, values, type_, call.settings.zero_based));
  if (status == ESPALIER_SINGULAR) {
    report.bad_row = solver->row() + 1;
    return kNoOrder;
  }
  // Other singular structures are factorized with perturbed pivots, as the original does, and solved where they can be.
  for (std::int64_t row = 0; !symmetric(type_) && row < call.n; ++row)
    if (call.pointers[row] == call.pointers[row + 1]) {
      report.bad_row = row + 1;
      return kNoOrder;
    }
  if (status != ESPALIER_OK) return error_of(status);
  const espalier_analysis_info& a = solver->analysis();
  report.analysis_kilobytes = a.predicted_bytes / 1024;
  report.factor_entries = a.nonzeros_factor;
  report.megaflops = static_cast<std::int64_t>(std::min(a.flops * 1e-6, 2e9));
  if (values_pending_) {
    const std::int64_t base = call.pointers[0];
    const auto shift = [&](Int v) { return std::int64_t{v} - base; };
    pointers_.resize(static_cast<std::size_t>(call.n) + 1);
    indices_.resize(static_cast<std::size_t>(entries_));
    std::transform(call.pointers, call.pointers + call.n + 1, pointers_.begin(), shift);
    std::transform(call.indices, call.indices + entries_, indices_.begin(), shift);
  }
  n_ = call.n;
  slots_[static_cast<std::size_t>(call.mnum) - 1].solver = std::move(solver);
  return kOk;
}

// The host wanted a matching, and had no values when it asked for the analysis.
int Problem::analyze_again(const double* values) {
  values_pending_ = false;
  for (Slot& slot : slots_) {
    if (slot.solver == nullptr) continue;
    slot.solver->set_default("analyze_values", "on");
    slot.solver->set_default("rescale", "off");
    const auto a = matrix_of<std::int64_t>(n_, pointers_.data(), indices_.data(), values, type_, true);
    if (const int status = slot.solver->analyze(a); status != ESPALIER_OK) return status;
  }
  pointers_ = indices_ = {};
  return ESPALIER_OK;
}

// A factor of its own on the analysis of another slot.
int Problem::give_solver(std::size_t slot) {
  if (slots_[slot].solver != nullptr) return ESPALIER_OK;
  const auto analyzed = std::find_if(slots_.begin(), slots_.end(), [](const Slot& s) { return s.solver != nullptr; });
  return analyzed == slots_.end() ? int{ESPALIER_MISUSE} : analyzed->solver->clone(slots_[slot].solver);
}

template <class Int>
int Problem::factorize(const Call<Int>& call, Report& report) {
  if (call.n != n_ || call.type != type_ || (call.values == nullptr && entries_ > 0)) return kBadInput;
  const auto at = static_cast<std::size_t>(call.mnum) - 1;
  const double* values = as_doubles(call.values, entries_, call.settings.single, values_);
  int status = give_solver(at);
  if (status == ESPALIER_OK && values_pending_) status = analyze_again(values);
  Slot& slot = slots_[at];
  slot.factorized = false;
  if (status == ESPALIER_OK) status = slot.solver->factorize(values, entries_);
  if (status != ESPALIER_OK) {
    if (slot.solver != nullptr && slot.solver->row() >= 0) report.bad_row = slot.solver->row() + 1;
    return error_of(status);
  }
  const espalier_factor_info& f = slot.solver->factor();
  report.perturbed = f.perturbed;
  report.factor_kilobytes = f.peak_host_bytes / 1024;
  if (type_ == kIndefinite) {
    // What was perturbed has the sign that it was given.
    report.positive = f.positive + f.zero;
    report.negative = f.negative;
  }
  slot.factorized = true;
  return kOk;
}

template <class Int>
int Problem::solve(const Call<Int>& call, Report& report) {
  if (call.n != n_ || call.columns < 1 || call.b == nullptr || call.x == nullptr) return kBadInput;
  Slot& slot = slots_[static_cast<std::size_t>(call.mnum) - 1];
  if (!slot.factorized) return kBadInput;
  const Settings& s = call.settings;
  const int steps = s.refinement_steps != 0               ? std::min(std::abs(s.refinement_steps), 1000)
                    : slot.solver->factor().perturbed > 0 ? 2
                                                          : 0;
  slot.solver->set_refinement(steps);
  const std::int64_t count = n_ * call.columns;
  const double* b = as_doubles(call.b, count, s.single, right_hand_sides_);
  double* x = s.single ? right_hand_sides_.data() : static_cast<double*>(call.x);
  const int status =
      slot.solver->solve(b, x, call.columns, s.transpose != 0 ? ESPALIER_TRANSPOSE : ESPALIER_NO_TRANSPOSE);
  if (const int error = error_of(status); error != kOk) return error;
  if (!std::all_of(x, x + count, [](double v) { return std::isfinite(v); })) return kZeroPivot;
  report.refinement_steps = slot.solver->solution().refinement_steps;
  if (s.single) std::copy_n(x, count, static_cast<float*>(call.x));
  if (s.into_b && s.single) std::copy_n(x, count, static_cast<float*>(call.b));
  if (s.into_b && !s.single && call.b != call.x) std::copy_n(x, count, static_cast<double*>(call.b));
  return kOk;
}

template int Problem::run(const Call<std::int32_t>&, Report&);
template int Problem::run(const Call<std::int64_t>&, Report&);

}  // namespace espalier::hosts::pardiso
