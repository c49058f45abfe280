#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/forks.hpp"
#include "solver/solver_impl.hpp"

namespace espalier {

namespace {

// Most rounds of moving failed pivots to later fronts: each lifts the lowest failures by one front. After fewer, tiles
// in which a pivot has more partners to choose from are better, where there are any (see choose_pivots_freely()).
constexpr int kMostMoves = 40;
constexpr int kMovesInNarrowTiles = 16;

// A pivot below this, relative to the largest scaled entry, carries no digit: it is rounding error of a zero.
double zero_pivot(Index n, bool single) {
  const double epsilon = single ? std::numeric_limits<float>::epsilon() : std::numeric_limits<double>::epsilon();
  return 4 * epsilon * std::sqrt(static_cast<double>(n));
}

// Once a zero pivot has shown that the matrix is singular, the pivots of its other zero eigenvalues may stand above the
// rounding error of one: measured on free bodies, whose six vanish within a factor of 50 of each other, but within
// 14,000 (the next pivot 20,000 further up) where tiles of 32 leave less choice of pivots, as on a GPU.
constexpr double kSingularFactor = 1e5;

constexpr double kHalfOfTheDigits = 1e-8;

// The narrowest of the host's own tiles (analysis/front_layout.cpp).
constexpr Index kFreeTiles = 128;

}  // namespace

std::vector<Offset> Solver::Impl::budgets() const {
  const auto count = static_cast<std::size_t>(std::max(1, device.devices));
  const std::vector<Offset>& each = options.device_memory_each_bytes;
  std::vector<Offset> list(count, options.device_memory_bytes);
  for (std::size_t d = 0; d < count && !each.empty(); ++d)
    list[d] = each[std::min(device.places.empty() ? d : device.places[d], each.size() - 1)];
  return list;
}

void Solver::Impl::make_numeric() {
  solver::NumericOptions o;
  o.kind = kind;
  o.device = device;
  o.device_memory_bytes = budgets();
  o.pinned_memory_bytes = options.pinned_memory_bytes;
  o.threshold = options.pivot_threshold;
  o.smallest_pivot = smallest_pivot;
  numeric.reset();  // its memory goes before new memory comes
  if (gpus_open.valid()) gpus_open.wait();
  if (device.backend == solver::DeviceChoice::Backend::cuda) gpu_forks = base::forks();
  for (const bool ours = options.device == "auto"; !numeric;) {
    try {
      charge_analysis();
      numeric = solver::make_numeric(plan, equations, residual, o, single(), pool, budget, timeline.get());
    } catch (const Error& e) {
      if (!ours || device.backend == solver::DeviceChoice::Backend::host) throw;
      // The choice was ours: one GPU takes over when several cannot, the host when that one cannot.
      const bool several = device.devices > 1;
      options.device = several ? fmt::format("gpu:{}", device.gpus.front()) : "cpu";
      const std::string next = several ? "one GPU" : "the host";
      log(fmt::format("the GPU cannot take the factorization ({}): going on with {}", e.what(), next));
      lay_out_plan(analysis::AssemblyTree(plan.tree));
      analysis.device = fmt::format("{}: {}", next, e.what());
      o.device = device;
      o.device_memory_bytes = budgets();
    }
  }
}

void Solver::Impl::factorize(std::span<const double> values) {
  const double start = base::now_seconds();
  begin_factorization();
  load_values(values);
  finish_factorization(factorize_moving_pivots(), start);
}

// New values to the solver's copy and, where a GPU has the equations, on to it: one piece is on the link while the next
// one is copied.
void Solver::Impl::load_values(std::span<const double> values) {
  solver::DeviceSystem* system = numeric->device_system();
  values_on_device = false;
  if (system != nullptr && equations.keeps_order()) {
    // A quarter at a time, between 1 and 32 MiB; two parts of it for each thread.
    const Offset all = equations.a.nonzeros(), piece = std::clamp(all / 4, Offset{1} << 17, Offset{1} << 22);
    const std::int64_t part = std::max<std::int64_t>(1 << 14, piece / (2 * pool.size()));
    for (Offset first = 0; first < all; first += piece) {
      const Offset now = std::min(piece, all - first);
      const double* from = values.data() + first;
      double* to = equations.a.values.data() + first;
      pool.for_each_piece(
          now, part, [&](std::int64_t begin, std::int64_t end) { std::copy(from + begin, from + end, to + begin); });
      system->send_values(first, now);
    }
  } else {
    solver::copy_values(equations, values, pool);
    send_values();
  }
  residual.set_values(equations.a.values);
}

// The solver's values to the GPU that has the equations, if any.
void Solver::Impl::send_values() {
  if (solver::DeviceSystem* system = numeric->device_system()) system->send_values(0, equations.a.nonzeros());
}

// New values that lie on the GPU of the factor stay there, unless pivots fail: what follows then works on the host's
// copy.
void Solver::Impl::factorize_device(const double* values, Offset count, void* stream) {
  const double start = base::now_seconds();
  begin_factorization();
  solver::DeviceSystem* system = numeric->device_system();
  if (system == nullptr)
    throw Error(StatusCode::device_error,
                "the factor is not in the memory of a GPU (" + numeric->device_name() + "); use refactorize()");
  system->expect_reachable(values, "Solver::refactorize_device: the values");
  system->wait_for(stream);
  if (!equations.keeps_order()) {
    std::vector<double> copy(static_cast<std::size_t>(count));
    system->fetch(copy.data(), values, count);
    return factorize(copy);
  }
  set_smallest_pivot();
  const std::optional<device::FactorOutcome> outcome = numeric->factorize_device(values);
  values_on_device = true;
  if (outcome && outcome->not_positive < 0 && outcome->replaced.empty() && outcome->failed.empty())
    return finish_factorization(*outcome, start);
  fetch_values();
  finish_factorization(factorize_moving_pivots(), start);
}

void Solver::Impl::fetch_values() {
  if (!values_on_device) return;
  numeric->device_system()->read_values(equations.a.values);
  residual.set_values(equations.a.values);
  values_on_device = false;
}

void Solver::Impl::begin_factorization() {
  state = State::analyzed;
  factor = FactorResult{};
  if (timeline) timeline->clear();
  if (!numeric) make_numeric();
}

void Solver::Impl::finish_factorization(device::FactorOutcome outcome, double start) {
  if (kind == Kind::llt && (outcome.not_positive >= 0 || !outcome.replaced.empty()) && kind_may_change) {
    turn_to_ldlt();
    make_numeric();
    send_values();
    outcome = factorize_moving_pivots();
  }
  report(outcome);
  factor.seconds = base::now_seconds() - start;
  factor.flops_per_second = plan.flops / factor.seconds;
  if (factor.status.ok()) state = State::factorized;
}

// The matrix that llt gave up is analyzed again from the solver's copy; the caller's values still go where they went.
// Values of which no ldlt can be made cost this factorization alone: the analysis for llt is made again.
void Solver::Impl::turn_to_ldlt() {
  log("a pivot is not positive: going on with ldlt");
  const double start = base::now_seconds();
  const solver::StoredMatrix copy = std::move(equations.a);
  std::vector<Offset> target = std::move(equations.target);
  const Offset caller_nonzeros = equations.caller_nonzeros;
  const std::uint64_t caller_pattern = equations.caller_pattern;
  const bool symmetric_values = equations.symmetric_values;
  const auto analyze_copy = [&](Kind chosen) {
    state = State::empty;  // until the analysis stands
    analyze_as(copy, chosen);
    equations.target = std::move(target);
    equations.caller_nonzeros = caller_nonzeros;
    equations.caller_pattern = caller_pattern;
    equations.symmetric_values = symmetric_values;
    residual.set_values(equations.a.values);
    describe_plan(start);
  };
  try {
    analyze_copy(Kind::ldlt);
    kind_may_change = false;
  } catch (const Error&) {
    analyze_copy(Kind::llt);
    throw;
  }
}

void Solver::Impl::set_smallest_pivot() {
  smallest_pivot = options.perturbation > 0 ? options.perturbation : zero_pivot(plan.tree.n, single());
  numeric->set_smallest_pivot(smallest_pivot);
}

device::FactorOutcome Solver::Impl::factorize_moving_pivots() {
  set_smallest_pivot();
  device::FactorOutcome outcome = numeric->factorize();
  if (kind == Kind::llt) return outcome;
  int round = 0;
  const auto again = [&] {
    make_numeric();
    send_values();
    outcome = numeric->factorize();
  };
  const auto move_all = [&](int most) {
    for (; round < most && move_pivots(outcome); ++round) again();
  };
  move_all(narrow_tiles() ? kMovesInNarrowTiles : kMostMoves);
  if (round == kMovesInNarrowTiles && narrow_tiles() && !factor_solves()) {
    choose_pivots_freely();
    again();
    round = 0;
    move_all(kMostMoves);
  }
  if (outcome.replaced.empty() || options.perturbation > 0) return outcome;
  smallest_pivot *= kSingularFactor;
  numeric->set_smallest_pivot(smallest_pivot);
  outcome = numeric->factorize();
  move_all(kMostMoves);
  return outcome;
}

// Whether pivots have fewer partners to choose from than in the host's tiles as they are by default.
bool Solver::Impl::narrow_tiles() const {
  const bool widths_chosen = options.max_block_size > 0 && options.max_block_size < kFreeTiles;
  return !free_pivots && (widths_chosen || device.backend == solver::DeviceChoice::Backend::cuda);
}

// Whether refinement can mend what pivots that failed have done to the factor: a solution of A x = A 1 has half of the
// digits.
bool Solver::Impl::factor_solves() const {
  const auto n = static_cast<std::size_t>(plan.tree.n);
  const std::vector<double> ones(n, 1.0);
  std::vector<double> b(n), x(n);
  residual.multiply(ones.data(), b.data(), false);
  numeric->solve(b.data(), x.data(), 1, false);
  return residual.compute(b.data(), x.data(), nullptr, false).normwise <= kHalfOfTheDigits;
}

// CONT-201 of the collection moves 444 pivots in 40 rounds in tiles of 32 and 64 columns, and is no nearer to a factor;
// in the host's it moves four. So the host goes on, with its own widths, until the next analysis.
void Solver::Impl::choose_pivots_freely() {
  const std::string why =
      fmt::format("pivots failed in {} rounds of moving them to later fronts, for want of partners in their tiles",
                  kMovesInNarrowTiles);
  const bool on_gpu = device.backend == solver::DeviceChoice::Backend::cuda;
  log(fmt::format("{}: going on {}with the host's widths of tiles", why, on_gpu ? "on the host " : ""));
  free_pivots = true;
  numeric.reset();
  lay_out_plan(analysis::AssemblyTree(plan.tree));
  if (on_gpu) analysis.device = "host: " + why;
}

// Delayed pivoting by re-analysis: columns that could not be eliminated stably in their front go to its parent. Only
// the lowest failures are moved: what failed above them was computed from their debris.
bool Solver::Impl::move_pivots(const device::FactorOutcome& outcome) {
  if (outcome.failed.empty() && outcome.replaced.empty()) return false;
  std::vector<Index> bad(outcome.failed);
  bad.insert(bad.end(), outcome.replaced.begin(), outcome.replaced.end());
  std::sort(bad.begin(), bad.end());
  bad.erase(std::unique(bad.begin(), bad.end()), bad.end());
  const auto& tree = plan.tree;
  std::vector<char> below(static_cast<std::size_t>(tree.fronts()), 0);  // 1: a failure in the sub-tree below
  std::vector<Index> moved;
  std::size_t at = 0;
  for (Index f = 0; f < tree.fronts(); ++f) {
    bool any = below[f] != 0;
    for (; at < bad.size() && bad[at] < tree.first[f + 1]; ++at) {
      // In a root, a pivot may still find its partner in the last block column.
      const auto& l = plan.layout[f];
      const bool may_move = tree.parent[f] >= 0 || l.tile_of(bad[at] - tree.first[f]) + 1 < l.pivot_tiles;
      if (below[f] == 0 && may_move) moved.push_back(bad[at]);
      any = true;
    }
    if (any && tree.parent[f] >= 0) below[tree.parent[f]] = 1;
  }
  if (moved.empty()) return false;
  moved_pivots += static_cast<Index>(moved.size());
  log(fmt::format("{} pivot{} moved to a later front", moved.size(), moved.size() == 1 ? " is" : "s are"));
  analysis::AssemblyTree changed = plan.tree;
  analysis::relocate_pivots(changed, moved);
  numeric.reset();
  lay_out_plan(std::move(changed));
  return true;
}

void Solver::Impl::report(const device::FactorOutcome& outcome) {
  FactorResult& r = factor;
  const Index n = plan.tree.n;
  r.two_by_two = outcome.two_by_two;
  r.perturbed = static_cast<Index>(outcome.replaced.size());
  r.delayed = moved_pivots;
  r.peak_host_bytes = budget.peak();
  const auto add_device = [&](std::string name, double busy, double waiting, Index stolen, Offset peak,
                              const device::StreamReport& streamed) {
    const double idle = outcome.seconds > 0 ? std::max(0.0, 1 - busy / outcome.seconds) : 0;
    r.devices.push_back({std::move(name), busy, idle, peak, waiting, stolen, streamed.bytes_in, streamed.bytes_out,
                         streamed.link_seconds, streamed.predicted_bytes});
  };
  for (device::DeviceWork& w : numeric->device_work()) {
    add_device(std::move(w.name), w.busy_seconds, w.waiting_seconds, w.stolen_subtrees, w.peak_bytes, w.streaming);
    r.devices.back().transferred_bytes = w.transferred_bytes;
  }
  if (r.devices.empty())
    add_device(numeric->device_name(), outcome.busy_seconds, outcome.waiting_seconds, 0, numeric->device_peak_bytes(),
               numeric->streaming());
  const auto rows_of = [&](const std::vector<Index>& positions) {
    std::vector<Index> rows;
    for (const Index p : positions) rows.push_back(equations.row_of(plan.tree.order[static_cast<std::size_t>(p)]));
    std::sort(rows.begin(), rows.end());
    return rows;
  };
  if (outcome.not_positive >= 0) {
    const Index row = rows_of({outcome.not_positive}).front();
    r.status = {
        StatusCode::not_positive_definite,
        fmt::format("the matrix is not positive definite: the pivot of {} is not positive; use kind ldlt (or auto)",
                    solver::name_rows({row})),
        row};
    return;
  }
  r.determinant_sign = outcome.determinant_sign * equations.transform_sign;
  r.determinant_log = outcome.determinant_log - equations.transform_log;
  if (kind == Kind::llt) r.inertia = {n - r.perturbed, 0, r.perturbed};
  if (kind == Kind::ldlt) r.inertia = {n - outcome.negative - r.perturbed, outcome.negative, r.perturbed};
  if (r.perturbed > 0 && options.perturbation <= 0) {
    const std::vector<Index> rows = rows_of(outcome.replaced);
    r.determinant_sign = 0;
    r.determinant_log = -std::numeric_limits<double>::infinity();
    r.status = {
        StatusCode::singular,
        fmt::format("the matrix is numerically singular: {} of {} pivots vanish, at {}; remove or fix dependent rows",
                    r.perturbed, n, solver::name_rows(rows)),
        rows.front()};
  }
}

}  // namespace espalier
