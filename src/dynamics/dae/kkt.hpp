/// \file
/// The matrix of every Newton step, K = [W Phi_q^T + F_lambda; Phi_q 0], with its scaling and its factor.
#pragma once

#include <memory>
#include <vector>

#include "base/lazy_vector.hpp"
#include "dynamics/dae/constraint_response.hpp"
#include "dynamics/dae/linear_solver.hpp"
#include "dynamics/dae/products.hpp"
#include "dynamics/dae/system.hpp"
#include "dynamics/dae/turned_factor.hpp"
#include "dynamics/device/device_assembly.hpp"

namespace espalier::dynamics {

/// Assembles, scales and solves with K (n + m unknowns). A dropped constraint keeps its row and column, emptied, with a
/// one on the diagonal: its multiplier is zero and the pattern does not change.
///
/// Scaling: the unknowns are accelerations and multipliers, with W = F_a + c_v F_v + c_q F_q, so that W and Phi_q do
/// not grow or vanish with the step size (the scaling of Bottasso, Dopico and Trainelli, Multibody Syst. Dyn. 19
/// (2008), in the variables of index-3 integrators). On top of it K is equilibrated symmetrically, S K S, with s_i =
/// |W_ii|^-1/2 for motion and s_j = 1 / max_i |Phi_ji s_i| for constraints, which takes out units and masses.
class KktSolver {
 public:
  explicit KktSolver(std::unique_ptr<LinearSolver> solver) : solver_(std::move(solver)) {}

  /// Threads for what is done here; outlives the object; null: the calling thread.
  void set_pool(base::ThreadPool* pool) { pool_ = pool; }

  /// Lays out K for the patterns; the next factorize() analyzes it, after an earlier pattern by following what has
  /// changed. They must stay alive.
  /// @param f_lambda n x m, by columns; null: zero
  void set_pattern(const SparsePattern& w, const SparsePattern& phi_q, const SparsePattern* f_lambda = nullptr);
  /// Marks dropped constraints (m entries, non-zero = dropped).
  void set_dropped(const std::vector<char>& dropped);
  /// n diagonals of W that stand in, for the scaling, for those that are nothing beside them: a rigid body has no
  /// stiffness of its own but rounding. Empty: none.
  void set_typical(std::vector<double> diagonals) { typical_ = std::move(diagonals); }
  /// The next factorize() analyses K anew, with the values it finds: an analysis takes its scaling from the first
  /// values it meets and remembers pivots that moved since.
  void forget_analysis() {
    analyzed_ = Analyzed::none;
    response_.forget();
  }

  /// Entries of W and Phi_q to be written by the caller before factorize(); they stay readable (the values of the
  /// factor).
  [[nodiscard]] Span w_values() { return w_values_; }
  [[nodiscard]] Span phi_q_values() { return phi_q_values_; }
  [[nodiscard]] Span f_lambda_values() { return f_lambda_values_; }
  /// @throws espalier::Error if K is singular; Status.row is the row of K (>= n: constraint row - n).
  void factorize();

