#include "device/cuda/out_of_core/cuda_stream.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "device/cuda/out_of_core/launches.hpp"
#include "device/cuda/out_of_core/layout.hpp"
#include "device/cuda/out_of_core/pivot_record.hpp"
#include "device/cuda/out_of_core/resources.hpp"
#include "device/cuda/runtime/device_memory.hpp"
#include "device/cuda/tables/fragment_solve.hpp"

namespace espalier::device::cuda {

namespace {

using out_of_core::ColumnGroup;
using out_of_core::InCoreStep;
using out_of_core::StreamOp;
using out_of_core::StreamQueue;

template <class T>
class CudaStream final : public CudaStreamLayout<T> {
 public:
  /// @param solve_pool  null: this backend never solves
  CudaStream(std::shared_ptr<const StreamSource> source, Kind kind, const PivotRule& rule, base::ThreadPool* solve_pool,
             const CudaStreamOptions& options)
      : CudaStreamLayout<T>(std::move(source)),
        kind_(kind),
        rule_(rule),
        options_(options),
        resources_(options),
        pivots_(kind, this->plan().tree.n) {
    if (solve_pool != nullptr)
      solve_.emplace(this->plan(), this->stream_tables().device_plan().fronts, kind, *solve_pool);
  }

  // ---- memory and copies --------------------------------------------------------------------------------------------

  void prepare(const out_of_core::StreamingPlan& plan, int slots, Offset slot_bytes) override {
    streaming_ = &plan;
    std::array<std::size_t, out_of_core::kStreamQueues> count{};
    for (const StreamOp& op : plan.ops) ++count[static_cast<std::size_t>(op.queue)];
    resources_.take(plan.arena_bytes, slots, slot_bytes, count);
    for (const InCoreStep& s : plan.steps)
      steps_.push_back(s.fronts.empty() ? UnitTables{} : this->stream_tables().build(s));
    for (const ColumnGroup& g : plan.groups) groups_.push_back(this->stream_tables().build(g));
    launches_.emplace(*this, this->stream_tables(), kind_, plan, resources_.arena(), options_.patience_seconds);
    T* arena = reinterpret_cast<T*>(resources_.arena());
    copy_now(plan.shared_at, &arena, sizeof arena);
    set_pivot_rule(rule_);
  }

  void set_pivot_rule(const PivotRule& rule) override {
    rule_ = rule;
    if (streaming_ == nullptr) return;
    enter_thread();
    const T limits[2] = {static_cast<T>(rule.tiny), static_cast<T>(1 / rule.threshold)};
    copy_now(streaming_->shared_at + kLimitsAt, limits, sizeof limits);
  }

