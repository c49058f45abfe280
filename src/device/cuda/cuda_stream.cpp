#include "device/cuda/cuda_stream.hpp"

#if ESPALIER_WITH_CUDA

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <utility>

#include "device/cuda/device_memory.hpp"
#include "device/cuda/factor_kernel.cuh"
#include "device/cuda/factor_parameters.hpp"
#include "device/cuda/fragment_solve.hpp"
#include "device/cuda/stream_kernels.cuh"
#include "device/cuda/stream_resources.hpp"
#include "device/cuda/stream_tables.hpp"
#include "device/determinant.hpp"

namespace espalier::device::cuda {

namespace {

using analysis::ColumnGroup;
using analysis::InCoreStep;
using analysis::StreamOp;
using analysis::StreamQueue;
using analysis::StreamWork;

constexpr Offset kLimitsAt = 64;  // bytes from StreamingPlan::shared_at; the arena's address stands before

// What the backends of one plan share.
struct StreamSource {
  StreamSource(const analysis::Plan& the_plan, Kind kind, Offset element_bytes)
      : own(the_plan.assignment.devices > 1 ? std::make_unique<analysis::Plan>(analysis::plan_for_one_device(the_plan))
                                            : nullptr),
        plan(own != nullptr ? *own : the_plan),
        tables(plan, kind, element_bytes) {}
  std::unique_ptr<analysis::Plan> own;
  const analysis::Plan& plan;
  StreamTables tables;
};

template <class T>
class CudaStream final : public StreamBackend<T> {
 public:
  /// @param solve_pool  null: this backend never solves
  CudaStream(std::shared_ptr<const StreamSource> source, Kind kind, const PivotRule& rule, base::ThreadPool* solve_pool,
             const CudaStreamOptions& options)
      : source_(std::move(source)),
        plan_(source_->plan),
        kind_(kind),
        rule_(rule),
        options_(options),
        tables_(source_->tables),
        resources_(options) {
    if (solve_pool != nullptr) solve_.emplace(plan_, tables_.device_plan().fronts, kind, *solve_pool);
    for (const Front& x : tables_.device_plan().fronts) {
      sizes_.factor.push_back(padded(x.factor_size()));
      sizes_.contribution.push_back(padded(x.contribution_size()));
    }
  }

  // ---- layout -------------------------------------------------------------------------------------------------------

  [[nodiscard]] const analysis::Plan& plan() const override { return plan_; }
  [[nodiscard]] Offset element_bytes() const override { return sizeof(T); }
  [[nodiscard]] const std::vector<analysis::Task>& order() const override { return tables_.order(); }
  [[nodiscard]] const analysis::ArraySizes& sizes() const override { return sizes_; }
  [[nodiscard]] Offset factor_offset(Index f, Index column) const override {
    const Front& x = front(f);
    return column < x.pivot_tiles ? x.column_offset(column) : sizes_.factor[f];
  }
  [[nodiscard]] Offset contribution_offset(Index f, Index column) const override {
    const Front& x = front(f);
    const int first = column * x.width;
    return column < x.tiles - x.pivot_tiles ? x.contribution_offset(first, first) : sizes_.contribution[f];
  }
  void panel(Index f, Index begin, Index end, Index row, std::vector<analysis::Piece>& pieces) const override {
    const Front& x = front(f);
    const int top = x.column_begin(row);
    for (Index j = begin; j < end; ++j)
      for (int q = x.column_begin(j) / kChunk; q < x.column_end(j) / kChunk; ++q)
        pieces.push_back({x.chunk_offset(q, top), static_cast<Offset>(x.total_pad - top) * kChunk});
  }
  [[nodiscard]] Offset share_bytes(Index f) const override { return tables_.share_bytes(f); }
  [[nodiscard]] Offset table_bytes(const InCoreStep& s) const override { return tables_.tables(s).bytes; }
  [[nodiscard]] Offset scratch_bytes(const InCoreStep& s) const override { return tables_.scratch(s).bytes; }
  [[nodiscard]] Offset output_bytes(const InCoreStep& s) const override { return tables_.scratch(s).flags; }
  [[nodiscard]] Offset table_bytes(Index f, Index b, Index e) const override { return tables_.tables(f, b, e).bytes; }
  [[nodiscard]] Offset scratch_bytes(Index f, Index b, Index e) const override {
    return tables_.scratch(f, b, e).bytes;
  }
  [[nodiscard]] Offset output_bytes(Index f, Index b, Index e) const override { return tables_.scratch(f, b, e).flags; }
  [[nodiscard]] bool copies_values() const override { return true; }

