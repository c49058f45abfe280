/// \file
/// One GPU's part in a factorization: its memory, its copy of the tables, and what it is told to do. An executor has
/// one for each of its GPUs. For this backend alone: needs the CUDA runtime.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "device/cuda/executor/cuda_executor.hpp"
#include "device/cuda/kernels/factor/factor_ends.hpp"
#include "device/cuda/kernels/factor/factor_kernel.cuh"
#include "device/cuda/kernels/factor/factor_parameters.hpp"
#include "device/cuda/kernels/solve/solve_kernel.cuh"
#include "device/cuda/runtime/device_guard.hpp"
#include "device/cuda/runtime/device_memory.hpp"
#include "device/cuda/runtime/table_upload.hpp"
#include "plan/plan.hpp"

namespace espalier::device::cuda {

/// One pass of a solve over `width` right-hand sides from `first_column` on: one, or a multiple of kSlab, of which
/// those beyond `columns` are zero.
template <class T>
struct SolvePass {
  const T* rhs;  ///< what the side reads
  T* result;     ///< where solutions go, maybe on another device
  Index columns, first_column, width;
  bool transpose;
  bool on_paths = false;  ///< through the fronts that send_paths() has been told of alone
};

/// Where a side's arrays lie, for another side that reaches them. What all sides have in common has no place here.
template <class T>
struct SideAddresses {
  T* top = nullptr;      ///< region 0
  T* own = nullptr;      ///< its other regions, in their order
  T* places = nullptr;   ///< Place::offset counts from here
  T* pivots = nullptr;   ///< FactorState::pivot, inverse_d and inverse_e
  T* vectors = nullptr;  ///< of a pass of a solve: forward solution, solution, updates
  T** base = nullptr;
  int* control = nullptr;
  int* flags = nullptr;
  int* solve_control = nullptr;
};

/// What all sides of an executor have in common; outlives them.
struct SideContext {
  const plan::Plan& plan;
  Kind kind;
  const DevicePlan& tables;
  double patience_seconds;
  Offset spare;            ///< elements that each side takes for a sub-tree stolen from another; 0: nobody steals
  Offset values;           ///< length of the caller's value array
  base::ThreadPool* pool;  ///< its threads fill what is sent; null: the calling thread alone
  int pool_side = 0;       ///< the side that works with them
  bool exported = false;   ///< other processes open what sides reach of each other
  int pair_sign = 0;       ///< of a plan that stands in pairs: Job::pair_sign; else 0
};

/// Memory on the host that all devices see, for machines without access from device to device: the copies of what is
/// shared are then one. Null pointers otherwise.
template <class T>
struct CommonMemory {
  T* top = nullptr;
  T* places = nullptr;  ///< of all devices, one after another
  T* pivot = nullptr;
  T* updates = nullptr;  ///< of one pass with kSlab right-hand sides
  int* flag = nullptr;
};

template <class T>
class DeviceSide {
 public:
  /// Takes all memory of the factorization on GPU `device`; it is side number `self`. Sides may be made at the same
  /// time; one of them works with the threads of the pool.
  /// @param arena  of a side before, with what the plan keeps of it (go_on()); empty: it is taken
  /// @throws Error(out_of_memory) naming the bytes needed; Error(device_error)
  DeviceSide(const SideContext& context, int self, int device, Offset memory_bytes, const CommonMemory<T>& common,
             DeviceArray<T> arena = {});
  DeviceSide(const DeviceSide&) = delete;
  DeviceSide& operator=(const DeviceSide&) = delete;

  /// Sends the lists of what this side does, and the tables that all sides have, or copies these from a side that has
  /// them; each waits.
  void send_lists();
  void send_tables();
  void copy_tables(const DeviceSide& from);
  [[nodiscard]] SideAddresses<T> addresses() const;
  /// Tells the side where all sides' memory is, by number.
  void connect(const std::vector<SideAddresses<T>>& sides);

  // Everything below expects this side's device to be current.

