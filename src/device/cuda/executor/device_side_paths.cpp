// What a side does for a solve that passes some fronts alone.
#include <cstring>

#include "device/cuda/executor/device_side.hpp"
#include "device/cuda/kernels/path_kernels.hpp"
#include "device/cuda/tables/path_tasks.hpp"

namespace espalier::device::cuda {

namespace {

// Lists that go to the device together: each begins at a multiple of 16 bytes.
class Tables {
 public:
  template <class U>
  Offset add(std::span<const U> list) {
    const std::size_t begin = (bytes_.size() + 15) / 16 * 16;
    bytes_.resize(begin + list.size_bytes());
    if (!list.empty()) std::memcpy(bytes_.data() + begin, list.data(), list.size_bytes());
    return static_cast<Offset>(begin);
  }
  [[nodiscard]] const std::vector<std::byte>& bytes() const { return bytes_; }

 private:
  std::vector<std::byte> bytes_;
};

}  // namespace

template <class T>
void DeviceSide<T>::send_paths(const PathSolve<T>& solve) {
  const PathTasks tasks = tasks_on_paths(lists(), solve.paths);
  Tables tables;
  const auto add = [&](const auto& list) { return tables.add(std::span(list.data(), list.size())); };
  const Offset up = add(tasks.up), down = add(tasks.down), marks = add(tasks.marks), fronts = add(tasks.fronts);
  const Offset given = add(solve.given), wanted = add(solve.wanted);
  constexpr auto kLine = static_cast<Offset>(128 / sizeof(T));
  const auto sent = (static_cast<Offset>(tables.bytes().size()) + 127) / 128 * 128;
  const auto values = static_cast<Offset>(solve.given.size()) * solve.columns;
  const auto of_b = (values + kLine - 1) / kLine * kLine;
  const auto of_x = static_cast<Offset>(solve.wanted.size()) * solve.columns;
  const Offset bytes = sent + (of_b + of_x) * static_cast<Offset>(sizeof(T));
  if (path_memory_.size() < bytes) {
    stream_.wait();
    budget_.give_back(path_memory_.bytes());
    path_memory_ = DeviceArray<std::byte>();
    path_memory_ = DeviceArray<std::byte>(bytes, budget_, budget_.held() + bytes);
  }
  std::byte* const to = path_memory_.data();
  const auto place = [&](auto*& pointer, Offset begin) {
    pointer = reinterpret_cast<std::remove_reference_t<decltype(pointer)>>(to + begin);
  };
  place(paths_.up, up);
  place(paths_.down, down);
  place(paths_.marks, marks);
  place(paths_.fronts, fronts);
  place(paths_.given, given);
  place(paths_.wanted, wanted);
  place(paths_.b, sent);
  paths_.x = paths_.b + of_b;
  paths_.ups = static_cast<int>(tasks.up.size());
  paths_.downs = static_cast<int>(tasks.down.size());
  paths_.small_up = static_cast<int>(tasks.small_up);
  paths_.small_down = static_cast<int>(tasks.small_down);
  paths_.front_count = static_cast<int>(tasks.fronts.size());
  paths_.given_count = static_cast<Offset>(solve.given.size());
  copy_in(to, tables.bytes().data(), static_cast<Offset>(tables.bytes().size()));
  copy_in(paths_.b, solve.b, values * static_cast<Offset>(sizeof(T)));
}

template <class T>
void DeviceSide<T>::enqueue_path_begin(const SolvePass<T>& pass) {
  const bool first = pass.first_column == 0;
  PathBegin<T> job{};
  job.fronts = fronts_.data();
  job.passed = paths_.fronts;
  job.count = paths_.front_count;
  job.marks = paths_.marks;
  job.forward = vectors_at_;
  job.updates = updates(addresses(), pass.width);
  job.solution = vectors_at_ + n() * pass.width;
  job.pass = static_cast<int>(pass.width);
  job.rhs = first ? pass.result : nullptr;
  job.columns = pass.columns;
  job.control = solve_control_.data();
  job.control_size = kCounters;
  call("launch of the kernel before a solve on paths", [&] { return launch_path_begin(job, stream_.get()); });
  const RowCopy<T> given{pass.result, paths_.given, paths_.b, nullptr, paths_.given_count, pass.columns};
  if (first) call("launch of the copy of what is given", [&] { return launch_row_copy(given, stream_.get()); });
}

template <class T>
void DeviceSide<T>::fetch_wanted(const PathSolve<T>& solve, const T* result) {
  const auto count = static_cast<Offset>(solve.wanted.size());
  const RowCopy<T> wanted{paths_.x, nullptr, result, paths_.wanted, count, solve.columns};
  call("launch of the copy of what is wanted", [&] { return launch_row_copy(wanted, stream_.get()); });
  if (count == 0) return stream_.wait();
  copy_out(solve.x, paths_.x, count * solve.columns * static_cast<Offset>(sizeof(T)));
}

template class DeviceSide<double>;
template class DeviceSide<float>;

}  // namespace espalier::device::cuda
