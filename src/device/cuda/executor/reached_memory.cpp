#include "device/cuda/executor/reached_memory.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <random>

#include "device/cuda/runtime/device_memory.hpp"

namespace espalier::device::cuda {

namespace {

// Numbers of processes repeat where these live in containers.
std::uint64_t this_process() {
  static const std::uint64_t number = [] {
    std::random_device random;
    return (std::uint64_t{random()} << 32 | random()) ^ static_cast<std::uint64_t>(::getpid());
  }();
  return number;
}

void enable_peer_access(int device) {
  const auto e = attempt("cudaDeviceEnablePeerAccess", [&] { return cudaDeviceEnablePeerAccess(device, 0); });
  if (e == cudaErrorPeerAccessAlreadyEnabled)
    (void)cudaGetLastError();
  else
    check(e, "cudaDeviceEnablePeerAccess");
}

// use(pointer): flags lie behind the counters.
template <class T, class Use>
void for_arrays(SideAddresses<T>& side, Use&& use) {
  use(side.top);
  use(side.own);
  use(side.places);
  use(side.pivots);
  use(side.vectors);
  use(side.base);
  use(side.control);
  use(side.solve_control);
  side.flags = side.control + kCounters;
}

}  // namespace

auto OpenedArrays::record_of(void* array) const -> Array {
  Array record{this_process(), device_, reinterpret_cast<std::uint64_t>(array), {}};
  int near = 0;  // ranks that open it, with this one
  for (int r = 0; r < link_.size(); ++r) near += machines_.are_near(r, link_.rank()) ? 1 : 0;
  if (array != nullptr && near > 1)
    call("cudaIpcGetMemHandle", [&] { return cudaIpcGetMemHandle(&record.handle, array); });
  return record;
}

void* OpenedArrays::open_from(const Array& theirs, int rank) {
  auto* const address = reinterpret_cast<void*>(theirs.address);
  if (rank == link_.rank() || address == nullptr) return address;
  const bool here = theirs.process == this_process();
  if (here && theirs.device == device_)  // kernels that wait for each other would not both find room
    throw Error(StatusCode::invalid_input,
                fmt::format("ranks {} and {} are threads of one process and share GPU {}: give each a GPU of its own",
                            link_.rank(), rank, device_));
  if (!machines_.are_near(rank, link_.rank())) return nullptr;
  if (here) {
    enable_peer_access(static_cast<int>(theirs.device));
    return address;
  }
  void* opened = nullptr;
  call("cudaIpcOpenMemHandle",
       [&] { return cudaIpcOpenMemHandle(&opened, theirs.handle, cudaIpcMemLazyEnablePeerAccess); });
  opened_.push_back(opened);
  return opened;
}

void OpenedArrays::open(const std::vector<void*>& mine) {
  std::vector<Array> records;
  link_.expect_all([&] {
    for (void* array : mine) records.push_back(record_of(array));
  });
  const auto all = link_.all_gather_of(std::span<const Array>(records));
  link_.expect_all([&] {
    arrays_.assign(all.size(), {});
    for (std::size_t r = 0; r < all.size(); ++r) {
      const int rank = static_cast<int>(r);
      try {
        for (const Array& theirs : all[r]) arrays_[r].push_back(open_from(theirs, rank));
      } catch (const Error& e) {
        throw Error(
            e.status().code,
            fmt::format("{} does not reach the memory of {}: {}; GPUs of one machine must reach each other's "
                        "memory: else take every process for a machine of its own (--nodes process), use device cpu, "
                        "or one process for all GPUs",
                        link_.name_of(link_.rank()), link_.name_of(rank), e.what()));
      }
    }
  });
}

void OpenedArrays::close() noexcept {
  for (void* opened : opened_) (void)cudaIpcCloseMemHandle(opened);
  (void)cudaGetLastError();
  opened_.clear();
  arrays_.clear();
}

template <class T>
void ReachedMemory<T>::open(const SideAddresses<T>& mine) {
  std::vector<void*> arrays;
  SideAddresses<T> own = mine;
  for_arrays(own, [&](auto* pointer) { arrays.push_back(pointer); });
  opened_.open(arrays);
  sides_.assign(opened_.arrays().size(), {});
  for (std::size_t r = 0; r < sides_.size(); ++r) {
    auto next = opened_.arrays()[r].begin();
    for_arrays(sides_[r],
               [&](auto*& pointer) { pointer = static_cast<std::remove_reference_t<decltype(pointer)>>(*next++); });
  }
}

template <class T>
void ReachedMemory<T>::close() noexcept {
  opened_.close();
  sides_.clear();
}

template class ReachedMemory<double>;
template class ReachedMemory<float>;

}  // namespace espalier::device::cuda
