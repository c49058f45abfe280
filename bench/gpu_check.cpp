// The GPU backend, checked and timed: every system is generated, analysed, factored and solved on the GPU; answers are
// judged by an independent residual and, for small systems, against the host executor.
//   espalier_gpu_check [--small] [--kind llt|ldlt|lu] [--fp32] [--narrow ROWS] [--whole ROWS PIVOTS] [--host] [--repeat
//   N]
//                      [--plan] [--out DIR] [--commit HASH] [--columns N] [--devices 0,1,...] [--counts 1,2,...]
//                      [--staging] [--fail-device K] [--additional-subtrees X] [--column-group N] [--patience SECONDS]
//                      [SYSTEM ...]                                                          SYSTEM: "elasticity 40",
//                      "kkt 20",
//                      ...
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "analysis/ordering.hpp"
#include "device/cuda/cuda_executor.hpp"
#include "device/host/host_executor.hpp"
#include "factor/gpu_simulator.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/residual.hpp"
#include "solver/equations.hpp"

namespace {

using namespace espalier;
using device::cuda::CudaExecutor;

struct Settings {
  bool small = false;
  bool fp32 = false;
  bool host = false;
  bool plan_only = false;
  bool lists = false;  // with plan_only: every device's list
  int repeat = 5;
  Index columns = 1;
  std::vector<int> devices = {0};  // GPUs
  std::vector<int> counts;         // so many of them in turn; empty: all
  bool staging = false;
  double patience = 10;
  int fail_device = -1;
  std::vector<int> delays;  // nanoseconds a task, by device
  std::string times;        // file for the times of all tasks
  Kind kind = Kind::automatic;
  device::cuda::DeviceTuning tuning;
  std::string out;
  std::string commit = "unknown";
  std::vector<std::string> systems;
};

// Refactorization and solve of one right-hand side in milliseconds that must be reached on one H200
// (docs/performance.md).
struct Floor {
  const char* system;
  double factor, solve;
};
constexpr Floor kFloors[] = {{"elasticity 40", 52, 2.2},     {"elasticity 64", 400, 9},   {"elasticity 80", 1350, 21},
                             {"plate 600", 110, 4.5},        {"plate 1200", 600, 19},     {"kkt 20", 6, 0.7},
                             {"kkt 2", 1.5, 0.33},           {"kkt 400 10 8 8", 30, 2.2}, {"kkt 200 3 2 2", 0.5, 0.15},
                             {"kkt 1000 2 1 1", 0.36, 0.12}, {"gyroscopic 48", 220, 3.8}};

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> words;
  for (std::string w; in >> w;) words.push_back(w);
  return words;
}

std::vector<int> numbers(std::string text) {
  std::replace(text.begin(), text.end(), ',', ' ');
  std::vector<int> list;
  for (const std::string& w : words_of(text)) list.push_back(std::stoi(w));
  return list;
}

