#include "device/host/task_queues.hpp"

#include <algorithm>
#include <numeric>

namespace espalier::device::host {

TaskQueues::TaskQueues(const plan::Plan& plan)
    : devices_(static_cast<std::size_t>(plan.ownership.devices)),
      stealing_(plan.ownership.stealing),
      queues_(std::make_unique<Queue[]>(devices_)) {
  const plan::Ownership& a = plan.ownership;
  for (const plan::SubTree& s : a.subtrees) {
    queues_[static_cast<std::size_t>(s.device)].units.push_back(static_cast<std::uint32_t>(units_.size()));
    units_.push_back({s.first_task, s.end_task, s.seconds});
  }
  const auto tasks = static_cast<Index>(plan.tasks.size());
  if (devices_ > 1) {
    order_.resize(static_cast<std::size_t>(a.top_task));
    std::iota(order_.begin(), order_.end(), 0);
  }
  for (std::size_t d = 0; d < devices_; ++d) {
    RunOfTasks top{devices_ > 1 ? static_cast<Offset>(order_.size()) : 0, tasks, 0};
    if (devices_ > 1) {
      for (Index t = a.top_task; t < tasks; ++t)
        if (a.owner(plan.tasks[t].front, plan.tasks[t].j) == static_cast<Index>(d)) order_.push_back(t);
      top.end = static_cast<Offset>(order_.size());
    }
    queues_[d].top = static_cast<std::uint32_t>(units_.size());
    units_.push_back(top);
  }
  reset();
}

void TaskQueues::reset() {
  for (std::size_t d = 0; d < devices_; ++d) {
    Queue& q = queues_[d];
    q.cursor.store(std::uint64_t{kNone} << 32, std::memory_order_relaxed);
    q.first = 0;
    q.last = q.units.size();
    q.seconds = 0;
    for (const std::uint32_t u : q.units) q.seconds += units_[u].seconds;
    q.top_begun = false;
    q.stolen = 0;
  }
}

// The next unit of a device: its own, or the last of whoever has most left, or its part of the top.
std::uint32_t TaskQueues::open(Queue& queue) {
  if (queue.first < queue.last) {
    const std::uint32_t unit = queue.units[queue.first++];
    queue.seconds -= units_[unit].seconds;
    return unit;
  }
  if (queue.top_begun) return kNone;
  Queue* victim = nullptr;
  for (std::size_t d = 0; stealing_ && d < devices_; ++d)
    if (queues_[d].first < queues_[d].last && (victim == nullptr || queues_[d].seconds > victim->seconds))
      victim = &queues_[d];
  if (victim == nullptr) {
    queue.top_begun = true;
    return queue.top;
  }
  const std::uint32_t unit = victim->units[--victim->last];
  victim->seconds -= units_[unit].seconds;
  ++queue.stolen;
  return unit;
}

Offset TaskQueues::next(Index device) {
  Queue& queue = queues_[static_cast<std::size_t>(device)];
  const auto task = [this](Offset at) { return order_.empty() ? at : Offset{order_[static_cast<std::size_t>(at)]}; };
  for (;;) {
    const std::uint64_t now = queue.cursor.fetch_add(1, std::memory_order_relaxed);
    const auto unit = static_cast<std::uint32_t>(now >> 32);
    if (unit != kNone) {
      const Offset at = units_[unit].begin + static_cast<Offset>(now & 0xffffffff);
      if (at < units_[unit].end) return task(at);
    }
    const std::lock_guard lock(mutex_);
    if (queue.cursor.load(std::memory_order_relaxed) >> 32 != unit) continue;  // another worker has opened one
    const std::uint32_t opened = open(queue);
    if (opened == kNone) return -1;
    queue.cursor.store(std::uint64_t{opened} << 32 | 1, std::memory_order_relaxed);
    if (units_[opened].begin < units_[opened].end) return task(units_[opened].begin);
  }
}

}  // namespace espalier::device::host