  // ---- memory and copies --------------------------------------------------------------------------------------------

  void prepare(const analysis::StreamingPlan& plan, int slots, Offset slot_bytes) override {
    streaming_ = &plan;
    std::array<std::size_t, analysis::kStreamQueues> count{};
    for (const StreamOp& op : plan.ops) ++count[static_cast<std::size_t>(op.queue)];
    resources_.take(plan.arena_bytes, slots, slot_bytes, count);
    for (const InCoreStep& s : plan.steps) steps_.push_back(s.fronts.empty() ? UnitTables{} : tables_.build(s));
    for (const ColumnGroup& g : plan.groups) groups_.push_back(tables_.build(g));
    choose_shapes();
    T* arena = reinterpret_cast<T*>(resources_.arena());
    copy_now(plan.shared_at, &arena, sizeof arena);
    set_pivot_rule(rule_);
    if (kind_ == Kind::ldlt) {
      inverse_d_.resize(static_cast<std::size_t>(plan_.tree.n));
      inverse_e_.resize(static_cast<std::size_t>(plan_.tree.n));
    }
  }

  void set_pivot_rule(const PivotRule& rule) override {
    rule_ = rule;
    if (streaming_ == nullptr) return;
    enter_thread();
    const T limits[2] = {static_cast<T>(rule.tiny), static_cast<T>(1 / rule.threshold)};
    copy_now(streaming_->shared_at + kLimitsAt, limits, sizeof limits);
  }