Settings parse(int argc, char** argv) {
  Settings s;
  for (int k = 1; k < argc; ++k) {
    const std::string a = argv[k];
    const auto value = [&]() -> std::string {
      if (k + 1 >= argc) throw std::invalid_argument(a + " needs a value");
      return argv[++k];
    };
    if (a == "--small")
      s.small = true;
    else if (a == "--fp32")
      s.fp32 = true;
    else if (a == "--plan")
      s.plan_only = true;
    else if (a == "--lists")
      s.lists = true;
    else if (a == "--patience")
      s.patience = std::stod(value());
    else if (a == "--staging")
      s.staging = true;
    else if (a == "--fail-device")
      s.fail_device = std::stoi(value());
    else if (a == "--devices")
      s.devices = numbers(value());
    else if (a == "--counts")
      s.counts = numbers(value());
    else if (a == "--additional-subtrees")
      s.tuning.additional_subtrees = std::stod(value());
    else if (a == "--stealing")
      s.tuning.stealing = true;
    else if (a == "--speeds")
      for (const int speed : numbers(value())) s.tuning.device_speed.push_back(speed);
    else if (a == "--no-shared-top")
      s.tuning.shared_top = false;
    else if (a == "--count-balance")
      s.tuning.count_balance = true;
    else if (a == "--delays")
      s.delays = numbers(value());
    else if (a == "--times")
      s.times = value();
    else if (a == "--column-group")
      s.tuning.column_group = std::stoi(value());
    else if (a == "--host")
      s.host = true;
    else if (a == "--repeat")
      s.repeat = std::stoi(value());
    else if (a == "--columns")
      s.columns = std::stoi(value());
    else if (a == "--narrow")
      s.tuning.narrow_rows = std::stoi(value());
    else if (a == "--whole") {
      s.tuning.whole_rows = std::stoi(value());
      s.tuning.whole_pivots = s.tuning.whole_pivots_ldlt = std::stoi(value());
    } else if (a == "--group")
      s.tuning.group_entries = std::stoll(value());
    else if (a == "--out")
      s.out = value();
    else if (a == "--commit")
      s.commit = value();
    else if (a == "--kind") {
      const std::string kind = value();
      s.kind = kind == "llt" ? Kind::llt : kind == "ldlt" ? Kind::ldlt : Kind::lu;
    } else
      s.systems.push_back(a);
  }
  if (s.systems.empty() && !s.small)
    for (const Floor& f : kFloors) s.systems.emplace_back(f.system);
  if (s.counts.empty()) s.counts = {static_cast<int>(s.devices.size())};
  return s;
}

// A system with its plan.
struct Case {
  std::string name;
  Kind kind = Kind::llt;
  SparseMatrix a;
  solver::Equations equations;
  analysis::AssemblyTree tree;
  int devices = 1;
  analysis::Plan plan;
  double analysis_seconds = 0;  // without the plan
  double plan_seconds = 0;
};

const char* name_of(Kind kind) { return kind == Kind::llt ? "llt" : kind == Kind::ldlt ? "ldlt" : "lu"; }

// The plan for so many devices.
void lay_out(Case& c, int devices, const Settings& settings, bool for_host, base::ThreadPool& pool) {
  const double start = now();
  c.devices = devices;
  analysis::PlanOptions options = device::cuda::cuda_plan_options(c.kind, settings.tuning, devices);
  if (for_host) {
    options = analysis::PlanOptions{};
    options.tiles.panel = settings.fp32 ? 16 : 8;  // one cache line, as the host kernels ask for
    options.unsymmetric = c.kind == Kind::lu;
    options.ldlt = c.kind == Kind::ldlt;
  }
  c.plan = analysis::make_plan(c.tree, c.equations.a, c.equations.row_of_col, options, pool);
  c.plan_seconds = now() - start;
}

Case prepare(const std::string& name, Kind wish, const Settings& settings, bool for_host, base::ThreadPool& pool) {
  Case c;
  c.name = name;
  c.a = matrix::generate(matrix::parse_generator(words_of(name)), &pool);
  c.kind = solver::choose_kind(c.a, wish, pool);
  const double start = now();
  c.equations = solver::copy_equations(c.a, c.kind, pool);
  solver::scale_and_match(c.equations, c.kind, Options{}, pool);
  analysis::TreeOptions tree_options;
  tree_options.pair = c.equations.pair;
  tree_options.zero_diagonal = c.equations.zero_diagonal;
  c.tree = analysis::build_tree(analysis::graph_of(c.equations.a, pool, c.equations.row_of_col), tree_options, pool);
  c.analysis_seconds = now() - start;
  if (for_host) lay_out(c, 1, settings, true, pool);
  return c;
}

template <class T>
std::vector<T> right_hand_side(const Case& c, const std::vector<double>& b, Index columns) {
  const Index n = c.plan.tree.n;
  std::vector<T> x(static_cast<std::size_t>(n) * columns);
  for (Index k = 0; k < n; ++k) {
    const Index row = c.equations.row_of(c.plan.tree.order[k]);
    const double scale = c.equations.row_scale.empty() ? 1.0 : c.equations.row_scale[row];
    for (Index j = 0; j < columns; ++j)
      x[static_cast<std::size_t>(k) * columns + j] = static_cast<T>(scale * b[static_cast<std::size_t>(j) * n + row]);
  }
  return x;
}

