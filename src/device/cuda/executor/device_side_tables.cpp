// How a side gets its tables.
#include "device/cuda/executor/device_side.hpp"

namespace espalier::device::cuda {

template <class T>
template <class U, class List>
void DeviceSide<T>::send(DeviceArray<U>& to, const List& from) {
  static_assert(sizeof(U) == sizeof(typename List::value_type));
  uploads_.copy(to.data(), from.data(), to.bytes(), stream_.get());
}

template <class T>
template <class Use>
void DeviceSide<T>::for_tables(Use&& use) {
  const auto& t = context_.tables;
  const auto& plan = context_.plan;
  use(&DeviceSide::fronts_, t.fronts);
  use(&DeviceSide::links_, t.links);
  use(&DeviceSide::bounds_, t.bounds);
  use(&DeviceSide::waits_, t.waits);
  use(&DeviceSide::relative_, plan.relative);
  use(&DeviceSide::rows_, plan.tree.rows);
  use(&DeviceSide::entry_ptr_, plan.entry_ptr);
  use(&DeviceSide::entries_, plan.entries);
}

template <class T>
void DeviceSide<T>::take_tables() {
  const auto take = [&](auto& array, std::size_t size) {
    array = std::remove_reference_t<decltype(array)>(static_cast<Offset>(size), budget_, needed_);
  };
  for_tables([&](auto DeviceSide::*array, const auto& list) { take(this->*array, list.size()); });
  take(tasks_, lists().tasks.size());
  take(stealable_end_, lists().stealable_end.size());
  take(up_, lists().up.size());
  take(down_, lists().down.size());
  take(inverses_, lists().inverses.size());
  take(place_table_, context_.tables.places.size());
  if (!context_.plan.options.keep_contributions) return;
  take(part_.marks, static_cast<std::size_t>(context_.plan.fronts()));
  take(part_.tasks, lists().tasks.size());
  take(part_.inverses, lists().inverses.size());
}

template <class T>
void DeviceSide<T>::send_lists() {
  send(tasks_, lists().tasks);
  send(stealable_end_, lists().stealable_end);
  send(up_, lists().up);
  send(down_, lists().down);
  send(inverses_, lists().inverses);
  stream_.wait();
}

template <class T>
void DeviceSide<T>::send_tables() {
  for_tables([&](auto DeviceSide::*array, const auto& list) { send(this->*array, list); });
  stream_.wait();  // other sides copy them
}

template <class T>
void DeviceSide<T>::copy_tables(const DeviceSide& from) {
  for_tables([&](auto DeviceSide::*array, const auto&) {
    call("cudaMemcpyAsync(tables)", [&] {
      return cudaMemcpyAsync((this->*array).data(), (from.*array).data(),
                             static_cast<std::size_t>((this->*array).bytes()), cudaMemcpyDefault, stream_.get());
    });
  });
  stream_.wait();
}

template <class T>
void DeviceSide<T>::take_chunks(const std::vector<std::uint32_t>& chunks) {
  chunks_ = DeviceArray<std::uint32_t>(static_cast<Offset>(chunks.size()), budget_, needed_);
  send(chunks_, chunks);
  stream_.wait();
}

template <class T>
void DeviceSide<T>::send_places(const std::vector<T*>& places) {
  send(place_table_, places);
}

template class DeviceSide<double>;
template class DeviceSide<float>;

}  // namespace espalier::device::cuda
