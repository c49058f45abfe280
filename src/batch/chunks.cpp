#include "batch/chunks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace espalier::batch {

namespace {

auto at(Index k) { return static_cast<std::size_t>(k); }

ChunkJob part_of(const ChunkJob& all, const solver::Analysis& analysis, Index first, Index count) {
  const auto nonzeros = static_cast<std::size_t>(analysis.system->prepared.caller_nonzeros);
  const std::size_t numbers = at(analysis.n()) * at(all.columns);
  return {all.values.subspan(at(first) * nonzeros, at(count) * nonzeros),
          all.b + at(first) * numbers,
          all.x + at(first) * numbers,
          count,
          all.columns,
          all.transpose};
}

// @returns why further chunks are of no use; empty: they are
std::string solve_part(Chunk& chunk, const ChunkJob& part, std::span<SystemResult> results, std::span<char> left) {
  const std::vector<char> now = chunk.solve(part, results);
  if (now.empty()) return "together they do not tell the inertia of each, or pivots fail";
  std::copy(now.begin(), now.end(), left.begin());
  return 2 * std::count(now.begin(), now.end(), 1) > part.count ? "pivots fail in most of them" : "";
}

}  // namespace

Chunks::~Chunks() {
  if (session_.device_lost()) (void)chunk_.release();
}

void Chunks::forget() {
  chunk_.reset();
  best_.reset();
}

Index Chunks::size_for(const solver::SharedAnalysis& analysis, Index count) {
  if (!Chunk::serves(*analysis, session_.options)) return 0;
  const Offset most = std::numeric_limits<Index>::max() / analysis->n();
  if (const std::optional<Index> wish = Chunk::wished_size())
    return static_cast<Index>(std::min({Offset{*wish}, Offset{count}, most}));
  if (!best_) best_ = Chunk::best_size(*analysis, session_.context);
  return std::min(*best_, count);
}

void Chunks::make(const solver::SharedAnalysis& analysis, Index size) {
  if (chunk_ != nullptr && chunk_->systems() >= size && chunk_->systems() <= 2 * size) return;
  chunk_.reset();
  session_.note_devices();
  chunk_ = std::make_unique<Chunk>(analysis, size, session_.context);
}

std::vector<char> Chunks::solve(const solver::SharedAnalysis& analysis, const ChunkJob& all,
                                std::span<SystemResult> results, int& workers) {
  std::vector<char> left(at(all.count), 1);
  const Index size = size_for(analysis, all.count);
  if (size < 2) return left;
  workers = std::max<int>(workers, size);
  std::string why;
  try {
    make(analysis, size);
    for (Index first = 0; first < all.count && why.empty(); first += size) {
      const Index count = std::min(size, all.count - first);
      why = solve_part(*chunk_, part_of(all, *analysis, first, count), results.subspan(at(first), at(count)),
                       std::span(left).subspan(at(first), at(count)));
    }
  } catch (const Error& e) {
    if (e.status().code == StatusCode::cancelled) throw;
    chunk_.reset();
    why = e.what();
  }
  session_.context.log(fmt::format("batch: {} of {} systems were solved in chunks of {}, the others one by one{}",
                                   std::count(left.begin(), left.end(), 0), all.count, size,
                                   why.empty() ? "" : ": " + why));
  if (chunk_ != nullptr) log_seconds();
  return left;
}

void Chunks::log_seconds() const {
  const Chunk::Seconds& s = chunk_->seconds();
  session_.context.log(
      fmt::format("batch: so far {:.4f} s for values, {:.4f} factorizations, {:.4f} substitutions, "
                  "{:.4f} residuals and verdicts",
                  s.values, s.factorizations, s.substitutions, s.residuals));
}

}  // namespace espalier::batch
