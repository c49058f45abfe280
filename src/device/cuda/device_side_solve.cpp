// What a side does for a solve.
#include "device/cuda/device_side.hpp"

#if ESPALIER_WITH_CUDA

namespace espalier::device::cuda {

template <class T>
bool DeviceSide<T>::take_solve_memory(Index at_once) {
  if (at_once_ == at_once) return false;
  const Offset below = common_.updates != nullptr ? 0 : static_cast<Offset>(context_.plan.relative.size());
  const Offset size = (2 * n() + below) * at_once;
  if (vectors_.size() < size) {
    at_once_ = 0;
    vectors_ = DeviceArray<T>();
    vectors_ = DeviceArray<T>(size, budget_, needed_);
  }
  at_once_ = at_once;
  return true;
}

template <class T>
SolveClear DeviceSide<T>::solve_clear(Index at_once) const {
  const Offset rows = 2 * n() + (common_.updates != nullptr ? 0 : static_cast<Offset>(context_.plan.relative.size()));
  return {solve_control_.data(), static_cast<int>(solve_control_.size()), reinterpret_cast<int*>(vectors_.data()),
          rows * at_once * static_cast<Offset>(sizeof(T) / sizeof(int))};
}

template <class T>
void DeviceSide<T>::enqueue_clear_solve(Index at_once) {
  const SolveClear clear = solve_clear(at_once);
  const auto fill = [&](int* from, Offset count, int byte) {
    call("cudaMemsetAsync",
         [&] { return cudaMemsetAsync(from, byte, static_cast<std::size_t>(count) * sizeof(int), stream_.get()); });
  };
  fill(clear.zeros, clear.zeros_count, 0);
  fill(clear.ones, clear.ones_count, 0xff);
}

template <class T>
void DeviceSide<T>::enqueue_solve(const std::vector<std::unique_ptr<DeviceSide>>& sides, const T* rhs, T* result,
                                  Index columns, Index first_column, bool transpose) {
  const bool many = at_once_ > 1, lu = context_.kind == Kind::lu;
  const TaskLists& l = lists();
  SolveState<T> s{};
  s.fronts = fronts_.data();
  s.up = up_.data();
  s.down = down_.data();
  s.up_tasks = static_cast<int>(l.up.size());
  s.down_tasks = static_cast<int>(l.down.size());
  s.small_up = static_cast<int>(l.small_up);
  s.small_down = static_cast<int>(l.small_down);
  s.links = links_.data();
  s.bounds = bounds_.data();
  s.relative = relative_.data();
  s.rows = rows_.data();
  s.base = base_.data();
  s.inverse_d = state_.inverse_d;
  s.inverse_e = state_.inverse_e;
  s.up_second = lu && transpose;
  s.down_second = lu && !transpose;
  s.rhs = rhs;
  s.result = result;
  s.columns = columns;
  s.forward = vectors_.data();
  s.updates = updates();
  s.solution = vectors_.data() + n() * at_once_;
  s.control = solve_control_.data();
  s.patience = state_.patience;
  s.devices = static_cast<int>(sides.size());
  s.self = self_;
  for (std::size_t d = 0; d < sides.size(); ++d) {
    s.peer_updates[d] = sides[d]->updates();
    s.peer_control[d] = common_.updates != nullptr ? solve_control_.data() : sides[d]->solve_control_.data();
  }
  call("launch of the solve kernel",
       [&] { return SolveKernel<T>::launch(many, solve_shape_[many ? 1 : 0], s, first_column, stream_.get()); });
}

template class DeviceSide<double>;
template class DeviceSide<float>;

}  // namespace espalier::device::cuda

#endif
