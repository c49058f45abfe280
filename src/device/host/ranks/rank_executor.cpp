#include "device/host/ranks/rank_executor.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include "device/host/kept_fronts.hpp"
#include "device/host/outcome.hpp"
#include "device/host/ranks/rank_traffic.hpp"
#include "device/host/tile_factor.hpp"
#include "device/host/triangular_solve.hpp"
#include "device/rank_rows.hpp"
#include "plan/fingerprint.hpp"
#include "plan/rank_parts.hpp"
#include "plan/reached_fronts.hpp"

namespace espalier::device::host {

namespace {

// The thread that calls drives messages wherever it waits, as long as this stands.
class Driver final : public WhileWaiting {
 public:
  Driver(ranks::Communicator& link, ranks::Handler handler) : link_(link), handler_(std::move(handler)), before_(here) {
    here = this;
  }
  ~Driver() override { here = before_; }
  Driver(const Driver&) = delete;
  Driver& operator=(const Driver&) = delete;

  void poll() override { link_.drive(handler_); }
  void begin_waiting() override { link_.begin_waiting(); }
  void expect_patience() override { link_.expect_patience(); }
  void wait(const std::function<bool()>& done) { link_.wait(handler_, done); }

 private:
  ranks::Communicator& link_;
  ranks::Handler handler_;
  WhileWaiting* before_;
};

template <class T>
class RankExecutor final : public Executor<T>, private SolveSharing<T> {
 public:
  explicit RankExecutor(const Job& job)
      : plan_(job.plan),
        pool_(job.pool),
        link_(*job.link),
        budget_(job.budget != nullptr ? job.budget : &own_budget_),
        held_before_(budget_->held()),
        next_rule_(job.rule),
        rows_(job.plan, job.link->size()) {
    link_.expect_all([&] { take_memory(job); });
    const auto marks = link_.all_numbers(plan::fingerprint(plan_, static_cast<int>(job.kind),
                                                           [&](Index f, Index j) { return plan::maker(plan_, f, j); }));
    for (std::size_t r = 0; r < marks.size(); ++r)
      if (marks[r] != marks[0])
        throw Error(StatusCode::invalid_input,
                    fmt::format("{} and {} have come to different plans: give all ranks the same matrix and options",
                                link_.name_of(0), link_.name_of(static_cast<int>(r))));
    rows_.own([&](Index f) { return plan::first_keeper(plan_, f); });
  }

  void set_pivot_rule(const PivotRule& rule) override { next_rule_ = rule; }
  void halt_at_failures(bool halt) override { state_->halting = halt && state_->kind != Kind::llt; }

  // Sub-trees are of one rank: what values do not reach there stays, and is sent again to who makes the top. So no rank
  // need know what others keep.
  FactorOutcome factorize_changed(std::span<const T> values, std::span<const T> before) override {
    if (complete_ && plan_.options.keep_contributions) {
      state_->kept = unchanged_fronts(*state_, values, before, next_rule_, pool_);
      for (Index f = 0; f < plan_.fronts(); ++f)
        if (!is_alone(f) || !takes(f)) state_->kept[at(f)] = 0;
    }
    return factorize(values);
  }

  FactorOutcome factorize(std::span<const T> values) override {
    const double start = base::now_seconds();
    const KeptOnce<T> once{*state_};
    complete_ = false;
    state_->rule = next_rule_;
    reset_state(*state_, values);
    for (auto& w : work_) w.waited_seconds = w.task_seconds = 0;
    traffic_->reset();
    link_.begin_operation();
    const std::int64_t sent = link_.sent_bytes();
    next_ = finished_ = 0;
    pool_.run([&](int worker) { take_tasks(worker); });
    FactorOutcome out = summarize(*state_, work_);
    out.halted = traffic_->halted();
    out.share = 1 - gather_work(link_.sent_bytes() - sent);
    complete_ = !out.halted;
    out.seconds = base::now_seconds() - start;
    return out;
  }

  void solve(T* x, Index columns, bool transpose) override {
    expect_room(columns);
    link_.begin_operation();
    {
      Driver driver(link_, [this](int, const ranks::Message& m) { solve_->take(m.header().front, m.body()); });
      driver_ = &driver;
      solve_->run(x, columns, transpose);
      driver_ = nullptr;
    }
    rows_.share(link_, x, columns);
  }

  [[nodiscard]] std::string name() const override {
    return fmt::format("{} ranks of the host ({} thread{} here)", link_.size(), pool_.size(),
                       pool_.size() == 1 ? "" : "s");
  }
  [[nodiscard]] Offset peak_bytes() const override { return budget_->peak() - held_before_; }

  [[nodiscard]] std::vector<DeviceWork> device_work() const override { return device_work_; }

 private:
  // What every rank did in the last factorization, on all ranks. @returns the share of the operations that was kept
  double gather_work(std::int64_t sent) {
    DeviceWork mine;
    for (const auto& w : work_) {
      mine.busy_seconds += (w.task_seconds - w.waited_seconds) / static_cast<double>(work_.size());
      mine.waiting_seconds += w.waited_seconds / static_cast<double>(work_.size());
      mine.peak_bytes += w.bytes();
    }
    mine.peak_bytes += plan_.memory.size * static_cast<Offset>(sizeof(T));
    const double kept = state_->kept.empty() ? 0 : plan::share_of_work(plan_, state_->kept);
    const double times[3] = {mine.busy_seconds, mine.waiting_seconds, kept};
    const std::int64_t bytes[2] = {mine.peak_bytes, sent};
    const auto all_times = link_.all_gather_of(std::span<const double>(times));
    const auto all_bytes = link_.all_gather_of(std::span<const std::int64_t>(bytes));
    device_work_.clear();
    double all_kept = 0;
    for (std::size_t r = 0; r < all_times.size(); ++r) {
      DeviceWork work;
      work.name = link_.name_of(static_cast<int>(r));
      work.busy_seconds = all_times[r][0];
      work.waiting_seconds = all_times[r][1];
      work.peak_bytes = all_bytes[r][0];
      work.transferred_bytes = all_bytes[r][1];
      device_work_.push_back(std::move(work));
      all_kept += all_times[r][2];
    }
    return all_kept;
  }

