// The memory curve: one system factored on the GPU with several budgets of device memory, in core and streaming, each
// answer judged by an independent residual; beside each point the time that the host link bounds.
//   espalier_stream_curve [--kind llt|ldlt|lu] [--fp32] [--repeat N] [--small] [--plan] [--out FILE] [--refuse K]
//                         SYSTEM BUDGET ...         SYSTEM: "elasticity 64"; BUDGET in MiB
// --plan: predicted figures only, no GPU. --small: budgets by parts of the floor, random ones, each twice.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <iostream>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>

#include "analysis/ordering.hpp"
#include "device/cuda/cuda_executor.hpp"
#include "device/cuda/cuda_stream.hpp"
#include "device/host/host_executor.hpp"
#include "factor/streaming_executor.hpp"
#include "matrix/generators/generate.hpp"
#include "matrix/residual.hpp"
#include "solver/equations.hpp"

namespace {

using namespace espalier;

struct Settings {
  bool fp32 = false, small = false, plan_only = false;
  int repeat = 3, refuse = 0, copy_threads = 0, lanes = 1;
  double step = 0, group = 0;
  Kind kind = Kind::automatic;
  std::string out;
  std::string system;
  std::vector<Offset> budgets;  // bytes
};

double now() { return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count(); }

std::vector<std::string> words_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> words;
  for (std::string w; in >> w;) words.push_back(w);
  return words;
}

Settings parse(int argc, char** argv) {
  Settings s;
  for (int k = 1; k < argc; ++k) {
    const std::string a = argv[k];
    const auto value = [&]() -> std::string {
      if (k + 1 >= argc) throw std::invalid_argument(a + " needs a value");
      return argv[++k];
    };
    if (a == "--fp32")
      s.fp32 = true;
    else if (a == "--small")
      s.small = true;
    else if (a == "--plan")
      s.plan_only = true;
    else if (a == "--repeat")
      s.repeat = std::stoi(value());
    else if (a == "--refuse")
      s.refuse = std::stoi(value());
    else if (a == "--copy-threads")
      s.copy_threads = std::stoi(value());
    else if (a == "--step")
      s.step = std::stod(value());
    else if (a == "--group")
      s.group = std::stod(value());
    else if (a == "--lanes")
      s.lanes = std::stoi(value());
    else if (a == "--out")
      s.out = value();
    else if (a == "--kind") {
      const std::string kind = value();
      s.kind = kind == "llt" ? Kind::llt : kind == "ldlt" ? Kind::ldlt : Kind::lu;
    } else if (s.system.empty())
      s.system = a;
    else
      s.budgets.push_back(static_cast<Offset>(std::stod(a) * (1 << 20)));
  }
  return s;
}

struct Case {
  Kind kind = Kind::llt;
  SparseMatrix a;
  solver::Equations equations;
  analysis::Plan plan;
};

Case prepare(const Settings& settings, base::ThreadPool& pool) {
  Case c;
  c.a = matrix::generate(matrix::parse_generator(words_of(settings.system)), &pool);
  c.kind = solver::choose_kind(c.a, settings.kind, pool);
  c.equations = solver::copy_equations(c.a, c.kind, pool);
  solver::scale_and_match(c.equations, c.kind, Options{}, pool);
  analysis::TreeOptions tree_options;
  tree_options.pair = c.equations.pair;
  tree_options.zero_diagonal = c.equations.zero_diagonal;
  auto tree = analysis::build_tree(analysis::graph_of(c.equations.a, pool, c.equations.row_of_col), tree_options, pool);
  device::cuda::DeviceTuning tuning;
  if (settings.small) tuning.narrow_rows = 200;  // small systems, too, shall have fronts of both widths
  c.plan = analysis::make_plan(std::move(tree), c.equations.a, c.equations.row_of_col,
                               device::cuda::cuda_plan_options(c.kind, tuning), pool);
  return c;
}

template <class T>
class Curve {
 public:
  Curve(const Case& c, const Settings& settings, base::ThreadPool& pool)
      : c_(c), settings_(settings), pool_(pool), values_(static_cast<std::size_t>(c.equations.a.nonzeros())) {
    const double largest = solver::scale_values(c.equations, values_.data(), pool);
    const double eps = sizeof(T) == 4 ? 1.2e-7 : 2.2e-16;
    rule_ = {0.01, (c.kind == Kind::llt ? 0 : eps) * largest};
    for (std::size_t k = 0; k < static_cast<std::size_t>(c.plan.tree.n); ++k)
      b_.push_back(1.0 + static_cast<double>(k % 7) * 0.25);
  }

  nlohmann::json in_core() {
    auto gpu = device::cuda::make_cuda_executor<T>(c_.plan, c_.kind, rule_);
    nlohmann::json j = measure(*gpu);
    double best = 1e30;
    for (int k = 0; k < settings_.repeat; ++k) best = std::min(best, gpu->refactorize_again());
    j["refactor_ms"] = 1e3 * best;
    j["budget"] = 0;
    in_core_ms_ = 1e3 * best;
    print(j);
    return j;
  }

