/// \file
/// `espalier info`: this build, this machine, the libraries, the rate of the dense kernels, and the machine model.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/memory.hpp"
#include "base/thread_pool.hpp"
#include "command.hpp"
#include "common/terminal.hpp"
#include "device/host/kernels/kernels.hpp"
#include "device/registry.hpp"
#include "plan/machine_model.hpp"
#include "solver/session/build_info.hpp"

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

// All rates: {"host": {"name": ..., "rates": {"flops": {"value": ..., "unit": ..., "source": ...}}}, "gpu": ...}.
nlohmann::ordered_json model_json(plan::MachineModel model) {
  nlohmann::ordered_json rates;
  for (const plan::NamedRate& r : plan::rates_of(model))
    rates[r.key] = {{"value", r.rate->value}, {"unit", r.unit}, {"source", plan::name_of(r.rate->source)}};
  return {{"name", model.name}, {"rates", rates}};
}

// One line a rate; those by kind of factorization in one. The tasks of the kernels, which only the simulator of GPUs
// reads, are in the JSON.
void add_model(Table& table, const std::string& device, plan::MachineModel model) {
  const std::vector<plan::NamedRate> rates = plan::rates_of(model);
  const auto shown = [](const plan::NamedRate& r) { return fmt::format("{:g}", r.rate->value); };
  for (std::size_t k = 0; k < rates.size(); ++k) {
    const plan::NamedRate& r = rates[k];
    if (r.key.starts_with("kernels.")) continue;
    std::string key = r.key, value = shown(r), meaning = r.meaning;
    if (key.ends_with(".llt")) {
      key = key.substr(0, key.size() - 3) + "{llt,ldlt,lu}";
      value += ", " + shown(rates[k + 1]) + ", " + shown(rates[k + 2]);
      k += 2;
    }
    table.add({fmt::format("{}.{}", device, key), value, r.unit, std::string(plan::name_of(r.rate->source)), meaning});
  }
}

std::string machine_text(const plan::Machine& machine) {
  Table table("<<<<<");
  add_model(table, "host", machine.host);
  add_model(table, "gpu", machine.gpu);
  return fmt::format("machine model: host is {}, gpu is {}; --machine key=value,... changes it\n{}", machine.host.name,
                     machine.gpu.name, table.text());
}

/// How the Python package was made that holds this binary; empty where none does.
std::string package_origin() {
  std::ifstream file(std::filesystem::read_symlink("/proc/self/exe").parent_path() / "../origin.txt");
  std::string line;
  std::getline(file, line);
  return line;
}

nlohmann::ordered_json info_json(const solver::BuildInfo& build, const Machine& machine, const KernelRate& kernels,
                                 const plan::Machine& model) {
  nlohmann::ordered_json libraries;
  for (const auto& library : build.libraries) libraries[library.name] = library.version;
  return {
      {"version", build.version},
      {"package", package_origin()},
      {"build",
       {{"type", build.build_type},
        {"compiler", build.compiler},
        {"flags", build.flags},
        {"processor", build.processor},
        {"sanitizers", build.sanitizers},
        {"backends", build.backends}}},
      {"libraries", libraries},
      {"machine", {{"processor", machine.processor}, {"cores", machine.cores}, {"memory_bytes", machine.memory_bytes}}},
      {"kernels", {{"target", kernels.target}, {"gemm_flops_per_second", kernels.flops_per_second}}},
      {"machine_model", {{"host", model_json(model.host)}, {"gpu", model_json(model.gpu)}}}};
}

std::string info_text(const solver::BuildInfo& build, const Machine& machine, const KernelRate& kernels) {
  std::string libraries;
  for (const auto& library : build.libraries) {
    libraries += fmt::format("{}{} {}", libraries.empty() ? "" : ", ", library.name, library.version);
  }
  Table table("<<");
  if (const std::string package = package_origin(); !package.empty()) table.add({"package", package});
  table.add({"build", fmt::format("{}, {}{}{}", build.build_type, build.compiler,
                                  build.sanitizers.empty() ? "" : ", sanitizers: ", build.sanitizers)});
  table.add({"flags", build.flags});
  table.add({"libraries", libraries});
  table.add({"processor", machine.processor});
  table.add({"host", fmt::format("{} {}, {}", machine.cores, machine.cores == 1 ? "core" : "cores",
                                 base::format_bytes(machine.memory_bytes))});
  table.add({"backends", fmt::format("{}", fmt::join(build.backends, ", "))});
  for (const device::LeftOut& l : device::registry().left_out)
    table.add({"no " + std::string(l.name), std::string(l.reason)});
  table.add({"kernels", fmt::format("{}, matrix product in FP64: {} on one thread", kernels.target,
                                    rate(kernels.flops_per_second))});
  return toned(Tone::strong, "espalier " + build.version) + "\n" + table.text();
}

}  // namespace

void add_info(CLI::App& app, Action& action) {
  auto json = std::make_shared<bool>(false);
  auto overrides = std::make_shared<std::string>();
  CLI::App* sub =
      app.add_subcommand("info", "Show this build, devices, libraries, the speed of the kernels and the machine model");
  sub->add_flag("--json", *json, "print it as JSON");
  sub->add_option("--machine", *overrides, "rates that differ from the table, as for solve")
      ->type_name("KEY=VALUE,...");
  sub->callback([json, overrides, &action] {
    action = [json, overrides] {
      const plan::Machine model = plan::machine_with(*overrides);
      const auto build = solver::build_info();
      const Machine machine = this_machine();
      const KernelRate kernels{device::host::kernels<double>().target, device::host::measure_gemm_rate(kSeconds)};
      if (*json) {
        print_result("{}\n", info_json(build, machine, kernels, model).dump(2));
      } else {
        print_result("{}", info_text(build, machine, kernels) + machine_text(model));
      }
      return kSolved;
    };
  });
}

}  // namespace espalier::cli
