#include "device/cuda/executor/device_side.hpp"

#include <algorithm>
#include <map>
#include <mutex>
#include <numeric>
#include <string>

#include "device/cuda/kernels/block_inverse.hpp"
#include "device/cuda/tables/device_bytes.hpp"

namespace espalier::device::cuda {

namespace {

// @param held  bytes that are there already
Offset limit_of(Offset memory_bytes, Offset held) {
  std::size_t free = 0, total = 0;
  call("cudaMemGetInfo", [&] { return cudaMemGetInfo(&free, &total); });
  const auto all = static_cast<Offset>(free) + held;
  return memory_bytes > 0 ? std::min(memory_bytes, all) : all;
}

// Asked for once: all properties together take a millisecond.
std::string device_name(int device) {
  static std::mutex mutex;
  static std::map<int, std::string> names;
  const std::lock_guard lock(mutex);
  auto found = names.find(device);
  if (found == names.end()) {
    cudaDeviceProp p{};
    call("cudaGetDeviceProperties", [&] { return cudaGetDeviceProperties(&p, device); });
    found = names.emplace(device, p.name).first;
  }
  return found->second;
}

}  // namespace

template <class T>
DeviceSide<T>::DeviceSide(const SideContext& context, int self, int device, Offset memory_bytes,
                          const CommonMemory<T>& common, DeviceArray<T> arena)
    : context_(context),
      common_(common),
      self_(self),
      device_(device),
      budget_(limit_of(memory_bytes, arena.bytes())),
      uploads_(self == context.pool_side ? context.pool : nullptr),
      counters_(2 * kCounters),
      one_(1),
      end_(1) {
  name_ = device_name(device_);
  if (context_.tables.lists.size() > 1) name_ += " #" + std::to_string(device_);
  *one_.data() = 1;
  needed_ =
      bytes_of(context_.plan, context_.kind, context_.tables, self_, context_.values, sizeof(T), context_.spare).all();
  take_memory(std::move(arena));
  take_tables();
  choose_shapes();
}

// Elements of the regions, the top aside, that lie on this device.
template <class T>
Offset DeviceSide<T>::own_elements() const {
  const auto& t = context_.tables;
  Offset own = 0;
  for (std::size_t r = 1; r < t.regions.size(); ++r)
    if (t.region_device[r] == self_) own += t.regions[r];
  return own;
}

template <class T>
void DeviceSide<T>::take_memory(DeviceArray<T> arena) {
  const auto& t = context_.tables;
  const auto take = [&](auto& array, Offset size) {
    array = std::remove_reference_t<decltype(array)>(size, budget_, needed_);
  };
  const auto take_reached = [&](auto& array, Offset size) {
    take(array, context_.exported ? whole_pages<std::remove_pointer_t<decltype(array.data())>>(size) : size);
  };
  if (arena.size() > 0) {
    budget_.take(arena.bytes(), needed_);
    top_ = std::move(arena);
  } else if (common_.top == nullptr) {
    take_reached(top_, t.regions[0] + room_for_changes());
  }
  take_reached(own_, own_elements() + context_.spare);
  if (!t.place_space.empty() && common_.places == nullptr)
    take_reached(places_, t.place_space[static_cast<std::size_t>(self_)]);
  if (common_.pivot == nullptr) take_reached(pivot_, (context_.kind == Kind::ldlt ? 3 : 1) * n());
  pivots_ = common_.pivot != nullptr ? common_.pivot : pivot_.data();
  const Offset flags = common_.flag == nullptr ? parts() * t.flags : 0;
  take_reached(control_, kCounters + flags + context_.plan.fronts());
  flag_data_ = common_.flag != nullptr ? common_.flag : control_.data() + kCounters;
  take(values_, context_.values);
  take_reached(base_, static_cast<Offset>(t.regions.size()));
  take(marks_, 2 * n());
  take(limits_, static_cast<Offset>(PivotLimits<T>().size()));
  take(products_, judge_blocks(context_.plan.tree.n));
  take(ticket_, 1);
  take_reached(solve_control_, kCounters);  // counters are read with those of a factorization, before the first solve
  call("cudaMemsetAsync", [&] {
    return cudaMemsetAsync(solve_control_.data(), 0, static_cast<std::size_t>(solve_control_.bytes()), stream_.get());
  });
  call("cudaMemsetAsync", [&] { return cudaMemsetAsync(ticket_.data(), 0, sizeof(int), stream_.get()); });
  take_solve_memory(1);
}

template <class T>
void DeviceSide<T>::choose_shapes() {
  std::size_t whole = 0;
  for (const Front& f : context_.tables.fronts)
    if (f.whole != 0) {
      const auto size = static_cast<std::size_t>(f.total_pad), p = static_cast<std::size_t>(f.pivot_pad);
      whole = std::max(whole, size * (size + 4) + p * (p + 4));
    }
  for (const bool wide : {false, true})
    call("launch shape of the factorization kernel", [&] {
      return dispatch([&](auto kernel) { return decltype(kernel)::shape_for(wide, whole, shape_[wide ? 1 : 0]); });
    });
  call("launch shape of the solve kernel", [&] { return SolveKernel<T>::resident(solve_shape_); });
}

template <class T>
template <class Use>
cudaError_t DeviceSide<T>::dispatch(Use&& use) const {
  const auto of_kind = [&]<bool kHalf>(std::bool_constant<kHalf>) {
    switch (context_.kind) {
      case Kind::llt:
        return use(FactorKernel<T, Kind::llt, kHalf>{});
      case Kind::ldlt:
        return use(FactorKernel<T, Kind::ldlt, kHalf>{});
      default:
        return use(FactorKernel<T, Kind::lu, kHalf>{});
    }
  };
  if constexpr (base::keeps_fp64<T>)
    if (context_.pair_sign != 0) return of_kind(std::true_type());
  return of_kind(std::false_type());
}

template <class T>
void DeviceSide<T>::forget_pairs() {
  context_.pair_sign = 0;
  choose_shapes();
}

template <class T>
SideAddresses<T> DeviceSide<T>::addresses() const {
  SideAddresses<T> a;
  a.top = common_.top != nullptr ? common_.top : top_.data();
  a.own = own_.data();
  a.places = places_.data();
  a.pivots = pivots_;
  a.vectors = vectors_at_;
  a.base = base_.data();
  a.control = control_.data();
  a.flags = flag_data_;
  a.solve_control = solve_control_.data();
  return a;
}

template <class T>
void DeviceSide<T>::connect(const std::vector<SideAddresses<T>>& sides) {
  const auto& t = context_.tables;
  std::vector<T*> base(t.regions.size(), addresses().top);
  std::vector<Offset> own(sides.size(), 0);
  for (std::size_t r = 1; r < base.size(); ++r) {
    const auto d = static_cast<std::size_t>(t.region_device[r]);
    base[r] = sides[d].own + own[d];
    own[d] += t.regions[r];
  }
  std::vector<T*> starts(sides.size());
  for (std::size_t d = 0; d < sides.size(); ++d) {
    starts[d] = sides[d].places;
    if (common_.places != nullptr) starts[d] = d == 0 ? common_.places : starts[d - 1] + t.place_space[d - 1];
  }
  std::vector<T*> places;
  for (const Place& p : t.places) places.push_back(starts[static_cast<std::size_t>(p.device)] + p.offset);
  copy_in(base_.data(), base.data(), static_cast<Offset>(base.size() * sizeof(T*)));
  send_places(places);

  FactorState<T>& s = state_;
  s.fronts = fronts_.data();
  s.tasks = tasks_.data();
  s.links = links_.data();
  s.bounds = bounds_.data();
  s.waits = waits_.data();
  s.relative = relative_.data();
  s.entry_ptr = entry_ptr_.data();
  s.entries = entries_.data();
  s.values = values_.data();
  s.base = base_.data();
  s.places = place_table_.data();
  s.pivot = pivots_;
  s.inverse_d = context_.kind == Kind::ldlt ? pivots_ + n() : nullptr;
  s.inverse_e = context_.kind == Kind::ldlt ? pivots_ + 2 * n() : nullptr;
  s.replaced = marks_.data();
  s.failed = marks_.data() + n();
  s.control = control_.data();
  s.flag = flag_data_;
  s.finished = control_.data() + (control_.size() - context_.plan.fronts());
  s.limits = limits_.data();
  s.patience = static_cast<std::uint64_t>(context_.patience_seconds * 1e9);
  s.part_flags = t.flags;
  s.peers.self = self_;
  s.peers.same_memory = common_.flag != nullptr;
  s.peers.count = s.peers.same_memory ? 1 : static_cast<int>(sides.size());
  for (std::size_t d = 0; d < sides.size(); ++d) {
    s.peers.top[d] = sides[d].top;
    s.peers.control[d] = sides[d].control;
    s.peers.flag[d] = sides[d].flags;
    s.peers.pivot[d] = sides[d].pivots;
    s.peers.base[d] = sides[d].base;
  }
  for (std::size_t r = static_cast<std::size_t>(t.first_stealable); r < base.size(); ++r)
    s.peers.home[r - static_cast<std::size_t>(t.first_stealable)] = base[r];
  if (sides.size() > 1) s.first_stealable = t.first_stealable;
  s.spare = own_.data() + own_elements();
  s.stealable_end = stealable_end_.data();
}

template <class T>
void DeviceSide<T>::set_limits(const PivotLimits<T>& limits) {
  copy_in(limits_.data(), limits.data(), sizeof limits);
}

template <class T>
void DeviceSide<T>::copy_in(void* to, const void* from, Offset bytes) {
  if (bytes == 0) return;
  call("cudaMemcpyAsync(to device)", [&] {
    return cudaMemcpyAsync(to, from, static_cast<std::size_t>(bytes), cudaMemcpyHostToDevice, stream_.get());
  });
  stream_.wait();
}

template <class T>
void DeviceSide<T>::copy_out(void* to, const void* from, Offset bytes) const {
  call("cudaMemcpyAsync(to host)", [&] {
    return cudaMemcpyAsync(to, from, static_cast<std::size_t>(bytes), cudaMemcpyDeviceToHost, stream_.get());
  });
  stream_.wait();
}

template <class T>
void DeviceSide<T>::enqueue_clear_factor() {
  const auto clear = [&](auto& array) {
    if (array.size() > 0)
      call("cudaMemsetAsync",
           [&] { return cudaMemsetAsync(array.data(), 0, static_cast<std::size_t>(array.bytes()), stream_.get()); });
  };
  clear(control_);
  clear(marks_);
}

template <class T>
void DeviceSide<T>::enqueue_begin(const FilledValues& values) {
  const FactorBegin<T> job{control_.data(), control_.size(), marks_.data(), marks_.size(),  limits_.data(),
                           values.largest,  values.parts,    values.tiny,   values.rounding};
  call("launch of the kernel before the factorization", [&] { return launch_begin(job, stream_.get()); });
}

template <class T>
void DeviceSide<T>::enqueue_take(const DeviceSide& first, const FilledValues& values) {
  const FactorTake<T> job{first.values_.data(), values_.data(),  values_.size(), chunks_.data(),
                          chunks_.size(),       control_.data(), limits_.data(), values.largest,
                          values.parts,         values.tiny,     values.rounding};
  if (chunks_.size() > 0 || values.largest != nullptr)
    call("launch of the kernel that takes the values", [&] { return launch_take(job, stream_.get()); });
}

template <class T>
void DeviceSide<T>::enqueue_judge(const FilledValues& values, const std::vector<SideAddresses<T>>& sides,
                                  const unsigned char* owner) {
  FactorJudge<T> job{};
  job.n = context_.plan.tree.n;
  for (std::size_t d = 0; d < sides.size(); ++d) job.pivots[d] = sides[d].pivots;
  job.pairs = context_.kind == Kind::ldlt;
  job.owner = owner;
  job.values = values_.data();
  job.diagonal = values.diagonal;
  job.rounding = values.rounding;
  job.limits = context_.kind == Kind::llt ? nullptr : limits_.data();
  job.marks = marks_.data();
  job.control = control_.data();
  job.largest = values.largest;
  job.parts = values.parts;
  job.products = products_.data();
  job.ticket = ticket_.data();
  job.end = end_.data();
  call("launch of the kernel after the factorization", [&] { return launch_judge(job, stream_.get()); });
}

template <class T>
void DeviceSide<T>::enqueue_factor(bool skip_last_half) {
  enqueue_tasks(skip_last_half);
  if (!skip_last_half) enqueue_inverses();
}

template <class T>
void DeviceSide<T>::enqueue_tasks(bool first_half_only) {
  const TaskLists& l = lists();
  const auto all = static_cast<std::int64_t>(l.tasks.size());
  launch_tasks(state_, l.narrow_tasks, first_half_only ? all / 2 : all);
}

template <class T>
void DeviceSide<T>::launch_tasks(const FactorState<T>& state, std::int64_t narrow_end, std::int64_t end) {
  const auto launch = [&](bool wide, std::int64_t first, std::int64_t last) {
    if (first >= last) return;
    call("launch of the factorization kernel", [&] {
      return dispatch([&](auto kernel) {
        return decltype(kernel)::launch(wide, shape_[wide ? 1 : 0], state, static_cast<int>(first),
                                        static_cast<int>(last), static_cast<int>(n()), stream_.get(),
                                        context_.pair_sign);
      });
    });
  };
  launch(false, 0, std::min(narrow_end, end));
  launch(true, narrow_end, end);
}

template <class T>
void DeviceSide<T>::enqueue_inverses() {
  call("launch of the kernel that joins inverses", [&] {
    return launch_block_inverses(state_, inverses_.data(), static_cast<int>(inverses_.size()), stream_.get());
  });
}

template <class T>
void DeviceSide<T>::record_tasks() {
  trace_ = DeviceArray<TaskTime>(static_cast<Offset>(lists().tasks.size()), budget_, needed_);
  state_.trace = trace_.data();
}

template <class T>
void DeviceSide<T>::clear_record() {
  if (trace_.size() > 0)
    call("cudaMemset", [&] { return cudaMemset(trace_.data(), 0, static_cast<std::size_t>(trace_.bytes())); });
}

template <class T>
std::vector<TaskTime> DeviceSide<T>::task_times() const {
  std::vector<TaskTime> times(static_cast<std::size_t>(trace_.size()));
  copy_out(times.data(), trace_.data(), trace_.bytes());
  return times;
}

template <class T>
void DeviceSide<T>::enqueue_counters() {
  const auto copy = [&](int* to, const DeviceArray<int>& from) {
    call("cudaMemcpyAsync(counters)", [&] {
      return cudaMemcpyAsync(to, from.data(), kCounters * sizeof(int), cudaMemcpyDeviceToHost, stream_.get());
    });
  };
  copy(counters_.data(), control_);
  copy(counters_.data() + kCounters, solve_control_);
}

template <class T>
void DeviceSide<T>::abort(const SideAddresses<T>& side) noexcept {
  // A copy engine brings the word: kernels that fill the device leave no room for a kernel.
  (void)cudaMemcpyAsync(side.control + kAborted, one_.data(), sizeof(int), cudaMemcpyDefault, urgent_.get());
  (void)cudaMemcpyAsync(side.solve_control + 1, one_.data(), sizeof(int), cudaMemcpyDefault, urgent_.get());
  (void)cudaStreamSynchronize(urgent_.get());
}

template <class T>
void DeviceSide<T>::marked(bool failed, std::vector<unsigned char>& marks) const {
  std::vector<unsigned char> mine(static_cast<std::size_t>(n()));
  copy_out(mine.data(), marks_.data() + (failed ? n() : 0), n());
  marks.resize(mine.size(), 0);
  for (std::size_t k = 0; k < mine.size(); ++k) marks[k] = static_cast<unsigned char>(marks[k] | mine[k]);
}

template <class T>
void DeviceSide<T>::read_pivots(int list, std::vector<T>& to) const {
  const Offset first = Offset{list} * n();
  to.resize(static_cast<std::size_t>(n()));
  if (common_.pivot != nullptr)
    std::copy(common_.pivot + first, common_.pivot + first + n(), to.begin());
  else
    copy_out(to.data(), pivot_.data() + first, n() * static_cast<Offset>(sizeof(T)));
}

template <class T>
void DeviceSide<T>::pivots(std::vector<T>& to) const {
  read_pivots(0, to);
}

template <class T>
void DeviceSide<T>::inverse_pivots(std::vector<T>& d, std::vector<T>& e) const {
  read_pivots(1, d);
  read_pivots(2, e);
}

template class DeviceSide<double>;
template class DeviceSide<float>;

}  // namespace espalier::device::cuda
