// The end of a program: the store, solves, and what is predicted.
#include <algorithm>
#include <utility>

#include "out_of_core/program.hpp"
#include "out_of_core/solve_shares.hpp"

namespace espalier::out_of_core {

namespace {

constexpr Index kSolveColumns = 8;  // right-hand sides that a pass over the factor takes

}  // namespace

// Contributions of the devices one after another behind the factors.
void Program::move_contributions() {
  std::vector<Offset> start;
  Offset at = factor_elements_;
  for (const DeviceState& s : states_) {
    start.push_back(at);
    at += s.host.peak() / element;
  }
  for (OutOfCorePlan& p : plans) {
    p.store_elements = at;
    const auto move = [&](std::array<Offset, 2>& parts) {
      for (Offset& host : parts)
        if (host >= 0) {
          const Offset place = host - factor_elements_;
          host = start[static_cast<std::size_t>(place / kDeviceApart)] + place % kDeviceApart;
        }
    };
    for (Operation& op : p.ops)
      if (op.type == OperationType::store_contribution || op.type == OperationType::load_contribution) move(op.host);
    for (LeftContribution& left : p.left) move(left.store);
  }
}

// What stays, what streams, and room for the tables and vectors of both where the factorization needs none any more.
void Program::plan_solve() {
  OutOfCorePlan& p = plans.front();
  for (Index f = 0; f < plan.fronts(); ++f)
    if (resident_[static_cast<std::size_t>(unit_of(f))] != 0) {
      p.resident.push_back(f);
      p.resident_bytes += layout.sizes().factor[f] * element * (plan.options.unsymmetric ? 2 : 1);
    }
  if (p.resident.empty()) return;
  // Zero-copy reads do not quite reach the rate of copies.
  constexpr double kOfCopies = 0.85;
  const double link = kOfCopies * rates.bytes_in;
  p.streamed = choose_streamed(layout, p.resident, link / (link + rates.host_solve));
  for (;; p.streamed.clear()) {
    std::vector<Index> both(p.resident.size() + p.streamed.size());
    std::merge(p.resident.begin(), p.resident.end(), p.streamed.begin(), p.streamed.end(), both.begin());
    for (const Index columns : {kSolveColumns, Index{1}}) {
      p.solve_columns = columns;
      p.solve_bytes = layout.solve_bytes(both, columns);
      p.solve_at = state(0).arena.take_first(p.solve_bytes);
      if (p.solve_at >= 0) return;
    }
    if (p.streamed.empty()) throw NoRoom{};
  }
}

// The host and the link side by side, then what stays; every number is read twice.
void Program::predict_solve() {
  OutOfCorePlan& p = plans.front();
  const double parts = plan.options.unsymmetric ? 2 : 1;  // of which a pass reads one
  Offset all = 0;
  for (Index f = 0; f < plan.fronts(); ++f) all += layout.sizes().factor[f] * element;
  Offset through_link = 0;
  for (const Index f : p.streamed) through_link += layout.sizes().factor[f] * element;
  const double resident = static_cast<double>(p.resident_bytes) / parts;
  const auto streamed = static_cast<double>(through_link);
  const double host = static_cast<double>(all) - resident - streamed;
  p.solve_seconds = 2 * (std::max(host / rates.host_solve, streamed / rates.bytes_in) + resident / rates.device_solve);
}

std::vector<OutOfCorePlan> Program::finish() {
  move_contributions();
  plan_solve();
  predict_solve();
  double bytes = 0, queues = 0;
  for (const OutOfCorePlan& p : plans) bytes += static_cast<double>(p.bytes_in + p.bytes_out);
  for (const DeviceState& s : states_)
    for (const double clock : s.clock) queues = std::max(queues, clock);
  const double memory = bytes / rates.host_bytes;
  const double seconds = std::max(queues, memory) + std::min(queues, memory) / 10;
  for (std::size_t d = 0; d < plans.size(); ++d) {
    OutOfCorePlan& p = plans[d];
    p.arena_bytes = states_[d].arena.peak();
    p.predicted_seconds = seconds;
    p.link_seconds =
        std::max(static_cast<double>(p.bytes_in) / rates.bytes_in, static_cast<double>(p.bytes_out) / rates.bytes_out);
  }
  return std::move(plans);
}

}  // namespace espalier::out_of_core