template <class T>
std::vector<double> solution_of(const Case& c, const std::vector<T>& x, Index columns) {
  const Index n = c.plan.tree.n;
  std::vector<double> out(x.size());
  for (Index k = 0; k < n; ++k) {
    const Index col = c.plan.tree.order[k];
    const double scale = c.equations.col_scale.empty() ? 1.0 : c.equations.col_scale[col];
    for (Index j = 0; j < columns; ++j)
      out[static_cast<std::size_t>(j) * n + col] =
          scale * static_cast<double>(x[static_cast<std::size_t>(k) * columns + j]);
  }
  return out;
}

template <class T>
bool same_bits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0;
}

double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  return v[v.size() / 2];
}

// One line a task: device, work, part, rows of the front, pivots, tile column, chunks of products, begin, end, waited
// (nanoseconds since the device's first task).
template <class T>
void write_times(const Case& c, const CudaExecutor<T>& gpu, const std::string& path) {
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

template <class T>
nlohmann::json run_case(const Case& c, const Settings& settings, base::ThreadPool& pool) {
  const Index n = c.plan.tree.n, columns = settings.columns;
  std::vector<T> values(static_cast<std::size_t>(c.equations.a.nonzeros()));
  const double largest = solver::scale_values(c.equations, values.data(), pool);
  const double eps = std::is_same_v<T, float> ? 1.2e-7 : 2.2e-16;
  const device::PivotRule rule{0.01, (c.kind == Kind::llt ? 0 : eps) * largest};

  const double setup = now();
  device::cuda::CudaOptions cuda;
  cuda.device = settings.devices.front();
  if (c.devices > 1) cuda.devices.assign(settings.devices.begin(), settings.devices.begin() + c.devices);
  cuda.staging = settings.staging;
  cuda.fail_device = settings.fail_device;
  cuda.patience_seconds = settings.patience;
  cuda.delays.assign(settings.delays.begin(), settings.delays.end());
  base::Timeline timeline;
  if (!settings.times.empty()) cuda.timeline = &timeline;
  auto gpu = device::cuda::make_cuda_executor<T>(c.plan, c.kind, rule, cuda);
  const double setup_seconds = now() - setup;
  const device::FactorOutcome first = gpu->factorize(values);
  if (!settings.times.empty()) write_times(c, *gpu, settings.times);

  std::vector<double> b(static_cast<std::size_t>(n) * columns);
  for (std::size_t k = 0; k < b.size(); ++k) b[k] = 1.0 + static_cast<double>(k % 7) * 0.25;
  const std::vector<T> rhs = right_hand_side<T>(c, b, columns);
  std::vector<T> x1 = rhs;
  gpu->solve(x1.data(), columns, false);
  std::vector<double> factor_times, solve_times;
  bool identical = true;
  for (int k = 0; k < settings.repeat; ++k) {
    factor_times.push_back(gpu->refactorize_again());
    T* device_x = gpu->device_rhs(columns);
    gpu->to_device(device_x, rhs.data(), static_cast<Offset>(rhs.size()));
    solve_times.push_back(gpu->solve_device(device_x, columns, false));
    std::vector<T> x2(rhs.size());
    gpu->from_device(x2.data(), device_x, static_cast<Offset>(x2.size()));
    identical = identical && same_bits(x1, x2);
  }
  const device::FactorOutcome last = gpu->factorize(values);
  const std::vector<double> x = solution_of(c, x1, columns);
  const auto error = matrix::backward_errors(c.a, x, b, columns, Transpose::no, &pool);
  nlohmann::json j{{"system", c.name},
                   {"kind", name_of(c.kind)},
                   {"precision", sizeof(T) == 8 ? "fp64" : "fp32"},
                   {"unknowns", n},
                   {"flops", c.plan.flops},
                   {"nonzeros_factor", c.plan.nonzeros_factor},
                   {"fronts", c.plan.fronts()},
                   {"devices", c.devices},
                   {"analysis_seconds", c.analysis_seconds + c.plan_seconds},
                   {"plan_seconds", c.plan_seconds},
                   {"setup_seconds", setup_seconds},
                   {"refactor_ms", 1e3 * *std::min_element(factor_times.begin(), factor_times.end())},
                   {"refactor_median_ms", 1e3 * median(factor_times)},
                   {"columns", columns},
                   {"solve_ms", 1e3 * *std::min_element(solve_times.begin(), solve_times.end())},
                   {"solve_median_ms", 1e3 * median(solve_times)},
                   {"device_bytes", gpu->peak_bytes()},
                   {"busy_ms", 1e3 * last.busy_seconds},
                   {"waiting_ms", 1e3 * last.waiting_seconds},
                   {"backward_error", error.normwise},
                   {"identical", identical},
                   {"not_positive", first.not_positive},
                   {"negative", first.negative},
                   {"two_by_two", first.two_by_two},
                   {"replaced", first.replaced.size()},
                   {"failed", first.failed.size()},
                   {"determinant", {first.determinant_sign, first.determinant_log}}};
  for (const device::DeviceWork& w : gpu->device_work())
    j["by_device"].push_back({{"name", w.name},
                              {"busy_ms", 1e3 * w.busy_seconds},
                              {"waiting_ms", 1e3 * w.waiting_seconds},
                              {"stolen", w.stolen_subtrees},
                              {"transferred_bytes", w.transferred_bytes},
                              {"bytes", w.peak_bytes}});
  if (c.kind == Kind::lu || settings.small) {
    std::vector<T> y = rhs;
    gpu->solve(y.data(), columns, true);
    // With equal row and column scaling of the transposed system: only the residual of the factored matrix is checked
    // where rows were not permuted.
    if (c.equations.row_of_col.empty() && c.equations.row_scale.empty()) {
      const auto t = matrix::backward_errors(c.a, solution_of(c, y, columns), b, columns, Transpose::yes, &pool);
      j["transposed_error"] = t.normwise;
    }
  }
  if (settings.host) {
    const Case h = prepare(c.name, c.kind, settings, true, pool);
    auto host = device::host::make_host_executor<T>(h.plan, h.kind, rule, pool, nullptr, nullptr);
    const auto outcome = host->factorize(values);
    std::vector<T> y = right_hand_side<T>(h, b, 1);
    host->solve(y.data(), 1, false);
    const std::vector<double> xh = solution_of(h, y, 1);
    double difference = 0, size = 0;
    for (Index k = 0; k < n; ++k) {
      difference = std::max(difference, std::abs(xh[static_cast<std::size_t>(k)] - x[static_cast<std::size_t>(k)]));
      size = std::max(size, std::abs(xh[static_cast<std::size_t>(k)]));
    }
    j["host_difference"] = difference / size;
    j["host_negative"] = outcome.negative;
    j["host_determinant"] = {outcome.determinant_sign, outcome.determinant_log};
  }
  return j;
}

bool good(const nlohmann::json& j) {
  const double eps = j["precision"] == "fp64" ? 2.2e-16 : 1.2e-7;
  bool ok = j["identical"].get<bool>() && j["backward_error"].get<double>() <= 1e3 * eps;
  if (j.contains("transposed_error")) ok = ok && j["transposed_error"].get<double>() <= 1e3 * eps;
  if (j.contains("host_negative")) ok = ok && j["host_negative"] == j["negative"];
  return ok;
}

void print_row(const nlohmann::json& j) {
  std::string floors;
  for (const Floor& f : kFloors)
    if (j["system"] == f.system) floors = fmt::format("{:g}/{:g}", f.factor, f.solve);
  fmt::print(
      "{:<18} x{} {:<4} {} {:>8} {:>9.3g} {:>10.3f} {:>7.2f} {:>9.3f} {:>10} {:>9.1e} {:>4} {:>7.2f} GB {:>6.2f} s",
      j["system"].get<std::string>(), j["devices"].get<int>(), j["kind"].get<std::string>(),
      j["precision"].get<std::string>(), j["unknowns"].get<Index>(), j["flops"].get<double>(),
      j["refactor_ms"].get<double>(), j["flops"].get<double>() / j["refactor_ms"].get<double>() * 1e-9,
      j["solve_ms"].get<double>(), floors, j["backward_error"].get<double>(),
      j["identical"].get<bool>() ? "same" : "DIFF", j["device_bytes"].get<double>() * 1e-9,
      j["analysis_seconds"].get<double>());
  if (j["kind"] != "llt")
    fmt::print("  neg {} 2x2 {} repl {} fail {}", j["negative"].get<Index>(), j["two_by_two"].get<Index>(),
               j["replaced"].get<std::size_t>(), j["failed"].get<std::size_t>());
  if (j.contains("transposed_error")) fmt::print("  T {:.1e}", j["transposed_error"].get<double>());
  if (j.contains("host_difference"))
    fmt::print("  host diff {:.1e} neg {} det {:.10g} / {:.10g}", j["host_difference"].get<double>(),
               j["host_negative"].get<Index>(), j["determinant"][1].get<double>(),
               j["host_determinant"][1].get<double>());
  fmt::print("{}\n", good(j) ? "" : "   FAILED");
  if (j.contains("by_device"))
    for (const auto& d : j["by_device"])
      fmt::print("    {}: busy {:.2f} ms, waiting {:.2f} ms, stolen {}, moved {:.3f} GB, holds {:.2f} GB\n",
                 d["name"].get<std::string>(), d["busy_ms"].get<double>(), d["waiting_ms"].get<double>(),
                 d["stolen"].get<int>(), d["transferred_bytes"].get<double>() * 1e-9, d["bytes"].get<double>() * 1e-9);
  std::fflush(stdout);
}

struct Wish {
  std::string system;
  Kind kind;
};

std::vector<Wish> wishes(const Settings& s) {
  std::vector<Wish> list;
  for (const auto& name : s.systems) list.push_back({name, s.kind});
  if (s.small && s.systems.empty()) {
    for (const char* name : {"poisson 3", "poisson 9", "elasticity 2", "elasticity 6", "elasticity 10", "plate 30"})
      for (const Kind k : {Kind::llt, Kind::ldlt, Kind::lu})
        if (s.kind == Kind::automatic || s.kind == k) list.push_back({name, k});
    for (const char* name : {"kkt 2 3 2 2", "kkt 10 2 1 1", "kkt 3 6 4 4"})
      for (const Kind k : {Kind::ldlt, Kind::lu})
        if (s.kind == Kind::automatic || s.kind == k) list.push_back({name, k});
    for (const char* name : {"gyroscopic 3", "gyroscopic 8"})
      if (s.kind == Kind::automatic || s.kind == Kind::lu) list.push_back({name, Kind::lu});
  }
  return list;
}

// What a plan would ask of each GPU.
void show_plan(const Case& c, const Settings& settings) {
  const double start = now();
  const auto d = device::cuda::make_device_plan(c.plan, c.kind);
  const double seconds = now() - start, unit = settings.fp32 ? 4e-9 : 8e-9;
  const auto& a = c.plan.assignment;
  Index top = 0;
  double top_flops = 0;
  std::vector<double> alone(static_cast<std::size_t>(c.devices), 0);
  for (Index f = 0; f < c.plan.fronts(); ++f) {
    const auto& l = c.plan.layout[f];
    const double flops = analysis::front_flops(l.pivots, l.rows, c.kind == Kind::lu);
    if (a.subtree(f) < 0) {
      ++top;
      top_flops += flops;
    } else {
      alone[static_cast<std::size_t>(a.subtrees[static_cast<std::size_t>(a.subtree(f))].device)] += flops;
    }
  }
  fmt::print("{:<18} x{} {:<4} {} fronts, top {} with {:.1f} % of the work, {} sub-trees, plan {:.3f} + {:.3f} s\n",
             c.name, c.devices, name_of(c.kind), c.plan.fronts(), top, 100 * top_flops / c.plan.flops,
             a.subtrees.size(), c.plan_seconds, seconds);
  const double simulation = now();
  const factor::SimulatedRun run = factor::simulate(d, factor::h200_rates(c.kind));
  double busy = 0;
  for (const double b : run.busy) busy += b / run.seconds / c.devices;
  fmt::print(
      "    simulated on H200: {:.3f} ms, {:.1f} TFLOP/s, busy {:.0f} %; model {:.3f} ms; simulation took {:.2f} s\n",
      1e3 * run.seconds, 1e-12 * c.plan.flops / run.seconds, 100 * busy,
      1e3 * analysis::gpu_time(c.plan.tree, c.kind == Kind::lu, c.kind == Kind::ldlt).on(c.devices),
      now() - simulation);
  if (!settings.lists) return;
  for (std::size_t x = 0; x < d.lists.size(); ++x) {
    double gigabytes = unit * static_cast<double>(d.regions[0]);
    for (std::size_t r = 1; r < d.regions.size(); ++r)
      if (d.region_device[r] == static_cast<int>(x)) gigabytes += unit * static_cast<double>(d.regions[r]);
    if (!d.place_space.empty()) gigabytes += unit * static_cast<double>(d.place_space[x]);
    const auto& l = d.lists[x];
    fmt::print("    #{}: {} tasks ({} narrow), {} solve tasks, {:.1f} % of the work alone, {:.3f} GB\n", x,
               l.tasks.size(), l.narrow_tasks, l.up.size() + l.down.size(), 100 * alone[x] / c.plan.flops, gigabytes);
  }
}

// Without a GPU: what the plans would ask of one.
int show_plans(const Settings& settings) {
  base::ThreadPool pool(base::available_cores());
  for (const Wish& wish : wishes(settings)) {
    Case c = prepare(wish.system, wish.kind, settings, false, pool);
    for (const int devices : settings.counts) {
      lay_out(c, devices, settings, false, pool);
      show_plan(c, settings);
    }
  }
  return 0;
}

int run(const Settings& settings) {
  if (settings.plan_only) return show_plans(settings);
  const auto available = device::cuda::available_devices();
  if (available.devices.empty()) {
    fmt::print("skipped: {}\n", available.reason);
    return 77;
  }
  const auto& gpu = available.devices.front();
  fmt::print("{}, CUDA driver {}, compute {}.{}\n", gpu.name, gpu.driver, gpu.compute_major, gpu.compute_minor);
  fmt::print("{:<18} {:<4} {} {:>8} {:>9} {:>10} {:>7} {:>9} {:>10} {:>9}\n", "system", "kind", "prec", "unknowns",
             "flops", "refactor ms", "TFLOP/s", "solve ms", "floors", "error");
  base::ThreadPool pool(base::available_cores());
  nlohmann::json rows = nlohmann::json::array();
  int failures = 0;
  for (const Wish& wish : wishes(settings)) {
    try {
      Case c = prepare(wish.system, wish.kind, settings, false, pool);
      for (const int devices : settings.counts) {
        lay_out(c, devices, settings, false, pool);
        rows.push_back(settings.fp32 ? run_case<float>(c, settings, pool) : run_case<double>(c, settings, pool));
        print_row(rows.back());
        failures += good(rows.back()) ? 0 : 1;
      }
    } catch (const std::exception& e) {
      fmt::print("{:<18} FAILED: {}\n", wish.system, e.what());
      std::fflush(stdout);
      ++failures;
    }
  }
  if (!settings.out.empty()) {
    const std::time_t t = std::time(nullptr);
    char date[32];
    std::strftime(date, sizeof date, "%Y-%m-%d", std::gmtime(&t));
    std::string name = gpu.name;
    std::replace(name.begin(), name.end(), ' ', '-');
    std::filesystem::create_directories(settings.out);
    const nlohmann::json report{
        {"device", gpu.name}, {"driver", gpu.driver}, {"commit", settings.commit}, {"date", date}, {"rows", rows}};
    const std::string several = settings.devices.size() > 1 ? fmt::format("x{}", settings.devices.size()) : "";
    std::ofstream(settings.out + "/" + name + several + "-" + date + (settings.fp32 ? "-fp32" : "") + ".json")
        << report.dump(1) << '\n';
  }
  fmt::print("{} of {} checks failed\n", failures, wishes(settings).size());
  return failures == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(parse(argc, argv));
  } catch (const std::exception& e) {
    std::cerr << "espalier_gpu_check: " << e.what() << '\n';
    return 2;
  }
}
