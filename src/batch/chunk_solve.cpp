// Solutions of a chunk's systems, each refined for itself.
#include <algorithm>
#include <memory>
#include <set>

#include "base/timeline.hpp"
#include "batch/chunk_block.hpp"
#include "solve/part_refinement.hpp"

namespace espalier::batch {

// to_ = op(A)^-1 from_.
void Chunk::substitute(Index columns, bool transpose) {
  const double start = base::now_seconds();
  numeric_->solve(from_.get(), to_.get(), columns, transpose);
  seconds_.substitutions += base::now_seconds() - start;
}

// Solutions to to_ and their errors to the blocks, where the values are on a device; a step of refinement there is one
// for all systems that are in work. @returns false: there is no such device, not enough of its memory, or the blocks
// are not equal
bool Chunk::solve_on_device(const ChunkJob& job, bool refined) {
  device::DeviceLinearSystem* const device = numeric_->device_system();
  if (one_ == nullptr || device == nullptr || device->on_ranks()) return false;
  const double start = base::now_seconds();
  constexpr Index kMost = solve::Refinement::kMostColumns;
  // Another step would hardly change a bit.
  constexpr double kAtRounding = 1e-15;
  solve::RefinementOptions options = refinement_;
  options.target = std::max(options.target, kAtRounding);
  const Offset all = n_;
  const auto apply = [&](const double* from, double* to, Index count) {
    device->substitute(from, to, count, job.transpose);
  };
  try {
    for (Index first = 0; first < job.columns; first += kMost) {
      const Index now = std::min(kMost, job.columns - first);
      double *const b = device->right_hand_sides(now), *const x = device->solutions(now);
      device->copy_vectors(from_.get() + first * all, b, now * all);
      apply(b, x, now);
      parts_.assign(at(now * systems()), {});
      if (refined) solve::refine_parts(*device, apply, {b, x, now, job.transpose}, options, parts_);
      device->copy_vectors(x, to_.get() + first * all, now * all);
      device->finish();
      for (std::size_t k = 0; k < parts_.size(); ++k) blocks_[k % blocks_.size()]->note(parts_[k]);
    }
  } catch (const Error& e) {
    device->settle();
    if (e.status().code != StatusCode::out_of_memory) throw;
    for (const auto& block : blocks_) block->refined = {};
    return false;
  }
  seconds_.substitutions += base::now_seconds() - start;
  return true;
}

void Chunk::solve_on_host(const ChunkJob& job, bool refined) {
  substitute(job.columns, job.transpose);
  if (!refined) return;
  for_blocks([&](Block& block, Index) {
    if (block.left) return;
    const Index n = block.n();
    block.x.resize(at(job.columns) * at(n));
    for (Index c = 0; c < job.columns; ++c) std::copy_n(column_of(to_, block, c), n, block.x.data() + Offset{c} * n);
  });
  refine(job);
  for_blocks([&](const Block& block, Index) {
    const Index n = block.n();
    for (Index c = 0; c < job.columns && !block.left; ++c)
      std::copy_n(block.x.data() + Offset{c} * n, n, column_of(to_, block, c));
  });
}

// Systems are refined side by side, each until it stalls: one substitution a step for all that still have as many
// right-hand sides in work.
void Chunk::refine(const ChunkJob& job) {
  constexpr Index kMost = solve::Refinement::kMostColumns;
  for (Index first = 0; first < job.columns; first += kMost) {
    for_blocks([&](Block& block, Index k) {
      if (block.left) return;
      const Offset begin = Offset{first} * block.n();
      block.steps =
          std::make_unique<solve::Refinement>(block.residual,
                                              solve::Systems{job.systems[at(k)].b + begin, block.x.data() + begin,
                                                             std::min(kMost, job.columns - first), job.transpose},
                                              refinement_);
    });
    for (;;) {
      std::set<Index> columns;
      for (const auto& block : blocks_)
        if (!block->left && !block->steps->done()) columns.insert(block->steps->columns());
      if (columns.empty()) break;
      for (const Index now : columns) correct(now, job.transpose);
      for_blocks([](Block& block, Index) {
        if (!block.left && !block.steps->done()) block.steps->take_corrections();
      });
    }
    for_blocks([&](Block& block, Index) {
      if (!block.left) block.note(block.steps->result());
    });
  }
}

// Corrects the solutions of blocks with so many columns in work.
void Chunk::correct(Index columns, bool transpose) {
  const auto takes_part = [&](const Block& block) {
    return !block.left && !block.steps->done() && block.steps->columns() == columns;
  };
  std::fill_n(from_.get(), Offset{n_} * columns, 0.0);
  for_blocks([&](const Block& block, Index) {
    if (!takes_part(block)) return;
    const Index n = block.n();
    for (Index c = 0; c < columns; ++c)
      std::copy_n(block.steps->residuals() + Offset{c} * n, n, column_of(from_, block, c));
  });
  context_.pool.check();
  substitute(columns, transpose);
  for_blocks([&](const Block& block, Index) {
    if (!takes_part(block)) return;
    const Index n = block.n();
    for (Index c = 0; c < columns; ++c)
      std::copy_n(column_of(to_, block, c), n, block.steps->corrections() + Offset{c} * n);
  });
}

}  // namespace espalier::batch
