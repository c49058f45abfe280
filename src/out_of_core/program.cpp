#include "out_of_core/program.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace espalier::out_of_core {

namespace {

Index places(const OutOfCoreLayout& layout) { return layout.plan().fronts(); }

}  // namespace

Program::DeviceState::DeviceState(Offset budget, double its_speed, bool around)
    : arena(budget, around), host(kDeviceApart / 16), speed(its_speed) {}

Program::Program(const OutOfCoreLayout& the_layout, const std::vector<Unit>& the_units,
                 const std::vector<InCoreStep>& steps, const std::vector<OutOfCoreDevice>& devices,
                 const PlanParameters& the_shape, const PlanningRates& the_rates, base::ThreadPool* pool)
    : layout(the_layout),
      plan(the_layout.plan()),
      units(the_units),
      shape(the_shape),
      rates(the_rates),
      element(the_layout.element_bytes()),
      contribution_parts(plan.options.unsymmetric ? 2 : 1),
      factor_parts(plan.options.unsymmetric || plan.options.ldlt ? 2 : 1),
      plans(devices.size()),
      contributions(static_cast<std::size_t>(places(the_layout))),
      store_touches_(static_cast<int>(devices.size() * kQueues)),
      unit_of_(static_cast<std::size_t>(places(the_layout)), -1) {
  for (std::size_t d = 0; d < devices.size(); ++d) {
    states_.emplace_back(devices[d].budget_bytes, devices[d].speed, shape.around);
    plans[d].lanes = shape.lanes;
    plans[d].steps.resize(units.size());
    plans[d].shared_at = need(static_cast<Index>(d), Arena::kAlignment, true);
  }
  for (std::size_t u = 0; u < units.size(); ++u) {
    for (const Index f : units[u].fronts) unit_of_[f] = static_cast<Index>(u);
    if (units[u].large >= 0) unit_of_[units[u].large] = static_cast<Index>(u);
  }
  for_each_unit(units.size(), pool, [&](std::size_t u) {  // copies of a hundred megabytes for each candidate
    if (units[u].large < 0) plans[static_cast<std::size_t>(units[u].devices.front())].steps[u] = steps[u];
  });
  choose_residents();
  lay_out_store();
}

// Bytes of the factors of a unit, as a solve needs them.
Offset Program::resident_bytes(std::size_t of_unit) const {
  if (const Index f = units[of_unit].large; f >= 0)
    return Arena::round(layout.sizes().factor[f] * element) * (plan.options.unsymmetric ? 2 : 1);
  return Arena::round(plans.front().steps[of_unit].memory.factor_size * element);
}

// The units that are eliminated last: all above them is among them, and they take room when little else does.
void Program::choose_residents() {
  resident_.assign(units.size(), 0);
  if (plans.size() > 1) return;
  auto left = static_cast<Offset>(shape.resident * static_cast<double>(arena_bytes(0)));
  for (std::size_t u = units.size(); u-- > 0;) {
    left -= resident_bytes(u);
    if (left < 0) return;
    resident_[u] = 1;
  }
}

// Factors first, in the order of the units; contributions come and go behind them.
void Program::lay_out_store() {
  std::vector<Offset> first(contributions.size(), -1), second(contributions.size(), -1);
  Offset at = 0;
  for (std::size_t u = 0; u < units.size(); ++u) {
    if (resident_[u] != 0) continue;
    if (const Index f = units[u].large; f >= 0) {
      for (int k = 0; k < factor_parts; ++k, at += layout.sizes().factor[f]) (k == 0 ? first : second)[f] = at;
      continue;
    }
    InCoreStep& s = plans[static_cast<std::size_t>(units[u].devices.front())].steps[u];
    s.store_at = at;
    for (std::size_t k = 0; k < s.fronts.size(); ++k) {
      first[s.fronts[k]] = at + s.memory.factor[k];
      if (plan.options.unsymmetric) second[s.fronts[k]] = at + s.memory.factor2[k];
    }
    at += s.memory.factor_size;
  }
  constexpr Offset kLine = 64;  // elements
  factor_elements_ = (at + kLine - 1) / kLine * kLine;
  for (OutOfCorePlan& p : plans) {
    p.factor_store = first;
    p.factor2_store = second;
    p.factor_elements = factor_elements_;
    p.resident_at.assign(contributions.size(), {-1, -1});
  }
}

// ---- operations -----------------------------------------------------------------------------------------------------

Queue Program::queue_for(OperationType type) const {
  switch (type) {
    case OperationType::load_tables:
    case OperationType::load_values:
    case OperationType::load_slab:
    case OperationType::load_contribution:
      return Queue::in;
    case OperationType::store_factor:
    case OperationType::store_contribution:
    case OperationType::store_outputs:
      return Queue::out;
    default:
      return shape.lanes == 2 && unit % 2 == 1 ? Queue::second_run : Queue::run;
  }
}

