#include "dynamics/dae/equations.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "dynamics/dae/vectors.hpp"

namespace espalier::dynamics {

double max_norm(ConstSpan x) { return max_norm(nullptr, x); }

namespace {
PhaseRow row_of(bool on_device) { return on_device ? PhaseRow::device : PhaseRow::host; }
}  // namespace

std::unique_ptr<LinearSolver> make_linear_solver(Index unknowns) {
  // Dense LU of 60 unknowns takes about 30 us, as long as the bookkeeping of a sparse one (2-core x86 server).
  constexpr Index kLargestDense = 60;
  if (unknowns <= kLargestDense) return make_dense_solver();
  return make_espalier_solver(newton_options(unknowns));
}

Equations::Equations(System& system, std::unique_ptr<LinearSolver> solver, base::ThreadPool* pool)
    : system_(system),
      on_device_system_(dynamic_cast<SystemOnDevice*>(&system)),
      sizes_(system.sizes()),
      kkt_(solver ? std::move(solver) : make_linear_solver(sizes_.velocity + sizes_.constraints)) {
  set_pool(pool);
  update_pattern();
}

bool Equations::update_pattern() {
  if (have_pattern_ && version_ == system_.pattern_version()) return false;
  leave_device();
  sizes_ = system_.sizes();
  const auto n = at(sizes_.velocity);
  const auto m = at(sizes_.constraints);
  if (system_.tangent_pattern().cols != sizes_.velocity || system_.constraint_pattern().rows != sizes_.constraints) {
    throw std::logic_error("the patterns of the system do not fit its sizes (was finish() called?)");
  }
  kkt_.set_pattern(system_.tangent_pattern(), system_.constraint_pattern(), system_.multiplier_pattern());
  if (dropped_.size() != m) dropped_.assign(m, 0);
  kkt_.set_dropped(dropped_);
  phi_.assign(m, 0.0);
  nu_.assign(m, 0.0);
  gamma_.assign(m, 0.0);
  work_m_.assign(m, 0.0);
  work_n_.assign(n, 0.0);
  phi_q_.assign(at(system_.constraint_pattern().nonzeros()), 0.0);
  version_ = system_.pattern_version();
  have_pattern_ = true;
  first_factorization_ = true;
  return true;
}

void Equations::forget_analysis() {
  kkt_.forget_analysis();
  first_factorization_ = true;
}

void Equations::set_dropped(std::vector<char> dropped) {
  if (!dropped.empty() && dropped.size() != phi_.size())
    throw std::invalid_argument("one mark per constraint is needed");
  dropped_ = std::move(dropped);
  dropped_.resize(phi_.size(), 0);
  kkt_.set_dropped(dropped_);
}

void Equations::evaluate_constraints(double t, ConstSpan q, ConstSpan v) {
  if (phi_.empty()) return;
  const Phase phase("constraints", counts_.assembly_seconds, trace_);
  ++counts_.constraints;
  system_.constraints(t, q, v, {phi_, nu_, v.empty() ? Span{} : Span(gamma_), phi_q_});
  for (std::size_t i = 0; i < dropped_.size(); ++i) {
    if (dropped_[i]) phi_[i] = 0;
  }
}

void Equations::evaluate_gamma(double t, ConstSpan q, ConstSpan v) {
  if (phi_.empty()) return;
  const Phase phase("constraints", counts_.assembly_seconds, trace_);
  ++counts_.constraints;
  system_.constraints(t, q, v, {{}, {}, gamma_, {}});
}

void Equations::set_slip(ConstSpan rate, double time) {
  const SparsePattern& p = system_.constraint_pattern();
  for (const Index row : system_.non_holonomic()) {
    const auto i = at(row);
    double sum = -nu_[i];
    for (auto k = at(p.ptr[i]); k < at(p.ptr[i + 1]); ++k) sum += phi_q_[k] * rate[at(p.ind[k])];
    phi_[i] = dropped_[i] ? 0 : sum * time;
  }
}

void Equations::level(ConstSpan x, ConstSpan shift, Span out) const {
  if (out.empty()) return;
  multiply_by_rows(system_.constraint_pattern(), phi_q_, x, out, pool_);
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (!shift.empty()) out[i] -= shift[i];
    if (dropped_[i]) out[i] = 0;
  }
}

