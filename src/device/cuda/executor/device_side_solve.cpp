// What a side does for a solve.
#include <algorithm>

#include "device/cuda/executor/device_side.hpp"
#include "device/cuda/tables/front_shape.hpp"

namespace espalier::device::cuda {

namespace {

// Beyond what is free of the arena, vectors of many right-hand sides may take a sixteenth of what the factorization
// holds, and small ones this much.
constexpr Offset kSolveShare = 16, kSolveBytes = Offset{256} << 20;

}  // namespace

template <class T>
Offset DeviceSide<T>::solve_rows() const {
  return 2 * n() + (common_.updates != nullptr ? 0 : static_cast<Offset>(context_.plan.relative.size()));
}

template <class T>
bool DeviceSide<T>::has_room_for(Index pass) const {
  const Offset size = solve_rows() * pass, bytes = size * static_cast<Offset>(sizeof(T));
  const Offset more = bytes - vectors_.bytes();
  if (size <= vectors_size_ || size <= idle_elements() - rhs_in_arena()) return true;
  if (bytes > std::max((budget_.held() - vectors_.bytes()) / kSolveShare, kSolveBytes)) return false;
  std::size_t free = 0, total = 0;
  call("cudaMemGetInfo", [&] { return cudaMemGetInfo(&free, &total); });
  return more <= std::min(budget_.left(), static_cast<Offset>(free));
}

template <class T>
bool DeviceSide<T>::take_solve_memory(Index pass) {
  const Offset size = solve_rows() * pass;
  if (vectors_size_ >= size) return false;
  budget_.give_back(vectors_.bytes());
  vectors_ = DeviceArray<T>();
  vectors_size_ = 0;
  if (size > idle_elements() - rhs_in_arena())
    vectors_ = DeviceArray<T>(context_.exported ? whole_pages<T>(size) : size, budget_, needed_);
  vectors_at_ = vectors_.size() > 0 ? vectors_.data() : top_.data() + context_.tables.kept;
  vectors_size_ = size;
  return true;
}

template <class T>
bool DeviceSide<T>::take_rhs(Offset elements) {
  if (rhs_size_ >= elements) return false;
  budget_.give_back(rhs_.bytes());
  rhs_ = DeviceArray<T>();
  rhs_size_ = 0;
  const Offset size = rounded(elements);  // whole lines of the cache
  if (size > idle_elements() - vectors_in_arena())
    rhs_ = DeviceArray<T>(size, budget_, budget_.held() + size * static_cast<Offset>(sizeof(T)));
  rhs_at_ = rhs_.size() > 0 ? rhs_.data() : top_.data() + (context_.tables.regions[0] - size);
  rhs_size_ = size;
  return true;
}

template <class T>
SolveClear DeviceSide<T>::solve_clear(Index pass) const {
  return {solve_control_.data(), kCounters, reinterpret_cast<int*>(vectors_at_),
          solve_rows() * pass * static_cast<Offset>(sizeof(T) / sizeof(int))};
}

template <class T>
void DeviceSide<T>::enqueue_clear_solve(Index pass) {
  const SolveClear clear = solve_clear(pass);
  const auto fill = [&](int* from, Offset count, int byte) {
    call("cudaMemsetAsync",
         [&] { return cudaMemsetAsync(from, byte, static_cast<std::size_t>(count) * sizeof(int), stream_.get()); });
  };
  fill(clear.zeros, clear.zeros_count, 0);
  fill(clear.ones, clear.ones_count, 0xff);
}

template <class T>
void DeviceSide<T>::enqueue_solve(const std::vector<SideAddresses<T>>& sides, const SolvePass<T>& pass) {
  const bool lu = context_.kind == Kind::lu;
  const TaskLists& l = lists();
  SolveState<T> s{};
  s.fronts = fronts_.data();
  s.up = up_.data();
  s.down = down_.data();
  s.up_tasks = static_cast<int>(l.up.size());
  s.down_tasks = static_cast<int>(l.down.size());
  s.small_up = static_cast<int>(l.small_up);
  s.small_down = static_cast<int>(l.small_down);
  if (pass.on_paths) {
    s.up = paths_.up;
    s.down = paths_.down;
    s.up_tasks = paths_.ups;
    s.down_tasks = paths_.downs;
    s.small_up = paths_.small_up;
    s.small_down = paths_.small_down;
    s.marks = paths_.marks;
  }
  s.links = links_.data();
  s.bounds = bounds_.data();
  s.relative = relative_.data();
  s.rows = rows_.data();
  s.base = base_.data();
  s.inverse_d = state_.inverse_d;
  s.inverse_e = state_.inverse_e;
  s.up_second = lu && pass.transpose;
  s.down_second = lu && !pass.transpose;
  s.up_triangular = context_.kind == Kind::llt || s.up_second;  // all others hold permutations, too
  s.down_triangular = context_.kind == Kind::llt || s.down_second;
  s.rhs = pass.rhs;
  s.result = pass.result;
  s.columns = pass.columns;
  s.pass = static_cast<int>(pass.width);
  s.first_column = static_cast<int>(pass.first_column);
  s.forward = vectors_at_;
  s.updates = updates(addresses(), pass.width);
  s.solution = vectors_at_ + n() * pass.width;
  s.control = solve_control_.data();
  s.patience = state_.patience;
  s.devices = static_cast<int>(sides.size());
  s.self = self_;
  for (std::size_t d = 0; d < sides.size(); ++d) {
    s.peer_updates[d] = updates(sides[d], pass.width);
    s.peer_control[d] = common_.updates != nullptr ? solve_control_.data() : sides[d].solve_control;
  }
  call("launch of the solve kernel", [&] { return SolveKernel<T>::launch(solve_shape_, s, stream_.get()); });
}

template class DeviceSide<double>;
template class DeviceSide<float>;

}  // namespace espalier::device::cuda