  void set_limits(const PivotLimits<T>& limits);
  void copy_in(void* to, const void* from, Offset bytes);  ///< waits
  void copy_out(void* to, const void* from, Offset bytes) const;
  /// Zeroes flags and counters for the next factorization, and fills the vectors of the next pass of a solve.
  void enqueue_clear_factor();
  void enqueue_clear_solve(Index pass);
  /// The memory that enqueue_clear_solve() clears.
  [[nodiscard]] SolveClear solve_clear(Index pass) const;
  /// The kernels, and what they prepare for solves. skip_last_half: only the first half of the tasks, as if the device
  /// had died then (for tests).
  void enqueue_factor(bool skip_last_half = false);
  /// The same in two steps; the second changes what the first has made.
  void enqueue_tasks(bool first_half_only = false);
  void enqueue_inverses();
  /// The fronts (not 0) that enqueue_part() makes. @pre the plan keeps contributions
  void choose_part(std::span<const char> made);
  /// In place of enqueue_begin() and enqueue_factor(): makes these, where all others are as a whole factorization has
  /// left them, with sound pivots. Between the two steps all sides wait for each other.
  void enqueue_renewal();
  void enqueue_part();
  /// Elements of the arena: plans that are changed go on in it (plan::elements_with_room()).
  [[nodiscard]] Offset arena_elements() const { return top_.size(); }
  /// The arena and all pivots (as by pivots_), once all work is done; the side is of no use then.
  [[nodiscard]] DeviceArray<T> leave_arena(std::vector<T>& pivots);
  /// The fronts of the arena are finished, whoever made them. @param pivots  as many as leave_arena() says
  void go_on(const std::vector<T>& pivots);
  /// What stands before the kernels where this is the only GPU.
  void enqueue_begin(const FilledValues& values);
  /// The same where it is one of several that reach the first's memory; copies the values that it needs.
  void enqueue_take(const DeviceSide& first, const FilledValues& values);
  /// What stands after the kernels of all sides, on the first. owner: by position, whose pivot counts; device memory.
  void enqueue_judge(const FilledValues& values, const std::vector<SideAddresses<T>>& sides,
                     const unsigned char* owner);
  /// What the judge found, once the stream is done.
  [[nodiscard]] const FactorEnd& factor_end() const { return *end_.data(); }
  /// From the next recording of enqueue_factor() on: kernels that know nothing of pairs.
  void forget_pairs();
  /// From the next recording on, too: every task is held up so long, and recorded.
  void delay_tasks(unsigned nanoseconds) { state_.delay = nanoseconds; }
  void record_tasks();
  void clear_record();
  /// Times of the tasks of this side's list; zero for those that another device did.
  [[nodiscard]] std::vector<TaskTime> task_times() const;
  /// Which values enqueue_take() copies.
  void take_chunks(const std::vector<std::uint32_t>& chunks);
  /// Whether a pass with so many right-hand sides takes no more memory than is left, and than is reasonable.
  [[nodiscard]] bool has_room_for(Index pass) const;
  /// Buffers of one pass with so many right-hand sides. @returns whether they moved
  bool take_solve_memory(Index pass);
  /// A buffer for right-hand sides of the caller. @returns whether it moved
  bool take_rhs(Offset elements);
  [[nodiscard]] T* rhs() const { return rhs_at_; }
  void enqueue_solve(const std::vector<SideAddresses<T>>& sides, const SolvePass<T>& pass);
  /// A solve on paths: its tables and what is given; then, before each pass, memory as that needs it, and after all of
  /// them the wanted rows. @throws Error(out_of_memory); nothing has happened then
  void send_paths(const PathSolve<T>& solve);
  void enqueue_path_begin(const SolvePass<T>& pass);
  void fetch_wanted(const PathSolve<T>& solve, const T* result);  ///< waits
  /// Copies the counters to the host, where they are valid once the stream is done.
  void enqueue_counters();
  [[nodiscard]] const int* factor_counters() const { return counters_.data(); }
  [[nodiscard]] const int* solve_counters() const { return counters_.data() + kCounters; }
  /// On the device: nonzero when the last pass of a solve was given up.
  [[nodiscard]] const int* solve_aborted() const { return solve_control_.data() + 1; }
  /// Ends kernels that are running, here or on another side; takes effect although they fill the device.
  void abort() noexcept { abort(addresses()); }
  void abort(const SideAddresses<T>& side) noexcept;
  /// Adds marks by position; failed: 1/threshold exceeded, else PivotMark.
  void marked(bool failed, std::vector<unsigned char>& marks) const;
  /// n pivots; only those that this device made or got are defined.
  void pivots(std::vector<T>& to) const;
  /// The same of ldlt: the inverse of D, n each: see Executor.
  void inverse_pivots(std::vector<T>& d, std::vector<T>& e) const;

  [[nodiscard]] int self() const { return self_; }
  [[nodiscard]] int device() const { return device_; }
  [[nodiscard]] const Stream& stream() const { return stream_; }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] T* values() const { return values_.data(); }
  [[nodiscard]] Offset values_size() const { return values_.size(); }
  [[nodiscard]] DeviceBudget& budget() { return budget_; }
  [[nodiscard]] TableUpload& uploads() { return uploads_; }
  [[nodiscard]] Offset held() const { return budget_.held(); }
  [[nodiscard]] const TaskLists& lists() const { return context_.tables.lists[static_cast<std::size_t>(self_)]; }

