#include "batch/chunks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <utility>

#include "base/at.hpp"
#include "batch/workers.hpp"

namespace espalier::batch {

namespace {

// Kernels on several GPUs wait for each other, so that those of two teams could wait for ever.
int most_teams(const solver::Analysis& analysis) {
  const solver::DeviceChoice& device = analysis.device;
  return device.backend->limits().own_memory && device.numbers.size() > 1 ? 1 : 2;
}

// @returns why further chunks are of no use; empty: they are
std::string solve_part(Chunk& chunk, const ChunkJob& part, std::span<SystemResult> results, std::span<char> left) {
  const std::vector<char> now = chunk.solve(part, results);
  if (now.empty()) return "together they do not tell the inertia of each, or pivots fail";
  std::copy(now.begin(), now.end(), left.begin());
  return 2 * std::count(now.begin(), now.end(), 1) > std::ssize(part.systems) ? "pivots fail in most of them" : "";
}

}  // namespace

struct Chunks::Team {
  explicit Team(Options options) : session(std::move(options)) {}
  solver::Session session;  // threads and memory
  std::unique_ptr<Chunk> chunk;
};

Chunks::Chunks(solver::Session& session) : session_(session) {}

Chunks::~Chunks() {
  if (!session_.device_lost()) return;
  for (const auto& team : teams_) (void)team->chunk.release();
}

void Chunks::forget() {
  teams_.clear();
  best_.reset();
}

Index Chunks::size_for(const solver::SharedAnalysis& analysis, Index count) {
  if (!Chunk::serves(session_.options)) return 0;
  const Offset most = std::numeric_limits<Index>::max() / analysis->n();
  if (const std::optional<Index> wish = Chunk::wished_size())
    return static_cast<Index>(std::min({Offset{*wish}, Offset{count}, most}));
  if (!best_) best_ = Chunk::best_size(*analysis, most_teams(*analysis), session_.context);
  if (*best_ < 2) return 0;
  // Equal chunks, as many in each team.
  const Index teams = most_teams(*analysis);
  Index chunks = (count + *best_ - 1) / *best_;
  if (chunks > 1) chunks = (chunks + teams - 1) / teams * teams;
  return chunks > 0 ? (count + chunks - 1) / chunks : 0;
}

// Where there is no memory for the second team, the first goes alone.
void Chunks::make_teams(const solver::SharedAnalysis& analysis, Index size, int teams) {
  const auto fits = [&](const Chunk& c) { return c.systems() >= size && c.systems() <= 2 * size; };
  if (!teams_.empty() && wanted_ >= teams && fits(*teams_.front()->chunk)) return;
  teams_.clear();
  wanted_ = teams;
  session_.note_devices();
  const int threads = std::max(1, session_.pool.size() / teams);
  const auto add = [&] {
    auto team = std::make_unique<Team>(options_of_worker(session_.options, threads, teams));
    team->chunk = teams_.empty() ? std::make_unique<Chunk>(analysis, size, team->session.context)
                                 : std::make_unique<Chunk>(*teams_.front()->chunk, team->session.context);
    teams_.push_back(std::move(team));
  };
  add();
  try {
    while (static_cast<int>(teams_.size()) < teams) add();
  } catch (const Error& e) {
    if (e.status().code != StatusCode::out_of_memory) throw;
  }
}

// @returns why not all chunks were tried; empty: they were
std::string Chunks::solve_in_lanes(const ChunkJob& all, std::span<SystemResult> results, std::span<char> left) {
  const auto systems = static_cast<Index>(all.systems.size());
  const Index size = teams_.front()->chunk->systems();
  std::vector<std::string> why(teams_.size());
  std::atomic<bool> useful{true}, broken{false};
  share(session_.pool, static_cast<int>(teams_.size()), (systems + size - 1) / size, [&](int team, Index k) {
    if (!useful) return;
    const Index first = k * size, count = std::min(size, systems - first);
    std::string& mine = why[at(team)];
    try {
      mine =
          solve_part(*teams_[at(team)]->chunk, {all.systems.subspan(at(first), at(count)), all.columns, all.transpose},
                     results.subspan(at(first), at(count)), left.subspan(at(first), at(count)));
    } catch (const Error& e) {
      mine = e.what();
      broken = true;
    }
    if (!mine.empty()) useful = false;
  });
  if (broken) teams_.clear();
  const auto reason = std::find_if(why.begin(), why.end(), [](const std::string& s) { return !s.empty(); });
  return reason != why.end() ? *reason : "";
}

std::vector<char> Chunks::solve(const solver::SharedAnalysis& analysis, const ChunkJob& all,
                                std::span<SystemResult> results, int& workers) {
  const auto count = static_cast<Index>(all.systems.size());
  std::vector<char> left(all.systems.size(), 1);
  const Index size = size_for(analysis, count);
  if (size < 2) return left;
  std::string why;
  try {
    const Index chunks = (count + size - 1) / size;
    make_teams(analysis, size, std::min({most_teams(*analysis), session_.pool.size(), static_cast<int>(chunks)}));
    workers = std::max(workers, static_cast<int>(std::min(Offset{count}, Offset{size} * std::ssize(teams_))));
    why = solve_in_lanes(all, results, left);
  } catch (const Error& e) {
    if (e.status().code == StatusCode::cancelled) throw;
    teams_.clear();
    why = e.what();
  }
  session_.context.log(fmt::format("batch: {} of {} systems were solved in chunks of {}, the others one by one{}",
                                   std::count(left.begin(), left.end(), 0), count, size,
                                   why.empty() ? "" : ": " + why));
  if (!teams_.empty()) log_seconds();
  return left;
}

void Chunks::log_seconds() const {
  Chunk::Seconds all;
  for (const auto& team : teams_) all += team->chunk->seconds();
  session_.context.log(
      fmt::format("batch: so far {:.4f} s for values, {:.4f} factorizations, {:.4f} substitutions, "
                  "{:.4f} residuals and verdicts; teams: {}",
                  all.values, all.factorizations, all.substitutions, all.residuals, teams_.size()));
}

}  // namespace espalier::batch
