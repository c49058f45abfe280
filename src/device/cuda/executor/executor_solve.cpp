#include <bit>

#include "device/cuda/executor/executor_on_devices.hpp"

namespace espalier::device::cuda {

template <class T>
void ExecutorOnDevices<T>::solve(T* x, Index columns, bool transpose) {
  const Offset count = static_cast<Offset>(plan_.tree.n) * columns;
  T* rhs = device_rhs(columns);
  to_device(rhs, x, count);
  solve_device(rhs, columns, transpose);
  from_device(x, rhs, count);
}

template <class T>
const Graph& ExecutorOnDevices<T>::solve_graph_of(T* x, Index columns, bool transpose, bool cleared) {
  return solve_graph({x, columns, transpose, 0, 0, at_once_, cleared}, first(), [&] {
    for (Index c = 0; c < columns; c += at_once_) {
      const Index pass = pass_width(columns - c);
      if (c > 0 || !cleared) first().enqueue_clear_solve(pass);
      first().enqueue_solve(addresses(), {x, x, columns, c, pass, transpose});
    }
  });
}

template <class T>
double ExecutorOnDevices<T>::solve_device(T* x, Index columns, bool transpose) {
  take_solve_memory(columns);
  if (several()) return solve_on_all(x, columns, transpose);
  const DeviceGuard guard(first().device());
  const Graph& graph = solve_graph_of(x, columns, transpose, false);
  const double seconds = first().stream().timed([&] { graph.launch(first().stream().get()); });
  first().enqueue_counters();
  first().stream().wait();
  if (first().solve_counters()[1] != 0) throw stalled("solve");
  return seconds;
}

template <class T>
bool ExecutorOnDevices<T>::solve_on_paths(const PathSolve<T>& solve) {
  if (several()) return false;
  const DeviceGuard guard(first().device());
  T* rhs = nullptr;
  try {
    rhs = device_rhs(solve.columns);
    take_solve_memory(solve.columns);
    first().send_paths(solve);
  } catch (const Error& e) {
    if (e.status().code != StatusCode::out_of_memory) throw;
    return false;
  }
  for (Index c = 0; c < solve.columns; c += at_once_) {
    const SolvePass<T> pass{rhs, rhs, solve.columns, c, pass_width(solve.columns - c), solve.transpose, true};
    first().enqueue_path_begin(pass);
    first().enqueue_solve(addresses(), pass);
  }
  first().enqueue_counters();
  first().fetch_wanted(solve, rhs);
  if (first().solve_counters()[1] != 0) throw stalled("solve");
  return true;
}

template <class T>
void ExecutorOnDevices<T>::enqueue_solve(T* x, Index columns, bool transpose) {
  if (several()) {
    solve_on_all(x, columns, transpose);
    return;
  }
  const DeviceGuard guard(first().device());
  solve_graph_of(x, columns, transpose, true).launch(first().stream().get());
}

template <class T>
T* ExecutorOnDevices<T>::device_rhs(Index columns) {
  const Offset count = static_cast<Offset>(plan_.tree.n) * columns;
  at(first(), [&] {
    if (first().take_rhs(count)) solve_graphs_.clear();
  });
  return first().rhs();
}

template <class T>
void ExecutorOnDevices<T>::take_solve_memory(Index columns) {
  Index most = columns > 1 ? std::min<Index>(kManyColumns, slabs(columns)) : 1;
  if (common_.updates != nullptr) most = std::min<Index>(most, kSlab);
  for (const auto& side : sides_)
    at(*side, [&] {
      while (most > kSlab && !side->has_room_for(most)) most -= kSlab;
    });
  if (at_once_ == most) return;
  at_once_ = 0;  // until all have it
  for (const auto& side : sides_)
    at(*side, [&] {
      side->stream().wait();
      if (side->take_solve_memory(most)) solve_graphs_.clear();
    });
  solve_clean_ = false;
  at_once_ = most;
}

template <class T>
template <class Record>
const Graph& ExecutorOnDevices<T>::solve_graph(const SolveKey& key, const Side& side, Record&& record) {
  const auto found = solve_graphs_.find(key);
  if (found != solve_graphs_.end()) return found->second;
  constexpr std::size_t kMostGraphs = 64;
  if (solve_graphs_.size() >= kMostGraphs) solve_graphs_.clear();
  return solve_graphs_.emplace(key, Graph::record(side.stream().get(), record)).first->second;
}

template <class T>
double ExecutorOnDevices<T>::solve_on_all(T* x, Index columns, bool transpose) {
  const Offset count = static_cast<Offset>(plan_.tree.n) * columns;
  side_rhs_.resize(sides_.size());
  std::vector<T> staged;
  for (const auto& side : sides_) {
    DeviceArray<T>& mine = side_rhs_[static_cast<std::size_t>(side->self())];
    if (mine.size() >= count) continue;
    at(*side, [&] {
      solve_graphs_.clear();
      side->budget().give_back(mine.bytes());
      mine = DeviceArray<T>();
      mine = DeviceArray<T>(count, side->budget(), side->held() + count * static_cast<Offset>(sizeof(T)));
    });
  }
  if (common_.updates != nullptr) stage_rhs(x, count);
  double seconds = 0;
  for (Index c = 0; c < columns; c += at_once_)
    seconds += run_on_all(
        solve_clean_, false,
        [&](Side& side) {
          T* mine = side_rhs_[static_cast<std::size_t>(side.self())].data();
          T* result = common_.updates != nullptr ? mine : x;
          solve_graph({x, columns, transpose, side.self(), c, at_once_, false}, side, [&] {
            if (c == 0 && common_.updates == nullptr)
              call("copy of right-hand sides",
                   [&] { return launch_copy(mine, static_cast<const T*>(x), count, side.stream().get()); });
            side.enqueue_solve(addresses(), {mine, result, columns, c, pass_width(columns - c), transpose});
            side.enqueue_counters();
          }).launch(side.stream().get());
        },
        [] {}, [&] { clear_solve(at_once_); });
  if (common_.updates != nullptr) collect_solution(x, columns);
  for (const auto& side : sides_)
    if (side->solve_counters()[1] != 0) throw stalled("solve");
  return seconds;
}

template <class T>
void ExecutorOnDevices<T>::stage_rhs(const T* x, Offset count) {
  std::vector<T> host(static_cast<std::size_t>(count));
  const Offset bytes = count * static_cast<Offset>(sizeof(T));
  at(first(), [&] { first().copy_out(host.data(), x, bytes); });
  for (const auto& side : sides_)
    at(*side, [&] { side->copy_in(side_rhs_[static_cast<std::size_t>(side->self())].data(), host.data(), bytes); });
}

template <class T>
void ExecutorOnDevices<T>::collect_solution(T* x, Index columns) {
  const auto count = static_cast<std::size_t>(plan_.tree.n) * static_cast<std::size_t>(columns);
  const auto bytes = static_cast<Offset>(count * sizeof(T));
  std::vector<T> all(count), part(count);
  for (const auto& side : sides_) {
    at(*side, [&] { side->copy_out(part.data(), side_rhs_[static_cast<std::size_t>(side->self())].data(), bytes); });
    for (Index f = 0; f < plan_.fronts(); ++f)
      if (std::countr_zero(tables_.fronts[f].members) == side->self())
        std::copy(part.begin() + static_cast<std::ptrdiff_t>(plan_.tree.first[f]) * columns,
                  part.begin() + static_cast<std::ptrdiff_t>(plan_.tree.first[f + 1]) * columns,
                  all.begin() + static_cast<std::ptrdiff_t>(plan_.tree.first[f]) * columns);
  }
  to_device(x, all.data(), static_cast<Offset>(count));
}

template class ExecutorOnDevices<double>;
template class ExecutorOnDevices<float>;

}  // namespace espalier::device::cuda
