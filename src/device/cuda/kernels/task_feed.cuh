/// \file
/// How a block of threads gets its tasks and tells that they are done, to its own device and to others.
#pragma once

#include "device/cuda/kernels/assemble.cuh"
#include "device/cuda/kernels/products.cuh"
#include "espalier/types.hpp"

namespace espalier::device::cuda {

/// Where tasks come from, in shared memory. A block takes its next task when it has finished the arithmetic of the one
/// before, so the unfinished task with the lowest number is never held up by another.
struct TaskFeed {
  FactorTask task;
  Front front;
  void* base;  ///< of the front's region
  int stop;
  int id;
  int first, end;
  int* counter;
  unsigned waited;  ///< nanoseconds that the task has waited so far
};

/// What a task works with.
template <class T>
struct Workshop {
  const FactorState<T>* state;
  Pipeline<T> pipe;  ///< pipe.stages is the area
  TaskFeed* feed;
  int n;
  T pair_sign = 0;  ///< see half_products.cuh; 0: the system has no pairs

  /// Start of the region in which the task's front lies.
  __device__ T* base() const { return static_cast<T*>(feed->base); }
};

/// Whether this device does the tasks of a stealable region; by one thread. The first block that asks finds out.
template <class T>
__device__ inline bool opened_here(const FactorState<T>& s, int region, unsigned owner) {
  const int k = region - s.first_stealable;
  int* opened = s.control + kOpened + k;
  int known = load_acquire(opened);
  if (known == 0 && atomicCAS(opened, 0, 3) == 0) {
    const bool mine = (owner >> s.peers.self & 1) != 0;
    const bool room = mine || atomicExch(s.control + kSlot, 1) == 0;
    const bool won = room && claim_devices(s.peers.control[0] + kClaims + k, s.peers.self + 1) == 0;
    if (room && !won && !mine) atomicExch(s.control + kSlot, 0);
    if (won) {
      T* base = mine ? s.peers.home[k] : s.spare;
      for (int d = 0; d < s.peers.count; ++d) store_pointer_devices(s.peers.base[d] + region, base);
      if (!mine) atomicAdd(s.control + kStolen, 1);
      fence_devices();
    }
    known = won ? 1 : 2;
    store_release(opened, known);
  }
  while (known == 0 || known == 3) {
    known = load_acquire(opened);
    if (aborted(s.control)) return false;
  }
  return known == 1;
}

/// One warp brings task `id` and its front.
template <class T>
__device__ inline void load_task(Workshop<T>& w, int id) {
  const FactorState<T>& s = *w.state;
  TaskFeed& feed = *w.feed;
  const int lane = static_cast<int>(threadIdx.x) & 31;
  FactorTask task;
  for (;;) {
    const bool ends = id >= feed.end || aborted(s.control);
    if (lane == 0) feed.stop = ends;
    if (ends) return;
    task = s.tasks[id];
    if (task.region < s.first_stealable) break;
    int here = 0;
    if (lane == 0) here = opened_here(s, task.region, s.fronts[task.front].members);
    if (__shfl_sync(0xffffffffu, here, 0) != 0) break;
    if (lane == 0) {  // all tasks of this sub-tree are another device's
      atomicMax(feed.counter, s.stealable_end[task.region - s.first_stealable] - feed.first);
      id = feed.first + atomicAdd(feed.counter, 1);
    }
    id = __shfl_sync(0xffffffffu, id, 0);
  }
  if (lane == 0) {
    feed.id = id;
    feed.task = task;
    feed.base = s.base[task.region];
  }
  const int* from = reinterpret_cast<const int*>(s.fronts + task.front);
  for (int x = lane; x < static_cast<int>(sizeof(Front) / sizeof(int)); x += 32)
    reinterpret_cast<int*>(&feed.front)[x] = from[x];
}

/// use(d) for every device d of the set; by all threads.
template <class Use>
__device__ inline void for_each_device(unsigned devices, Use&& use) {
  for (; devices != 0; devices &= devices - 1) use(__ffs(static_cast<int>(devices)) - 1);
}

/// The other devices that wait for what the task makes.
template <class T>
__device__ inline unsigned waiting_peers(const FactorState<T>& s, const Front& f, bool contribution) {
  if (s.peers.count == 1) return 0;
  return s.peers.others(contribution ? f.readers : f.region == 0 ? f.members : 0);
}

/// The other devices that need the pivots: all members in the top, the owner of a stolen sub-tree.
template <class T>
__device__ inline unsigned pivot_peers(const FactorState<T>& s, const Front& f) {
  return s.peers.count == 1 ? 0 : s.peers.others(f.members);
}

/// Sets flags when all threads have come here with their writes, first on this device, then, after push(d), at every
/// device d of `peers`.
/// @param second  a second flag stands so much further on; 0: there is none
/// @param finished  count of finished tasks to add one to; may be null
template <class T, class Push>
__device__ inline void set_flags(const FactorState<T>& s, std::int64_t flag, int part, std::int64_t second,
                                 unsigned peers, int* finished, Push&& push) {
  __syncthreads();
  if (threadIdx.x == 0) {
    if (s.peers.same_memory)
      fence_devices();
    else
      fence_device();
    store_relaxed(s.flags(part) + flag, 1);
    if (second != 0) store_relaxed(s.flags(part) + flag + second, 1);
    if (finished != nullptr) add_relaxed(finished, 1);
  }
  if (peers == 0) return;
  for_each_device(peers, push);
  fence_global();
  __syncthreads();
  if (threadIdx.x == 0) {
    fence_devices();
    for_each_device(peers, [&](int d) {
      int* own = s.peers.flag[d] + part * s.part_flags + flag;
      store_relaxed_devices(own, 1);
      if (second != 0) store_relaxed_devices(own + second, 1);
    });
  }
}

/// Makes the task's writes visible and sets its flags as set_flags(); meanwhile warp 1 fetches the next task.
template <class T, class Push>
__device__ void finish_task(Workshop<T>& w, int front, std::int64_t flag, int part, std::int64_t second, unsigned peers,
                            Push&& push) {
  fence_shared();
  fence_global();
  int id = 0;
  if (threadIdx.x == 32) id = w.feed->first + atomicAdd(w.feed->counter, 1);
  set_flags(*w.state, flag, part, second, peers, w.state->finished + front, push);
  if (threadIdx.x >= 32 && threadIdx.x < 64) load_task(w, __shfl_sync(0xffffffffu, id, 0));
}

/// Copies `count` elements, an even number, to the same place of the top on device d; by all threads.
template <class T>
__device__ inline void copy_to_peer(const FactorState<T>& s, int d, const T* from, std::int64_t count) {
  T* to = s.peers.top[d] + (from - s.peers.top[s.peers.self]);
  for (std::int64_t x = 2 * static_cast<int>(threadIdx.x); x < count; x += 2 * kThreads)
    *reinterpret_cast<PairOf<T>*>(to + x) = load_pair(from + x);
}

/// Pivots, and the inverse of D, of `count` positions from `position` on.
template <class T, Kind K>
__device__ inline void copy_pivots_to_peer(const FactorState<T>& s, int d, int position, int count, int n) {
  for (int x = threadIdx.x; x < count; x += kThreads)
    for (std::int64_t k = position + x; k < (K == Kind::ldlt ? 3 : 1) * static_cast<std::int64_t>(n); k += n)
      s.peers.pivot[d][k] = s.pivot[k];
}

/// Memory that this front takes over must no longer be read by those that had it before.
template <class T>
__device__ void wait_for_memory(const FactorState<T>& s, const Front& f) {
  for (int w = f.wait_begin + static_cast<int>(threadIdx.x); w < f.wait_end; w += kThreads)
    wait_for(s.finished + s.waits[w], s.fronts[s.waits[w]].tasks, s.control, s.patience);
  __syncthreads();
}

}  // namespace espalier::device::cuda