double Program::seconds_of(const DeviceState& s, const Operation& op, double flops, double chain) const {
  if (op.queue == Queue::in) return rates.copy_start + static_cast<double>(op.bytes) / rates.bytes_in;
  if (op.queue == Queue::out) return rates.copy_start + static_cast<double>(op.bytes) / rates.bytes_out;
  const double work = flops / (rates.flops * s.speed);
  if (op.type != OperationType::eliminate) return rates.start + work + chain;
  // Among the fronts of a step, some have work while another's pivots wait for one another.
  const bool half = shape.lanes == 2;  // of the machine
  return rates.start + (half ? std::max(chain, 2 * work) : std::max(work, chain) + std::min(work, chain) / 2);
}

double Program::begin_of(Index device, const Operation& op, std::size_t queue) const {
  const DeviceState& s = state(device);
  double begin = s.clock[queue];
  const auto after = [&](const DeviceState& of, std::size_t q, std::int64_t number) {
    if (number > 0) begin = std::max(begin, of.finished[q][static_cast<std::size_t>(number - 1)]);
  };
  for (std::size_t q = 0; q < kQueues; ++q)
    if (q != queue) after(s, q, op.waits[q]);
  for (const QueueWait& w : op.others) after(state(w.device), static_cast<std::size_t>(w.queue), w.number);
  return begin;
}

void Program::wait_in_store(Index device, Operation& op, int queue, std::span<const Access> store) {
  std::vector<std::int64_t> waits(states_.size() * kQueues, 0);
  const int first = static_cast<int>(device) * static_cast<int>(kQueues);
  for (const Access& a : store)
    if (a.at >= 0)
      store_touches_.touch(a.at, a.bytes, first + queue, state(device).count[static_cast<std::size_t>(queue)], a.write,
                           waits);
  for (std::size_t k = 0; k < waits.size(); ++k) {
    if (waits[k] == 0) continue;
    const auto other = static_cast<Index>(k / kQueues);
    const std::size_t q = k % kQueues;
    if (other == device)
      op.waits[q] = std::max(op.waits[q], waits[k]);
    else
      op.others.push_back({other, static_cast<Queue>(q), waits[k]});
  }
}

void Program::emit(Index device, Operation op, std::span<const Access> touched, std::span<const Access> store,
                   double flops, double chain) {
  DeviceState& s = state(device);
  op.queue = queue_for(op.type);
  const auto q = static_cast<std::size_t>(op.queue);
  const std::int64_t number = ++s.count[q];
  for (const Access& a : touched)
    if (a.at >= 0 && a.bytes > 0)
      s.touches.touch(a.at, Arena::round(a.bytes), static_cast<int>(q), number, a.write, op.waits);
  wait_in_store(device, op, static_cast<int>(q), store);
  s.clock[q] = begin_of(device, op, q) + seconds_of(s, op, flops, chain);
  s.finished[q].push_back(s.clock[q]);
  OutOfCorePlan& p = plans[static_cast<std::size_t>(device)];
  if (op.queue == Queue::in) p.bytes_in += op.bytes;
  if (op.queue == Queue::out) p.bytes_out += op.bytes;
  p.ops.push_back(std::move(op));
}

double Program::free_at(Index device) const {
  const auto& clock = state(device).clock;
  return std::max(clock[static_cast<std::size_t>(Queue::run)], clock[static_cast<std::size_t>(Queue::second_run)]);
}

// ---- memory ---------------------------------------------------------------------------------------------------------

Offset Program::take(Index device, Offset bytes, bool lasting) {
  Arena& arena = state(device).arena;
  for (;;) {
    const Offset at = lasting ? arena.take_lasting(bytes) : arena.take_passing(bytes);
    if (at >= 0) return at;
    if (!evict_one(device)) return -1;
  }
}

Offset Program::need(Index device, Offset bytes, bool lasting) {
  const Offset at = take(device, bytes, lasting);
  if (at < 0) throw NoRoom{};
  return at;
}

Offset Program::need_first(Index device, Offset bytes) {
  for (;;) {
    const Offset at = state(device).arena.take_first(bytes);
    if (at >= 0) return at;
    if (!evict_one(device)) throw NoRoom{};
  }
}

// Sends away what is needed last. @returns false when nothing can go
bool Program::evict_one(Index device) {
  Segment* worst = nullptr;
  const auto ask = [&](Segment& s) {
    if (!s.resident || s.device != device || s.pinned > 0) return;
    if (worst == nullptr || s.next_unit > worst->next_unit) worst = &s;
  };
  for (const Index f : held_)
    for (Segment& s : contributions[f]) ask(s);
  for (Segment& s : factors) ask(s);
  if (worst == nullptr) return false;
  if (!worst->stored) store_contribution(*worst);
  release(*worst);
  return true;
}

