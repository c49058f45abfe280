#include "solver/analysis/analysis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <string_view>
#include <utility>

#include "analysis/ordering.hpp"
#include "analysis/verify.hpp"
#include "base/stage.hpp"
#include "matrix/validate.hpp"
#include "plan/plan_bytes.hpp"
#include "plan/regions.hpp"
#include "solve/rank_residual.hpp"
#include "solver/analysis/analysis_draft.hpp"
#include "solver/analysis/analysis_file.hpp"
#include "solver/analysis/condition_guess.hpp"
#include "solver/options/executor_choice.hpp"
#include "solver/options/option_text.hpp"
#include "solver/options/precision_choice.hpp"
#include "solver/ranks/rank_ordering.hpp"

namespace espalier::solver {

void check_matrix(const GivenMatrix& given, base::ThreadPool& pool) {
  const MatrixView& a = given.a;
  if (a.rows != a.cols)
    throw Error(StatusCode::invalid_input,
                fmt::format("the matrix is {} x {}; a linear system needs a square one", a.rows, a.cols));
  if (a.rows == 0) throw Error(StatusCode::invalid_input, "the matrix has no rows; there is nothing to solve");
  if (given.numbers == base::Numbers::real)
    matrix::validate(a, &pool);
  else
    matrix::validate(complex_view(given), &pool);
}

namespace {

device::PlanWish wish_of(const System& system, const Context& context) {
  device::PlanWish wish;
  wish.kind = system.kind;
  wish.precision = context.precision();
  wish.complex = system.complex_factor();
  wish.max_block_size = context.options.max_block_size;
  wish.sharing = context.options.sharing;
  wish.keep_contributions = context.options.partial_refactorization;
  wish.threads = context.threads();
  if (context.link != nullptr) {
    wish.ranks = context.link->size();
    wish.rank = context.link->rank();
  }
  wish.machine = plan::machine_with(context.options.machine);
  return wish;
}

plan::Plan bordered_plan(analysis::AssemblyTree tree, const System& system, const plan::PlanOptions& options,
                         base::ThreadPool& pool) {
  const BorderedPattern pattern = with_border(system.prepared, *system.border);
  plan::Plan plan = plan::make_plan(std::move(tree), pattern.a, system.prepared.row_of_col, options, pool);
  for (plan::EntryPlace& e : plan.entries) e = {pattern.source[at(e.source())], e.row(), e.col(), e.transposed()};
  return plan;
}

// Where devices have memory of their own: whether what the plan keeps has place there beside a tenth for tables and
// vectors. The numbers of a pattern before give their memory away.
bool has_room(const plan::Plan& plan, const DeviceChoice& device, const Context& context,
              const plan::KeptEntries* kept) {
  const auto size = static_cast<Offset>(context.precision() == Precision::fp64 ? sizeof(double) : sizeof(float));
  const Offset held = kept != nullptr && kept->places ? kept->before.memory.size * size : 0;
  const std::vector<Offset> elements = plan::elements_by_device(plan), budgets = budgets_of(device, context.options);
  for (std::size_t d = 0; d < elements.size(); ++d) {
    const Offset free = device.backend->free_bytes(device.numbers[d]) + held, needed = elements[d] * size;
    if (needed + needed / 10 > (budgets[d] > 0 ? std::min(budgets[d], free) : free)) return false;
  }
  return true;
}

// Where all fits on a device without what fronts leave for their parents (PlanOptions::keep_contributions), and not
// with it, that is not kept. What does not fit either way goes out of core, which stores it.
void keep_where_it_fits(plan::Plan& plan, const DeviceChoice& device, const Context& context,
                        const plan::KeptEntries* kept) {
  const bool asked = plan.options.keep_contributions && plan.options.arrays != nullptr;
  if (!asked || has_room(plan, device, context, kept)) return;
  plan::MemoryPlan keeping = plan.memory;
  plan.options.keep_contributions = false;
  const plan::ArraySizes sizes = plan::array_sizes(plan, plan::name_regions(plan, true));
  plan::plan_memory(plan, &sizes, context.pool.size());
  if (has_room(plan, device, context, kept))
    return context.log("a device has no memory for what all fronts make: factorizations make everything");
  plan.options.keep_contributions = true;
  plan.memory = std::move(keeping);
}

}  // namespace

std::shared_ptr<const matrix::RowIndex> share_rows(System& system, const DeviceChoice& device, const Context& context) {
  // Residuals of smaller matrices are sooner computed on each rank than gathered; devices of ranks compute them whole.
  constexpr Offset kEntriesToShare = 1 << 15;
  std::shared_ptr<const matrix::RowIndex> whole = system.rows;
  const MatrixView a = system.prepared.a;
  if (context.link == nullptr || device.one_a_rank || a.nonzeros() < kEntriesToShare) return whole;
  const solve::OwnRows mine = solve::own_rows(a.rows, context.link->rank(), context.link->size());
  system.rows = std::make_shared<const matrix::RowIndex>(matrix::rows_of_index(*whole, mine.first, mine.end));
  system.rows_are_shared = true;
  return whole;
}

Analysis lay_out(std::shared_ptr<const System> system, analysis::AssemblyTree tree, Changes changes,
                 const Context& context, const matrix::RowIndex* rows, const plan::KeptEntries* kept) {
  device::PlanWish wish = wish_of(*system, context);
  if (changes.free_pivots) wish.max_block_size = 0;
  wish.devices = changes.device.devices();
  if (changes.device.one_a_rank) wish.ranks = 1, wish.rank = 0, wish.keep_contributions = false;  // as in one process
  wish.unequal = changes.device.unequal;
  wish.speed = changes.device.speed;
  Analysis made;
  const plan::PlanOptions options = changes.device.backend->plan_options(wish);
  if (system->real_form) rows = &system->real_form->rows;
  made.plan = tree.border > 0 ? bordered_plan(std::move(tree), *system, options, context.pool)
                              : plan::make_plan(std::move(tree), system->factored_pattern(),
                                                system->factored_row_of_col(), options, context.pool, rows, kept);
  keep_where_it_fits(made.plan, changes.device, context, kept);
  made.system = std::move(system);
  made.device = std::move(changes.device);
  made.moved_pivots = changes.moved_pivots;
  made.free_pivots = changes.free_pivots;
  made.fp64 = context.raised;
  return made;
}

// What does not fit in the host's budget goes to the disk, if there is one.
void predict_disk(const Analysis& a, const Context& context, AnalysisResult& r) {
  const Offset limit = context.budget.limit();
  if (context.options.scratch.empty() || limit <= 0 || r.predicted_bytes <= limit) return;
  try {
    const DiskForecast disk = predict_disk(a, context, limit - a.bytes());  // as a factorization finds it
    if (disk.file_bytes == 0) return;
    r.predicted_bytes = limit;
    r.predicted_disk_bytes = disk.file_bytes;
    r.predicted_disk_written_bytes = disk.written_bytes;
    r.predicted_disk_read_bytes = disk.read_bytes;
    r.predicted_way_read_bytes = disk.way_read_bytes;
  } catch (const Error& e) {  // the factorization says so, too
    context.log(e.what());
  }
}

void describe(Analysis& a, const Context& context) {
  AnalysisResult& r = a.result;
  r.kind = a.kind();
  r.nonzeros_factor = a.plan.nonzeros_factor;
  r.flops = a.flops();
  r.fronts = a.plan.fronts();
  for (Index f = 0; f < a.plan.fronts(); ++f) {
    r.tiers = std::max(r.tiers, a.plan.tier[f] + 1);
    r.largest_front = std::max(r.largest_front, a.plan.layout[f].rows);
  }
  r.predicted_bytes = predicted_host_bytes(a, context);
  predict_disk(a, context, r);
  r.predicted_seconds = a.device.backend->predict(a.plan.tree, wish_of(*a.system, context)).on(a.device.devices());
  r.device = a.device.reason;
}

namespace {

// For tests and measurements: real forms on backends that have complex numbers. Of ranks all wish the same.
bool real_form_is_wished() {
  const char* text = std::getenv("ESPALIER_COMPLEX_FORM");
  const std::string_view form = text == nullptr ? "auto" : text;
  if (form != "auto" && form != "real")
    throw Error(StatusCode::invalid_input,
                fmt::format("ESPALIER_COMPLEX_FORM: '{}' is not understood; give auto or real", form));
  return form == "real";
}

// Complex systems on devices without complex numbers, which take their real form: the tree is that from now on.
void take_real_form(System& system, DeviceChoice& device, analysis::AssemblyTree& tree, const Context& context) {
  if (system.numbers() == base::Numbers::real) return;
  const bool needed = !device.backend->limits().complex;
  if (!needed && !real_form_is_wished()) return;
  analysis::AssemblyTree two = doubled(tree);
  system.real_form = make_real_form(system.prepared, std::move(tree), context.pool);
  tree = std::move(two);
  device.reason += "; as a real system of twice the size";
  context.log(fmt::format("the complex system is factorized as a real one of twice the size{}",
                          needed ? fmt::format(": a {} has no complex numbers", device.backend->noun()) : ""));
}

// Chooses devices and lays out the plan: the end of every analysis.
Analyzed finish(Ordered&& given, double ordered, Context context) {
  auto [draft, tree, start] = std::move(given);
  const base::Stage stage("plan");
  const device::PlanWish wish = wish_of(draft.system, context);
  Changes changes{context.link != nullptr
                      ? device_of_ranks(context.options, context.registry, *context.link, tree, wish)
                      : choose_device(context.options, context.registry, tree, wish)};
  const std::shared_ptr<const matrix::RowIndex> rows = share_rows(draft.system, changes.device, context);
  if (!changes.device.notice.empty()) context.log(changes.device.notice);
  take_real_form(draft.system, changes.device, tree, context);
  auto system = std::make_shared<const System>(std::move(draft.system));
  if (system->border && changes.device.backend->limits().keeps_border)
    add_border(tree, *system->border, system->prepared);
  const bool may = context.options.precision == Precision::automatic && !context.raised && context.link == nullptr;
  const device::Backend& backend = *changes.device.backend;
  const double gain = may ? gain_of_single(backend, tree, wish_of(*system, context), changes.device.devices()) : 1;
  if (may) context.raised = gain < kLeastGain || is_too_ill_for_single(*system, draft.values, tree, context);
  auto made =
      std::make_shared<Analysis>(lay_out(std::move(system), std::move(tree), std::move(changes), context, rows.get()));
  made->gain_of_single = gain;
  made->fill_of_ordering = made->plan.nonzeros_factor;
  made->flops_of_ordering = made->plan.flops;
  made->result = std::move(draft.result);
  made->result.plan_seconds = base::now_seconds() - ordered;
  describe(*made, context);
  AnalysisResult& r = made->result;
  r.seconds = base::now_seconds() - start;
  context.log(
      fmt::format("analysis: {} fronts in {} tiers, largest {}, {:.3g} entries of the factor, {:.3g} flops, {:.3f} s",
                  r.fronts, r.tiers, r.largest_front, static_cast<double>(r.nonzeros_factor), r.flops, r.seconds));
  return {std::move(made), std::move(draft.values)};
}

// A copy of the matrix, scaled and matched for `kind`; then ordered.
Draft prepare(const GivenMatrix& a, Kind kind, const Context& context) {
  Draft draft;
  draft.system.kind = kind;
  draft.system.prepared = prepare_matrix(a, kind, context.pool);
  const double copied = base::now_seconds();
  const base::Stage stage("scaling and matching");
  scale_and_match(draft.system.prepared, kind, context.options, context.pool);
  draft.result.matching_seconds = base::now_seconds() - copied;
  return draft;
}

analysis::AssemblyTree tree_of(Draft& draft, const Context& context) {
  const double start = base::now_seconds();
  const base::Stage stage("ordering");
  const PreparedMatrix& p = draft.system.prepared;
  draft.system.rows = solve::ResidualOperator::rows_of(p.a, context.pool);
  analysis::TreeOptions options;
  options.permutation = context.options.permutation;
  options.pair = p.pair;
  options.zero_diagonal = p.zero_diagonal;
  analysis::AssemblyTree tree = ordered_once(context, [&](base::ThreadPool& pool) {
    const analysis::Graph graph = analysis::graph_of(p.a, pool, p.row_of_col, draft.system.rows.get());
    return analysis::build_tree(graph, options, pool);
  });
  draft.result.ordering_seconds = base::now_seconds() - start;
  return tree;
}

// What the analysis does not need any more.
void give_values_away(Draft& draft) { draft.values = std::exchange(draft.system.prepared.a.values, {}); }

Ordered ordered(Draft draft, double start, const Context& context) {
  analysis::AssemblyTree tree = tree_of(draft, context);
  give_values_away(draft);
  return {std::move(draft), std::move(tree), start};
}

// A tree that comes from a file may be anything.
void check_tree(const std::string& path, const System& system, const analysis::AssemblyTree& tree,
                const Context& context) {
  const PreparedMatrix& p = system.prepared;
  const analysis::Graph graph = analysis::graph_of(p.a, context.pool, p.row_of_col, system.rows.get());
  if (const std::string wrong = analysis::verify_tree(graph, tree); !wrong.empty())
    throw Error(StatusCode::invalid_input,
                fmt::format("{}: the file is not a valid analysis of this matrix: {}; analyze the matrix and save the "
                            "analysis again",
                            path, wrong));
}

}  // namespace

std::shared_ptr<const matrix::RowIndex> System::index_of_all(base::ThreadPool& pool) const {
  return rows_are_shared ? solve::ResidualOperator::rows_of(prepared.a, pool) : rows;
}

Offset Analysis::bytes() const {
  const Offset values = system->prepared.a.nonzeros() * system->parts() * static_cast<Offset>(sizeof(double));
  return system->bytes() + values + plan::bytes_of(plan).all();
}

Offset predicted_host_bytes(const Analysis& a, const Context& context) {
  const Offset n = a.n(), parts = a.system->parts();
  const Offset real_entries = a.system->real_form ? MatrixView(a.system->real_form->a).nonzeros() : 0;
  const Offset entries = a.system->prepared.a.nonzeros() + (real_entries + 1) / 2;
  const Offset value_bytes = parts * static_cast<Offset>(context.single() ? sizeof(float) : sizeof(double));
  const Offset numbers = predicted_executor_bytes(a, context);
  const Offset vectors =
      4 * parts * n * static_cast<Offset>(sizeof(double));                // of llt's smallest pivots, of the refinement
  const Offset copies = context.options.partial_refactorization ? 2 : 1;  // with those of the factorization before
  return a.bytes() + numbers + (copies * plan::values_of(a.plan, entries) + n) * value_bytes + vectors;
}

Analyzed finish(Ordered ordered, const Context& context) {
  return finish(std::move(ordered), base::now_seconds(), context);
}

Ordered order(const GivenMatrix& given, const Context& context, std::shared_ptr<const Border> border) {
  const double start = base::now_seconds();
  check_matrix(given, context.pool);
  GivenMatrix a = given;
  if (!context.options.analyze_values) a.a.values = {};
  const Kind wish = context.options.kind;
  const Kind chosen = choose_kind(a, wish, context.pool);
  Draft draft = prepare(a, chosen, context);
  draft.system.border = std::move(border);
  draft.system.kind_may_change = wish == Kind::automatic && chosen == Kind::llt;
  return ordered(std::move(draft), start, context);
}

Analyzed analyze(const GivenMatrix& given, const Context& context, std::shared_ptr<const Border> border) {
  const base::Stage stage("analysis");
  return finish(order(given, context, std::move(border)), context);
}

Analyzed analyze_for_ldlt(const Analysis& llt, std::span<const double> values, const Context& context) {
  const double start = base::now_seconds();
  const PreparedMatrix& before = llt.system->prepared;
  GivenMatrix a(before.a, before.numbers);
  a.a.values = values;
  Draft draft = prepare(a, Kind::ldlt, context);
  PreparedMatrix& p = draft.system.prepared;
  if (context.options.singular == SingularMatrix::error) refuse_zero_rows(p);
  draft.system.border = llt.system->border;
  p.target = before.target;
  p.caller_nonzeros = before.caller_nonzeros;
  p.caller_pattern = before.caller_pattern;
  p.symmetric_values = before.symmetric_values;
  return finish(ordered(std::move(draft), start, context), context);
}

Analyzed load_analysis(const std::string& path, const GivenMatrix& given, const Context& context) {
  check_matrix(given, context.pool);
  return analysis_from(path, read_analysis(path, pattern_hash(given.a, context.pool)), given, context);
}

Analyzed analysis_from(const std::string& path, SavedAnalysis saved, const GivenMatrix& given, const Context& context) {
  const double start = base::now_seconds();
  GivenMatrix a = given;
  const Kind wish = context.options.kind;
  if (wish != Kind::automatic && wish != saved.kind)
    throw Error(StatusCode::invalid_input, fmt::format("{}: the saved analysis is for {}, but {} was asked for", path,
                                                       name_of(saved.kind), name_of(wish)));
  (void)choose_kind(a, saved.kind, context.pool);  // llt and ldlt need a symmetric matrix
  Draft draft;
  draft.system.kind = saved.kind;
  draft.system.kind_may_change = wish == Kind::automatic && saved.kind == Kind::llt;
  PreparedMatrix& p = draft.system.prepared = prepare_matrix(a, saved.kind, context.pool);
  if (saved.tree.n != p.n())
    throw Error(StatusCode::invalid_input, path + ": the analysis belongs to a matrix of another size");
  p.row_scale = std::move(saved.row_scale);
  p.col_scale = std::move(saved.col_scale);
  p.row_of_col = std::move(saved.row_of_col);
  note_determinant(p);
  draft.system.rows = solve::ResidualOperator::rows_of(p.a, context.pool);
  check_tree(path, draft.system, saved.tree, context);
  give_values_away(draft);
  return finish({std::move(draft), std::move(saved.tree), start}, start, context);
}

SharedAnalysis lay_out_again(const Analysis& before, analysis::AssemblyTree tree, Changes changes,
                             const Context& context) {
  auto made = std::make_shared<Analysis>(
      lay_out(before.system, std::move(tree), std::move(changes), context, before.system->all_rows()));
  made->gain_of_single = before.gain_of_single;
  made->fill_of_ordering = before.fill_of_ordering;
  made->flops_of_ordering = before.flops_of_ordering;
  made->result = before.result;
  if (made->device.reason != before.device.reason) made->result.device = made->device.reason;
  return made;
}

ChangedAnalysis change_analysis(const Analysis& before, analysis::AssemblyTree tree, std::vector<Index> front_before,
                                Index moved_pivots, const Context& context) {
  const System& system = *before.system;
  const matrix::RowIndex& rows = system.factored_rows();
  if (rows.ptr.empty() || system.rows_are_shared || before.plan.tree.border > 0) return {};
  auto changed = plan::change_plan(before.plan, std::move(tree), std::move(front_before), system.factored_pattern(),
                                   system.factored_row_of_col(), rows, context.pool);
  if (!changed) return {};
  auto made = std::make_shared<Analysis>();
  made->system = before.system;
  made->device = before.device;
  made->plan = std::move(changed->plan);
  made->moved_pivots = moved_pivots;
  made->free_pivots = before.free_pivots;
  made->fp64 = before.fp64;
  made->gain_of_single = before.gain_of_single;
  made->fill_of_ordering = before.fill_of_ordering;
  made->flops_of_ordering = before.flops_of_ordering;
  made->result = before.result;
  return {std::move(made), std::move(changed->before)};
}

}  // namespace espalier::solver
