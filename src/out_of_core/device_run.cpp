#include "out_of_core/device_run.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include "base/timeline.hpp"
#include "out_of_core/store_uses.hpp"

namespace espalier::out_of_core {

namespace {

constexpr int kNoSlot = -1;

std::int64_t waits_for(const Operation& op, Queue q) { return op.waits[static_cast<std::size_t>(q)]; }

}  // namespace

template <class T>
DeviceRun<T>::DeviceRun(std::unique_ptr<OutOfCoreBackend<T>> backend, Index number, const OutOfCoreOptions& options,
                        QueueProgress& progress)
    : backend_(std::move(backend)),
      number_(number),
      options_(options),
      progress_(progress),
      in_crew_(options.copy_threads),
      out_crew_(options.copy_threads) {}

template <class T>
void DeviceRun<T>::prepare(const OutOfCorePlan& plan, const std::vector<OutOfCoreBackend<T>*>& peers) {
  plan_ = &plan;
  peers_ = &peers;
  backend_->prepare(plan, 2 * options_.slots, options_.slot_bytes);
  for (const Operation& op : plan.ops)
    (op.queue == Queue::in ? loads_ : op.queue == Queue::out ? stores_ : runs_).push_back(&op);
}

template <class T>
void DeviceRun<T>::begin(std::span<const T> values, T* store, const PinnedStore& pinned, DiskStore* disk,
                         const PartialRun& part) {
  disk_ = disk;
  part_ = &part;
  values_ = values;
  store_ = store;
  pinned_ = &pinned;
  in_seconds_ = out_seconds_ = 0;
  in_direct_ = out_direct_ = 0;
  on_the_way_.clear();
  slots_on_the_way_ = 0;
  backend_->keep(part.kept());
  backend_->begin(values);
}

template <class T>
device::OutOfCoreReport DeviceRun<T>::report(Offset budget_bytes) const {
  const auto steps =
      std::count_if(plan_->steps.begin(), plan_->steps.end(), [](const auto& s) { return !s.fronts.empty(); });
  return {budget_bytes,
          plan_->arena_bytes,
          plan_->bytes_in,
          plan_->bytes_out,
          plan_->link_seconds,
          plan_->predicted_seconds,
          in_seconds_,
          out_seconds_,
          static_cast<Index>(steps),
          static_cast<Index>(plan_->groups.size()),
          backend_->times(),
          plan_->store_elements * static_cast<Offset>(sizeof(T)),
          pinned_ != nullptr ? pinned_->pinned_bytes() : 0,
          in_direct_ + out_direct_};
}

// ---- what computes --------------------------------------------------------------------------------------------------

template <class T>
void DeviceRun<T>::run_all(base::Stage* stage, double share) {
  std::array<std::int64_t, kQueues> numbers{};
  if (part_->makes_all()) tell_disk(Queue::run, nullptr);
  for (const Operation* op : runs_) {
    if (!part_->makes_all()) tell_disk(Queue::run, op);
    if (options_.interruption != nullptr) options_.interruption->check();
    for (const Queue q : {Queue::in, Queue::out, Queue::run, Queue::second_run}) {
      const std::int64_t n = waits_for(*op, q);
      if (n == 0 || q == op->queue) continue;
      progress_.wait_asked(number_, q, n);
      backend_->wait_for_mark(op->queue, q, n);
    }
    if (part_->makes(*op, number_))
      backend_->run(*op);
    else
      bring(*op);
    const std::int64_t number = ++numbers[static_cast<std::size_t>(op->queue)];
    backend_->mark(op->queue, number);
    progress_.asked(number_, op->queue, number);
    if (stage != nullptr) stage->add_share(share / static_cast<double>(runs_.size()));
  }
  tell_disk(Queue::run, nullptr);
  progress_.wait_asked(number_, Queue::in, static_cast<std::int64_t>(loads_.size()));
  progress_.wait_done(number_, Queue::out, static_cast<std::int64_t>(stores_.size()));
  backend_->finish();
}

// ---- a store on disk ------------------------------------------------------------------------------------------------

template <class T>
void DeviceRun<T>::tell_disk(Queue queue, const Operation* op) {
  if (disk_ == nullptr) return;
  const int which = queue == Queue::in ? 0 : queue == Queue::out ? 1 : 2;
  disk_->at_step(kDiskQueues * static_cast<int>(number_) + which,
                 op == nullptr ? DiskStore::kEnd : step_of(*plan_, op, disk_->plan_steps()));
}

// In the place of an operation that is not made.
template <class T>
void DeviceRun<T>::bring(const Operation& op) {
  for (const LeftContribution& left : part_->brought(op, number_))
    for (std::size_t part = 0; part < left.at.size(); ++part) {
      if (left.store[part] < 0) continue;
      const auto copy = [&](const std::byte* from, Offset done, Offset bytes) {
        backend_->bring(op.queue, left.at[part] + done, from, bytes);
      };
      if (disk_ != nullptr) {
        disk_->each_piece(left.store[part] * static_cast<Offset>(sizeof(T)), left.part_bytes, DiskStore::Access::read,
                          copy);
        continue;
      }
      HostExtents from;
      from.add(reinterpret_cast<std::byte*>(store_ + left.store[part]), left.part_bytes);
      by_pinned_block(from, [&](const std::byte* host, Offset done, Offset bytes) { copy(host, done, bytes); });
    }
}

// Makes a queue of copies wait for what computes.
template <class T>
template <class Meanwhile>
void DeviceRun<T>::wait_for_runs(const Operation& op, Meanwhile&& meanwhile) {
  for (const Queue lane : {Queue::run, Queue::second_run}) {
    const std::int64_t n = waits_for(op, lane);
    if (n == 0) continue;
    progress_.wait_asked(number_, lane, n, meanwhile);
    backend_->wait_for_mark(op.queue, lane, n);
  }
}

// What other devices store must have arrived; what they load must have been read, which only a load without the ring
// leaves open when it has been asked for.
template <class T>
template <class Meanwhile>
void DeviceRun<T>::wait_for_others(const Operation& op, Meanwhile&& meanwhile) {
  for (const QueueWait& w : op.others) {
    if (w.queue == Queue::out)
      progress_.wait_done(w.device, w.queue, w.number, meanwhile);
    else {
      progress_.wait_asked(w.device, w.queue, w.number, meanwhile);
      backend_->wait_for_mark(op.queue, *(*peers_)[static_cast<std::size_t>(w.device)], w.queue, w.number);
    }
  }
}

// ---- to the device --------------------------------------------------------------------------------------------------

template <class T>
void DeviceRun<T>::load_all() {
  std::int64_t number = 0;
  int slot = 0;
  for (const Operation* op : loads_) {
    ++number;
    const auto idle = [] { return false; };
    tell_disk(Queue::in, op);
    wait_for_others(*op, idle);
    wait_for_runs(*op, idle);
    if (const std::int64_t n = waits_for(*op, Queue::out); n > 0) progress_.wait_done(number_, Queue::out, n);
    if (part_->makes(*op, number_)) load(*op, slot);
    backend_->mark(Queue::in, number);
    progress_.asked(number_, Queue::in, number);
  }
  tell_disk(Queue::in, nullptr);
}

template <class T>
void DeviceRun<T>::load(const Operation& op, int& slot) {
  if (op.type == OperationType::load_values) return load_values(op, slot);
  for (int part = 0; part < parts_of(op); ++part) {
    extents_of(op, part, extents_);
    const Offset to = op.at[static_cast<std::size_t>(part)];
    if (op.type != OperationType::load_tables && goes_directly(extents_)) {
      load_directly(to);
      continue;
    }
    load_through_ring(to, extents_.bytes(), slot, [&](std::byte* staging, Offset done, Offset now) {
      extents_.copy_to(staging, done, now, in_crew_, op.type == OperationType::load_tables ? nullptr : disk_);
    });
  }
}

template <class T>
void DeviceRun<T>::load_values(const Operation& op, int& slot) {
  constexpr auto kSize = static_cast<Offset>(sizeof(T));
  gathered_.set(*backend_, *plan_, op);
  load_through_ring(op.at[0], op.bytes, slot, [&](std::byte* staging, Offset done, Offset now) {
    gathered_.gather<T>(values_, reinterpret_cast<T*>(staging), done / kSize, now / kSize, in_crew_);
  });
}

template <class T>
void DeviceRun<T>::load_directly(Offset to) {
  by_pinned_block(extents_, [&](const std::byte* host, Offset done, Offset now) {
    backend_->copy_in_direct(to + done, host, now);
  });
  in_direct_ += extents_.bytes();
}

// fill(staging memory, first byte, bytes) for every slot in turn.
template <class T>
template <class Fill>
void DeviceRun<T>::load_through_ring(Offset to, Offset bytes, int& slot, Fill&& fill) {
  for (Offset done = 0; done < bytes; done += options_.slot_bytes) {
    const Offset now = std::min(options_.slot_bytes, bytes - done);
    backend_->wait_for_slot(slot);
    const double start = base::now_seconds();
    fill(backend_->staging(slot), done, now);
    in_seconds_ += base::now_seconds() - start;
    backend_->copy_in(to + done, slot, now);
    slot = (slot + 1) % options_.slots;
  }
}

template <class T>
void DeviceRun<T>::extents_of(const Operation& op, int part, HostExtents& extents) {
  extents.clear();
  constexpr auto kSize = static_cast<Offset>(sizeof(T));
  std::byte* store = reinterpret_cast<std::byte*>(store_);
  const Offset host = op.host[static_cast<std::size_t>(part)];
  if (op.type == OperationType::load_tables) {
    const std::span<const std::byte> t = backend_->tables(op);
    extents.add(const_cast<std::byte*>(t.data()), static_cast<Offset>(t.size()));
  } else if (op.type == OperationType::load_slab) {
    std::vector<Extent> list;
    backend_->slab(op.front, op.begin, op.end, op.row, list);
    for (const Extent& p : list) extents.add(store + (host + p.at) * kSize, p.size * kSize);
  } else {
    extents.add(store + host * kSize, op.bytes / parts_of(op));
  }
}

// ---- without the ring ----------------------------------------------------------------------------------------------

// All of the extents lie in pinned memory, and they are large enough.
template <class T>
bool DeviceRun<T>::goes_directly(const HostExtents& extents) const {
  if (extents.count() == 0 || extents.bytes() / static_cast<Offset>(extents.count()) < options_.least_direct_bytes)
    return false;
  return extents.each([&](const std::byte* at, Offset, Offset bytes) { return pinned_->holds(at, bytes); });
}

// copy(host memory, bytes before it, bytes) for what lies within one block, which is pinned or not.
template <class T>
template <class Copy>
void DeviceRun<T>::by_pinned_block(const HostExtents& extents, Copy&& copy) const {
  extents.each([&](std::byte* at, Offset before, Offset bytes) {
    for (Offset done = 0; done < bytes;) {
      const Offset now = std::min(bytes - done, pinned_->left_in_block(at + done));
      copy(at + done, before + done, now);
      done += now;
    }
    return true;
  });
}

// ---- to the host ----------------------------------------------------------------------------------------------------

template <class T>
void DeviceRun<T>::store_all() {
  std::int64_t number = 0;
  int slot = 0;
  const auto receive_one = [&] { return receive(); };
  for (const Operation* op : stores_) {
    ++number;
    tell_disk(Queue::out, op);
    wait_for_others(*op, receive_one);
    wait_for_runs(*op, receive_one);
    if (const std::int64_t n = waits_for(*op, Queue::in); n > 0) {
      progress_.wait_asked(number_, Queue::in, n, receive_one);
      backend_->wait_for_mark(Queue::out, Queue::in, n);
    }
    if (part_->makes(*op, number_))
      send(*op, number, slot);
    else
      on_the_way_.push_back({kNoSlot, op, number, 0, 0, true});  // what is before it has to arrive first
    backend_->mark(Queue::out, number);
    progress_.asked(number_, Queue::out, number);
  }
  while (receive()) {
  }
  tell_disk(Queue::out, nullptr);
}

template <class T>
void DeviceRun<T>::send(const Operation& op, std::int64_t number, int& slot) {
  if (op.type != OperationType::store_outputs) {
    arrivals_of(op, arrivals_);
    if (goes_directly(arrivals_)) return send_directly(op, number);
  }
  send_through_ring(op, number, slot);
}

template <class T>
void DeviceRun<T>::send_directly(const Operation& op, std::int64_t number) {
  const Offset each = op.bytes / parts_of(op);
  by_pinned_block(arrivals_, [&](std::byte* host, Offset done, Offset now) {
    backend_->copy_out_direct(host, op.at[static_cast<std::size_t>(done / each)] + done % each, now);
  });
  out_direct_ += op.bytes;
  on_the_way_.push_back({kNoSlot, &op, number, 0, op.bytes, true});
}

template <class T>
void DeviceRun<T>::send_through_ring(const Operation& op, std::int64_t number, int& slot) {
  const int parts = parts_of(op);
  const Offset each = op.bytes / parts;
  for (int part = 0; part < parts; ++part)
    for (Offset done = 0; done < each; done += options_.slot_bytes) {
      while (slots_on_the_way_ == options_.slots) receive();
      const Offset now = std::min(options_.slot_bytes, each - done);
      const int at = options_.slots + slot;
      backend_->copy_out(at, op.at[static_cast<std::size_t>(part)] + done, now);
      on_the_way_.push_back({at, &op, number, part * each + done, now, part + 1 == parts && done + now == each});
      ++slots_on_the_way_;
      slot = (slot + 1) % options_.slots;
    }
}

// Where what an operation sends belongs.
template <class T>
void DeviceRun<T>::arrivals_of(const Operation& op, HostExtents& extents) {
  extents.clear();
  for (int part = 0; part < parts_of(op); ++part)
    extents.add(reinterpret_cast<std::byte*>(store_ + op.host[static_cast<std::size_t>(part)]),
                op.bytes / parts_of(op));
}

// The oldest arrival to its place. @returns false when there is none
template <class T>
bool DeviceRun<T>::receive() {
  if (on_the_way_.empty()) return false;
  const Arrival a = on_the_way_.front();
  on_the_way_.pop_front();
  if (a.slot == kNoSlot) {
    backend_->wait_until(Queue::out, a.number);
    if (a.op->type == OperationType::store_outputs) backend_->take_outputs(*a.op, {});
  } else {
    --slots_on_the_way_;
    backend_->wait_for_slot(a.slot);
    empty(a);
  }
  if (a.last) progress_.done(number_, Queue::out, a.number);
  return true;
}

template <class T>
void DeviceRun<T>::empty(const Arrival& a) {
  const std::byte* from = backend_->staging(a.slot);
  if (a.op->type == OperationType::store_outputs) {
    outputs_.resize(static_cast<std::size_t>(a.op->bytes));
    std::copy_n(from, a.size, outputs_.data() + a.begin);
    if (a.last) backend_->take_outputs(*a.op, outputs_);
    return;
  }
  arrivals_of(*a.op, received_);
  const double start = base::now_seconds();
  received_.copy_from(from, a.begin, a.size, out_crew_, disk_);
  out_seconds_ += base::now_seconds() - start;
}

#define ESPALIER_INSTANTIATE(T) template class DeviceRun<T>;
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::out_of_core
