/// \file
/// The limits of the machine, and the list of experiments.
#include <fmt/format.h>

#include "experiments/ceilings.hpp"
#include "experiments/experiments.hpp"

namespace espalier::bench {

void run_ceilings(Bench& bench) {
  bench.document()["ceilings"] = measure_ceilings({bench.plan().threads, 1.0});
  const auto& found = bench.document()["ceilings"];
  const auto& memory = found["memory"];
  bench.print(fmt::format("matrix product, FP64, {}: {:.1f} GFLOP/s on one thread, {:.1f} on {}\n",
                          found["kernels"].get<std::string>(),
                          found["gemm_flops_per_second_one_thread"].get<double>() * 1e-9,
                          found["gemm_flops_per_second"].get<double>() * 1e-9, bench.plan().threads));
  bench.print(fmt::format("memory: read {:.1f} GB/s, triad {:.1f} GB/s\n",
                          memory["read_bytes_per_second"]["best"].get<double>() * 1e-9,
                          memory["triad_bytes_per_second"]["best"].get<double>() * 1e-9));
  for (const auto& gpu : found["gpus"]) bench.print(gpu.dump(1) + "\n");
  bench.save();
}

const std::vector<Experiment>& experiments() {
  static const std::vector<Experiment> all = {
      {"peers", "Every solver on the same systems in the same run", "", run_peers},
      {"block-size", "Time against the widest block column of a front", "widths (0: by the size of the front)",
       run_block_size},
      {"memory", "Time against the memory budget of a device", "budgets as shares of the need, such as 1,0.5,0.25",
       run_memory},
      {"scaling", "Time and idle share against the number of devices", "devices: host:1,1 host:2,1 gpu:0 gpu:0,1 ...",
       run_scaling},
      {"ablation", "What each idea of sharing work among devices brings", "devices: host:2,1 gpu:0,1 ...",
       run_ablation},
      {"refactor", "Latency of a Newton step from 1,000 unknowns up", "", run_refactor},
      {"growth", "Time and memory against n with fitted exponents", "", run_growth},
      {"ceilings", "Matrix product, memory and links of this machine", "", run_ceilings},
      {"overhead", "What the benchmark itself adds to what it times", "", run_overhead},
  };
  return all;
}

}  // namespace espalier::bench