  void begin(std::span<const T>) override {
    outcome_ = FactorOutcome{};
    determinant_ = Determinant{};
    stopped_ = false;
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
  void wait_for_mark(StreamQueue q, StreamBackend<T>& of, StreamQueue other, std::int64_t number) override {
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
    if (stopped_)
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
    lane_ = op.queue;
    runs_.push_back(&op);
    std::int64_t& number = started_[static_cast<std::size_t>(lane_)];
    call("cudaEventRecord", [&] { return cudaEventRecord(resources_.start(lane_, ++number), runs()); });
    switch (op.work) {
      case StreamWork::eliminate:
        return eliminate(unit(op), streaming_->steps[static_cast<std::size_t>(op.unit)]);
      case StreamWork::begin_group:
        return begin_group(unit(op), group(op));
      case StreamWork::add_child:
        return add_child(unit(op), group(op), op);
      case StreamWork::update:
        return update(unit(op), group(op), op);
      default:
        return launch(unit(op), state(unit(op), group(op)), false);
    }
  }

  void take_outputs(const StreamOp& op, std::span<const std::byte> bytes) override {
    const ScratchPlaces& at = unit(op).scratch;
    int control[kCounted];
    std::memcpy(control, bytes.data() + at.control, sizeof control);
    stopped_ = stopped_ || control[kAborted] != 0;
    const bool good = control[kNotPositive] == 0;
    const auto use = [&](Index local, Index position) {
      T pivot;
      std::memcpy(&pivot, bytes.data() + at.pivot + local * static_cast<Offset>(sizeof(T)), sizeof pivot);
      if (good) determinant_.multiply(static_cast<double>(pivot));
      if (good && !rule_.smallest.empty() &&
          static_cast<double>(pivot) <= rule_.smallest[static_cast<std::size_t>(position)])
        outcome_.replaced.push_back(position);
      if (bytes[static_cast<std::size_t>(at.replaced + local)] != std::byte{0}) outcome_.replaced.push_back(position);
      if (bytes[static_cast<std::size_t>(at.failed + local)] != std::byte{0}) outcome_.failed.push_back(position);
      if (!good && local == at.pivots - control[kNotPositive])
        outcome_.not_positive = outcome_.not_positive < 0 ? position : std::min(outcome_.not_positive, position);
      if (kind_ != Kind::ldlt) return;
      const Offset skip = local * static_cast<Offset>(sizeof(T));
      std::memcpy(&inverse_d_[static_cast<std::size_t>(position)], bytes.data() + at.inverse_d + skip, sizeof(T));
      std::memcpy(&inverse_e_[static_cast<std::size_t>(position)], bytes.data() + at.inverse_e + skip, sizeof(T));
    };
    for_each_position(op, use);
    outcome_.negative += control[kNegative];
    outcome_.two_by_two += control[kTwoByTwo];
  }

  FactorOutcome outcome() override {
    std::sort(outcome_.replaced.begin(), outcome_.replaced.end());
    std::sort(outcome_.failed.begin(), outcome_.failed.end());
    outcome_.determinant_sign = determinant_.sign();
    outcome_.determinant_log = determinant_.log();
    return outcome_;
  }

  void take_pivots(StreamBackend<T>& from) override {
    if (kind_ != Kind::ldlt) return;
    auto& other = dynamic_cast<CudaStream&>(from);
    const auto take = [&](Index begin, Index count) {
      std::copy_n(other.inverse_d_.begin() + begin, count, inverse_d_.begin() + begin);
      std::copy_n(other.inverse_e_.begin() + begin, count, inverse_e_.begin() + begin);
    };
    for (const InCoreStep& s : other.streaming_->steps)
      for (const Index f : s.fronts) take(plan_.tree.first[f], plan_.tree.first[f + 1] - plan_.tree.first[f]);
    for (std::size_t k = 0; k < other.groups_.size(); ++k) {
      const ColumnGroup& g = other.streaming_->groups[k];
      take(plan_.tree.first[g.front] + front(g.front).column_begin(g.begin), other.groups_[k].scratch.pivots);
    }
  }

  void solve(const T* store, T* x, Index columns, bool transpose) override {
    solve_->run({store, &streaming_->factor_store, &streaming_->factor2_store, &inverse_d_, &inverse_e_}, x, columns,
                transpose);
  }

  [[nodiscard]] StreamTimes times() const override { return times_; }
  [[nodiscard]] std::string name() const override {
    cudaDeviceProp p{};
    call("cudaGetDeviceProperties", [&] { return cudaGetDeviceProperties(&p, options_.device); });
    return std::string(p.name) + " #" + std::to_string(options_.device) + ", streaming";
  }
  [[nodiscard]] Offset peak_bytes() const override { return resources_.arena_bytes(); }

 private:
  static constexpr int kCounted = 16;

  static Offset padded(Offset x) { return (x + kChunk - 1) / kChunk * kChunk; }
  [[nodiscard]] const Front& front(Index f) const { return tables_.device_plan().fronts[static_cast<std::size_t>(f)]; }
  [[nodiscard]] const UnitTables& unit(const StreamOp& op) const {
    return op.grouped ? groups_[static_cast<std::size_t>(op.unit)] : steps_[static_cast<std::size_t>(op.unit)];
  }
  [[nodiscard]] const ColumnGroup& group(const StreamOp& op) const {
    return streaming_->groups[static_cast<std::size_t>(op.unit)];
  }

  void add_up_times() {
    std::array<std::int64_t, analysis::kStreamQueues> number{};
    for (const StreamOp* op : runs_) {
      const std::int64_t n = ++number[static_cast<std::size_t>(op->queue)];
      float ms = 0;
      call("cudaEventElapsedTime",
           [&] { return cudaEventElapsedTime(&ms, resources_.start(op->queue, n), resources_.mark(op->queue, n)); });
      time_of(times_, op->work) += 1e-3 * static_cast<double>(ms);
    }
  }

  template <class Use>
  void for_each_position(const StreamOp& op, Use&& use) const {
    Index local = 0;
    if (op.grouped) {
      const ColumnGroup& g = group(op);
      const Index first = plan_.tree.first[g.front] + front(g.front).column_begin(g.begin);
      for (; local < unit(op).scratch.pivots; ++local) use(local, first + local);
      return;
    }
    for (const Index f : streaming_->steps[static_cast<std::size_t>(op.unit)].fronts)
      for (Index k = plan_.tree.first[f]; k < plan_.tree.first[f + 1]; ++k) use(local++, k);
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
  [[nodiscard]] cudaStream_t runs() const { return resources_.stream(lane_); }

  template <class Use>
  void dispatch(const char* name, Use&& use) const {
    call(name, [&] {
      switch (kind_) {
        case Kind::llt:
          return use(FactorKernel<T, Kind::llt>{}, GroupKernels<T, Kind::llt>{});
        case Kind::ldlt:
          return use(FactorKernel<T, Kind::ldlt>{}, GroupKernels<T, Kind::ldlt>{});
        default:
          return use(FactorKernel<T, Kind::lu>{}, GroupKernels<T, Kind::lu>{});
      }
    });
  }

  void choose_shapes() {
    std::size_t whole = 0;
    for (const Front& f : tables_.device_plan().fronts)
      if (f.whole != 0) {
        const auto size = static_cast<std::size_t>(f.total_pad), p = static_cast<std::size_t>(f.pivot_pad);
        whole = std::max(whole, size * (size + 4) + p * (p + 4));
      }
    for (const bool wide : {false, true})
      dispatch("launch shape of the factorization kernel",
               [&](auto kernel, auto) { return decltype(kernel)::shape_for(wide, whole, shape_[wide ? 1 : 0]); });
    dispatch("group kernels", [](auto, auto kernels) { return decltype(kernels)::prepare(); });
  }

  template <class Unit>
  [[nodiscard]] FactorState<T> state(const UnitTables& u, const Unit& places) const {
    FactorState<T> s{};
    std::byte* tables = resources_.arena() + places.tables_at;
    std::byte* scratch = resources_.arena() + places.scratch_at;
    std::byte* shared = resources_.arena() + streaming_->shared_at;
    s.fronts = reinterpret_cast<const Front*>(tables + u.at.fronts);
    s.tasks = reinterpret_cast<const FactorTask*>(tables + u.at.tasks);
    s.links = reinterpret_cast<const Link*>(tables + u.at.links);
    s.bounds = reinterpret_cast<const std::int32_t*>(tables + u.at.bounds);
    s.waits = reinterpret_cast<const std::int32_t*>(tables + u.at.waits);
    s.relative = reinterpret_cast<const std::int32_t*>(tables + u.at.relative);
    s.entry_ptr = reinterpret_cast<const std::int64_t*>(tables + u.at.entry_ptr);
    s.entries = reinterpret_cast<const std::uint64_t*>(tables + u.at.entries);
    s.values = reinterpret_cast<const T*>(resources_.arena() + places.values_at);
    s.base = reinterpret_cast<T* const*>(shared);
    s.inverse_d = reinterpret_cast<T*>(scratch + u.scratch.inverse_d);
    s.inverse_e = reinterpret_cast<T*>(scratch + u.scratch.inverse_e);
    s.pivot = reinterpret_cast<T*>(scratch + u.scratch.pivot);
    s.replaced = reinterpret_cast<unsigned char*>(scratch + u.scratch.replaced);
    s.failed = reinterpret_cast<unsigned char*>(scratch + u.scratch.failed);
    s.control = reinterpret_cast<int*>(scratch + u.scratch.control);
    s.finished = reinterpret_cast<int*>(scratch + u.scratch.finished);
    set_flags(s, reinterpret_cast<int*>(scratch + u.scratch.flags));
    s.limits = reinterpret_cast<const T*>(shared + kLimitsAt);
    s.patience = static_cast<std::uint64_t>(options_.patience_seconds * 1e9);
    s.part_flags = u.scratch.part_flags;
    return s;
  }
  template <class S>
  static void set_flags(S& s, int* flags) {
    if constexpr (requires { s.flag; }) s.flag = flags;
  }

  void clear_scratch(const UnitTables& u, Offset scratch_at) {
    const ScratchPlaces& at = u.scratch;
    std::byte* scratch = resources_.arena() + scratch_at;
    const auto set = [&](Offset begin, int value, Offset bytes) {
      if (bytes > 0)
        call("cudaMemsetAsync",
             [&] { return cudaMemsetAsync(scratch + begin, value, static_cast<std::size_t>(bytes), runs()); });
    };
    set(at.replaced, 0, at.bytes - at.replaced);
    for (int part = 0; part < (kind_ == Kind::lu ? 2 : 1); ++part)
      set(at.flags + 4 * ((part + 1) * at.part_flags - at.set_flags), 1, 4 * at.set_flags);
  }

  // Steps of two lanes share the multiprocessors: a kernel keeps what it has until its list of tasks is empty.
  void launch(const UnitTables& u, const FactorState<T>& s, bool narrow) {
    const auto go = [&](bool wide, int first, int end) {
      if (first == end) return;
      LaunchShape shape = shape_[wide ? 1 : 0];
      if (narrow && streaming_->lanes == 2) shape.blocks = (shape.blocks + 1) / 2;
      dispatch("launch of the factorization kernel", [&](auto kernel, auto) {
        return decltype(kernel)::launch(wide, shape, s, first, end, u.scratch.pivots, runs());
      });
    };
    const int split = narrow ? u.narrow_end : 0;
    go(false, 0, split);
    go(true, split, u.end);
  }

  void eliminate(const UnitTables& u, const InCoreStep& step) {
    clear_scratch(u, step.scratch_at);
    launch(u, state(u, step), true);
  }

  void begin_group(const UnitTables& u, const ColumnGroup& g) {
    clear_scratch(u, g.scratch_at);
    const Index pivots = plan_.layout[g.front].pivot_tiles;
    const auto zero = [&](Offset at, Offset elements) {
      if (elements > 0)
        call("cudaMemsetAsync", [&] {
          return cudaMemsetAsync(resources_.arena() + at, 0, static_cast<std::size_t>(elements) * sizeof(T), runs());
        });
    };
    const Offset factor =
        factor_offset(g.front, std::min(g.end, pivots)) - factor_offset(g.front, std::min(g.begin, pivots));
    const Offset below = contribution_offset(g.front, std::max(g.end, pivots) - pivots) -
                         contribution_offset(g.front, std::max(g.begin, pivots) - pivots);
    zero(g.factor_at[0], factor);
    if (kind_ != Kind::llt) zero(g.factor_at[1], factor);
    zero(g.contribution_at[0], below);
    if (kind_ == Kind::lu) zero(g.contribution_at[1], below);
    if (g.entries > 0) add(u, g, AddedPart<T>{});
  }

  void add(const UnitTables& u, const ColumnGroup& g, const AddedPart<T>& part) {
    dispatch("launch of the assembly kernel",
             [&](auto, auto kernels) { return decltype(kernels)::add(state(u, g), u.end, u.group_end, part, runs()); });
  }

  void add_child(const UnitTables& u, const ColumnGroup& g, const StreamOp& op) {
    const Front& child = front(op.front);
    const Offset before = contribution_offset(op.front, op.begin);
    AddedPart<T> part;
    part.link = tables_.link_of(op.front);
    part.begin = op.begin * child.width;
    part.end = std::min<int>(child.below, op.end * child.width);
    const auto place = [&](Offset at) { return reinterpret_cast<const T*>(resources_.arena() + at) - before; };
    part.lower = place(op.at[0]);
    if (kind_ == Kind::lu) part.upper = place(op.at[1]);
    add(u, g, part);
  }

  void update(const UnitTables& u, const ColumnGroup& g, const StreamOp& op) {
    StreamedPanel<T> panel;
    panel.begin = op.begin;
    panel.end = op.end;
    panel.row = op.panel ? front(op.front).column_begin(op.row) : -1;
    panel.part[0] = reinterpret_cast<const T*>(resources_.arena() + op.at[0]);
    if (kind_ != Kind::llt) panel.part[1] = reinterpret_cast<const T*>(resources_.arena() + op.at[1]);
    dispatch("launch of the update kernel", [&](auto, auto kernels) {
      return decltype(kernels)::update(state(u, g), u.width, u.end, u.group_end, panel, runs());
    });
  }

  std::shared_ptr<const StreamSource> source_;
  const analysis::Plan& plan_;
  Kind kind_;
  PivotRule rule_;
  CudaStreamOptions options_;
  const StreamTables& tables_;
  StreamResources resources_;
  std::optional<FragmentSolve<T>> solve_;
  analysis::ArraySizes sizes_;
  const analysis::StreamingPlan* streaming_ = nullptr;
  std::vector<UnitTables> steps_, groups_;
  LaunchShape shape_[2];
  FactorOutcome outcome_;
  Determinant determinant_;
  bool stopped_ = false;
  std::vector<const StreamOp*> runs_;  // of the last factorization
  std::array<std::int64_t, analysis::kStreamQueues> started_{};
  StreamTimes times_;
  StreamQueue lane_ = StreamQueue::run;  // where run() puts kernels
  std::vector<T> inverse_d_, inverse_e_;
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
std::vector<std::unique_ptr<StreamBackend<T>>> make_cuda_streams(const analysis::Plan& plan, Kind kind,
                                                                 const PivotRule& rule, base::ThreadPool& pool,
                                                                 const std::vector<CudaStreamOptions>& devices) {
  const auto source = std::make_shared<const StreamSource>(plan, kind, static_cast<Offset>(sizeof(T)));
  std::vector<std::unique_ptr<StreamBackend<T>>> list;
  for (const CudaStreamOptions& options : devices)
    list.push_back(std::make_unique<CudaStream<T>>(source, kind, rule, list.empty() ? &pool : nullptr, options));
  return list;
}

template std::vector<std::unique_ptr<StreamBackend<double>>> make_cuda_streams(const analysis::Plan&, Kind,
                                                                               const PivotRule&, base::ThreadPool&,
                                                                               const std::vector<CudaStreamOptions>&);
template std::vector<std::unique_ptr<StreamBackend<float>>> make_cuda_streams(const analysis::Plan&, Kind,
                                                                              const PivotRule&, base::ThreadPool&,
                                                                              const std::vector<CudaStreamOptions>&);

}  // namespace espalier::device::cuda

#endif