  void begin(std::span<const T>) override {
    pivots_.begin();
    runs_.clear();
    started_ = {};
    times_ = {};
  }
  void enter_thread() override {
    call("cudaSetDevice", [&] { return cudaSetDevice(resources_.device()); });
  }
  std::byte* staging(int slot) override { return resources_.slot(slot); }
  void copy_in(Offset to, int slot, Offset bytes) override {
    move(resources_.arena() + to, resources_.slot(slot), bytes, cudaMemcpyHostToDevice, StreamQueue::in);
    mark_slot(slot, StreamQueue::in);
  }
  void copy_out(int slot, Offset from, Offset bytes) override {
    move(resources_.slot(slot), resources_.arena() + from, bytes, cudaMemcpyDeviceToHost, StreamQueue::out);
    mark_slot(slot, StreamQueue::out);
  }
  void wait_for_slot(int slot) override {
    call("cudaEventSynchronize", [&] { return cudaEventSynchronize(resources_.slot_event(slot)); });
  }
  bool pin(std::byte* at, Offset bytes) override {
    const cudaError_t e = attempt("cudaHostRegister", [&] {
      return cudaHostRegister(at, static_cast<std::size_t>(bytes), cudaHostRegisterPortable);
    });
    (void)cudaGetLastError();
    return e == cudaSuccess;
  }
  void unpin(std::byte* at) noexcept override { (void)cudaHostUnregister(at); }
  void copy_in_direct(Offset to, const std::byte* from, Offset bytes) override {
    move(resources_.arena() + to, from, bytes, cudaMemcpyHostToDevice, StreamQueue::in);
  }
  void copy_out_direct(std::byte* to, Offset from, Offset bytes) override {
    move(to, resources_.arena() + from, bytes, cudaMemcpyDeviceToHost, StreamQueue::out);
  }
  std::span<const std::byte> tables(const StreamOp& op) override { return unit(op).bytes; }
  void mark(StreamQueue q, std::int64_t number) override {
    call("cudaEventRecord", [&] { return cudaEventRecord(resources_.mark(q, number), resources_.stream(q)); });
  }
  void wait_for_mark(StreamQueue q, StreamQueue other, std::int64_t number) override {
    wait_for_mark(q, *this, other, number);
  }
  void wait_for_mark(StreamQueue q, out_of_core::StreamBackend<T>& of, StreamQueue other,
                     std::int64_t number) override {
    const StreamResources& its = dynamic_cast<CudaStream&>(of).resources_;
    call("cudaStreamWaitEvent", [&] { return cudaStreamWaitEvent(resources_.stream(q), its.mark(other, number), 0); });
  }
  void wait_until(StreamQueue q, std::int64_t number) override {
    call("cudaEventSynchronize", [&] { return cudaEventSynchronize(resources_.mark(q, number)); });
  }
  void finish() override {
    for (const auto q : {StreamQueue::run, StreamQueue::second_run})
      call("cudaStreamSynchronize", [&] { return cudaStreamSynchronize(resources_.stream(q)); });
    add_up_times();
    if (pivots_.stopped())
      throw Error(StatusCode::device_error, "the factorization on " + name() + " was given up after waiting " +
                                                std::to_string(options_.patience_seconds) +
                                                " s for one of its own blocks");
  }
  void abandon() noexcept override {
    for (const auto q : {StreamQueue::in, StreamQueue::run, StreamQueue::second_run, StreamQueue::out})
      (void)cudaStreamSynchronize(resources_.stream(q));
    (void)cudaGetLastError();
  }

  // ---- operations ---------------------------------------------------------------------------------------------------

  void run(const StreamOp& op) override {
    runs_.push_back(&op);
    const cudaStream_t stream = resources_.stream(op.queue);
    const std::int64_t number = ++started_[static_cast<std::size_t>(op.queue)];
    call("cudaEventRecord", [&] { return cudaEventRecord(resources_.start(op.queue, number), stream); });
    launches_->run(op, unit(op), stream);
  }

  void take_outputs(const StreamOp& op, std::span<const std::byte> bytes) override {
    pivots_.take(unit(op).scratch, op.grouped ? positions_of(group(op), unit(op)) : positions_of(step(op)), rule_,
                 bytes);
  }
  FactorOutcome outcome() override { return pivots_.outcome(); }

  void take_pivots(out_of_core::StreamBackend<T>& from) override {
    auto& other = dynamic_cast<CudaStream&>(from);
    const auto take = [&](const Positions& list) {
      for (const auto& [begin, end] : list) pivots_.copy_from(other.pivots_, begin, end - begin);
    };
    for (const InCoreStep& s : other.streaming_->steps) take(positions_of(s));
    for (std::size_t k = 0; k < other.groups_.size(); ++k)
      take(positions_of(other.streaming_->groups[k], other.groups_[k]));
  }

  void solve(const T* store, T* x, Index columns, bool transpose) override {
    solve_->run(
        {store, &streaming_->factor_store, &streaming_->factor2_store, &pivots_.inverse_d(), &pivots_.inverse_e()}, x,
        columns, transpose);
  }

  [[nodiscard]] StreamTimes times() const override { return times_; }
  [[nodiscard]] std::string name() const override {
    cudaDeviceProp p{};
    call("cudaGetDeviceProperties", [&] { return cudaGetDeviceProperties(&p, options_.device); });
    return std::string(p.name) + " #" + std::to_string(options_.device) + ", streaming";
  }
  [[nodiscard]] Offset peak_bytes() const override { return resources_.arena_bytes(); }

