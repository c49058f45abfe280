/// \file
/// The GPU backend, checked and timed: every system is generated, analysed, factored and solved on the GPU; answers are
/// judged by an independent residual and, with --host, against the host executor.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>

#include "gpu/check_run.hpp"

namespace espalier::bench {
namespace {

using Json = nlohmann::json;

double milliseconds(const Json& phase, const char* which) {
  return phase.is_object() ? 1e3 * phase.at(which).get<double>() : 0;
}

std::string floor_text(const std::string& system) {
  for (const Floor& f : floors())
    if (system == f.system) return fmt::format("{:g}/{:g}", f.factor, f.solve);
  return "";
}

void print_pivots(const Json& row) {
  const Json& check = row["check"];
  if (row["kind"] != "llt")
    fmt::print("  neg {} 2x2 {} repl {} fail {}", check["negative"].get<Index>(), check["two_by_two"].get<Index>(),
               row["perturbed"].get<std::size_t>(), check["failed"].get<std::size_t>());
  if (check.contains("transposed_error")) fmt::print("  T {:.1e}", check["transposed_error"].get<double>());
  if (check.contains("host"))
    fmt::print("  host diff {:.1e} neg {} det {:.10g} / {:.10g}", check["host"]["difference"].get<double>(),
               check["host"]["negative"].get<Index>(), check["determinant_log"].get<double>(),
               check["host"]["determinant_log"].get<double>());
}

void print_row(const Json& row) {
  const double ms = milliseconds(row["refactorization"], "least");
  const Json& solve = row["solve_one"].is_null() ? row["solve_many"] : row["solve_one"];
  fmt::print(
      "{:<18} x{} {:<4} {} {:>8} {:>9.3g} {:>10.3f} {:>7.2f} {:>9.3f} {:>10} {:>9.1e} {:>4} {:>7.2f} GB {:>6.2f} s",
      row["system"].get<std::string>(), row["parameters"]["devices"].get<int>(), row["kind"].get<std::string>(),
      row["parameters"]["precision"].get<std::string>(), row["unknowns"].get<Index>(), row["flops"].get<double>(), ms,
      row["flops"].get<double>() / ms * 1e-9, milliseconds(solve, "least"), floor_text(row["system"]),
      row["backward_error"]["normwise"].get<double>(), row["check"]["identical"].get<bool>() ? "same" : "DIFF",
      row["memory"]["device_bytes"].get<double>() * 1e-9, milliseconds(row["analysis"], "least") * 1e-3);
  fmt::print("  reuse {}", row["parameters"]["reuse_distance"].get<int>());
  print_pivots(row);
  fmt::print("{}\n", good(row) ? "" : "   FAILED");
  for (const auto& d : row["devices"])
    fmt::print("    {}: busy {:.2f} ms, waiting {:.2f} ms, stolen {}, moved {:.3f} GB, holds {:.2f} GB\n",
               d["name"].get<std::string>(), 1e3 * d["busy_seconds"].get<double>(),
               1e3 * d["waiting_seconds"].get<double>(), d["stolen_subtrees"].get<int>(),
               d["transferred_bytes"].get<double>() * 1e-9, d["peak_bytes"].get<double>() * 1e-9);
  std::fflush(stdout);
}

/// Without a GPU: what the plans would ask of one. The results are written after every row.
int show_plans(const CheckSettings& settings, base::ThreadPool& pool) {
  Json document = gpu_document("simulated", settings.common, {}, "");
  for (const Wish& wish : wishes(settings)) {
    GpuCase c = prepare_case(wish.system, wish.kind, pool);
    for (const CheckSettings& now : settings.variants()) {
      lay_out_for_gpus(c, now.counts.front(), now.tuning, pool);
      document["rows"].push_back(show_plan(c, now));
      if (!settings.common.out.empty()) measure::write_document(document, settings.common.out);
    }
  }
  return 0;
}

/// A row that says why there are no figures.
Json failed_row(const Wish& wish, const std::string& why) {
  fmt::print("{:<18} FAILED: {}\n", wish.system, why);
  std::fflush(stdout);
  Json row = measure::empty_row(wish.system, "espalier", "");
  row["kind"] = name_of(wish.kind);
  row["outcome"] = "failed";
  row["message"] = why;
  return row;
}

/// All counts of devices of one system; returns how many failed. The results are written after every row.
int check_system(const Wish& wish, const CheckSettings& settings, Json& document, base::ThreadPool& pool) {
  int failures = 0;
  try {
    GpuCase c = prepare_case(wish.system, wish.kind, pool);
    for (const CheckSettings& now : settings.variants()) {
      lay_out_for_gpus(c, now.counts.front(), now.tuning, pool);
      document["rows"].push_back(now.common.fp32 ? check_case<float>(c, now, pool) : check_case<double>(c, now, pool));
      print_row(document["rows"].back());
      failures += good(document["rows"].back()) ? 0 : 1;
    }
  } catch (const std::exception& e) {
    document["rows"].push_back(failed_row(wish, e.what()));
    ++failures;
  }
  if (!settings.common.out.empty()) measure::write_document(document, settings.common.out);
  return failures;
}

int run(const CheckSettings& settings) {
  base::ThreadPool pool(base::available_cores());
  if (settings.common.plan_only) return show_plans(settings, pool);
  const auto available = device::cuda::available_devices();
  if (available.devices.empty()) {
    fmt::print("skipped: {}\n", available.reason);
    return 77;
  }
  const auto& gpu = available.devices.front();
  fmt::print("{}, CUDA driver {}, compute {}.{}\n", gpu.name, gpu.driver, gpu.compute_major, gpu.compute_minor);
  fmt::print("{:<18} {:<4} {} {:>8} {:>9} {:>10} {:>7} {:>9} {:>10} {:>9}\n", "system", "kind", "prec", "unknowns",
             "flops", "refactor ms", "TFLOP/s", "solve ms", "floors", "error");
  std::vector<std::string> names;
  for (const auto& device : available.devices) names.push_back(device.name);
  Json document = gpu_document("gpu-check", settings.common, names, gpu.driver);
  int failures = 0;
  const std::vector<Wish> all = wishes(settings);
  for (const Wish& wish : all) failures += check_system(wish, settings, document, pool);
  fmt::print("{} of {} checks failed\n", failures, all.size());
  return failures == 0 ? 0 : 1;
}

}  // namespace
}  // namespace espalier::bench

int main(int argc, char** argv) {
  CLI::App app("The GPU backend, checked and timed. Ends with 1 when a check failed, with 77 where there is no GPU.");
  espalier::bench::CheckSettings settings;
  try {
    espalier::bench::declare(app, settings, argc, argv);
    app.parse(argc, argv);
    if (settings.counts.empty()) settings.counts = {static_cast<int>(settings.devices.size())};
    return espalier::bench::run(settings);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& e) {
    std::cerr << "espalier_gpu_check: " << e.what() << '\n';
    return 2;
  }
}