 private:
  template <class U, class List>
  void send(DeviceArray<U>& to, const List& from);
  void send_places(const std::vector<T*>& places);
  /// Calls use(array, list of the host) for the tables that all sides have; array: pointer to member.
  template <class Use>
  void for_tables(Use&& use);
  void read_pivots(int list, std::vector<T>& to) const;  // 0: pivots, 1 and 2: of the inverse of D
  [[nodiscard]] Offset own_elements() const;
  [[nodiscard]] Offset room_for_changes() const;
  // Tasks [0, narrow_end) of state.tasks by the narrow kernel, those before `end` by the wide one.
  void launch_tasks(const FactorState<T>& state, std::int64_t narrow_end, std::int64_t end);
  void take_memory(DeviceArray<T> arena);
  void take_tables();
  void choose_shapes();
  template <class Use>
  cudaError_t dispatch(Use&& use) const;
  [[nodiscard]] int parts() const { return context_.kind == Kind::lu ? 2 : 1; }
  [[nodiscard]] Offset n() const { return context_.plan.tree.n; }
  [[nodiscard]] T* updates(const SideAddresses<T>& side, Index pass) const {
    return common_.updates != nullptr ? common_.updates : side.vectors + 2 * n() * pass;
  }
  /// What is free of the arena between factorizations: buffers of solves stand there if they fit, vectors of a pass at
  /// its begin, right-hand sides at its end.
  [[nodiscard]] Offset idle_elements() const {
    return context_.tables.lists.size() == 1 ? context_.tables.regions[0] - context_.tables.kept : 0;
  }
  [[nodiscard]] Offset vectors_in_arena() const { return vectors_.size() > 0 ? 0 : vectors_size_; }
  [[nodiscard]] Offset rhs_in_arena() const { return rhs_.size() > 0 ? 0 : rhs_size_; }
  /// Rows of the vectors of a pass: forward solution, solution, updates.
  [[nodiscard]] Offset solve_rows() const;

  SideContext context_;
  CommonMemory<T> common_;
  int self_, device_;
  DeviceBudget budget_;
  Offset needed_ = 0;
  std::string name_;
  Stream stream_, urgent_;
  TableUpload uploads_;
  PinnedArray<int> counters_, one_;
  PinnedArray<FactorEnd> end_;
  DeviceArray<PivotProduct> products_;
  DeviceArray<int> ticket_;
  DeviceArray<T> top_, own_, places_, values_, pivot_, limits_;
  DeviceArray<T> vectors_, rhs_;  // empty where they stand in the arena
  T *vectors_at_ = nullptr, *rhs_at_ = nullptr;
  Offset vectors_size_ = 0, rhs_size_ = 0;
  T* pivots_ = nullptr;
  int* flag_data_ = nullptr;
  DeviceArray<unsigned char> marks_;
  DeviceArray<int> control_;  // counters, flags unless all devices share them, finished tasks of fronts
  DeviceArray<int> solve_control_;
  DeviceArray<T*> base_, place_table_;
  DeviceArray<std::int32_t> stealable_end_;
  DeviceArray<TaskTime> trace_;
  DeviceArray<Front> fronts_;
  DeviceArray<ChildRows> links_;
  DeviceArray<std::int32_t> bounds_, waits_, relative_, rows_;
  DeviceArray<FactorTask> tasks_;
  DeviceArray<SolveTask> up_, down_, inverses_;
  DeviceArray<std::byte> path_memory_;
  struct PathTables {  // in path_memory_
    SolveTask *up, *down;
    int ups, downs, small_up, small_down;
    unsigned char* marks;
    std::int32_t *fronts, *given, *wanted;
    int front_count;
    Offset given_count;
    T *b, *x;
  };
  PathTables paths_{};
  DeviceArray<std::int64_t> entry_ptr_;
  DeviceArray<std::uint64_t> entries_;
  DeviceArray<std::uint32_t> chunks_;  // of values that are copied from the first side
  struct PartialRun {
    std::vector<char> made;  // fronts, as chosen last; empty: none are
    DeviceArray<char> marks;
    DeviceArray<FactorTask> tasks;
    DeviceArray<SolveTask> inverses;
    std::int64_t narrow_end = 0, end = 0;
    int inverse_count = 0;
  } part_;
  LaunchConfiguration shape_[2];
  SolveLaunches solve_shape_;
  FactorState<T> state_{};
};

}  // namespace espalier::device::cuda
