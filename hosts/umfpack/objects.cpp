#include "umfpack/objects.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "umfpack/umfpack.hpp"

namespace espalier::hosts::umfpack {

namespace {

auto matrix_of(std::int32_t) { return sized<espalier_matrix_i32>(); }
auto matrix_of(std::int64_t) { return sized<espalier_matrix_i64>(); }

Control copy_of(const double* control) {
  return control == nullptr ? Control{} : Control(control, control + kControls);
}

const double* pointer_to(const Control& control) { return control.empty() ? nullptr : control.data(); }

}  // namespace

RealLibrary& real_library() {
  static auto& library = *new RealLibrary("ESPALIER_UMFPACK_LIBRARY", {"libumfpack.so.5", "libumfpack.so.6"});
  return library;
}

template <class Int>
Symbolic<Int>::Symbolic(Int rows, const Int* p, const Int* i, void* real, double flops)
    : n(rows), pointers(p, p + rows + 1), indices(i, i + p[rows]), real_(real), flops_(flops) {}

// Measured on Laplacians with a wind in two and three dimensions, two cores with OpenBLAS: the flops of UMFPACK in a
// second and what an entry costs it, the same for us, and what an entry costs in our analysis.
constexpr double kTheirRate = 6e9, kTheirSecondsPerEntry = 5e-7, kOurRate = 3e10, kSecondsPerEntry = 2.5e-6;

template <class Int>
bool Symbolic<Int>::pays() {
  if (real_ == nullptr || takes_small_systems()) return true;
  const std::lock_guard lock(mutex_);
  if (!solvers_.empty()) return true;
  const auto entries = static_cast<double>(indices.size());
  return spent_ + flops_ / kTheirRate + entries * kTheirSecondsPerEntry >
         entries * kSecondsPerEntry + flops_ / kOurRate;
}

template <class Int>
bool Symbolic<Int>::too_costly(double our_flops) const {
  if (real_ == nullptr || takes_small_systems()) return false;
  const auto entries = static_cast<double>(indices.size());
  return our_flops / kOurRate > 2 * (flops_ / kTheirRate + entries * kTheirSecondsPerEntry) + 1e-3;
}

template <class Int>
void Symbolic<Int>::note_real(double seconds) {
  const std::lock_guard lock(mutex_);
  spent_ += seconds;
}

template <class Int>
Symbolic<Int>::~Symbolic() {
  if (real_ != nullptr) ask_real<Int>("free_symbolic", kOk, &real_);
}

template <class Int>
std::shared_ptr<HostSolver> Symbolic<Int>::take(const double* values, bool& afresh, int& status) {
  const std::lock_guard lock(mutex_);
  status = ESPALIER_OK;
  if (!afresh) {
    for (const auto& solver : solvers_)
      if (solver.use_count() == 1) return solver;
  }
  const bool first = solvers_.empty(), another = afresh;
  afresh = afresh || first;
  std::unique_ptr<HostSolver> made;
  if (afresh) {
    made = std::make_unique<HostSolver>("umfpack");
    made->insist("kind", "lu");
    made->set_default("required_backward_error", "inf");  // HostSolver looks
    made->set_default("refinement_target", "1e-14");
    auto a = matrix_of(Int{});
    a.rows = a.cols = n;
    a.nonzeros = pointers.back();
    a.pointers = pointers.data();
    a.indices = indices.data();
    a.values = values;
    a.layout = ESPALIER_CSC;
    status = made->analyze(a);
  } else {
    status = solvers_.front()->clone(made);
  }
  if (status != ESPALIER_OK) return nullptr;
  if (another) return made;
  solvers_.push_back(std::move(made));
  return solvers_.back();
}

template <class Int>
bool Symbolic<Int>::same_pattern(const Int* p, const Int* i) const {
  return std::equal(pointers.begin(), pointers.end(), p) && std::equal(indices.begin(), indices.end(), i);
}

template <class Int>
Numeric<Int>::Numeric(std::shared_ptr<Symbolic<Int>> of, const double* values, const double* control)
    : symbolic(std::move(of)), values_(values, values + symbolic->indices.size()), control_(copy_of(control)) {}

template <class Int>
Numeric<Int>::~Numeric() {
  if (real_ != nullptr) ask_real<Int>("free_numeric", kOk, &real_);
}

// The order and the scaling are those of the values that came first; where these are too different, they get their own.
template <class Int>
int Numeric<Int>::factorize() {
  const std::lock_guard lock(mutex_);
  const auto count = static_cast<std::int64_t>(values_.size());
  int status = ESPALIER_OK;
  for (bool afresh = false;; afresh = true) {
    solver_ = symbolic->take(values_.data(), afresh, status);
    if (solver_ == nullptr) return status;
    if (symbolic->too_costly(solver_->analysis().flops)) {
      solver_ = nullptr;
      return ESPALIER_CANCELLED;
    }
    status = solver_->factorize(values_.data(), count);
    const bool weak = status == ESPALIER_SINGULAR || (status == ESPALIER_OK && solver_->factor().perturbed > 0);
    if (!weak || afresh) break;
  }
  if (status != ESPALIER_OK) solver_ = nullptr;
  return status;
}

template <class Int>
double Numeric<Int>::reciprocal_condition() {
  const std::lock_guard lock(mutex_);
  if (solver_ == nullptr) return 0;
  std::vector<double> x(static_cast<std::size_t>(symbolic->n), 0.0);
  for (std::size_t k = 0; k < values_.size(); ++k)
    x[static_cast<std::size_t>(symbolic->indices[k])] += std::abs(values_[k]);
  for (std::size_t k = 0; k < x.size(); ++k) x[k] *= scattered_sign(k);
  if (solver_->substitute(x.data(), x.data(), 1, ESPALIER_NO_TRANSPOSE) != ESPALIER_OK) return 0;
  double largest = 0;
  for (const double v : x) largest = std::isfinite(v) ? std::max(largest, std::abs(v)) : HUGE_VAL;
  return largest > 0 ? std::min(1.0, 1 / largest) : 0;
}

template <class Int>
int Numeric<Int>::solve(const double* b, double* x, bool transposed, int steps, espalier_solve_info& info) {
  const std::lock_guard lock(mutex_);
  if (solver_ == nullptr) {
    std::fill_n(x, symbolic->n, std::nan(""));
    return ESPALIER_SINGULAR;
  }
  solver_->set_refinement(steps);
  const int status = solver_->solve(b, x, 1, transposed ? ESPALIER_TRANSPOSE : ESPALIER_NO_TRANSPOSE);
  info = solver_->solution();
  return status;
}

template <class Int>
void* Numeric<Int>::real() {
  const std::lock_guard lock(mutex_);
  if (real_ != nullptr) return real_;
  if (void* analysis = symbolic->real())
    ask_real<Int>("numeric", kInternal, symbolic->pointers.data(), symbolic->indices.data(), values_.data(), analysis,
                  &real_, pointer_to(control_), static_cast<double*>(nullptr));
  return real_;
}

template class Symbolic<std::int32_t>;
template class Symbolic<std::int64_t>;
template class Numeric<std::int32_t>;
template class Numeric<std::int64_t>;

}  // namespace espalier::hosts::umfpack