  nlohmann::json streaming(Offset budget) {
    factor::StreamingOptions o;
    o.budget_bytes = budget;
    o.rates = rates();
    o.copy_threads = settings_.copy_threads > 0 ? settings_.copy_threads : std::max(1, pool_.size() / 2);
    device::cuda::CudaStreamOptions d;
    d.refuse_allocation = settings_.refuse;
    const double start = now();
    auto executor = factor::make_streaming_executor<T>(
        device::cuda::make_cuda_stream<T>(c_.plan, c_.kind, rule_, pool_, d), o, nullptr);
    const double setup = now() - start;
    nlohmann::json j = measure(*executor);
    const device::StreamReport r = executor->streaming();
    j["budget"] = budget;
    j["setup_seconds"] = setup;
    j["predicted_bytes"] = r.predicted_bytes;
    j["bytes_in"] = r.bytes_in;
    j["bytes_out"] = r.bytes_out;
    j["link_ms"] = 1e3 * r.link_seconds;
    j["predicted_ms"] = 1e3 * r.predicted_seconds;
    j["copy_in_ms"] = 1e3 * r.copy_in_seconds;
    j["copy_out_ms"] = 1e3 * r.copy_out_seconds;
    j["steps"] = r.steps;
    j["groups"] = r.groups;
    print(j);
    return j;
  }

  Offset floor_of() {
    try {
      (void)analysis::plan_streaming(*device::cuda::make_cuda_stream<T>(c_.plan, c_.kind, rule_, pool_), 1000);
    } catch (const Error& e) {
      const std::string text = e.what(), mark = "streaming needs: ";
      return std::stoll(text.substr(text.find(mark) + mark.size()));
    }
    return 0;
  }

  void print_plan(Offset budget) {
    const double start = now();
    const auto backend = device::cuda::make_cuda_stream<T>(c_.plan, c_.kind, rule_, pool_);
    const double made = now();
    const analysis::StreamingPlan p = analysis::plan_streaming(*backend, budget, rates());
    const auto steps = std::count_if(p.steps.begin(), p.steps.end(), [](const auto& s) { return !s.fronts.empty(); });
    fmt::print(
        "{:>9.1f} MiB: predicted {:8.1f} ms, link {:8.1f} ms, in {:7.2f} GB, out {:7.2f} GB, {} steps, {} "
        "groups, {} lanes, {} operations; store {:.2f} GB; planned in {:.2f} s (tables {:.2f} s)\n",
        static_cast<double>(budget) / (1 << 20), 1e3 * p.predicted_seconds, 1e3 * p.link_seconds,
        static_cast<double>(p.bytes_in) * 1e-9, static_cast<double>(p.bytes_out) * 1e-9, steps, p.groups.size(),
        p.lanes, p.ops.size(), static_cast<double>(p.store_elements) * sizeof(T) * 1e-9, now() - made, made - start);
  }

  int failures = 0;

 private:
  analysis::StreamRates rates() const {
    return {.lanes = settings_.lanes, .step = settings_.step, .group = settings_.group};
  }
  std::vector<T> right_hand_side() const {
    std::vector<T> x(b_.size());
    for (Index k = 0; k < c_.plan.tree.n; ++k) {
      const Index row = c_.equations.row_of(c_.plan.tree.order[k]);
      const double scale = c_.equations.row_scale.empty() ? 1.0 : c_.equations.row_scale[row];
      x[static_cast<std::size_t>(k)] = static_cast<T>(scale * b_[static_cast<std::size_t>(row)]);
    }
    return x;
  }
  double error_of(const std::vector<T>& x) const {
    std::vector<double> out(x.size());
    for (Index k = 0; k < c_.plan.tree.n; ++k) {
      const Index col = c_.plan.tree.order[k];
      const double scale = c_.equations.col_scale.empty() ? 1.0 : c_.equations.col_scale[col];
      out[static_cast<std::size_t>(col)] = scale * static_cast<double>(x[static_cast<std::size_t>(k)]);
    }
    return matrix::backward_errors(c_.a, out, b_, 1, Transpose::no, &pool_).normwise;
  }

