#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "analysis/verify.hpp"
#include "base/beside.hpp"
#include "base/forks.hpp"
#include "device/cuda/executor/cuda_executor.hpp"
#include "device/cuda/tables/device_plan.hpp"
#include "device/host/host_executor.hpp"
#include "matrix/validate.hpp"
#include "solver/analysis_file.hpp"
#include "solver/option_text.hpp"
#include "solver/solver_impl.hpp"

namespace espalier {

namespace {

void check_matrix(const MatrixView& a, base::ThreadPool& pool) {
  if (a.rows != a.cols)
    throw Error(StatusCode::invalid_input,
                fmt::format("the matrix is {} x {}; a linear system needs a square one", a.rows, a.cols));
  if (a.rows == 0) throw Error(StatusCode::invalid_input, "the matrix has no rows; there is nothing to solve");
  matrix::validate(a, &pool);
}

Offset plan_bytes(const plan::Plan& p) {
  const auto of = [](const auto& v) { return static_cast<Offset>(v.size() * sizeof(v[0])); };
  return of(p.tree.order) + of(p.tree.rows) + of(p.relative) + of(p.layout) + of(p.entry_ptr) + of(p.entries) +
         of(p.tasks) + of(p.memory.factor) * 4 + of(p.tree.parent) * 6;
}

}  // namespace

Offset Solver::Impl::analysis_bytes() const { return equations.bytes() + residual.bytes() + plan_bytes(plan); }

Offset Solver::Impl::predicted_host_bytes() const {
  const Offset n = equations.n(), entries = equations.a.nonzeros();
  const Offset value_bytes = single() ? sizeof(float) : sizeof(double);
  const Offset numbers = single() ? device::host::host_bytes<float>(plan, kind, pool.size())
                                  : device::host::host_bytes<double>(plan, kind, pool.size());
  const Offset vectors = 4 * n * static_cast<Offset>(sizeof(double));  // of llt's smallest pivots, of the refinement
  return analysis_bytes() + numbers + (entries + n) * value_bytes + vectors;
}

// @throws Error(out_of_memory) where the budget is too small for the factorization as it is planned
void Solver::Impl::charge_analysis() {
  budget.give_back(std::exchange(charged, 0));
  const bool in_core =
      device.backend == solver::DeviceChoice::Backend::host &&
      !(device.budgeted && (options.device_memory_bytes > 0 || !options.device_memory_each_bytes.empty()));
  const Offset limit = budget.limit(), needed = in_core ? predicted_host_bytes() : analysis_bytes();
  if (limit > 0 && needed > limit)
    throw Error(
        StatusCode::out_of_memory,
        fmt::format(
            "the factorization needs {} on the host, its budget is {}; a budget of at least {} bytes would do, or "
            "fewer threads",
            base::format_bytes(needed), base::format_bytes(limit), needed));
  budget.take(analysis_bytes());
  charged = analysis_bytes();
}

void Solver::Impl::analyze(const MatrixView& a) {
  const double start = base::now_seconds();
  state = State::empty;
  check_matrix(a, pool);
  const Kind wish = options.kind;
  const Kind chosen = solver::choose_kind(a, wish, pool);
  kind_may_change = wish == Kind::automatic && chosen == Kind::llt;
  moved_pivots = 0;
  free_pivots = false;
  analyze_as(a, chosen);
  describe_plan(start);
}

// The driver's start and the contexts take as long as an analysis.
void Solver::Impl::open_gpus() {
  if (gpus_open.valid() || !options.device.starts_with("gpu")) return;
  gpu_forks = base::forks();
  gpus_open = base::start_beside([device = options.device] { device::cuda::open_devices(solver::named_gpus(device)); });
}

void Solver::Impl::analyze_as(const MatrixView& a, Kind chosen) {
  open_gpus();
  numeric.reset();
  kind = chosen;
  analysis = AnalysisResult{};
  equations = solver::copy_equations(a, kind, pool);
  const double copied = base::now_seconds();
  solver::scale_and_match(equations, kind, options, pool);
  const double matched = base::now_seconds();
  analysis.matching_seconds = matched - copied;

  analysis::TreeOptions tree_options;
  tree_options.permutation = options.permutation;
  tree_options.pair = equations.pair;
  tree_options.zero_diagonal = equations.zero_diagonal;
  analysis::TreeStatistics statistics;
  analysis::AssemblyTree tree;
  residual = solve::ResidualOperator(equations.a, pool);
  {
    const analysis::Graph graph = analysis::graph_of(equations.a, pool, equations.row_of_col, &residual.row_index());
    tree = analysis::build_tree(graph, tree_options, pool, &statistics);
  }
  const double ordered = base::now_seconds();
  analysis.ordering_seconds = ordered - matched;
  lay_out_plan(std::move(tree));
  analysis.plan_seconds = base::now_seconds() - ordered;
}

void Solver::Impl::lay_out_plan(analysis::AssemblyTree tree) {
  const plan::Machine machine = plan::machine_with(options.machine);
  predicted = solver::predict_time(tree, kind, single(), pool.size(), machine);
  device = solver::choose_device(options, predicted);
  if (free_pivots && device.backend == solver::DeviceChoice::Backend::cuda) {
    device = solver::DeviceChoice();
    device.budgeted = false;
  }
  if (!device.notice.empty()) log(device.notice);
  if (device.backend == solver::DeviceChoice::Backend::cuda) {
    device::cuda::DeviceTuning tuning;
    tuning.max_block_size = options.max_block_size;
    tuning.machine = machine.gpu;
    plan::PlanOptions gpu_options = device::cuda::cuda_plan_options(kind, tuning, device.devices);
    gpu_options.additional_subtrees = options.sharing.additional_subtrees;
    gpu_options.stealing = options.sharing.stealing && device.unequal;  // among equal ones it only costs (measured)
    gpu_options.shared_top = options.sharing.shared_top;
    gpu_options.device_speed = device.speed;
    plan =
        plan::make_plan(std::move(tree), equations.a, equations.row_of_col, gpu_options, pool, &residual.row_index());
    return;
  }
  plan::PlanOptions plan_options;
  plan_options.tiles.panel = static_cast<Index>(single() ? 64 / sizeof(float) : 64 / sizeof(double));
  plan_options.tiles.max_block_size = free_pivots ? 0 : options.max_block_size;
  plan_options.machine = machine.host;
  plan_options.unsymmetric = kind == Kind::lu;
  plan_options.ldlt = kind == Kind::ldlt;
  plan_options.devices = device.devices;
  plan_options.additional_subtrees = options.sharing.additional_subtrees;
  plan_options.stealing = options.sharing.stealing;
  plan_options.shared_top = options.sharing.shared_top;
  plan_options.interleave = static_cast<Index>(2 * pool.size());
  plan_options.reuse_distance = static_cast<Index>(16 * pool.size());
  plan = plan::make_plan(std::move(tree), equations.a, equations.row_of_col, plan_options, pool, &residual.row_index());
}

void Solver::Impl::describe_plan(double start) {
  AnalysisResult& r = analysis;
  r.kind = kind;
  r.nonzeros_factor = plan.nonzeros_factor;
  r.flops = plan.flops;
  r.fronts = plan.fronts();
  for (Index f = 0; f < plan.fronts(); ++f) {
    r.tiers = std::max(r.tiers, plan.tier[f] + 1);
    r.largest_front = std::max(r.largest_front, plan.layout[f].rows);
  }
  r.predicted_bytes = predicted_host_bytes();
  const bool on_gpu = device.backend == solver::DeviceChoice::Backend::cuda;
  r.predicted_seconds = on_gpu ? predicted.gpu_seconds_on(device.devices) : predicted.host_seconds;
  r.device = device.reason;
  state = State::analyzed;
  r.seconds = base::now_seconds() - start;
  log(fmt::format("analysis: {} fronts in {} tiers, largest {}, {:.3g} entries of the factor, {:.3g} flops, {:.3f} s",
                  r.fronts, r.tiers, r.largest_front, static_cast<double>(r.nonzeros_factor), r.flops, r.seconds));
}

void Solver::Impl::load_analysis(const std::string& path, const MatrixView& a) {
  const double start = base::now_seconds();
  state = State::empty;
  check_matrix(a, pool);
  solver::SavedAnalysis saved = solver::read_analysis(path, solver::pattern_hash(a, pool));
  moved_pivots = 0;
  free_pivots = false;
  if (options.kind != Kind::automatic && options.kind != saved.kind)
    throw Error(StatusCode::invalid_input, fmt::format("{}: the saved analysis is for {}, but {} was asked for", path,
                                                       solver::name_of(saved.kind), solver::name_of(options.kind)));
  (void)solver::choose_kind(a, saved.kind, pool);  // llt and ldlt need a symmetric matrix
  open_gpus();
  numeric.reset();
  kind = saved.kind;
  kind_may_change = options.kind == Kind::automatic && kind == Kind::llt;
  analysis = AnalysisResult{};
  equations = solver::copy_equations(a, kind, pool);
  if (saved.tree.n != equations.n())
    throw Error(StatusCode::invalid_input, path + ": the analysis belongs to a matrix of another size");
  equations.row_scale = std::move(saved.row_scale);
  equations.col_scale = std::move(saved.col_scale);
  equations.row_of_col = std::move(saved.row_of_col);
  solver::note_determinant(equations);
  residual = solve::ResidualOperator(equations.a, pool);
  {
    const analysis::Graph graph = analysis::graph_of(equations.a, pool, equations.row_of_col, &residual.row_index());
    if (const std::string wrong = analysis::verify_tree(graph, saved.tree); !wrong.empty())
      throw Error(
          StatusCode::invalid_input,
          fmt::format("{}: the file is not a valid analysis of this matrix: {}; analyze the matrix and save the "
                      "analysis again",
                      path, wrong));
  }
  lay_out_plan(std::move(saved.tree));
  analysis.plan_seconds = base::now_seconds() - start;
  describe_plan(start);
}

}  // namespace espalier
