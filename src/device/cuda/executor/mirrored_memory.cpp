#include "device/cuda/executor/mirrored_memory.hpp"

#include <algorithm>
#include <utility>

namespace espalier::device::cuda {

CopyStreams::CopyStreams(std::size_t events) {
  for (std::size_t k = 0; k < events; ++k) add_event();
}

void CopyStreams::add_event() {
  events_.push_back(std::make_unique<Event>());
  free_.push_back(events_.size() - 1);
}

void CopyStreams::copy(Way way, const Rectangle& what) {
  if (what.row_bytes == 0 || what.rows == 0) return;
  const std::size_t pitch = what.rows > 1 ? what.pitch : what.row_bytes;
  call("cudaMemcpy2DAsync", [&] {
    return way == Way::to_host ? cudaMemcpy2DAsync(what.host, what.row_bytes, what.device, pitch, what.row_bytes,
                                                   what.rows, cudaMemcpyDeviceToHost, stream(way).get())
                               : cudaMemcpy2DAsync(what.device, pitch, what.host, what.row_bytes, what.row_bytes,
                                                   what.rows, cudaMemcpyHostToDevice, stream(way).get());
  });
}

void CopyStreams::pass_on(const PassedOn& what) {
  if (what.row_bytes == 0 || what.rows == 0) return;
  const auto queue = stream(Way::to_device).get();
  if (what.rows == 1)
    call("cudaMemcpyAsync(to another GPU)",
         [&] { return cudaMemcpyAsync(what.to, what.from, what.row_bytes, cudaMemcpyDefault, queue); });
  else
    call("cudaMemcpy2DAsync(to another GPU)", [&] {
      return cudaMemcpy2DAsync(what.to, what.pitch, what.from, what.pitch, what.row_bytes, what.rows, cudaMemcpyDefault,
                               queue);
    });
}

std::uint64_t CopyStreams::mark(Way way) {
  if (free_.empty()) add_event();
  const std::uint64_t mark = free_.back();
  events_[mark]->record(stream(way).get());
  free_.pop_back();
  return mark;
}

bool CopyStreams::is_done(std::uint64_t mark) {
  const auto e = cudaEventQuery(events_[mark]->get());
  if (e == cudaErrorNotReady) return false;
  check(e, "copies between this rank's GPU and its host");
  free_.push_back(mark);
  return true;
}

void CopyStreams::finish() noexcept {
  for (const Stream& s : streams_) (void)cudaStreamSynchronize(s.get());
  (void)cudaGetLastError();
  free_.clear();
  for (std::uint64_t k = 0; k < events_.size(); ++k) free_.push_back(k);
}

template <class T>
MirroredMemory<T>::MirroredMemory(ranks::Communicator& link, const ranks::Machines& machines, const plan::Plan& plan,
                                  Kind kind, const DevicePlan& tables, int device, DeviceBudget& budget)
    : rank_(link.rank()),
      n_(plan.tree.n),
      queues_(TileExchange<T>::kSlots),
      thread_(queues_, [device] { call("cudaSetDevice", [&] { return cudaSetDevice(device); }); }),
      exchange_(link, machines, plan, kind, tables, thread_),
      flags_((kind == Kind::lu ? 2 : 1) * tables.flags),
      control_(2 * kCounters),
      reached_(link, machines, device) {
  Offset blocks = 1;
  for (const Front& f : tables.fronts) blocks = std::max<Offset>(blocks, f.blocks);
  ones_ = PinnedArray<int>(blocks);
  std::fill(flags_.data(), flags_.data() + flags_.size(), 0);
  std::fill(control_.data(), control_.data() + control_.size(), 0);
  std::fill(ones_.data(), ones_.data() + ones_.size(), 1);
  memory_.mirror = flags_.data();
  memory_.control = control_.data();
  memory_.ones = ones_.data();
  memory_.aborted_at[0] = kCounters + 1;
  memory_.aborted_at[1] = kAborted;
  if (exchange_.mirrored_size() > 0) {
    const Offset size = whole_pages<T>(exchange_.mirrored_size());
    places_ = DeviceArray<T>(size, budget, budget.held() + size * static_cast<Offset>(sizeof(T)));
  }
  const std::size_t bytes = exchange_.slot_bytes();
  auto slots = std::make_shared<PinnedArray<std::byte>>(static_cast<Offset>(TileExchange<T>::kSlots * bytes));
  std::byte* const begin = slots->data();
  exchange_.use(std::make_shared<MessageSlots>(std::shared_ptr<std::byte[]>(std::move(slots), begin),
                                               TileExchange<T>::kSlots, bytes));
}

template <class T>
void MirroredMemory<T>::connect(std::vector<SideAddresses<T>>& sides) {
  const SideAddresses<T> mine = sides[static_cast<std::size_t>(rank_)];
  memory_.sides.assign(sides.size(), {});
  for (std::size_t r = 0; r < sides.size(); ++r) {
    SideAddresses<T>& s = sides[r];
    if ((exchange_.apart() >> r & 1) == 0) {
      memory_.sides[r] = {s.top, s.pivots, nullptr, s.places, static_cast<T*>(reached_.arrays()[r].front()), s.flags};
      continue;
    }
    s = mine;
    s.places = places_.data() + exchange_.mirrored_at(static_cast<int>(r));
    s.control = control_.data();
    s.flags = flags_.data();
    s.solve_control = control_.data() + kCounters;
  }
  exchange_.use(memory_);
}

template <class T>
void MirroredMemory<T>::begin_solve(const std::vector<SideAddresses<T>>& sides, Index pass) {
  for (std::size_t r = 0; r < sides.size(); ++r) memory_.sides[r].updates = sides[r].vectors + 2 * n_ * pass;
  exchange_.use(memory_);
  exchange_.begin_solve(pass);
}

template class MirroredMemory<double>;
template class MirroredMemory<float>;

}  // namespace espalier::device::cuda
