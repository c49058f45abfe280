#include "solver/session/session.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <new>
#include <stdexcept>
#include <utility>

#include "base/beside.hpp"
#include "base/forks.hpp"
#include "base/stage.hpp"
#include "solver/analysis/analysis_draft.hpp"
#include "solver/analysis/analysis_file.hpp"
#include "solver/options/device_text.hpp"
#include "solver/options/option_check.hpp"

namespace espalier::solver {

namespace {

// Where the caller says nothing: what the environment says to programs with threads ("4", or "4,2" for nested ones),
// else all cores.
int usual_threads(int neighbours) {
  if (const char* text = std::getenv("OMP_NUM_THREADS")) {
    int threads = 0;
    const auto [end, error] = std::from_chars(text, text + std::strlen(text), threads);
    if (error == std::errc{} && (*end == '\0' || *end == ',') && threads >= 1) return std::min(threads, kMostThreads);
  }
  return std::max(1, base::available_cores() / neighbours);
}

base::Interruption::Clock::duration period_of(const Options& o) {
  const std::chrono::duration<double> seconds(o.interrupted_every);
  return std::chrono::duration_cast<base::Interruption::Clock::duration>(seconds);
}

// With a folder for what does not fit, something has to say what fits.
Offset host_budget(const Options& o) {
  if (o.host_memory_bytes > 0 || o.scratch.empty()) return o.host_memory_bytes;
  return base::available_memory() / 10 * 9;
}

std::unique_ptr<base::Timeline> timeline_of(const Options& o) {
  return o.record_timeline ? std::make_unique<base::Timeline>() : nullptr;
}

}  // namespace

int threads_of(const Options& o, const ranks::Communicator* link) {
  check_options(o);
  // Ranks that may use the same cores share them.
  const int neighbours = link != nullptr ? link->neighbours() : 1;
  const int threads = o.threads > 0 ? o.threads : usual_threads(neighbours);
  const auto host = host_devices(o.device, threads);
  return host ? host->devices * host->threads : threads;
}

Session::Session(const Ranks& the_ranks, Options the_options, const device::Registry& registry)
    : ranks(the_ranks),
      options(std::move(the_options)),
      interruption(base::telling(options.interrupted), period_of(options)),
      pool(threads_of(options, link()), &interruption),
      budget("host memory", host_budget(options)),
      timeline(timeline_of(options)),
      planning_threads(pool.size()),
      context{options, registry, pool, budget, timeline.get(), link(), &planning_threads, &spare} {}

Session::Session(const Session& other, int threads)
    : ranks(other.ranks),
      options(other.options),
      interruption(base::telling(options.interrupted), period_of(options)),
      pool(threads > 0 ? threads : other.pool.size(), &interruption),
      budget("host memory", host_budget(options)),
      timeline(timeline_of(options)),
      planning_threads(pool.size()),
      context{options, other.context.registry, pool, budget, timeline.get(), link(), &planning_threads, &spare},
      parts(other.parts),
      gathered(other.gathered),
      rows(other.rows) {
  if (!other.factor) return;
  Values values;
  const System& system = *other.current().system;
  values.resize(at(system.prepared.a.nonzeros() * system.parts()));
  factor.emplace(other.factor->analysis(), std::move(values), context);
  analysis = other.analysis;
}

// What belongs to a device or to a thread of the parent cannot be ended in the child of a fork(): it is left alone.
Session::~Session() {
  if (!device_lost()) return;
  if (factor) factor->abandon();
  (void)new (std::nothrow) std::future<void>(std::move(opening));
}

bool Session::device_lost() const { return forks && *forks != base::forks(); }

void Session::expect_usable() const {
  if (device_lost())
    throw Error(StatusCode::device_error,
                "this solver has used a GPU before fork(), and CUDA does not follow into the child; make a new solver "
                "there, with device cpu, or start the process afresh (Python: multiprocessing's 'spawn')");
}

void Session::note_devices() {
  if (current().device.backend->limits().own_memory) forks = base::forks();
}

// At the beginning of an analysis.
void Session::agree_on_threads() {
  planning_threads = pool.size();
  if (link() == nullptr) return;
  for (const std::int64_t threads : link()->all_numbers(pool.size()))
    planning_threads = std::min(planning_threads, static_cast<int>(threads));
}

void Session::analyze(const GivenMatrix& a, std::shared_ptr<const Border> border) {
  fresh_.reset();
  spare.clear();
  factor.reset();
  agree_on_threads();
  open_devices();
  take(solver::analyze(a, context, std::move(border)));
}

// What fails leaves the analysis and its factor as they are. The arrays of one analysis are used again by the next but
// one, where no budget counts them.
ChangeResult Session::analyze_change(const GivenMatrix& a) {
  ChangeResult result;
  const Offset bytes = current().bytes();  // and what kept_size() adds
  spare.set_limit(budget.limit() > 0 ? 0 : static_cast<std::size_t>(bytes + bytes / 8));
  std::optional<base::SpareMemory::Use> use(&spare);
  FollowedAnalysis followed = follow_pattern(current(), a, context, fresh_.get(), factor->has_numbers());
  use.reset();
  if (fresh_ != nullptr && fresh_->done()) fresh_.reset();
  result.added_entries = followed.added;
  result.removed_entries = followed.removed;
  result.full = followed.made.analysis == nullptr;
  result.why = std::move(followed.why);
  if (result.full) return analyze_anew(a, std::move(result));
  result.entries_of_order = followed.made.analysis->fill_of_ordering;
  result.reordered = followed.reordered;
  result.moved_unknowns = followed.moved;
  result.kept_fronts = followed.kept;
  context.log(fmt::format(
      "the analysis follows the pattern: {} entries came, {} went, {} unknowns moved into separators, "
      "{} of {} fronts are the same",
      followed.added, followed.removed, followed.moved, followed.kept, followed.made.analysis->plan.fronts()));
  Factor::Left left = factor->leave_numbers();  // what numbers have taken goes to the machine
  use.emplace(&spare);
  factor.reset();
  take(std::move(followed.made));
  factor->take_numbers(std::move(left), std::move(followed.numbers));
  left = {};
  use.reset();
  watch_drift();
  return result;
}

ChangeResult Session::analyze_anew(const GivenMatrix& a, ChangeResult result) {
  spare.clear();
  context.log("the pattern is analyzed anew: " + result.why);
  const bool had_numbers = factor->has_numbers();
  if (link() != nullptr) {
    analyze(a);
    result.entries_of_order = current().fill_of_ordering;
    return result;
  }
  agree_on_threads();
  open_devices();
  const base::Stage stage("analysis");
  Ordered ordered = order(a, context);  // may find that it is none for a factorization
  fresh_.reset();
  factor.reset();  // devices are chosen by the memory that is free
  take(finish(std::move(ordered), context));
  if (had_numbers) factor->note_anew("the pattern was analyzed anew: " + result.why);
  result.entries_of_order = current().fill_of_ordering;
  return result;
}

void Session::watch_drift() {
  const bool may = link() == nullptr && options.permutation.empty() && !current().system->border;
  if (!may || fresh_ != nullptr || !has_drifted(current())) return;
  context.log("the pattern has drifted: an order for it is made beside the work");
  constexpr Offset kEntriesEach = 1 << 17;  // of a thread
  const Offset most = std::max(1, pool.size() / 2), wanted = current().system->prepared.a.nonzeros() / kEntriesEach;
  fresh_ = std::make_unique<FreshOrder>(current(), static_cast<int>(std::clamp<Offset>(wanted, 1, most)));
}

void Session::load_analysis(const std::string& path, const GivenMatrix& a) {
  fresh_.reset();
  factor.reset();
  agree_on_threads();
  open_devices();
  take(solver::load_analysis(path, a, context));
}

void Session::take_analysis(const std::string& path, SavedAnalysis saved, const GivenMatrix& a) {
  open_devices();
  take(analysis_from(path, std::move(saved), a, context));
}

void Session::analyze_given(const GivenMatrix& a) {
  parts = link() != nullptr;
  rows.reset();
  if (!parts) return analyze(a);
  analyze(gathered.gather(a, link()));
}

void Session::load_given(const std::string& path, const GivenMatrix& a) {
  parts = link() != nullptr;
  rows.reset();
  if (!parts) return load_analysis(path, a);
  load_analysis(path, gathered.gather(a, link()));
}

ChangeResult Session::analyze_change_given(const GivenMatrix& a) {
  parts = link() != nullptr;
  rows.reset();
  if (!parts) return analyze_change(a);
  return analyze_change(gathered.gather(a, link()));
}

void Session::take(Analyzed made) {
  analysis = made.analysis->result;
  factor.emplace(std::move(made.analysis), std::move(made.values), context);
}

// A driver's start and the contexts take as long as an analysis.
void Session::open_devices() {
  if (opening.valid()) return;
  auto named = named_devices(options.device, context.registry);
  if (!named || !named->backend->limits().own_memory) return;
  if (link() != nullptr) named->numbers = {*own_device(options, context.registry, *link())};
  forks = base::forks();
  opening = base::start_beside([backend = named->backend, numbers = named->numbers] { backend->open(numbers); });
}

std::vector<Solver::TierRow> tiers_of(const Session& s) {
  std::vector<Solver::TierRow> rows;
  if (!s.factor) return rows;
  const plan::Plan& p = s.current().plan;
  const double per_flop = s.current().flops() / p.flops;
  rows.resize(at(s.analysis.tiers));
  for (Index f = 0; f < p.fronts(); ++f) {
    if (at(p.tier[f]) >= rows.size()) rows.resize(at(p.tier[f]) + 1);
    Solver::TierRow& r = rows[at(p.tier[f])];
    const double k = p.layout[f].pivots;
    const double m = p.layout[f].rows;
    r.tier = p.tier[f];
    ++r.fronts;
    r.largest_front = std::max(r.largest_front, p.layout[f].rows);
    r.flops += plan::front_flops(p.layout[f].pivots, p.layout[f].rows, p.options.unsymmetric) * per_flop;
    r.factor_entries += static_cast<Offset>(k * m - k * (k - 1) / 2) * (p.options.unsymmetric ? 2 : 1);
  }
  return rows;
}

}  // namespace espalier::solver
