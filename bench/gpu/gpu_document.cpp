#include "gpu/gpu_document.hpp"

#include <CLI/CLI.hpp>
#include <filesystem>

#include "base/output_file.hpp"
#include "rivals/machine.hpp"
#include "rivals/session.hpp"
#include "solver/build_info.hpp"

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
  nlohmann::json machine = machine_record();
  machine["gpus"] = gpus;
  machine["driver"] = driver;
  return {{"schema", "espalier-bench/1"},   {"experiment", experiment},
          {"command", options.command},     {"date", utc_now()},
          {"commit", source_commit()},      {"version", solver::version()},
          {"machine", std::move(machine)},  {"settings", {{"repetitions", options.repeat}}},
          {"rows", nlohmann::json::array()}};
}

nlohmann::json samples_of(std::vector<double> seconds) {
  const Samples samples{std::move(seconds)};
  if (samples.empty()) return nullptr;
  return {{"median", samples.median()}, {"least", samples.least()}, {"seconds", samples.seconds}};
}

nlohmann::json empty_row(const std::string& system, const std::string& rival, const std::string& version) {
  nlohmann::json row = {{"system", system}, {"rival", rival}, {"version", version}, {"outcome", "ok"}, {"message", ""}};
  for (const char* key :
       {"unknowns", "nonzeros", "kind", "analysis", "first_factorization", "refactorization", "solve_one", "solve_many",
        "nonzeros_factor", "flops", "inertia", "perturbed", "refinement_steps", "backward_error"})
    row[key] = nullptr;
  row["memory"] = {{"peak_bytes", nullptr}, {"device_bytes", nullptr}, {"predicted_bytes", nullptr}};
  row["parameters"] = nlohmann::json::object();
  row["devices"] = nlohmann::json::array();
  return row;
}

nlohmann::json row_of_case(const GpuCase& c, const std::string& rival, const std::string& version) {
  nlohmann::json row = empty_row(c.name, rival, version);
  row["unknowns"] = c.plan.tree.n;
  row["nonzeros"] = c.a.nonzeros();
  row["kind"] = name_of(c.kind);
  row["flops"] = c.plan.flops;
  row["nonzeros_factor"] = c.plan.nonzeros_factor;
  return row;
}

void write_document(const nlohmann::json& document, const std::string& path) {
  namespace fs = std::filesystem;
  const std::string name = document.at("experiment").get<std::string>() + ".json";
  base::OutputFile file(fs::is_directory(path) ? (fs::path(path) / name).string() : path);
  file.write(document.dump(1) + "\n");
  file.commit();
}

}  // namespace espalier::bench
