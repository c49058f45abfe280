// In-core steps of an out-of-core plan.
#include <algorithm>

#include "out_of_core/programmers.hpp"

namespace espalier::out_of_core {

StepProgrammer::StepProgrammer(Program& program)
    : p_(program), chain_(static_cast<std::size_t>(program.plan.fronts()), 0) {}

bool StepProgrammer::leaves_step(Index f) const {
  const Index parent = p_.plan.tree.parent[f];
  return parent >= 0 && p_.unit_of(parent) != p_.unit && p_.plan.tree.rows_below(f) > 0;
}

// The whole contribution of a child in one place.
std::array<Offset, 2> StepProgrammer::bring_external(Index device, Index child, std::vector<Access>& loaded) {
  auto& list = p_.contributions[child];
  if (list.size() == 1 && list[0].resident && list[0].device == device) {
    ++list[0].pinned;
    p_.read_in_place(list[0]);
    return list[0].at;
  }
  const bool two = p_.contribution_parts == 2;
  const Offset bytes = Arena::round(p_.layout.sizes().contribution[child] * p_.element);
  const Offset at = p_.need(device, bytes * p_.contribution_parts);
  loaded.push_back({at, bytes * p_.contribution_parts, true});
  for (Segment& s : list) {
    if (!s.stored) p_.store_contribution(s);
    p_.release(s);
    const Offset from = p_.layout.contribution_offset(child, s.begin) * p_.element;
    p_.load_contribution(s, device, s.begin, s.end, {at + from, two ? at + bytes + from : -1});
  }
  return {at, two ? at + bytes : -1};
}

// Seconds of the longest chain of pivots that ends with front f.
double StepProgrammer::count_chain(Index f) {
  const Index parent = p_.plan.tree.parent[f];
  chain_[f] += p_.plan.layout[f].pivots * p_.rates.chain;
  if (parent >= 0 && p_.unit_of(parent) == p_.unit) chain_[parent] = std::max(chain_[parent], chain_[f]);
  return chain_[f];
}

void StepProgrammer::write() {
  const Index device = p_.units[static_cast<std::size_t>(p_.unit)].devices.front();
  InCoreStep& s = p_.plans[static_cast<std::size_t>(device)].steps[static_cast<std::size_t>(p_.unit)];
  std::vector<Access> loaded, touched;
  for (std::size_t k = 0; k < s.externals.size(); ++k)
    s.external_at[k] = bring_external(device, s.externals[k], loaded);
  const Offset values = p_.layout.copies_values() ? s.entries : 0;
  const Room room{p_.layout.table_bytes(s), values * p_.element, p_.layout.scratch_bytes(s),
                  s.memory.size * p_.element};
  const auto region = [&](Offset& at, Offset bytes, bool lasting, bool write) {
    at = p_.need(device, bytes, lasting);
    touched.push_back({at, bytes, write});
  };
  region(s.tables_at, room.tables, false, false);
  region(s.values_at, room.values, false, false);
  region(s.scratch_at, room.scratch, false, true);
  if (p_.stays()) {
    s.work_at = p_.need_first(device, room.work);
    touched.push_back({s.work_at, room.work, true});
  } else {
    region(s.work_at, room.work, false, true);
  }
  double flops = 0, longest = 0;
  for (std::size_t k = 0; k < s.fronts.size(); ++k) {
    const Index f = s.fronts[k];
    longest = std::max(longest, count_chain(f));
    flops += plan::front_flops(p_.plan.layout[f].pivots, p_.plan.layout[f].rows, p_.plan.options.unsymmetric);
    if (!leaves_step(f)) continue;
    const Offset bytes = Arena::round(p_.layout.sizes().contribution[f] * p_.element);
    region(s.root_at[k][0], bytes * p_.contribution_parts, true, true);
    if (p_.contribution_parts == 2) s.root_at[k][1] = s.root_at[k][0] + bytes;
  }
  for (const Access& a : loaded) touched.push_back({a.at, a.bytes, false});
  for (const Index child : s.externals)
    for (const Segment& g : p_.contributions[child])
      for (int k = 0; g.resident && k < p_.contribution_parts; ++k) touched.push_back({g.at[k], g.part_bytes, false});
  Operation op;
  op.unit = p_.unit;
  p_.load_inputs(device, op, s.tables_at, room.tables, s.values_at, values);
  op.type = OperationType::eliminate;
  p_.emit(device, op, touched, {}, flops, longest);
  finish(device, s, room, loaded);
}

// The step's factors, the first of its work array, stay where they are. @returns their bytes
Offset StepProgrammer::keep(Index device, const InCoreStep& s) {
  auto& places = p_.plans[static_cast<std::size_t>(device)].resident_at;
  for (std::size_t k = 0; k < s.fronts.size(); ++k) {
    auto& at = places[static_cast<std::size_t>(s.fronts[k])];
    at[0] = s.work_at + s.memory.factor[k] * p_.element;
    if (p_.plan.options.unsymmetric) at[1] = s.work_at + s.memory.factor2[k] * p_.element;
  }
  return Arena::round(s.memory.factor_size * p_.element);
}

void StepProgrammer::finish(Index device, InCoreStep& s, const Room& room, const std::vector<Access>& loaded) {
  Operation op;
  op.unit = p_.unit;
  p_.store_outputs(device, op, s.scratch_at, p_.layout.output_bytes(s));
  // Before the factors: others may wait for them.
  for (std::size_t k = 0; k < s.fronts.size(); ++k) {
    const Index f = s.fronts[k];
    if (s.root_at[k][0] < 0) continue;
    p_.add_contribution(f, device, 0, p_.plan.layout[f].tiles_below(), s.root_at[k],
                        Arena::round(p_.layout.sizes().contribution[f] * p_.element));
  }
  op.type = OperationType::store_factor;
  op.at[0] = s.work_at;
  op.host[0] = s.store_at;
  op.bytes = s.memory.factor_size * p_.element;
  const Offset kept = p_.stays() ? keep(device, s) : 0;
  if (kept == 0 && op.bytes > 0)
    p_.emit(device, op, std::array<Access, 1>{{{s.work_at, op.bytes, false}}},
            std::array<Access, 1>{{{s.store_at, s.memory.factor_size, true}}});
  p_.give_back(device, s.tables_at, room.tables);
  p_.give_back(device, s.values_at, room.values);
  p_.give_back(device, s.scratch_at, room.scratch);
  p_.give_back(device, s.work_at + kept, Arena::round(room.work) - kept);
  for (const Access& a : loaded) p_.give_back(device, a.at, a.bytes);
  for (const Index child : s.externals) p_.forget_contribution(child);
}

}  // namespace espalier::out_of_core
