#include "gpu/gpu_document.hpp"

#include <CLI/CLI.hpp>

#include "solver/session/build_info.hpp"

namespace espalier::bench {

void declare_gpu_options(CLI::App& app, GpuOptions& options, int argc, const char* const* argv) {
  for (int k = 0; k < argc; ++k) {
    const std::string text = argv[k];
    const char* quote = text.find(' ') == std::string::npos ? "" : "'";
    options.command += (k == 0 ? "" : " ") + (quote + text) + quote;
  }
  app.add_flag("--fp32", options.fp32, "single precision");
  app.add_flag("--small", options.small, "small systems only");
  app.add_flag("--plan", options.plan_only, "what the plan predicts; needs no GPU");
  app.add_option("--repeat", options.repeat, "timed runs")->check(CLI::PositiveNumber)->capture_default_str();
  app.add_option("--kind", options.kind, "auto, llt, ldlt or lu")
      ->check(CLI::IsMember({"auto", "llt", "ldlt", "lu"}))
      ->capture_default_str();
  app.add_option("--out", options.out, "write results (docs/guide/measure.md) to this file or folder");
}

void declare_devices(CLI::App& app, std::vector<int>& devices, std::vector<int>& counts) {
  app.add_option("--devices", devices, "GPUs, such as 0,1")->delimiter(',')->allow_extra_args(false);
  app.add_option("--counts", counts, "how many of them, in turn, such as 1,2")->delimiter(',')->allow_extra_args(false);
}

nlohmann::json gpu_document(const std::string& experiment, const GpuOptions& options,
                            const std::vector<std::string>& gpus, const std::string& driver) {
  nlohmann::json document =
      measure::new_document({experiment, options.command, solver::version(), {{"repetitions", options.repeat}}});
  document["machine"]["gpus"] = gpus;
  document["machine"]["driver"] = driver;
  return document;
}

nlohmann::json row_of_case(const GpuCase& c, const std::string& rival, const std::string& version) {
  nlohmann::json row = measure::empty_row(c.name, rival, version);
  row["unknowns"] = c.plan.tree.n;
  row["nonzeros"] = c.a.nonzeros();
  row["kind"] = name_of(c.kind);
  row["flops"] = c.plan.flops;
  row["nonzeros_factor"] = c.plan.nonzeros_factor;
  return row;
}

}  // namespace espalier::bench
