#include "gpu/check_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>

#include "base/timeline.hpp"
#include "device/host/host_executor.hpp"
#include "matrix/residual.hpp"

namespace espalier::bench {
namespace {

using device::cuda::CudaExecutor;
using Json = nlohmann::json;

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

device::cuda::CudaOptions cuda_options(const GpuCase& c, const CheckSettings& settings, base::ThreadPool& pool,
                                       base::Timeline& timeline) {
  device::cuda::CudaOptions options;
  options.device = settings.devices.front();
  if (c.devices > 1) options.devices.assign(settings.devices.begin(), settings.devices.begin() + c.devices);
  options.staging = settings.staging;
  options.pool = &pool;
  options.fail_device = settings.fail_device;
  options.patience_seconds = settings.patience;
  options.delays.assign(settings.delays.begin(), settings.delays.end());
  if (!settings.times.empty()) options.timeline = &timeline;
  return options;
}

/// One line a task: device, work, part, region, front, rows of the front, pivots, width, block, tile column, chunks of
/// products, begin, end, waited (nanoseconds since the device's first task), block of threads.
template <class T>
void write_times(const GpuCase& c, const CudaExecutor<T>& gpu, const std::string& path) {
  std::ofstream out(path + "-" + std::to_string(c.devices));
  const auto times = gpu.task_times();
  const auto& tables = gpu.device_plan();
  for (std::size_t d = 0; d < times.size(); ++d) {
    std::uint64_t origin = ~std::uint64_t{0};
    for (const auto& t : times[d])
      if (t.end != 0) origin = std::min(origin, t.begin);
    for (std::size_t k = 0; k < times[d].size(); ++k) {
      const auto& t = times[d][k];
      if (t.end == 0) continue;
      const auto& task = tables.lists[d].tasks[k];
      const auto& f = tables.fronts[static_cast<std::size_t>(task.front)];
      const bool pivot = task.column < f.pivot_tiles;
      const int chunks = (pivot ? f.column_begin(task.column) : f.pivot_pad) / device::cuda::kChunk;
      out << d << ' ' << static_cast<int>(task.work) << ' ' << static_cast<int>(task.part) << ' ' << task.region << ' '
          << task.front << ' ' << f.total_pad << ' ' << f.pivot_pad << ' ' << f.width << ' ' << task.block << ' '
          << task.column << ' ' << chunks << ' ' << t.begin - origin << ' ' << t.end - origin << ' ' << t.waited << ' '
          << t.block << '\n';
    }
  }
}

/// Samples of the repeated runs, with values and right-hand sides in device memory.
struct Repeated {
  std::vector<double> factor, solve;
  bool identical = true;  ///< all solutions have the bits of the first
};

template <class T>
Repeated repeat(CudaExecutor<T>& gpu, const std::vector<T>& rhs, const std::vector<T>& first, Index columns,
                int times) {
  Repeated r;
  for (int k = 0; k < times; ++k) {
    r.factor.push_back(gpu.refactorize_again());
    T* x = gpu.device_rhs(columns);
    gpu.to_device(x, rhs.data(), static_cast<Offset>(rhs.size()));
    r.solve.push_back(gpu.solve_device(x, columns, false));
    std::vector<T> again(rhs.size());
    gpu.from_device(again.data(), x, static_cast<Offset>(again.size()));
    r.identical = r.identical && same_bits(first, again);
  }
  return r;
}

/// The same values through the host executor: largest difference of the solutions, inertia, determinant.
template <class T>
Json beside_host(const GpuCase& c, const GpuNumbers<T>& numbers, const std::vector<double>& b,
                 const std::vector<double>& x, base::ThreadPool& pool) {
  GpuCase h = c;
  lay_out_for_host(h, sizeof(T) == 4, pool);
  const auto host = device::host::make_host_executor<T>({h.plan, h.kind, false, numbers.rule, pool});
  const auto outcome = host->factorize(numbers.values);
  std::vector<T> y = to_plan_order<T>(h, b, 1);
  host->solve(y.data(), 1, false);
  const std::vector<double> xh = from_plan_order(h, y, 1);
  double difference = 0, size = 0;
  for (std::size_t k = 0; k < xh.size(); ++k) {
    difference = std::max(difference, std::abs(xh[k] - x[k]));
    size = std::max(size, std::abs(xh[k]));
  }
  return {
      {"difference", difference / size}, {"negative", outcome.negative}, {"determinant_log", outcome.determinant_log}};
}

Json device_reports(const std::vector<device::DeviceWork>& work, double seconds) {
  Json list = Json::array();
  for (const device::DeviceWork& w : work)
    list.push_back({{"name", w.name},
                    {"busy_seconds", w.busy_seconds},
                    {"idle_fraction", seconds > 0 ? 1 - (w.busy_seconds + w.waiting_seconds) / seconds : 0},
                    {"waiting_seconds", w.waiting_seconds},
                    {"stolen_subtrees", w.stolen_subtrees},
                    {"transferred_bytes", w.transferred_bytes},
                    {"peak_bytes", w.peak_bytes}});
  return list;
}

/// What the plan and the analysis tell of the row.
Json row_of(const GpuCase& c, bool single, const CheckSettings& settings) {
  std::string name = c.devices == 1 ? "espalier on 1 GPU" : fmt::format("espalier on {} GPUs", c.devices);
  if (settings.tuning.narrow_rows != device::cuda::DeviceTuning().narrow_rows)
    name += fmt::format(", narrow to {} rows", settings.tuning.narrow_rows);
  Json row = row_of_case(c, name, "Espalier, CUDA executor, values on the device");
  row["analysis"] = measure::samples_record({{c.analysis_seconds + c.plan_seconds}});
  row["parameters"] = {{"columns", settings.columns},
                       {"devices", c.devices},
                       {"narrow_rows", settings.tuning.narrow_rows},
                       {"reuse_distance", c.plan.options.reuse_distance},
                       {"precision", single ? "fp32" : "fp64"}};
  return row;
}

}  // namespace

template <class T>
Json check_case(const GpuCase& c, const CheckSettings& settings, base::ThreadPool& pool) {
  const Index n = c.plan.tree.n, columns = settings.columns;
  const GpuNumbers<T> numbers(c, pool);
  base::Timeline timeline;
  const double setup = base::now_seconds();
  const auto gpu =
      device::cuda::make_cuda_executor<T>(c.plan, c.kind, numbers.rule, cuda_options(c, settings, pool, timeline));
  const double setup_seconds = base::now_seconds() - setup;
  const device::FactorOutcome first = gpu->factorize(numbers.values);
  if (!settings.times.empty()) write_times(c, *gpu, settings.times);

  const std::vector<double> b = test_right_hand_sides(n, columns);
  const std::vector<T> rhs = to_plan_order<T>(c, b, columns);
  std::vector<T> solved = rhs;
  gpu->solve(solved.data(), columns, false);
  const Repeated repeated = repeat(*gpu, rhs, solved, columns, settings.common.repeat);
  const device::FactorOutcome last = gpu->factorize(numbers.values);
  const std::vector<double> x = from_plan_order(c, solved, columns);
  const auto error = matrix::backward_errors(c.a, x, b, columns, Transpose::no, &pool);

  Json row = row_of(c, sizeof(T) == 4, settings);
  row["refactorization"] = measure::samples_record({repeated.factor});
  row[columns == 1 ? "solve_one" : "solve_many"] = measure::samples_record({repeated.solve});
  row["backward_error"] = {{"normwise", error.normwise}, {"componentwise", error.componentwise}};
  row["perturbed"] = first.replaced.size();
  row["refinement_steps"] = 0;
  row["memory"]["device_bytes"] = gpu->peak_bytes();
  row["devices"] = device_reports(gpu->device_work(), last.seconds);
  Json check = {{"identical", repeated.identical},
                {"fronts", c.plan.fronts()},
                {"plan_seconds", c.plan_seconds},
                {"setup_seconds", setup_seconds},
                {"busy_seconds", last.busy_seconds},
                {"waiting_seconds", last.waiting_seconds},
                {"not_positive", first.not_positive},
                {"negative", first.negative},
                {"two_by_two", first.two_by_two},
                {"failed", first.failed.size()},
                {"determinant_sign", first.determinant_sign},
                {"determinant_log", first.determinant_log}};
  // With equal row and column scaling of the transposed system: only the residual of the factored matrix is checked
  // where rows were not permuted.
  if ((c.kind == Kind::lu || settings.common.small) && c.prepared.row_of_col.empty() && c.prepared.row_scale.empty()) {
    std::vector<T> y = rhs;
    gpu->solve(y.data(), columns, true);
    const std::vector<double> transposed = from_plan_order(c, y, columns);
    check["transposed_error"] = matrix::backward_errors(c.a, transposed, b, columns, Transpose::yes, &pool).normwise;
  }
  if (settings.host) check["host"] = beside_host(c, numbers, b, x, pool);
  row["check"] = std::move(check);
  if (!good(row)) row["outcome"] = "wrong answer", row["message"] = "the check failed; see \"check\"";
  return row;
}

bool good(const Json& row) {
  const double bound = 1e3 * (row["parameters"]["precision"] == "fp64" ? unit_of<double>() : unit_of<float>());
  const Json& check = row["check"];
  const Json& error = row["backward_error"]["normwise"];
  bool ok = check["identical"].get<bool>() && error.is_number() && error.get<double>() <= bound;
  if (check.contains("transposed_error")) ok = ok && check["transposed_error"].get<double>() <= bound;
  if (check.contains("host")) ok = ok && check["host"]["negative"] == check["negative"];
  return ok;
}

template Json check_case<double>(const GpuCase&, const CheckSettings&, base::ThreadPool&);
template Json check_case<float>(const GpuCase&, const CheckSettings&, base::ThreadPool&);

}  // namespace espalier::bench
