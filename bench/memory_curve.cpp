/// \file
/// The memory curve: one system factored on the GPU with several budgets of device memory, in core and out of core,
/// each answer judged by an independent residual; beside each point the time that the host link bounds.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <limits>
#include <random>

#include "base/timeline.hpp"
#include "device/cuda/out_of_core/backend.hpp"
#include "device/cuda/runtime/cuda_faults.hpp"
#include "gpu/gpu_case.hpp"
#include "gpu/gpu_document.hpp"
#include "matrix/residual.hpp"
#include "out_of_core/executor.hpp"

namespace espalier::bench {
namespace {

using Json = nlohmann::json;

struct CurveSettings {
  GpuOptions common;
  int refuse = 0, copy_threads = 0, lanes = 1;
  bool pin = false;
  double step = 0, group = 0, resident = -1;
  std::string system;
  std::vector<double> mebibytes;  // of each device
  std::vector<int> devices{0}, counts{1};
};

void declare(CLI::App& app, CurveSettings& settings, int argc, const char* const* argv) {
  settings.common.repeat = 3;
  declare_gpu_options(app, settings.common, argc, argv);
  settings.system = "elasticity 10";
  app.add_option("system", settings.system, "a generator with its sizes in quotes: \"elasticity 64\"")
      ->capture_default_str();
  app.add_option("budgets", settings.mebibytes, "budgets of each device's memory in MiB");
  declare_devices(app, settings.devices, settings.counts);
  app.add_option("--refuse", settings.refuse, "the call of the CUDA runtime of that number is refused, in each point");
  app.add_flag("--pin", settings.pin, "page-lock the host's store; what is timed comes afterwards");
  app.add_option("--copy-threads", settings.copy_threads, "host threads that copy (default: half of the cores)");
  app.add_option("--lanes", settings.lanes, "queues of the GPU");
  app.add_option("--step", settings.step, "share of the budget that a step of fronts may take");
  app.add_option("--group", settings.group, "likewise a group of block columns");
  app.add_option("--resident", settings.resident,
                 "likewise the factors that stay on the device; 0: none (default: what seems best)");
}

double mebibytes(Offset bytes) { return static_cast<double>(bytes) / (1 << 20); }

template <class T>
class Curve {
 public:
  Curve(const GpuCase& c, const CurveSettings& settings, base::ThreadPool& pool)
      : c_(c), settings_(settings), pool_(pool), numbers_(c, pool), b_(test_right_hand_sides(c.plan.tree.n, 1)) {}

  Json in_core() {
    auto gpu = device::cuda::make_cuda_executor<T>(c_.plan, c_.kind, numbers_.rule);
    Json row = measure(*gpu);
    std::vector<double> replayed;
    for (int k = 0; k < settings_.common.repeat; ++k) replayed.push_back(gpu->refactorize_again());
    row["refactorization"] = measure::samples_record({replayed});
    row["parameters"].update({{"budget_bytes", 0}, {"share", nullptr}});
    in_core_ = row["refactorization"]["least"];
    need_ = gpu->peak_bytes();
    print(row);
    return row;
  }