void Equations::motion(const StateView& s, Span f) {
  const Phase phase("forces", counts_.assembly_seconds, trace_, row_of(device_ != nullptr));
  ++counts_.residuals;
  try {
    system_.residual(s, f);
  } catch (const Error& error) {
    if (!give_device_up(error)) throw;
    system_.residual(s, f);
  }
  if (!phi_.empty()) add_transposed(system_.constraint_pattern(), phi_q_, s.lambda, f);
}

void Equations::motion_there(const StateView& s, const StateView& there, Span f, double* f_there) {
  const Phase phase("forces", counts_.assembly_seconds, trace_, PhaseRow::device);
  ++counts_.residuals;
  on_device_system_->residual_on_device(s, there, f, f_there);
  if (!phi_.empty()) add_transposed(system_.constraint_pattern(), phi_q_, s.lambda, f);
  const std::vector<Index>& seen = device_share()->seen;
  std::vector<double> part(seen.size());
  for (std::size_t k = 0; k < part.size(); ++k) part[k] = f[at(seen[k])];
  motion_->add(DeviceMotion::List::seen, part, f_there);
}

Levels Equations::levels(const StateView& s) {
  Levels result;
  evaluate_constraints(s.t, s.q, s.v);
  motion(s, work_n_);
  result.motion = max_norm(pool_, work_n_);
  result.position = max_norm(phi_);
  level(s.v, nu_, work_m_);
  result.velocity = max_norm(work_m_);
  level(s.a, gamma_, work_m_);
  result.acceleration = max_norm(work_m_);
  return result;
}

void Equations::set_pool(base::ThreadPool* pool) {
  pool_ = pool;
  kkt_.set_pool(pool);
}

void Equations::allow_device(MakeDevice make) {
  make_device_ = make;
  try_device();
}

void Equations::try_device() {
  if (on_device_system_ == nullptr || make_device_ == nullptr || device_ != nullptr || kkt_.gpu() < 0) return;
  const Phase phase("tables of the GPU", counts_.analysis_seconds, trace_);
  try {
    device_ = make_device_(kkt_.gpu_places(), pool_);
    if (device_ != nullptr && on_device_system_->use_device(*device_, kkt_.k_ptr()))
      return kkt_.use_device(*device_, on_device_system_->host_entries());
    device_.reset();
    make_device_ = nullptr;
  } catch (const Error& error) {
    if (error.status().code != StatusCode::out_of_memory) throw;
    leave_device();
    make_device_ = nullptr;
    device_notice_ = fmt::format("bodies are evaluated on the host: {}", error.what());
  }
}

void Equations::leave_device() {
  if (device_ == nullptr) return;
  motion_.reset();
  ++ticket_;
  kkt_.leave_device();
  on_device_system_->leave_device();
  device_.reset();
}

// After an error of the GPU that bodies or K have met, for good. @return false: it was another error
bool Equations::give_device_up(const Error& error) {
  if (device_ == nullptr || error.status().code != StatusCode::device_error) return false;
  leave_device();
  make_device_ = nullptr;
  device_notice_ = fmt::format("bodies are evaluated on the host: {}", error.what());
  return true;
}

DeviceMotion* Equations::claim_motion(const MotionDemand& demand, long& ticket) {
  if (!motion_allowed_ || device_ == nullptr || !kkt_.solves_there() || device_share() == nullptr) return nullptr;
  try {
    const bool serves = motion_ != nullptr && motion_demand_.vectors.data() == demand.vectors.data() &&
                        motion_demand_.points >= demand.points;
    if (!serves) {
      motion_.reset();
      motion_ = device_->make_motion(sizes_, demand, *device_share());
      motion_demand_ = demand;
    }
  } catch (const Error& error) {
    const StatusCode code = error.status().code;
    if (code != StatusCode::out_of_memory && code != StatusCode::device_error) throw;
    give_motion_up(error);
    return nullptr;
  }
  ticket = ++ticket_;
  return motion_.get();
}