 private:
  [[nodiscard]] const UnitTables& unit(const StreamOp& op) const {
    return op.grouped ? groups_[static_cast<std::size_t>(op.unit)] : steps_[static_cast<std::size_t>(op.unit)];
  }
  [[nodiscard]] const ColumnGroup& group(const StreamOp& op) const {
    return streaming_->groups[static_cast<std::size_t>(op.unit)];
  }
  [[nodiscard]] const InCoreStep& step(const StreamOp& op) const {
    return streaming_->steps[static_cast<std::size_t>(op.unit)];
  }
  [[nodiscard]] Positions positions_of(const ColumnGroup& g, const UnitTables& u) const {
    const Index first = this->plan().tree.first[g.front] + this->front(g.front).column_begin(g.begin);
    return {{first, first + u.scratch.pivots}};
  }
  [[nodiscard]] Positions positions_of(const InCoreStep& s) const {
    Positions list;
    for (const Index f : s.fronts) list.emplace_back(this->plan().tree.first[f], this->plan().tree.first[f + 1]);
    return list;
  }

  void add_up_times() {
    std::array<std::int64_t, out_of_core::kStreamQueues> number{};
    for (const StreamOp* op : runs_) {
      const std::int64_t n = ++number[static_cast<std::size_t>(op->queue)];
      float ms = 0;
      call("cudaEventElapsedTime",
           [&] { return cudaEventElapsedTime(&ms, resources_.start(op->queue, n), resources_.mark(op->queue, n)); });
      out_of_core::time_of(times_, op->work) += 1e-3 * static_cast<double>(ms);
    }
  }

  void copy_now(Offset to, const void* from, std::size_t bytes) {
    call("cudaMemcpy", [&] { return cudaMemcpy(resources_.arena() + to, from, bytes, cudaMemcpyHostToDevice); });
  }
  void move(void* to, const void* from, Offset bytes, cudaMemcpyKind kind, StreamQueue q) {
    call("cudaMemcpyAsync",
         [&] { return cudaMemcpyAsync(to, from, static_cast<std::size_t>(bytes), kind, resources_.stream(q)); });
  }
  void mark_slot(int slot, StreamQueue q) {
    call("cudaEventRecord", [&] { return cudaEventRecord(resources_.slot_event(slot), resources_.stream(q)); });
  }

  Kind kind_;
  PivotRule rule_;
  CudaStreamOptions options_;
  StreamResources resources_;
  StreamPivots<T> pivots_;
  std::optional<FragmentSolve<T>> solve_;
  std::optional<StreamLaunches<T>> launches_;
  const out_of_core::StreamingPlan* streaming_ = nullptr;
  std::vector<UnitTables> steps_, groups_;
  std::vector<const StreamOp*> runs_;  // of the last factorization
  std::array<std::int64_t, out_of_core::kStreamQueues> started_{};
  StreamTimes times_;
};

}  // namespace

Offset free_device_bytes(int device) {
  int before = 0;
  call("cudaGetDevice", [&] { return cudaGetDevice(&before); });
  call("cudaSetDevice", [&] { return cudaSetDevice(device); });
  std::size_t free = 0, total = 0;
  const auto e = attempt("cudaMemGetInfo", [&] { return cudaMemGetInfo(&free, &total); });
  (void)cudaSetDevice(before);
  check(e, "cudaMemGetInfo");
  constexpr Offset kReserve = 64 << 20;  // kernels' stacks and the driver's own
  return std::max<Offset>(0, static_cast<Offset>(free) - kReserve);
}

template <class T>
std::vector<std::unique_ptr<out_of_core::StreamBackend<T>>> make_cuda_streams(
    const plan::Plan& plan, Kind kind, const PivotRule& rule, base::ThreadPool& pool,
    const std::vector<CudaStreamOptions>& devices) {
  const auto source = std::make_shared<const StreamSource>(plan, kind, static_cast<Offset>(sizeof(T)));
  std::vector<std::unique_ptr<out_of_core::StreamBackend<T>>> list;
  for (const CudaStreamOptions& options : devices)
    list.push_back(std::make_unique<CudaStream<T>>(source, kind, rule, list.empty() ? &pool : nullptr, options));
  return list;
}

template std::vector<std::unique_ptr<out_of_core::StreamBackend<double>>> make_cuda_streams(
    const plan::Plan&, Kind, const PivotRule&, base::ThreadPool&, const std::vector<CudaStreamOptions>&);
template std::vector<std::unique_ptr<out_of_core::StreamBackend<float>>> make_cuda_streams(
    const plan::Plan&, Kind, const PivotRule&, base::ThreadPool&, const std::vector<CudaStreamOptions>&);

}  // namespace espalier::device::cuda
