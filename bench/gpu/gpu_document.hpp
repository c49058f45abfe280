/// \file
/// Results of the GPU's own programs in the schema espalier-bench/1 (docs/guide/measure.md), and the options that they
/// share.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "gpu/gpu_case.hpp"
#include "measure/document.hpp"

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

/// A row of the schema with what the case and its plan tell.
nlohmann::json row_of_case(const GpuCase& c, const std::string& rival, const std::string& version);

}  // namespace espalier::bench
