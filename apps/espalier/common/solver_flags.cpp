#include "common/solver_flags.hpp"

#include <CLI/CLI.hpp>

#include "solver/options/option_text.hpp"

namespace espalier::cli {

void SolverFlags::add_to(CLI::App& command) {
  const auto add = [&](const std::string& key, const char* type, const char* text) {
    command
        .add_option_function<std::string>(
            "--" + key, [this, key](const std::string& value) { values_[key] = value; }, text)
        ->type_name(type)
        ->group("Solver");
  };
  add("kind", "KIND", "auto (default) | llt | ldlt | lu");
  add("precision", "NAME",
      "fp64 (default) | fp32 | mixed: factor in FP32, refine to FP64 accuracy | auto: mixed where it pays");
  add("device", "NAME",
      "auto (default) | cpu | host:N | host:N,M (threads of each host device) | gpu:all | gpu:0,1 | "
      "reference (slow, to compare with)");
  add("device-memory", "SIZE", "memory budget of each device, for instance 2GiB (default: what is free)");
  add("host-memory", "SIZE", "memory budget on the host, for instance 512M (default: what is free)");
  add("pinned-memory", "SIZE",
      "of the host's memory that holds a factor out of core, what may be page-locked (default: half of the "
      "machine's)");
  add("scratch", "DIR", "folder for what of a factor does not fit in the host's memory (default: none)");
  add("machine", "KEY=VALUE,...",
      "rates by which devices and plans are chosen, for instance gpu.flops=2e13 (`espalier info` lists them)");
  add("threads", "N", "threads on the host (default: all cores)");
  add("singular", "WORD", "error (default) | report: a singular matrix gets rank, inertia and a factor");
  add("max-block-size", "B", "widest block column of a front (default: by the size of the front)");
}

Options SolverFlags::options() const {
  Options options;
  for (const auto& [key, value] : values_) {
    try {
      solver::set_option(options, key, value);
    } catch (const Error& error) {
      throw Error(error.status().code, std::string("--") + error.what());
    }
  }
  return options;
}

}  // namespace espalier::cli
