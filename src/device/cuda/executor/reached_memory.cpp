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

}  // namespace

// use(pointer): flags lie behind the counters.
template <class T>
template <class Use>
void ReachedMemory<T>::for_arrays(SideAddresses<T>& side, Use&& use) {
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

template <class T>
auto ReachedMemory<T>::record_of(SideAddresses<T> side, int device, bool exported) -> Record {
  Record record{};
  record.process = this_process();
  record.device = device;
  Array* next = record.arrays;
  for_arrays(side, [&](auto* pointer) {
    Array& array = *next++;
    array.address = reinterpret_cast<std::uint64_t>(pointer);
    if (pointer != nullptr && exported)
      call("cudaIpcGetMemHandle", [&] { return cudaIpcGetMemHandle(&array.handle, pointer); });
  });
  return record;
}

template <class T>
bool ReachedMemory<T>::is_near(int rank) const {
  return link_.machine_of(rank) == link_.machine_of(link_.rank());
}

// Kernels that wait for each other would not both find room.
template <class T>
void ReachedMemory<T>::expect_own_device(const Record& record, const Record& mine, int rank) const {
  if (rank != link_.rank() && record.process == mine.process && record.device == mine.device)
    throw Error(StatusCode::invalid_input,
                fmt::format("ranks {} and {} are threads of one process and share GPU {}: give each a GPU of its own",
                            link_.rank(), rank, mine.device));
}

template <class T>
void ReachedMemory<T>::open_from(const Record& record, const Record& mine, int rank) {
  SideAddresses<T>& side = sides_[static_cast<std::size_t>(rank)];
  const bool here = record.process == mine.process;
  if (here && rank != link_.rank()) enable_peer_access(static_cast<int>(record.device));
  const Array* next = record.arrays;
  for_arrays(side, [&](auto*& pointer) {
    const Array& array = *next++;
    void* opened = reinterpret_cast<void*>(array.address);
    if (!here && array.address != 0) {
      call("cudaIpcOpenMemHandle",
           [&] { return cudaIpcOpenMemHandle(&opened, array.handle, cudaIpcMemLazyEnablePeerAccess); });
      opened_.push_back(opened);
    }
    pointer = static_cast<std::remove_reference_t<decltype(pointer)>>(opened);
  });
}

template <class T>
void ReachedMemory<T>::open(const SideAddresses<T>& mine) {
  Record record{};
  bool alone = true;
  for (int r = 0; r < link_.size(); ++r) alone = alone && (r == link_.rank() || !is_near(r));
  link_.expect_all([&] { record = record_of(mine, device_, !alone); });
  const auto all = link_.all_gather_of(std::span<const Record>(&record, 1));
  link_.expect_all([&] {
    sides_.assign(all.size(), {});
    for (std::size_t r = 0; r < all.size(); ++r) {
      const int rank = static_cast<int>(r);
      try {
        expect_own_device(all[r].at(0), record, rank);
        if (is_near(rank)) open_from(all[r].at(0), record, rank);
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

template <class T>
void ReachedMemory<T>::close() noexcept {
  for (void* opened : opened_) (void)cudaIpcCloseMemHandle(opened);
  (void)cudaGetLastError();
  opened_.clear();
  sides_.clear();
}

template class ReachedMemory<double>;
template class ReachedMemory<float>;

}  // namespace espalier::device::cuda