  /// On the first `count` devices, each with that budget.
  Json out_of_core(Offset budget, int count) {
    out_of_core::OutOfCoreOptions options;
    options.devices.assign(static_cast<std::size_t>(count), {budget});
    options.rates = rates();
    options.pool = &pool_;
    options.copy_threads =
        settings_.copy_threads > 0 ? settings_.copy_threads : std::max(1, pool_.size() / (2 * count));
    std::vector<device::cuda::CudaOutOfCoreOptions> cuda(static_cast<std::size_t>(count));
    for (std::size_t d = 0; d < cuda.size(); ++d) cuda[d].device = settings_.devices[d];
    if (settings_.pin) options.pinned_bytes = std::numeric_limits<Offset>::max();
    device::cuda::call_faults().arm(settings_.refuse);
    const double start = base::now_seconds();
    auto executor = out_of_core::make_out_of_core_executor<T>(
        device::cuda::make_cuda_out_of_core_backends<T>(c_.plan, c_.kind, numbers_.rule, pool_, cuda), options,
        nullptr);
    const double setup = base::now_seconds() - start;
    const Json pinning = settings_.pin ? pin_store(*executor) : Json(nullptr);
    Json row = measure(*executor, count);
    const device::OutOfCoreReport r = together(*executor);
    row["memory"]["predicted_bytes"] = r.predicted_bytes;
    row["parameters"].update({{"budget_bytes", budget},
                              {"share", need_ > 0 ? Json(static_cast<double>(budget) / need_) : Json(nullptr)},
                              {"bytes_in", r.bytes_in},
                              {"bytes_out", r.bytes_out},
                              {"steps", r.steps},
                              {"groups", r.groups},
                              {"store_bytes", r.store_bytes},
                              {"pinned_bytes", r.pinned_bytes},
                              {"direct_bytes", r.direct_bytes}});
    row["check"].update({{"setup_seconds", setup},
                         {"pinning", pinning},
                         {"link_seconds", r.link_seconds},
                         {"predicted_seconds", r.predicted_seconds},
                         {"steps_seconds", r.times.steps},
                         {"assembly_seconds", r.times.assembly},
                         {"updates_seconds", r.times.updates},
                         {"own_pivots_seconds", r.times.own_pivots},
                         {"copy_in_seconds", r.copy_in_seconds},
                         {"copy_out_seconds", r.copy_out_seconds}});
    factor_bytes_ = std::max(factor_bytes_, r.bytes_out);
    link_seconds_ = std::max(link_seconds_, need_ > 0 && budget >= need_ / 2 ? r.link_seconds : 0.0);
    print(row);
    return row;
  }

  /// Bytes of each device below which no plan exists.
  Offset floor_of(int count) {
    try {
      (void)out_of_core::plan_out_of_core(
          *device::cuda::make_cuda_out_of_core_backend<T>(c_.plan, c_.kind, numbers_.rule, pool_),
          std::vector<out_of_core::OutOfCoreDevice>(static_cast<std::size_t>(count), {1000}));
    } catch (const out_of_core::BudgetTooSmall& e) {
      return e.needed();
    }
    return 0;
  }

  void print_plan(Offset budget, int count) {
    const double start = base::now_seconds();
    const auto backend = device::cuda::make_cuda_out_of_core_backend<T>(c_.plan, c_.kind, numbers_.rule, pool_);
    const double made = base::now_seconds();
    const auto plans = out_of_core::plan_out_of_core(
        *backend, std::vector<out_of_core::OutOfCoreDevice>(static_cast<std::size_t>(count), {budget}), rates(),
        &pool_);
    const double end = base::now_seconds();
    fmt::print("{} x {:.1f} MiB: predicted {:.1f} ms, store {:.2f} GB, planned in {:.2f} s (tables {:.2f} s)\n", count,
               mebibytes(budget), 1e3 * plans.front().predicted_seconds,
               static_cast<double>(plans.front().store_elements) * sizeof(T) * 1e-9, end - made, made - start);
    for (const out_of_core::OutOfCorePlan& p : plans) {
      const auto steps = std::count_if(p.steps.begin(), p.steps.end(), [](const auto& x) { return !x.fronts.empty(); });
      fmt::print(
          "    link {:8.1f} ms, in {:7.2f} GB, out {:7.2f} GB, {} steps, {} groups, {} operations; {:.2f} GB of {} "
          "fronts stay, {} fronts stream, a solve {:.1f} ms, {:.1f} MB for {} right-hand sides\n",
          1e3 * p.link_seconds, static_cast<double>(p.bytes_in) * 1e-9, static_cast<double>(p.bytes_out) * 1e-9, steps,
          p.groups.size(), p.ops.size(), static_cast<double>(p.resident_bytes) * 1e-9, p.resident.size(),
          p.streamed.size(), 1e3 * p.solve_seconds, static_cast<double>(p.solve_bytes) * 1e-6, p.solve_columns);
    }
  }

