#include "batch/groups.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>
#include <optional>
#include <tuple>
#include <utility>

#include "base/at.hpp"
#include "batch/alone.hpp"
#include "batch/easy_values.hpp"
#include "batch/equal_patterns.hpp"
#include "batch/joined_system.hpp"
#include "batch/workers.hpp"
#include "matrix/validate.hpp"
#include "solver/options/device_text.hpp"
#include "solver/session/status_of.hpp"

namespace espalier::batch {

namespace {

using solver::Session;

constexpr int kMostTeams = 2;
constexpr Index kUnknownsOfGroup = (1 << 19) / kMostTeams;  // of a group: in all as many as a Batch takes
// What one thread should not be left with, and fills a good part of a device.
constexpr Index kLargeSystem = kUnknownsOfGroup / 16;
// So many systems of one pattern are worth a plan of their own, which a Batch keeps from chunk to chunk.
constexpr std::size_t kLeastEqual = 64;

Options on_the_cores(Options o) {
  o.device = "cpu";
  return o;
}

ChunkSystem arrays_of(const System& s) { return {s.a.values, s.b.data(), s.x.data()}; }

}  // namespace

// Threads that order and go on with what is left, and a session for what is done together.
struct Groups::Team {
  Team(const Session& from, int threads, int teams)
      : session(options_of_worker(from.options, threads, 2 * teams), from.context.registry) {
    const Options alone = on_the_cores(options_of_worker(from.options, 1, 2 * teams * threads));
    for (int t = 0; t < threads; ++t) workers.push_back(std::make_unique<Session>(alone, from.context.registry));
  }
  template <class One>
  void share(std::size_t count, One&& one) {
    batch::share(session.pool, static_cast<int>(workers.size()), static_cast<Index>(count),
                 [&](int worker, Index k) { one(*workers[at(worker)], at(k)); });
  }

