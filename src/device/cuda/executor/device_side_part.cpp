// What a side does where some fronts are made again and the others stay.
#include <algorithm>

#include "device/cuda/executor/device_side.hpp"
#include "device/cuda/kernels/block_inverse.hpp"
#include "device/cuda/kernels/factor/factor_renewal.hpp"
#include "device/cuda/tables/made_tasks.hpp"

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
void DeviceSide<T>::enqueue_part() {
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
                             static_cast<Index>(n())};
  call("launch of the kernel that opens fronts again", [&] { return launch_renewal(job, stream_.get()); });
  FactorState<T> state = state_;
  state.tasks = part_.tasks.data();
  launch_tasks(state, part_.narrow_end, part_.end);
  call("launch of the kernel that joins inverses",
       [&] { return launch_block_inverses(state, part_.inverses.data(), part_.inverse_count, stream_.get()); });
}

template class DeviceSide<double>;
template class DeviceSide<float>;

}  // namespace espalier::device::cuda
