// What a side does where some fronts are made again and the others stay.
#include <algorithm>
#include <utility>
#include <vector>

#include "device/cuda/executor/device_side.hpp"
#include "device/cuda/kernels/block_inverse.hpp"
#include "device/cuda/kernels/factor/factor_renewal.hpp"
#include "device/cuda/tables/made_tasks.hpp"
#include "plan/changed_plan.hpp"

namespace espalier::device::cuda {

template <class T>
void DeviceSide<T>::choose_part(std::span<const char> made) {
  if (std::equal(made.begin(), made.end(), part_.made.begin(), part_.made.end())) return;
  part_.made.clear();  // until its lists are there
  const MadeTasks some = tasks_of(lists(), made);
  const auto send = [&](auto& to, const auto* from, std::size_t count) {
    uploads_.copy(to.data(), from, static_cast<Offset>(count * sizeof(*from)), stream_.get());
  };
  send(part_.marks, made.data(), made.size());
  send(part_.tasks, some.tasks.data(), some.tasks.size());
  send(part_.inverses, some.inverses.data(), some.inverses.size());
  stream_.wait();
  part_.narrow_end = some.narrow_tasks;
  part_.end = static_cast<std::int64_t>(some.tasks.size());
  part_.inverse_count = static_cast<int>(some.inverses.size());
  part_.made.assign(made.begin(), made.end());
}

template <class T>
void DeviceSide<T>::enqueue_renewal() {
  const auto clear = [&](void* from, std::size_t bytes) {
    call("cudaMemsetAsync", [&] { return cudaMemsetAsync(from, 0, bytes, stream_.get()); });
  };
  clear(control_.data(), kCounters * sizeof(int));
  clear(marks_.data(), static_cast<std::size_t>(marks_.bytes()));
  const FactorRenewal<T> job{fronts_.data(),
                             context_.plan.fronts(),
                             part_.marks.data(),
                             parts(),
                             context_.tables.flags,
                             flag_data_,
                             state_.finished,
                             control_.data(),
                             context_.kind == Kind::ldlt ? pivots_ : nullptr,
                             static_cast<Index>(n()),
                             self_};
  call("launch of the kernel that opens fronts again", [&] { return launch_renewal(job, stream_.get()); });
}

template <class T>
void DeviceSide<T>::enqueue_part() {
  FactorState<T> state = state_;
  state.tasks = part_.tasks.data();
  launch_tasks(state, part_.narrow_end, part_.end);
  call("launch of the kernel that joins inverses",
       [&] { return launch_block_inverses(state, part_.inverses.data(), part_.inverse_count, stream_.get()); });
}

// Elements of the arena beyond the plan's, where all else that is to come leaves so much.
template <class T>
Offset DeviceSide<T>::room_for_changes() const {
  const plan::Plan& plan = context_.plan;
  if (!plan.options.keep_contributions || context_.tables.lists.size() > 1) return 0;
  const Offset more = plan::elements_with_room(plan.memory) - context_.tables.regions[0];
  const Offset others = needed_ + needed_ / 4;  // vectors and the linear system, too
  return more * static_cast<Offset>(sizeof(T)) <= budget_.left() - others ? more : 0;
}

template <class T>
DeviceArray<T> DeviceSide<T>::leave_arena(std::vector<T>& pivots) {
  pivots.resize(static_cast<std::size_t>(pivot_.size()));
  copy_out(pivots.data(), pivot_.data(), pivot_.bytes());
  return std::move(top_);
}

// A flag is set where it is not zero, and nobody waits for the number of tasks of a front that is kept.
template <class T>
void DeviceSide<T>::go_on(const std::vector<T>& pivots) {
  copy_in(pivot_.data(), pivots.data(), pivot_.bytes());
  call("cudaMemsetAsync",
       [&] { return cudaMemsetAsync(control_.data(), 1, static_cast<std::size_t>(control_.bytes()), stream_.get()); });
}

template class DeviceSide<double>;
template class DeviceSide<float>;

}  // namespace espalier::device::cuda
