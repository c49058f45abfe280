#include "solver/analysis/fresh_order.hpp"

#include <algorithm>
#include <chrono>
#include <new>
#include <utility>

#include "analysis/ordering.hpp"
#include "base/beside.hpp"
#include "base/forks.hpp"
#include "base/interruption.hpp"

namespace espalier::solver {

namespace {

analysis::AssemblyTree order_of(const System& system, int threads, const std::shared_ptr<std::atomic<bool>>& stop) {
  base::Interruption interruption([stop] { return stop->load(); }, std::chrono::milliseconds(5));
  const base::Interruption::Call call(interruption);
  base::ThreadPool pool(threads, &interruption);
  const PreparedMatrix& p = system.prepared;
  analysis::TreeOptions options;
  options.pair = p.pair;
  options.zero_diagonal = p.zero_diagonal;
  return analysis::build_tree(analysis::graph_of(p.a, pool, p.row_of_col, system.rows.get()), options, pool);
}

}  // namespace

FreshOrder::FreshOrder(const Analysis& analysis, int threads)
    : system_(analysis.system),
      threads_(threads),
      forks_(base::forks()),
      stop_(std::make_shared<std::atomic<bool>>(false)),
      made_(
          base::start_beside([system = system_, threads, stop = stop_] { return order_of(*system, threads, stop); })) {}

FreshOrder::~FreshOrder() {
  *stop_ = true;
  if (thread_lost()) (void)new (std::nothrow) std::future<analysis::AssemblyTree>(std::move(made_));
}

bool FreshOrder::thread_lost() const { return forks_ != base::forks(); }

// Soon where much changes; else so late that it is likely to be there.
bool FreshOrder::is_due(Offset entries) {
  constexpr int kChanges = 6;
  constexpr double kChanged = 0.003;  // of all entries
  entries_ += entries;
  done_ = ++changes_ >= kChanges ||
          static_cast<double>(entries_) > kChanged * static_cast<double>(system_->prepared.a.nonzeros());
  return done_;
}

bool FreshOrder::fits(const Analysis& analysis) const {
  const PreparedMatrix &mine = system_->prepared, &its = analysis.system->prepared;
  return system_->kind == analysis.kind() && mine.n() == its.n() && mine.row_of_col == its.row_of_col &&
         mine.pair == its.pair;
}

std::optional<analysis::AssemblyTree> FreshOrder::take(base::ThreadPool& pool) {
  if (thread_lost()) return order_of(*system_, threads_, stop_);
  if (!made_.valid()) return {};
  while (made_.wait_for(std::chrono::milliseconds(5)) == std::future_status::timeout) pool.check();
  try {
    return made_.get();
  } catch (const std::bad_alloc&) {
  } catch (const Error&) {
  }
  return {};
}

bool has_drifted(const Analysis& analysis) {
  constexpr double kFill = 1.01, kFlops = 1.03;  // over those of the last order
  constexpr double kChanged = 0.003;             // of all entries, since then
  const auto over = [](double now, double then) { return now / std::max(1.0, then); };
  const plan::Plan& plan = analysis.plan;
  return over(static_cast<double>(plan.nonzeros_factor), static_cast<double>(analysis.fill_of_ordering)) > kFill ||
         over(plan.flops, analysis.flops_of_ordering) > kFlops ||
         over(static_cast<double>(analysis.changed_since_ordering),
              static_cast<double>(analysis.system->prepared.a.nonzeros())) > kChanged;
}

}  // namespace espalier::solver