  // K on a GPU: bodies write W where it stands, the host sends what is left.
  /// Where the columns of K begin, n + m + 1: what System::use_device() is told.
  [[nodiscard]] std::span<const Offset> k_ptr() const { return k_ptr_; }
  /// Whether the factor lies on a GPU that takes matrices from its own memory.
  [[nodiscard]] int gpu() const { return analyzed_ == Analyzed::yes ? solver_->gpu() : -1; }
  /// All that have a part of it. @pre gpu() >= 0
  [[nodiscard]] GpuPlaces gpu_places() const { return solver_->gpu_places(); }
  /// @param host_entries  positions in W of what the host adds
  void use_device(DeviceAssembly& device, std::vector<Offset> host_entries);
  void leave_device();
  /// Whether factorize_on_device() can be used; the first factorization of an analysis is made on the host.
  [[nodiscard]] bool on_device() const { return device_ != nullptr && gpu() >= 0; }
  /// Zeros; W's entries, for SystemOnDevice::tangent_on_device().
  [[nodiscard]] double* clear_on_device() { return device_->clear(); }
  /// As factorize(), W on the GPU, where w_values() holds what the host adds.
  /// @return false: the factor went to the host, which has to assemble K; nothing was factorized
  [[nodiscard]] bool factorize_on_device();
  /// W of the factor.
  [[nodiscard]] ConstSpan w_of_factor();
  /// out_i = the sum of |W_ij| x_j over j, with W of the factor, where it lies; see DeviceMatrix::sum_rows().
  /// @param x  n numbers, not negative @param out  n
  void sum_rows_of_w(ConstSpan x, Span out) const;
  /// What a factorization of K takes. @pre K was analysed
  [[nodiscard]] FactorWork work() const { return solver_->work(); }
  /// Sign of the determinant of the last factor, 0 where it is not known.
  [[nodiscard]] int determinant_sign() const { return solver_->determinant_sign(); }
  /// Whether turn() would look at it.
  [[nodiscard]] bool turning_may_pay() const;
  /// From now on the factor stands for K at another state: see TurnedFactor.
  /// @param turns  since the state of the factor @param phi_q_values  there
  /// @return right sides that the factor solved for; -1: not possible, or it does not pay; nothing has changed but
  /// that the factor is not turned
  [[nodiscard]] Index turn(std::vector<BodyTurn> turns, ConstSpan phi_q_values);
  /// Solves K [x_v; x_c] = [b_v; b_c] for `columns` right sides held in `b` (each n + m numbers), in place.
  /// @param normal  that many, the last ones, have b_v = 0
  /// @return right sides that the factor solved for; see ConstraintResponse
  Index solve(Span b, Index columns, Index normal = 0);
  // The same with right-hand sides and solutions in the memory of the GPU that has the factor.
  /// Whether the two that follow can be used.
  [[nodiscard]] bool solves_there() const { return scale_on_device_ && on_device() && !turned_.active(); }
  /// x := K^-1 x, n + m numbers. Waits.
  void solve_there(double* x);
  /// x := K^-1 [0; r]; r, m numbers, on the host. @return as solve()
  [[nodiscard]] Index solve_normal_there(ConstSpan r, double* x);
  /// scale() in that memory, at a place that stays the same as long as the GPU has K.
  [[nodiscard]] const double* scale_there() const { return vectors_->scale(); }
  /// y = Phi_q x with the Phi_q of the factor.
  void multiply_phi_q(ConstSpan x, Span y) const { multiply_by_rows(*phi_q_, phi_q_values_, x, y, pool_); }
  /// The s_i of the factor, n + m: x_i / s_i are the unknowns of S K S.
  [[nodiscard]] ConstSpan scale() const { return scale_; }
  [[nodiscard]] const SparsePattern& w_pattern() const { return *w_; }
  [[nodiscard]] const SparsePattern& phi_q_pattern() const { return *phi_q_; }
  [[nodiscard]] MatrixView matrix() const;  ///< K, scaled, as last factorized

 private:
  void layout();
  void layout_right();
  [[nodiscard]] std::span<const Index> multiplier_rows(Index constraint) const;
  void for_columns_of_w(const std::function<void(Index column)>& body) const;
  void measure_columns();
  void compute_scaling();
  void fill_rest();
  void factor_is_new(DeviceVectors* device);
  void put_scale_on_device();
  void solve_now(Span b, Index columns);
  void solve_scaled_on_device(double* columns, Index count);
  [[nodiscard]] bool solve_through_device(Span b);
  [[nodiscard]] bool response_is_ready(Index columns);
  void solve_with_factor(Span b, Index columns);
  void solve_on_host(Span b, Index columns);

  std::unique_ptr<LinearSolver> solver_;
  base::ThreadPool* pool_ = nullptr;
  ConstraintResponse response_;
  TurnedFactor turned_;
  const SparsePattern* w_ = nullptr;
  const SparsePattern* phi_q_ = nullptr;
  const SparsePattern* f_lambda_ = nullptr;
  Index n_ = 0, m_ = 0;
  enum class Analyzed { none, other_pattern, yes };
  Analyzed analyzed_ = Analyzed::none;
  std::vector<char> dropped_;    // m
  std::vector<double> typical_;  // n, or none
  base::LazyVector<double> w_values_;
  std::vector<double> phi_q_values_, f_lambda_values_;
  std::vector<Offset> k_ptr_;  // n + m + 1
  base::LazyVector<Index> k_ind_;
  base::LazyVector<double> k_values_;
  std::vector<double> scale_;               // n + m
  std::vector<double> diagonal_, largest_;  // n; |W_jj| and the largest |W_ij| of column j
  // Positions in K of each entry of Phi_q: in the lower left and in the upper right block; of each entry of F_lambda.
  std::vector<Offset> phi_position_, right_position_, f_lambda_position_;
  std::unique_ptr<DeviceMatrix> device_;
  std::unique_ptr<DeviceVectors> vectors_;  // of device_
  bool w_on_device_ = false;                // W of the factor lies there alone
  bool scale_on_device_ = false;            // the scales of the factor lie there, too
  std::vector<Offset> host_entries_;        // positions in W
  std::vector<Offset> rest_;                // positions in K outside W, ascending
  base::LazyVector<double> rest_values_;    // what stands there, on its way to the GPU
};

}  // namespace espalier::dynamics
