/// \file
/// Results of the GPU's own programs in the schema espalier-bench/1 (docs/guide/measure.md), and the options that they
/// share.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "gpu/gpu_case.hpp"

namespace CLI {
class App;  // its header takes seconds of every file that includes it
}

namespace espalier::bench {

/// What both programs understand.
struct GpuOptions {
  bool fp32 = false, small = false, plan_only = false;
  int repeat = 5;
  std::string kind = "auto";
  std::string out;
  std::string command;  ///< as typed
};

/// Declares them on `app` and keeps the command line.
void declare_gpu_options(CLI::App& app, GpuOptions& options, int argc, const char* const* argv);

/// Declares --devices and --counts: which GPUs, and how many of them in turn.
void declare_devices(CLI::App& app, std::vector<int>& devices, std::vector<int>& counts);

/// A document without rows. `gpus`: names of the GPUs, `driver`: of the first.
nlohmann::json gpu_document(const std::string& experiment, const GpuOptions& options,
                            const std::vector<std::string>& gpus, const std::string& driver);

/// {"median", "least", "seconds"} of samples; null where there are none.
nlohmann::json samples_of(std::vector<double> seconds);

/// A row of which nothing is known but these; the caller fills in what it measured.
nlohmann::json empty_row(const std::string& system, const std::string& rival, const std::string& version);
/// The same, with what the case and its plan tell.
nlohmann::json row_of_case(const GpuCase& c, const std::string& rival, const std::string& version);

/// Writes the document. A folder takes it as <experiment>.json. @throws Error(invalid_input) when it cannot be written
void write_document(const nlohmann::json& document, const std::string& path);

}  // namespace espalier::bench