  /// The lines of the drawing: no run is faster than in core, nor than the link moves the factor out once.
  [[nodiscard]] Json bounds() const {
    return {{"system", c_.name},
            {"device", "gpu:0"},
            {"need_bytes", need_},
            {"factor_bytes", factor_bytes_ > 0 ? Json(factor_bytes_) : Json(nullptr)},
            {"in_core_seconds", in_core_ > 0 ? Json(in_core_) : Json(nullptr)},
            {"link_bytes_per_second", nullptr},
            {"link_seconds", link_seconds_ > 0 ? Json(link_seconds_) : Json(nullptr)}};
  }

  int failures = 0;

 private:
  [[nodiscard]] out_of_core::PlanningRates rates() const {
    out_of_core::PlanningRates rates(plan::h200().out_of_core, c_.kind, settings_.pin);
    rates.lanes = settings_.lanes;
    rates.step = settings_.step;
    rates.group = settings_.group;
    rates.resident = settings_.resident;
    return rates;
  }

  // Sums over the devices; of peaks, times and predictions the most.
  static device::OutOfCoreReport together(const device::Executor<T>& executor) {
    device::OutOfCoreReport sum = executor.out_of_core();
    const auto work = executor.device_work();
    for (std::size_t d = 1; d < work.size(); ++d) {
      const device::OutOfCoreReport& r = work[d].out_of_core;
      sum.predicted_bytes = std::max(sum.predicted_bytes, r.predicted_bytes);
      sum.bytes_in += r.bytes_in;
      sum.bytes_out += r.bytes_out;
      sum.direct_bytes += r.direct_bytes;
      sum.link_seconds = std::max(sum.link_seconds, r.link_seconds);
      sum.copy_in_seconds = std::max(sum.copy_in_seconds, r.copy_in_seconds);
      sum.copy_out_seconds = std::max(sum.copy_out_seconds, r.copy_out_seconds);
      sum.steps += r.steps;
      sum.groups += r.groups;
    }
    return sum;
  }
  // Refactorizations until the store is pinned: their times, and the bytes that were pinned after each.
  Json pin_store(device::Executor<T>& executor) {
    Json list = Json::array();
    for (Offset pinned = -1, before = -2; pinned != before;) {
      before = pinned;
      const double start = base::now_seconds();
      (void)executor.factorize(numbers_.values);
      const double seconds = base::now_seconds() - start;
      pinned = executor.out_of_core().pinned_bytes;
      if (list.empty()) before = -2;  // it begins with the second one
      list.push_back({{"seconds", seconds}, {"pinned_bytes", pinned}});
      fmt::print("  factorization {}: {:.1f} ms, {:.2f} of {:.2f} GB pinned\n", list.size(), 1e3 * seconds,
                 static_cast<double>(pinned) * 1e-9, static_cast<double>(executor.out_of_core().store_bytes) * 1e-9);
    }
    return list;
  }
  [[nodiscard]] std::string device_text(int count) const {
    return fmt::format("gpu:{}", fmt::join(settings_.devices.begin(), settings_.devices.begin() + count, ","));
  }

  Json measure(device::Executor<T>& executor, int count = 1) {
    std::vector<double> factor, solve;
    std::vector<T> first;
    bool identical = true;
    device::FactorOutcome outcome;
    for (int k = 0; k <= settings_.common.repeat; ++k) {
      const double start = base::now_seconds();
      outcome = executor.factorize(numbers_.values);
      factor.push_back(base::now_seconds() - start);
      std::vector<T> x = to_plan_order<T>(c_, b_, 1);
      const double before = base::now_seconds();
      executor.solve(x.data(), 1, false);
      solve.push_back(base::now_seconds() - before);
      if (k == 0) first = x;
      identical = identical && std::memcmp(x.data(), first.data(), x.size() * sizeof(T)) == 0;
    }
    const auto error = matrix::backward_errors(c_.a, from_plan_order(c_, first, 1), b_, 1, Transpose::no, &pool_);
    Json row = row_of_case(c_, "espalier:device=" + device_text(count), "Espalier, out of core, values on the host");
    row["first_factorization"] = measure::samples_record({{factor.front()}});
    row["refactorization"] = measure::samples_record({{factor.begin() + 1, factor.end()}});
    row["solve_one"] = measure::samples_record({solve});
    row["backward_error"] = {{"normwise", error.normwise}, {"componentwise", error.componentwise}};
    row["perturbed"] = outcome.replaced.size();
    row["refinement_steps"] = 0;
    row["memory"]["device_bytes"] = executor.peak_bytes();
    row["parameters"] = {
        {"device", device_text(count)}, {"devices", count}, {"precision", sizeof(T) == 8 ? "fp64" : "fp32"}};
    row["check"] = {{"identical", identical},
                    {"not_positive", outcome.not_positive},
                    {"negative", outcome.negative},
                    {"two_by_two", outcome.two_by_two},
                    {"determinant_log", outcome.determinant_log}};
    return row;
  }

