/// \file
/// `espalier info`: this build, this machine, the libraries, and the rate of the dense kernels.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "command.hpp"
#include "device/host/kernels.hpp"
#include "solver/build_info.hpp"
#include "terminal.hpp"

namespace espalier::cli {

namespace {

constexpr double kSeconds = 0.3;  // of measuring: enough for the clock of a core to settle

struct Machine {
  std::string processor;  ///< its name, "unknown" where /proc does not say
  int cores = 1;          ///< that this process may use
  std::int64_t memory_bytes = 0;
};

Machine this_machine() {
  Machine machine{"unknown", base::available_cores(), 0};
  std::ifstream file("/proc/cpuinfo");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("model name")) {
      machine.processor = line.substr(line.find(':') + 2);
      break;
    }
  }
  machine.memory_bytes = static_cast<std::int64_t>(sysconf(_SC_PHYS_PAGES)) * sysconf(_SC_PAGESIZE);
  return machine;
}

struct KernelRate {
  std::string target;           ///< instruction set
  double flops_per_second = 0;  ///< of the FP64 matrix product on one thread
};

nlohmann::ordered_json info_json(const solver::BuildInfo& build, const Machine& machine, const KernelRate& kernels) {
  nlohmann::ordered_json libraries;
  for (const auto& library : build.libraries) libraries[library.name] = library.version;
  return {
      {"version", build.version},
      {"build",
       {{"type", build.build_type},
        {"compiler", build.compiler},
        {"flags", build.flags},
        {"processor", build.processor},
        {"sanitizers", build.sanitizers},
        {"cuda", build.cuda}}},
      {"libraries", libraries},
      {"machine", {{"processor", machine.processor}, {"cores", machine.cores}, {"memory_bytes", machine.memory_bytes}}},
      {"kernels", {{"target", kernels.target}, {"gemm_flops_per_second", kernels.flops_per_second}}}};
}

std::string info_text(const solver::BuildInfo& build, const Machine& machine, const KernelRate& kernels) {
  std::string libraries;
  for (const auto& library : build.libraries) {
    libraries += fmt::format("{}{} {}", libraries.empty() ? "" : ", ", library.name, library.version);
  }
  Table table("<<");
  table.add({"build", fmt::format("{}, {}{}{}", build.build_type, build.compiler,
                                  build.sanitizers.empty() ? "" : ", sanitizers: ", build.sanitizers)});
  table.add({"flags", build.flags});
  table.add({"libraries", libraries});
  table.add({"processor", machine.processor});
  table.add({"host", fmt::format("{} {}, {}", machine.cores, machine.cores == 1 ? "core" : "cores",
                                 base::format_bytes(machine.memory_bytes))});
  table.add({"GPUs", build.cuda ? "CUDA backend compiled in" : "none: built without CUDA (-DESPALIER_CUDA=ON)"});
  table.add({"kernels", fmt::format("{}, matrix product in FP64: {} on one thread", kernels.target,
                                    rate(kernels.flops_per_second))});
  return toned(Tone::strong, "espalier " + build.version) + "\n" + table.text();
}

}  // namespace

void add_info(CLI::App& app, Action& action) {
  auto json = std::make_shared<bool>(false);
  CLI::App* sub = app.add_subcommand("info", "Show this build, devices, libraries and the speed of the kernels");
  sub->add_flag("--json", *json, "print it as JSON");
  sub->callback([json, &action] {
    action = [json] {
      const auto build = solver::build_info();
      const Machine machine = this_machine();
      const KernelRate kernels{device::host::kernels<double>().target, device::host::measure_gemm_rate(kSeconds)};
      if (*json) {
        fmt::print("{}\n", info_json(build, machine, kernels).dump(2));
      } else {
        fmt::print("{}", info_text(build, machine, kernels));
      }
      return kSolved;
    };
  });
}

}  // namespace espalier::cli