void Equations::give_motion_up(const Error& error) {
  motion_.reset();
  ++ticket_;
  motion_allowed_ = false;
  device_notice_ = fmt::format("vectors of the integrator stay on the host: {}", error.what());
}

void Equations::assemble(const StateView& s, const TangentWeights& weights, bool on_device, const StateView* there) {
  const Phase phase("tangents", counts_.assembly_seconds, trace_, row_of(on_device));
  ++counts_.tangents;
  if (on_device)
    on_device_system_->tangent_on_device(s, weights, kkt_.clear_on_device(), kkt_.w_values(), there);
  else
    system_.tangent(s, weights, kkt_.w_values());
  if (system_.multiplier_pattern() != nullptr) system_.multiplier_tangent(s, kkt_.f_lambda_values());
  std::copy(phi_q_.begin(), phi_q_.end(), kkt_.phi_q_values().begin());
}

// @return false: see KktSolver::factorize_on_device()
bool Equations::factorize_assembled(const StateView& s, bool on_device) {
  const Phase phase(first_factorization_ ? "analysis, factorization" : "factorization",
                    first_factorization_ ? counts_.analysis_seconds : counts_.factor_seconds, trace_,
                    row_of(kkt_.gpu() >= 0));
  try {
    if (on_device) return kkt_.factorize_on_device();
    kkt_.factorize();
  } catch (const Error& error) {
    Status status = error.status();
    if (status.row >= 0) {
      status.message += status.row < sizes_.velocity
                            ? " (" + system_.coordinate_name(status.row) + ")"
                            : " (" + system_.constraint_name(status.row - sizes_.velocity) + ")";
    }
    const char* what = status.code == StatusCode::singular ? "is singular" : "could not be factorized";
    status.message = fmt::format("the matrix of the Newton step at t = {:g} {}: {}", s.t, what, status.message);
    throw Error(status);
  }
  return true;
}

void Equations::factorize(const StateView& s, const TangentWeights& weights, const StateView* there) {
  if (there == nullptr) system_.update_pattern(s.q);  // a part of q would not do; who looks at more forbids `there`
  if (update_pattern()) evaluate_constraints(s.t, s.q, s.v);  // what was evaluated has gone with the old pattern
  const bool on_device = kkt_.on_device();
  const auto needs_all = [&](bool has_left) {
    if (has_left && there != nullptr) throw Error(StatusCode::device_error, "the factor is not on the GPU any more");
  };
  needs_all(!on_device);
  bool made = false;
  try {
    assemble(s, weights, on_device, there);
    made = factorize_assembled(s, on_device);
  } catch (const Error& error) {
    if (!on_device || !give_device_up(error)) throw;
  }
  ++counts_.factorizations;
  if (first_factorization_) ++counts_.analyses;
  if (!made) {
    leave_device();
    needs_all(true);
    assemble(s, weights, false, nullptr);
    (void)factorize_assembled(s, false);
  }
  first_factorization_ = false;
  try_device();
}

bool Equations::turn_factor(ConstSpan q_of_factor, ConstSpan q) {
  const Phase phase("turned factor", counts_.factor_seconds, trace_, row_of(kkt_.gpu() >= 0));
  std::vector<BodyTurn> turns = system_.turns(q_of_factor, q);
  if (turns.empty()) return false;
  const Index solved = kkt_.turn(std::move(turns), phi_q_);
  if (solved < 0) return false;
  ++counts_.turns;
  counts_.solves += solved;
  return true;
}

void Equations::solve(Span b, Index columns, Index normal) {
  const Phase phase("solve", counts_.solve_seconds, trace_, row_of(kkt_.gpu() >= 0));
  counts_.solves += kkt_.solve(b, columns, normal);
}

void Equations::solve_there(double* x) {
  const Phase phase("solve", counts_.solve_seconds, trace_, PhaseRow::device);
  ++counts_.solves;
  kkt_.solve_there(x);
}

void Equations::solve_normal_there(ConstSpan r, double* x) {
  const Phase phase("solve", counts_.solve_seconds, trace_, PhaseRow::device);
  counts_.solves += kkt_.solve_normal_there(r, x);
}

}  // namespace espalier::dynamics
