#include <fmt/format.h>

#include "base/timeline.hpp"
#include "device/cuda/tables/device_bytes.hpp"
#include "gpu/check_run.hpp"
#include "gpu/gpu_document.hpp"
#include "gpu/gpu_simulator.hpp"

namespace espalier::bench {
namespace {

/// Flops of the sub-trees of each device, and of the top, whose fronts are counted.
struct Shares {
  std::vector<double> alone;
  double top = 0;
  Index top_fronts = 0;
};

Shares shares_of(const GpuCase& c) {
  Shares s{std::vector<double>(static_cast<std::size_t>(c.devices), 0)};
  const auto& a = c.plan.ownership;
  for (Index f = 0; f < c.plan.fronts(); ++f) {
    const auto& l = c.plan.layout[f];
    const double flops = plan::front_flops(l.pivots, l.rows, c.kind == Kind::lu);
    if (a.subtree(f) >= 0) {
      s.alone[static_cast<std::size_t>(a.subtrees[static_cast<std::size_t>(a.subtree(f))].device)] += flops;
      continue;
    }
    ++s.top_fronts;
    s.top += flops;
  }
  return s;
}

void show_lists(const GpuCase& c, const device::cuda::DevicePlan& d, const Shares& shares) {
  for (std::size_t x = 0; x < d.lists.size(); ++x) {
    const auto& l = d.lists[x];
    fmt::print("    #{}: {} tasks ({} narrow), {} solve tasks, {:.1f} % of the work alone\n", x, l.tasks.size(),
               l.narrow_tasks, l.up.size() + l.down.size(), 100 * shares.alone[x] / c.plan.flops);
  }
}

/// What the memory of each device goes to. @returns the bytes of all
Offset show_memory(const GpuCase& c, const device::cuda::DevicePlan& d, Offset scalar) {
  Offset all = 0;
  for (int x = 0; x < c.devices; ++x) {
    const auto b = device::cuda::bytes_of(c.plan, c.kind, d, x, c.prepared.a.nonzeros(), scalar);
    const auto gigabytes = [](Offset bytes) { return 1e-9 * static_cast<double>(bytes); };
    fmt::print(
        "    #{}: {:.3f} GB: factor {:.3f} (without padding {:.3f}), contributions {:.3f}, values {:.3f}, their places "
        "{:.3f}, rows {:.3f}, fronts {:.3f}, tasks {:.3f}, flags {:.3f}, vectors {:.3f}\n",
        x, gigabytes(b.all()), gigabytes(b.factor), gigabytes(b.factor_entries), gigabytes(b.contributions),
        gigabytes(b.values), gigabytes(b.entries), gigabytes(b.rows), gigabytes(b.fronts), gigabytes(b.tasks),
        gigabytes(b.flags), gigabytes(b.vectors));
    all += b.all();
  }
  return all;
}

}  // namespace

nlohmann::json show_plan(const GpuCase& c, const CheckSettings& settings) {
  const double start = base::now_seconds();
  const auto d = device::cuda::make_device_plan(c.plan, c.kind);
  const double seconds = base::now_seconds() - start;
  const Shares shares = shares_of(c);
  fmt::print("{:<18} x{} {:<4} {} fronts, top {} with {:.1f} % of the work, {} sub-trees, plan {:.3f} + {:.3f} s\n",
             c.name, c.devices, name_of(c.kind), c.plan.fronts(), shares.top_fronts, 100 * shares.top / c.plan.flops,
             c.plan.ownership.subtrees.size(), c.plan_seconds, seconds);
  const double simulation = base::now_seconds();
  const SimulatedRun run = simulate(d, gpu_rates(plan::h200(), c.kind));
  double busy = 0;
  for (const double b : run.busy) busy += b / run.seconds / c.devices;
  fmt::print(
      "    simulated on H200: {:.3f} ms, {:.1f} TFLOP/s, busy {:.0f} %; model {:.3f} ms; simulation took {:.2f} s\n",
      1e3 * run.seconds, 1e-12 * c.plan.flops / run.seconds, 100 * busy,
      1e3 * plan::gpu_time(c.plan.tree, c.kind, false, plan::h200()).on(c.devices), base::now_seconds() - simulation);
  const Offset bytes = show_memory(c, d, settings.common.fp32 ? 4 : 8);
  if (settings.lists) show_lists(c, d, shares);
  nlohmann::json row = row_of_case(c, fmt::format("simulated on {} GPU{}", c.devices, c.devices == 1 ? "" : "s"),
                                   "Espalier, plan in virtual time");
  row["refactorization"] = measure::samples_record({{run.seconds}});
  row["memory"]["predicted_bytes"] = bytes;
  row["parameters"] = {{"devices", c.devices}, {"reuse_distance", c.plan.options.reuse_distance}};
  row["check"] = {{"busy", busy}};
  return row;
}

}  // namespace espalier::bench