  // Memory for the right-hand sides, on all ranks or none.
  void expect_room(Index columns) {
    std::int64_t mine = columns;
    try {
      solve_->prepare(columns);
    } catch (const Error& e) {
      if (e.status().code != StatusCode::out_of_memory) throw;
      mine = -1;
    }
    const auto all = link_.all_numbers(mine);
    for (std::size_t r = 0; r < all.size(); ++r)
      if (all[r] != all[0] || all[r] < 0)
        throw Error(StatusCode::out_of_memory,
                    fmt::format("{} or {} has no room for {} right-hand sides", link_.name_of(0),
                                link_.name_of(static_cast<int>(r)), columns));
  }

  void take_memory(const Job& job) {
    for (int t = 0; t < pool_.size(); ++t) work_.emplace_back(plan_, job.kind, budget_);
    state_.emplace(plan_, MatrixKind{job.kind, job.hermitian}, job.rule, budget_);
    state_->keeps_what_is_left = false;
    traffic_.emplace(*state_, link_);
    solve_.emplace(*state_, pool_, budget_, static_cast<SolveSharing<T>*>(this));
  }

  void take_tasks(int worker) {
    const double begin = base::now_seconds();
    Workspace<T>& w = work_[at(worker)];
    std::optional<Driver> driver;
    if (worker == 0) driver.emplace(link_, [this](int from, const ranks::Message& m) { traffic_->take(from, m); });
    try {
      for (std::size_t k = next_++; k < plan_.tasks.size(); k = next_++) {
        if (state_->abort.load(std::memory_order_relaxed)) break;
        pool_.check();
        if (driver) driver->poll();
        execute(plan_.tasks[k], w);
        ++finished_;
      }
      w.task_seconds = base::now_seconds() - begin;
      if (driver) end_factorization(*driver);
    } catch (const Aborted&) {
    } catch (...) {
      state_->abort = true;
      throw;
    }
  }

  void end_factorization(Driver& driver) {
    const auto given_up = [this] { return state_->abort.load(std::memory_order_relaxed); };
    driver.wait([&] { return finished_ == plan_.tasks.size() || given_up(); });
    if (given_up()) return;
    traffic_->send_done();
    driver.wait([&] { return traffic_->all_done(); });
  }

  void execute(const plan::Task& task, Workspace<T>& w) {
    if (task.is_range())
      eliminate_range(*state_, w, task);
    else if (!state_->is_kept(task.front))
      make_tile(*state_, w, task);
    traffic_->send_made(task);
  }

  // SolveSharing
  [[nodiscard]] bool takes(Index f) const override { return plan::keeps_factor(plan_, f, link_.rank()); }
  [[nodiscard]] bool is_alone(Index f) const override { return plan_.ownership.subtree(f) >= 0; }
  void made(Index f, const T* rows, Index columns) override {
    const Index parent = plan_.tree.parent[f];
    const Offset count = Offset{plan_.layout[f].below()} * columns;
    if (parent < 0 || plan_.ownership.subtree(parent) >= 0 || plan::first_keeper(plan_, f) != link_.rank()) return;
    std::vector<int> to;
    for (const Index r : plan::keepers(plan_, parent))
      if (!plan::keeps_factor(plan_, f, r)) to.push_back(r);
    if (to.empty()) return;
    ranks::Message m(at(count) * sizeof(T));
    ranks::Header h;
    h.kind = static_cast<std::int32_t>(Cargo::solution_rows);
    h.front = f;
    m.set_header(h);
    ranks::Writer(m.body()).write(rows, at(count));
    link_.post(to, std::move(m));
  }
  void wait(const std::function<bool()>& done) override { driver_->wait(done); }

  const plan::Plan& plan_;
  base::ThreadPool& pool_;
  ranks::Communicator& link_;
  base::MemoryBudget own_budget_{"host memory"};
  base::MemoryBudget* budget_;
  Offset held_before_;   // by others, when the executor was made
  PivotRule next_rule_;  // of the next factorization
  std::vector<Workspace<T>> work_;
  std::optional<NumericState<T>> state_;
  std::optional<RankTraffic<T>> traffic_;
  std::optional<TriangularSolve<T>> solve_;
  RankRows rows_;  // the first that keeps a front tells its solution
  std::atomic<std::size_t> next_{0}, finished_{0};
  Driver* driver_ = nullptr;
  bool complete_ = false;                // the last factorization has made all fronts
  std::vector<DeviceWork> device_work_;  // by rank
};

}  // namespace

template <class T>
std::unique_ptr<Executor<T>> make_rank_executor(const Job& job) {
  return std::make_unique<RankExecutor<T>>(job);
}

#define ESPALIER_INSTANTIATE(T) template std::unique_ptr<Executor<T>> make_rank_executor(const Job&);
ESPALIER_FOR_SCALARS(ESPALIER_INSTANTIATE)
#undef ESPALIER_INSTANTIATE

}  // namespace espalier::device::host