  nlohmann::json measure(device::Executor<T>& executor) {
    std::vector<double> factor, solve;
    std::vector<T> first;
    bool identical = true;
    device::FactorOutcome outcome;
    for (int k = 0; k <= settings_.repeat; ++k) {
      const double start = now();
      outcome = executor.factorize(values_);
      factor.push_back(now() - start);
      std::vector<T> x = right_hand_side();
      const double before = now();
      executor.solve(x.data(), 1, false);
      solve.push_back(now() - before);
      if (k == 0) first = x;
      identical = identical && std::memcmp(x.data(), first.data(), x.size() * sizeof(T)) == 0;
    }
    std::vector<double> later(factor.begin() + 1, factor.end());
    std::sort(later.begin(), later.end());
    const double error = error_of(first);
    return {{"system", settings_.system},
            {"precision", sizeof(T) == 8 ? "fp64" : "fp32"},
            {"first_ms", 1e3 * factor.front()},
            {"refactor_ms", 1e3 * later.front()},
            {"refactor_median_ms", 1e3 * later[later.size() / 2]},
            {"solve_ms", 1e3 * *std::min_element(solve.begin(), solve.end())},
            {"backward_error", error},
            {"identical", identical},
            {"peak_bytes", executor.peak_bytes()},
            {"not_positive", outcome.not_positive},
            {"negative", outcome.negative},
            {"two_by_two", outcome.two_by_two},
            {"determinant_log", outcome.determinant_log},
            {"flops", c_.plan.flops}};
  }

  void print(const nlohmann::json& j) {
    const double eps = sizeof(T) == 8 ? 2.2e-16 : 1.2e-7;
    const Offset budget = j["budget"].get<Offset>();
    const bool good = j["identical"].get<bool>() && j["backward_error"].get<double>() <= 1e3 * eps &&
                      (budget == 0 || (j["peak_bytes"].get<Offset>() <= budget &&
                                       j["peak_bytes"].get<Offset>() == j["predicted_bytes"].get<Offset>()));
    failures += good ? 0 : 1;
    const double ms = j["refactor_ms"].get<double>();
    fmt::print(
        "{:>9.1f} MiB {:>9.1f} ms (first {:>8.1f}, median {:>8.1f}) rate {:>5.3f} {:>6.2f} TFLOP/s solve {:>8.2f} "
        "ms error {:.1e} {} det {:.8g} neg {}",
        static_cast<double>(budget) / (1 << 20), ms, j["first_ms"].get<double>(), j["refactor_median_ms"].get<double>(),
        in_core_ms_ / ms, c_.plan.flops / ms * 1e-9, j["solve_ms"].get<double>(), j["backward_error"].get<double>(),
        j["identical"].get<bool>() ? "same" : "DIFF", j["determinant_log"].get<double>(), j["negative"].get<Index>());
    if (budget > 0)
      fmt::print(
          " | link {:.1f} ms, predicted {:.1f} ms, in {:.2f} out {:.2f} GB, host copies in {:.0f} out {:.0f} ms, {} "
          "steps {} groups, setup {:.1f} s",
          j["link_ms"].get<double>(), j["predicted_ms"].get<double>(), j["bytes_in"].get<double>() * 1e-9,
          j["bytes_out"].get<double>() * 1e-9, j["copy_in_ms"].get<double>(), j["copy_out_ms"].get<double>(),
          j["steps"].get<Index>(), j["groups"].get<Index>(), j["setup_seconds"].get<double>());
    fmt::print("{}\n", good ? "" : "  FAILED");
    std::fflush(stdout);
  }

  const Case& c_;
  const Settings& settings_;
  base::ThreadPool& pool_;
  std::vector<T> values_;
  device::PivotRule rule_;
  std::vector<double> b_;
  double in_core_ms_ = 0;
};

template <class T>
int run(const Settings& settings) {
  base::ThreadPool pool(base::available_cores());
  const double start = now();
  const Case c = prepare(settings, pool);
  fmt::print("{}: {} unknowns, {:.3g} flops, {} fronts, analysis {:.2f} s\n", settings.system, c.plan.tree.n,
             c.plan.flops, c.plan.fronts(), now() - start);
  Curve<T> curve(c, settings, pool);
  std::vector<Offset> budgets = settings.budgets;
  if (settings.small) {
    const Offset floor = curve.floor_of();
    std::mt19937_64 random(3);
    for (const double factor : {1.0, 1.3, 2.0, 4.0}) budgets.push_back(static_cast<Offset>(factor * floor));
    for (int k = 0; k < 3; ++k) budgets.push_back(floor + static_cast<Offset>(random() % (4 * floor)));
  }
  if (settings.plan_only) {
    for (const Offset b : budgets) curve.print_plan(b);
    return 0;
  }
  nlohmann::json rows = nlohmann::json::array();
  if (settings.refuse == 0) rows.push_back(curve.in_core());
  for (const Offset b : budgets) {
    try {
      rows.push_back(curve.streaming(b));
    } catch (const std::exception& e) {
      fmt::print("{:>9.1f} MiB failed: {}\n", static_cast<double>(b) / (1 << 20), e.what());
      ++curve.failures;
    }
  }
  if (!settings.out.empty()) std::ofstream(settings.out) << rows.dump(1) << '\n';
  fmt::print("{} of {} points failed\n", curve.failures, budgets.size());
  return curve.failures == 0 ? 0 : 1;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    const Settings settings = parse(argc, argv);
    return settings.fp32 ? run<float>(settings) : run<double>(settings);
  } catch (const std::exception& e) {
    std::cerr << "espalier_stream_curve: " << e.what() << '\n';
    return 2;
  }
}
