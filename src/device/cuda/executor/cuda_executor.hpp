/// \file
/// The executor of the CUDA backend: carries out a plan on one GPU or on several. The header needs no CUDA.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/thread_pool.hpp"
#include "base/timeline.hpp"
#include "device/cuda/kernels/factor/factor_parameters.hpp"
#include "device/cuda/tables/device_plan.hpp"
#include "device/executor.hpp"

namespace espalier::device::cuda {

struct DeviceInfo {
  std::string name;
  std::string driver;  ///< "13.0": the newest CUDA that the driver speaks
  int compute_major = 0, compute_minor = 0;
  int multiprocessors = 0;
  Offset total_bytes = 0;
  Offset free_bytes = 0;
};

/// The GPUs that this process can use, and, when there are none, why.
struct Availability {
  std::vector<DeviceInfo> devices;
  std::string reason;
};
Availability available_devices();

/// Makes the contexts of the GPUs and opens the paths between them, which takes 0.3 to 0.7 s a GPU where no program
/// has done it before: all at the same time; and what else a first factorization would wait for. What fails here fails
/// again, with its name, where an executor needs it.
void open_devices(const std::vector<int>& devices) noexcept;

struct CudaOptions {
  int device = 0;            ///< the only one, unless `devices` names several
  std::vector<int> devices;  ///< GPUs that share the factorization; the plan must be made for so many
  bool staging = false;      ///< several GPUs exchange everything through host memory, as they must without peer access
  std::vector<unsigned> delays;        ///< for tests: nanoseconds by which each device's tasks are held up; empty: none
  base::Timeline* timeline = nullptr;  ///< gets every task of a factorization, a track for each block of threads
  int fail_device = -1;  ///< for tests: this one of `devices` (0-based) dies halfway in every factorization
  std::vector<Offset> memory_bytes = {};  ///< devices; budget of each, 0: what is free. Empty: what is free
  double patience_seconds = 30;           ///< a wait between blocks that lasts longer ends the run with an error
  int pair_sign = 0;                      ///< Job::pair_sign
  base::ThreadPool* pool = nullptr;  ///< lays out the tables and sends them; outlives the executor. Null: one thread
};

/// What a caller that fills CudaExecutor::values() itself knows about them. Pointers are memory of the GPU.
struct FilledValues {
  const double* largest = nullptr;  ///< `parts` numbers whose maximum is the largest magnitude; infinity: not finite
  int parts = 0;
  double tiny = 0;  ///< PivotRule::tiny relative to the largest magnitude
  const Offset* diagonal =
      nullptr;          ///< n; by position: place of the diagonal entry; llt. Null: no pivot is judged by it
  double rounding = 0;  ///< a pivot of at most rounding * its diagonal entry counts as zero (llt), one
                        ///< below rounding * the largest magnitude is reported as small (ldlt, lu)
  bool operator==(const FilledValues&) const = default;
};

/// Memory of the GPU that must be cleared before a solve: the first with zeros, the second with ones bits.
struct SolveClear {
  int* zeros = nullptr;
  int zeros_count = 0;  ///< at most 64
  int* ones = nullptr;
  Offset ones_count = 0;  ///< of ints
};

class TableUpload;

/// Executor with calls for values and right-hand sides that already lie in the memory of its first GPU. Calls return
/// when the GPU has finished, unless they say otherwise. Refactorizations and solves replay CUDA graphs and take no
/// memory.
template <class T>
class CudaExecutor : public Executor<T> {
 public:
  /// The stream (cudaStream_t) of the first GPU, in whose order values and right-hand sides are read and written.
  [[nodiscard]] virtual void* stream() const = 0;
  /// Where factorizations find the plan's values, and how many there are.
  [[nodiscard]] virtual T* values() const = 0;
  [[nodiscard]] virtual Offset values_size() const = 0;
  /// Like factorize(), with what values() holds when the work enqueued on stream() is done, and with a rule that the
  /// GPU completes. On one GPU: one launch, one wait, a few hundred bytes to the host.
  /// @returns nothing when the values are not all finite
  virtual std::optional<FactorOutcome> factorize_filled(const FilledValues& values) = 0;
  /// The same where the values differ from those of the last factorization, by the same arguments, in entries of some
  /// fronts alone: where only these and what is above them can be made again, to the last bit, that is all that is done
  /// (FactorOutcome::share). @param reached  fronts; not 0: one of them, closed under parents
  virtual std::optional<FactorOutcome> factorize_part(const FilledValues& values, std::span<const char> /*reached*/) {
    return factorize_filled(values);
  }
  /// Times of the last factorization's tasks, by device; empty but with CudaOptions::timeline.
  virtual std::vector<std::vector<TaskTime>> task_times() const = 0;
  virtual const DevicePlan& device_plan() const = 0;
  /// Through which tables of the host are sent to the first GPU, which must be current.
  virtual TableUpload& uploads() = 0;
  /// Repeats the numeric work on the values of the last call; no check of the outcome. @returns seconds on the GPU
  virtual double refactorize_again() = 0;
  /// Like solve(); x is device memory. @returns seconds on the GPU
  virtual double solve_device(T* x, Index columns, bool transpose) = 0;
  /// What the caller clears before enqueue_solve() for so many right-hand sides.
  virtual SolveClear clear_before_solve(Index columns) = 0;
  /// The same, enqueued on stream(): whether it was given up is known in solve_aborted() (memory of the GPU) when it
  /// is done. Several GPUs are waited for, and there is nothing to know afterwards (null).
  virtual void enqueue_solve(T* x, Index columns, bool transpose) = 0;
  [[nodiscard]] virtual const int* solve_aborted() const = 0;
  /// The error that says so.
  [[nodiscard]] virtual Error solve_given_up() const = 0;
  /// A device buffer of the executor for n x columns right-hand sides, and copies to and from it.
  virtual T* device_rhs(Index columns) = 0;
  virtual void to_device(T* to, const T* from, Offset count) = 0;
  virtual void from_device(T* to, const T* from, Offset count) = 0;
  /// See DeviceLinearSystem::on_ranks(), share_values(). @param given  the values, in memory of whole pages
  [[nodiscard]] virtual bool on_ranks() const { return false; }
  virtual void share_values(double* /*given*/, Offset /*first*/, Offset /*count*/) {}
};

/// Takes all device memory that the factorization needs.
/// @param plan  made with cuda_plan_options(kind); must outlive the executor
/// @throws Error(out_of_memory) naming the bytes needed; Error(device_error) with the failing call
template <class T>
std::unique_ptr<CudaExecutor<T>> make_cuda_executor(const plan::Plan& plan, Kind kind, const PivotRule& rule,
                                                    const CudaOptions& options = {});

}  // namespace espalier::device::cuda