  Session session;
  std::vector<std::unique_ptr<Session>> workers;
  Seconds seconds;
};

struct Groups::Member {
  const System* system = nullptr;
  SystemResult* result = nullptr;
  std::optional<solver::Ordered> ordered;  // nothing: it has failed
  double largest = 0;                      // scaled value
  bool alone = false;                      // Cholesky is bound to fail, and would in place of the others
  bool left = true;                        // for the cores
};

namespace {

double largest_scaled(const solver::PreparedMatrix& p, const solver::Values& values, base::ThreadPool& pool) {
  std::vector<double> scaled(at(p.a.nonzeros()));
  return solver::scale_values(p, {p.row_scale, p.col_scale, p.transform_log, p.wide}, values, scaled.data(), pool);
}

// What is no valid matrix, or of another kind than was asked for, is told so when it is ordered.
Kind kind_of(const MatrixView& a, Kind wish, base::ThreadPool& alone) {
  if (a.rows != a.cols) return Kind::automatic;
  try {
    matrix::validate(a);
    return solver::choose_kind(a, wish, alone);
  } catch (const Error&) {
    return Kind::automatic;
  }
}

bool has_diagonal(const solver::PreparedMatrix& p) {
  std::vector<double> values(at(p.a.nonzeros()));
  return take_easy_values(p, values);
}

}  // namespace

bool Groups::serve(const Options& options, const device::Registry& registry) {
  const auto text = solver::read_device(options.device, registry);
  const auto named = solver::named_devices(options.device, registry);
  if (!Chunk::serves(options) || !text || (!text->automatic && !named)) return false;
  if (const auto wish = Chunk::wished_size()) return *wish > 1;
  return named && named->backend->limits().own_memory;
}

Groups::Groups(Session& session)
    : session_(session), wished_(Chunk::wished_size().value_or(0)), teams_(std::min(kMostTeams, session.pool.size())) {}

int Groups::solve(std::span<const System> systems, std::span<SystemResult> results) {
  Numbers rest, large, small;
  for (Index k = 0; k < std::ssize(systems); ++k) rest.push_back(k);
  rest = solve_equal(systems, std::move(rest), results);
  for (const Index k : rest) (systems[at(k)].a.cols > kLargeSystem ? large : small).push_back(k);
  const std::vector<Numbers> groups = cut(systems, small);
  if (!groups.empty()) solve_in_lanes(systems, groups, results);
  // Where a device is named, each has it for itself.
  const bool named = solver::named_devices(session_.options.device, session_.context.registry).has_value();
  solve_on_threads(session_, systems, large, named ? 1 : session_.pool.size(), results);
  if (!small.empty())
    session_.context.log(
        fmt::format("solve_systems: {} of {} systems were solved together, in {} groups{}; {} teams took "
                    "{:.4f} s to order, {:.4f} for plans, {:.4f} for factors and solutions, {:.4f} for "
                    "the others",
                    together_.load(), small.size(), groups.size(), why_.empty() ? "" : ": " + why_, teams_,
                    seconds_.order, seconds_.plan, seconds_.solve, seconds_.others));
  std::size_t most = static_cast<std::size_t>(session_.pool.size());
  for (const Numbers& g : groups) most = std::max(most, together_ > 0 ? g.size() : 1);
  return static_cast<int>(std::min(most, std::max<std::size_t>(1, systems.size())));
}

void Groups::solve_in_lanes(std::span<const System> systems, const std::vector<Numbers>& groups,
                            std::span<SystemResult> results) {
  teams_ = std::min(teams_, static_cast<int>(groups.size()));
  std::vector<std::unique_ptr<Team>> teams;
  for (int l = 0; l < teams_; ++l)
    teams.push_back(std::make_unique<Team>(session_, std::max(1, session_.pool.size() / teams_), teams_));
  share(session_.pool, teams_, static_cast<Index>(groups.size()),
        [&](int team, Index g) { solve_group(*teams[at(team)], systems, groups[at(g)], results); });
  for (const auto& team : teams) seconds_ += team->seconds;
}

// Solves the systems of one pattern by a Batch; one that fails there is asked again. @returns the others
Groups::Numbers Groups::solve_equal(std::span<const System> systems, Numbers numbers, std::span<SystemResult> results) {
  const std::size_t least = wished_ > 0 ? at(wished_) : kLeastEqual;
  std::vector<char> done(systems.size(), 0);
  for (const Numbers& list : equal_patterns(systems, session_.options.kind, least, session_.pool)) {
    session_.pool.check();
    const System& first = systems[at(list.front())];
    Batch batch(session_.options);
    if (!batch.analyze(first.a).status.ok()) continue;
    std::vector<double> values, b;
    for (const Index k : list) {
      const System& s = systems[at(k)];
      values.insert(values.end(), s.a.values.begin(), s.a.values.end());
      b.insert(b.end(), s.b.begin(), s.b.end());
    }
    const BatchResult found =
        batch.solve(values, b, b, static_cast<Index>(list.size()), first.columns, first.transpose);
    for (std::size_t k = 0; k < found.systems.size(); ++k) {
      if (!found.systems[k].status.ok()) continue;
      const std::span<double> x = systems[at(list[k])].x;
      std::copy_n(b.begin() + static_cast<std::ptrdiff_t>(k * x.size()), x.size(), x.begin());
      results[at(list[k])] = found.systems[k];
      done[at(list[k])] = 1;
    }
  }
  std::erase_if(numbers, [&](Index k) { return done[at(k)] != 0; });
  return numbers;
}

// Groups of about equal size, of systems of a kind with as many right-hand sides, as many in each team.
std::vector<Groups::Numbers> Groups::cut(std::span<const System> systems, const Numbers& numbers) const {
  std::vector<Kind> kinds(numbers.size());
  session_.pool.for_each_range(std::ssize(numbers), 16, [&](std::int64_t begin, std::int64_t end) {
    base::ThreadPool alone(1);
    for (auto k = at(begin); k < at(end); ++k)
      kinds[k] = kind_of(systems[at(numbers[k])].a, session_.options.kind, alone);
  });
  std::map<std::tuple<Kind, Storage, Index, bool>, Numbers> alike;
  for (std::size_t k = 0; k < numbers.size(); ++k) {
    const System& s = systems[at(numbers[k])];
    alike[{kinds[k], s.a.storage, s.columns, s.transpose != Transpose::no}].push_back(numbers[k]);
  }
  std::vector<Numbers> groups;
  for (const auto& [key, list] : alike) {
    Offset unknowns = 0;
    for (const Index k : list) unknowns += systems[at(k)].a.cols;
    Offset count = (unknowns + kUnknownsOfGroup - 1) / kUnknownsOfGroup;
    if (count > 1) count = (count + teams_ - 1) / teams_ * teams_;
    Offset taken = 0, size = 0;
    const auto begin = static_cast<Offset>(groups.size());
    for (const Index k : list) {
      const bool full = wished_ > 0 ? size >= wished_ : taken >= unknowns * (std::ssize(groups) - begin) / count;
      if (size == 0 || full) {
        groups.emplace_back();
        size = 0;
      }
      groups.back().push_back(k);
      taken += systems[at(k)].a.cols;
      ++size;
    }
  }
  return groups;
}

void Groups::solve_group(Team& team, std::span<const System> systems, const Numbers& numbers,
                         std::span<SystemResult> results) {
  const double start = base::now_seconds();
  std::vector<Member> members(numbers.size());
  team.share(members.size(), [&](Session& worker, std::size_t k) {
    session_.pool.check();
    Member& m = members[k];
    m.system = &systems[at(numbers[k])];
    m.result = &results[at(numbers[k])];
    m.result->status = solver::status_of(worker.interruption, kRemedy, [&] {
      expect_values(m.system->a);
      m.ordered = solver::order(m.system->a, worker.context);
      const solver::Draft& draft = m.ordered->draft;
      m.largest = largest_scaled(draft.system.prepared, draft.values, worker.pool);
      m.alone = draft.system.kind == Kind::llt && !has_diagonal(draft.system.prepared);
    });
    if (m.result->status.ok()) return;
    m.ordered.reset();
    forget_solution(m.system->x);
  });
  team.seconds.order += base::now_seconds() - start;
  std::map<std::pair<Kind, Storage>, std::vector<Member*>> alike;
  for (Member& m : members)
    if (m.ordered && !m.alone)
      alike[{m.ordered->draft.system.kind, m.ordered->draft.system.prepared.a.storage}].push_back(&m);
  for (const auto& [key, list] : alike) solve_together(team, list);
  const double together = base::now_seconds();
  std::vector<Member*> left;
  for (Member& m : members)
    if (m.ordered && m.left) left.push_back(&m);
  team.share(left.size(), [&](Session& worker, std::size_t k) {
    session_.pool.check();
    Member& m = *left[k];
    m.result->status = solver::status_of(worker.interruption, kRemedy, [&] {
      solver::Analyzed made = solver::finish(std::move(*m.ordered), worker.context);
      worker.factor.emplace(std::move(made.analysis), std::move(made.values), worker.context);
    });
    if (m.result->status.ok())
      *m.result = solve_one(worker, arrays_of(*m.system), m.system->columns, m.system->transpose != Transpose::no);
    else
      forget_solution(m.system->x);
    worker.factor.reset();
  });
  team.seconds.others += base::now_seconds() - together;
}

// What there is no memory for together is halved.
void Groups::solve_together(Team& team, std::span<Member* const> members) {
  if (members.size() < 2 || !useful_) return;
  session_.pool.check();
  try {
    return solve_chunk(team, members);
  } catch (const Error& e) {
    if (e.status().code == StatusCode::cancelled) throw;
    if (e.status().code != StatusCode::out_of_memory) {
      useful_ = false;
      return note(e.what());
    }
    note(fmt::format("groups were cut, {}", e.what()));
  } catch (const std::bad_alloc&) {
    note("groups were cut, out of memory");
  }
  const std::size_t half = members.size() / 2;
  solve_together(team, members.first(half));
  solve_together(team, members.subspan(half));
}

void Groups::solve_chunk(Team& team, std::span<Member* const> members) {
  const double start = base::now_seconds();
  const solver::Context& context = team.session.context;
  std::vector<JoinedBlock> blocks;
  std::vector<const solver::System*> parts;
  std::vector<ChunkSystem> systems;
  for (const Member* m : members) {
    blocks.push_back({&*m->ordered, m->largest});
    parts.push_back(&m->ordered->draft.system);
    systems.push_back(arrays_of(*m->system));
  }
  solver::Ordered joined = joined_system(blocks, context);
  const solver::SharedAnalysis analysis = solver::finish(std::move(joined), context).analysis;
  const Index columns = members.front()->system->columns;
  if (!fits(*analysis, columns, context)) throw Error(StatusCode::out_of_memory, "they need more memory than there is");
  std::unique_lock alone(several_devices_, std::defer_lock);
  if (analysis->device.backend->limits().own_memory && analysis->device.devices() > 1) alone.lock();
  team.seconds.plan += base::now_seconds() - start;
  const double planned = base::now_seconds();
  Chunk chunk(analysis, parts, context);
  std::vector<SystemResult> results(members.size());
  const std::vector<char> left =
      chunk.solve({systems, columns, members.front()->system->transpose != Transpose::no}, results);
  team.seconds.solve += base::now_seconds() - planned;
  if (left.empty()) return note("together they do not tell the inertia of each, or pivots fail");
  for (std::size_t k = 0; k < members.size(); ++k) {
    if (left[k] != 0) continue;
    *members[k]->result = std::move(results[k]);
    members[k]->left = false;
    ++together_;
  }
}

// Half of a team's share of a device's memory, or of its budget: the rest is others'.
bool Groups::fits(const solver::Analysis& joined, Index columns, const solver::Context& context) const {
  const device::Backend& backend = *joined.device.backend;
  Offset memory = solver::budgets_of(joined.device, context.options).front();
  if (memory == 0 && !backend.limits().own_memory) return true;
  if (memory == 0) memory = backend.free_bytes(joined.device.numbers.front());
  const Offset vectors = (8 + 3 * Offset{columns}) * joined.n();
  const Offset bytes = backend.executor_bytes(joined.plan, joined.kind(), Precision::fp64, context.pool.size()) +
                       2 * static_cast<Offset>(sizeof(double)) * (joined.system->prepared.a.nonzeros() + vectors);
  return bytes <= memory / (2 * teams_);
}

void Groups::note(const std::string& why) {
  const std::lock_guard lock(noting_);
  if (why_.empty()) why_ = why;
}

}  // namespace espalier::batch