  /// Same bits, a small residual, and neither more memory than allowed nor other than predicted.
  [[nodiscard]] bool good(const Json& row) const {
    const Json& memory = row["memory"];
    const Offset budget = row["parameters"]["budget_bytes"];
    return row["check"]["identical"].get<bool>() && row["backward_error"]["normwise"].is_number() &&
           row["backward_error"]["normwise"].get<double>() <= 1e3 * unit_of<T>() &&
           (budget == 0 ||
            (memory["device_bytes"].get<Offset>() <= budget && memory["device_bytes"] == memory["predicted_bytes"]));
  }

  void print(Json& row) {
    const bool is_good = good(row);
    failures += is_good ? 0 : 1;
    if (!is_good) row["outcome"] = "wrong answer", row["message"] = "the check failed; see \"check\" and \"memory\"";
    const Json &refactor = row["refactorization"], &check = row["check"], &where = row["parameters"];
    const double seconds = refactor["least"];
    fmt::print(
        "{} x {:>9.1f} MiB {:>9.1f} ms (first {:>8.1f}, median {:>8.1f}) rate {:>5.3f} {:>6.2f} TFLOP/s solve {:>8.2f} "
        "ms error {:.1e} {} det {:.8g} neg {}",
        where["devices"].get<int>(), mebibytes(where["budget_bytes"]), 1e3 * seconds,
        1e3 * row["first_factorization"]["least"].get<double>(), 1e3 * refactor["median"].get<double>(),
        in_core_ / seconds, c_.plan.flops / seconds * 1e-12, 1e3 * row["solve_one"]["least"].get<double>(),
        row["backward_error"]["normwise"].get<double>(), check["identical"].get<bool>() ? "same" : "DIFF",
        check["determinant_log"].get<double>(), check["negative"].get<Index>());
    if (check.contains("link_seconds"))
      fmt::print(
          " | link {:.1f} ms, predicted {:.1f} ms, in {:.2f} out {:.2f} GB, {:.2f} of them directly, host copies in "
          "{:.0f} out {:.0f} ms, {} "
          "steps {} groups, setup {:.1f} s; first device: steps {:.0f}, assembly {:.0f}, updates {:.0f}, own pivots "
          "{:.0f} ms",
          1e3 * check["link_seconds"].get<double>(), 1e3 * check["predicted_seconds"].get<double>(),
          where["bytes_in"].get<double>() * 1e-9, where["bytes_out"].get<double>() * 1e-9,
          where["direct_bytes"].get<double>() * 1e-9, 1e3 * check["copy_in_seconds"].get<double>(),
          1e3 * check["copy_out_seconds"].get<double>(), where["steps"].get<Index>(), where["groups"].get<Index>(),
          check["setup_seconds"].get<double>(), 1e3 * check["steps_seconds"].get<double>(),
          1e3 * check["assembly_seconds"].get<double>(), 1e3 * check["updates_seconds"].get<double>(),
          1e3 * check["own_pivots_seconds"].get<double>());
    fmt::print("{}\n", is_good ? "" : "  FAILED");
    std::fflush(stdout);
  }