void Program::release(Segment& s) {
  if (!s.resident) return;
  for (int k = 0; k < (s.factor ? factor_parts : contribution_parts); ++k) give_back(s.device, s.at[k], s.part_bytes);
  s.resident = false;
}

// ---- contributions --------------------------------------------------------------------------------------------------

void Program::store_contribution(Segment& s) {
  const bool two = contribution_parts == 2;
  const Offset start = factor_elements_ + s.device * kDeviceApart;
  for (int k = 0; k < contribution_parts; ++k)
    s.host[k] = start + state(s.device).host.take_lowest(s.part_bytes) / element;
  Operation op;
  op.type = OperationType::store_contribution;
  op.front = s.front;
  op.begin = s.begin;
  op.end = s.end;
  op.at = s.at;
  op.host = s.host;
  op.bytes = s.part_bytes * contribution_parts;
  const Offset elements = s.part_bytes / element;
  emit(s.device, op, std::array<Access, 2>{{{s.at[0], s.part_bytes, false}, {two ? s.at[1] : -1, s.part_bytes, false}}},
       std::array<Access, 2>{{{s.host[0], elements, true}, {s.host[1], elements, true}}});
  s.stored = true;
}

void Program::load_contribution(const Segment& s, Index device, Index begin, Index end,
                                const std::array<Offset, 2>& at) {
  const bool two = contribution_parts == 2;
  const Offset skip = contribution_bytes(s.front, s.begin, begin) / element;
  const Offset bytes = contribution_bytes(s.front, begin, end);
  Operation op;
  op.type = OperationType::load_contribution;
  op.front = s.front;
  op.begin = begin;
  op.end = end;
  op.at = at;
  for (int k = 0; k < contribution_parts; ++k) op.host[k] = s.host[k] + skip;
  op.bytes = bytes * contribution_parts;
  emit(device, op, std::array<Access, 2>{{{at[0], bytes, true}, {two ? at[1] : -1, bytes, true}}},
       std::array<Access, 2>{{{op.host[0], bytes / element, false}, {two ? op.host[1] : -1, bytes / element, false}}});
}

void Program::add_contribution(Index f, Index device, Index begin, Index end, const std::array<Offset, 2>& at,
                               Offset bytes) {
  Segment s;
  s.front = f;
  s.device = device;
  s.begin = begin;
  s.end = end;
  s.at = at;
  s.part_bytes = bytes;
  s.next_unit = unit_of(plan.tree.parent[f]);
  if (contributions[f].empty()) held_.push_back(f);
  contributions[f].push_back(s);
  Segment& mine = contributions[f].back();
  const std::vector<Index>& readers = units[static_cast<std::size_t>(s.next_unit)].devices;
  const bool read_elsewhere = readers.size() > 1 || readers.front() != device;
  if (shape.frugal || read_elsewhere || rates.keep_contributions) store_contribution(mine);
  if (rates.keep_contributions) leave(mine);
  if (shape.frugal) release(mine);
}

// The segment was made by the last operation that computes.
void Program::leave(Segment& s) {
  OutOfCorePlan& p = plans[static_cast<std::size_t>(s.device)];
  std::size_t made = p.ops.size();
  do --made;
  while (p.ops[made].queue == Queue::in || p.ops[made].queue == Queue::out);
  s.left = static_cast<Index>(p.left.size());
  p.left.push_back({s.front, made, s.at, s.host, s.part_bytes, false});
}

void Program::forget(Segment& s) {
  release(s);
  if (s.stored && !rates.keep_contributions)
    for (int k = 0; k < contribution_parts; ++k)
      state(s.device).host.give_back((s.host[k] - factor_elements_ - s.device * kDeviceApart) * element, s.part_bytes);
  s.stored = false;
  s.begin = s.end;
}

void Program::forget_contribution(Index f) {
  for (Segment& s : contributions[f]) forget(s);
  contributions[f].clear();
  std::erase(held_, f);
}

// ---- units ----------------------------------------------------------------------------------------------------------

void Program::load_inputs(Index device, const Operation& of, Offset tables_at, Offset tables, Offset values_at,
                          Offset entries) {
  Operation op = of;
  const auto load = [&](OperationType type, Offset at, Offset bytes) {
    op.type = type;
    op.at[0] = at;
    op.bytes = bytes;
    if (bytes > 0) emit(device, op, std::array<Access, 1>{{{at, bytes, true}}});
  };
  load(OperationType::load_tables, tables_at, tables);
  load(OperationType::load_values, values_at, entries * element);
}

void Program::store_outputs(Index device, const Operation& of, Offset scratch_at, Offset bytes) {
  Operation op = of;
  op.type = OperationType::store_outputs;
  op.at[0] = scratch_at;
  op.bytes = bytes;
  if (bytes > 0) emit(device, op, std::array<Access, 1>{{{scratch_at, bytes, false}}});
}

}  // namespace espalier::out_of_core