  const GpuCase& c_;
  const CurveSettings& settings_;
  base::ThreadPool& pool_;
  GpuNumbers<T> numbers_;
  std::vector<double> b_;
  double in_core_ = 0, link_seconds_ = 0;
  Offset need_ = 0, factor_bytes_ = 0;
};

template <class T>
std::vector<Offset> budgets_of(const CurveSettings& settings, Curve<T>& curve) {
  std::vector<Offset> budgets;
  for (const double m : settings.mebibytes) budgets.push_back(static_cast<Offset>(m * (1 << 20)));
  if (!settings.common.small) return budgets;
  const Offset floor = curve.floor_of(*std::max_element(settings.counts.begin(), settings.counts.end()));
  std::mt19937_64 random(3);
  for (const double factor : {1.0, 1.3, 2.0, 4.0})
    budgets.push_back(static_cast<Offset>(factor * static_cast<double>(floor)));
  for (int k = 0; k < 3; ++k) budgets.push_back(floor + static_cast<Offset>(random() % (4 * floor)));
  return budgets;
}

template <class T>
int run(const CurveSettings& settings) {
  base::ThreadPool pool(base::available_cores());
  const auto available = device::cuda::available_devices();
  if (available.devices.empty() && !settings.common.plan_only) {
    fmt::print("skipped: {}\n", available.reason);
    return 77;
  }
  GpuCase c = prepare_case(settings.system, kind_of(settings.common.kind), pool);
  device::cuda::DeviceTuning tuning;
  if (settings.common.small) tuning.narrow_rows = 200;  // small systems, too, shall have fronts of both widths
  lay_out_for_gpus(c, 1, tuning, pool);
  fmt::print("{}: {} unknowns, {:.3g} flops, {} fronts, analysis {:.2f} s\n", settings.system, c.plan.tree.n,
             c.plan.flops, c.plan.fronts(), c.analysis_seconds + c.plan_seconds);
  Curve<T> curve(c, settings, pool);
  const std::vector<Offset> budgets = budgets_of(settings, curve);
  if (settings.common.plan_only) {
    for (const int count : settings.counts)
      for (const Offset b : budgets) curve.print_plan(b, count);
    return 0;
  }
  std::vector<std::string> names;
  for (const int d : settings.devices) names.push_back(available.devices.at(static_cast<std::size_t>(d)).name);
  Json document = gpu_document("memory", settings.common, names, available.devices.front().driver);
  const auto keep = [&](Json row) {
    document["rows"].push_back(std::move(row));
    document["bounds"] = Json::array({curve.bounds()});
    if (!settings.common.out.empty()) measure::write_document(document, settings.common.out);
  };
  if (settings.refuse == 0) keep(curve.in_core());
  const auto point = [&](Offset budget, int count) {
    try {
      keep(curve.out_of_core(budget, count));
    } catch (const std::exception& e) {
      fmt::print("{} x {:>9.1f} MiB failed: {}\n", count, mebibytes(budget), e.what());
      Json row = measure::empty_row(settings.system, "espalier:device=gpu", "");
      row["parameters"] = {{"device", "gpu"}, {"devices", count}, {"budget_bytes", budget}, {"share", nullptr}};
      row["outcome"] = "failed";
      row["message"] = e.what();
      keep(std::move(row));
      ++curve.failures;
    }
  };
  for (const int count : settings.counts)
    for (const Offset b : budgets) point(b, count);
  fmt::print("{} of {} points failed\n", curve.failures, budgets.size() * settings.counts.size());
  return curve.failures == 0 ? 0 : 1;
}

}  // namespace
}  // namespace espalier::bench

int main(int argc, char** argv) {
  CLI::App app(
      "One system in several budgets of device memory. Ends with 1 when a point failed, with 77 without a GPU.");
  espalier::bench::CurveSettings settings;
  try {
    espalier::bench::declare(app, settings, argc, argv);
    app.parse(argc, argv);
    for (const int count : settings.counts)
      if (count < 1 || count > static_cast<int>(settings.devices.size()))
        throw CLI::ValidationError("--counts", "more than --devices names");
    return settings.common.fp32 ? espalier::bench::run<float>(settings) : espalier::bench::run<double>(settings);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  } catch (const std::exception& e) {
    std::cerr << "espalier_memory_curve: " << e.what() << '\n';
    return 2;
  }
}
