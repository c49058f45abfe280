#include "batch/chunk.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>

#include "base/at.hpp"
#include "base/timeline.hpp"
#include "batch/chunk_block.hpp"
#include "batch/easy_values.hpp"
#include "batch/least_negative.hpp"
#include "batch/repeated_analysis.hpp"
#include "solver/factor/factor.hpp"
#include "solver/factor/pivot_policy.hpp"

namespace espalier::batch {

Chunk::Seconds& Chunk::Seconds::operator+=(const Seconds& other) {
  values += other.values;
  factorizations += other.factorizations;
  substitutions += other.substitutions;
  residuals += other.residuals;
  return *this;
}

bool Chunk::serves(const Options& options) {
  return options.precision == Precision::fp64 && options.rescale == Rescale::off && options.perturbation == 0 &&
         options.zero_pivot == 0;
}

// Together as many as fill a device, and no more than half of its memory takes: a plan for more costs the host more
// than larger chunks bring.
Index Chunk::best_size(const solver::Analysis& one, Index chunks, const solver::Context& context) {
  constexpr Offset kUnknowns = 1 << 19;
  const device::Backend& backend = *one.device.backend;
  if (!backend.limits().own_memory) return 0;
  Offset memory = budgets_of(one.device, context.options).front();
  if (memory == 0) memory = backend.free_bytes(one.device.numbers.front());
  const Offset bytes = backend.executor_bytes(one.plan, one.kind(), Precision::fp64, 1) +
                       2 * static_cast<Offset>(sizeof(double)) * (one.system->prepared.a.nonzeros() + 8 * one.n());
  return static_cast<Index>(std::min(kUnknowns / one.n(), memory / 2 / bytes) / chunks);
}

std::optional<Index> Chunk::wished_size() {
  const char* text = std::getenv("ESPALIER_BATCH_CHUNK");
  if (text == nullptr) return std::nullopt;
  Index size = 0;
  const auto [end, error] = std::from_chars(text, text + std::strlen(text), size);
  if (error != std::errc{} || *end != '\0' || size < 0)
    throw Error(
        StatusCode::invalid_input,
        fmt::format("ESPALIER_BATCH_CHUNK: '{}' is not understood; give a number of systems, or 0 for one by one",
                    text));
  return size;
}

Chunk::Chunk(const solver::SharedAnalysis& one, Index systems, const solver::Context& context)
    : Chunk(one, repeated_analysis(*one, systems, context),
            std::vector<const solver::System*>(at(systems), one->system.get()), context) {}

Chunk::Chunk(solver::SharedAnalysis joined, const std::vector<const solver::System*>& systems,
             const solver::Context& context)
    : Chunk(nullptr, std::move(joined), systems, context) {}

Chunk::Chunk(const Chunk& like, const solver::Context& context) : Chunk(like.one_, like.all_, like.systems_, context) {}

Chunk::Chunk(solver::SharedAnalysis one, solver::SharedAnalysis all, std::vector<const solver::System*> systems,
             const solver::Context& context)
    : one_(std::move(one)), all_(std::move(all)), systems_(std::move(systems)), context_(context), n_(all_->n()) {
  values_.assign(at(all_->system->prepared.a.nonzeros()), 0.0);
  numeric_ = solver::make_numeric(*all_, values_, {}, context_);
  numeric_->halt_at_failures(false);
  make_blocks();
  Index largest = 0;
  for (const auto& block : blocks_) largest = std::max(largest, block->n());
  numeric_->set_smallest_pivot(solver::zero_pivot(largest, base::ScalarTraits<double>::epsilon));
}

Chunk::~Chunk() = default;

void Chunk::make_blocks() {
  for (int t = 0; t < context_.pool.size(); ++t) workers_.push_back(std::make_unique<Worker>());
  Index first = 0;
  Offset entry = 0;
  const solver::System* before = nullptr;
  std::shared_ptr<const solver::Scales> scales;
  for (const solver::System* system : systems_) {
    const solver::PreparedMatrix& p = system->prepared;
    if (std::exchange(before, system) != system)
      scales =
          std::make_shared<const solver::Scales>(solver::Scales{p.row_scale, p.col_scale, p.transform_log, p.wide});
    base::ThreadPool& pool = workers_[blocks_.size() % workers_.size()]->pool;
    blocks_.push_back(std::make_unique<Block>(*system, scales, first, entry, pool));
    first += p.n();
    entry += p.a.nonzeros();
  }
}

double* Chunk::column_of(const Vectors& vectors, const Block& block, Index column) const {
  return vectors.get() + Offset{column} * n_ + block.first;
}

std::span<double> Chunk::values_of(const Block& block) {
  return std::span(values_).subspan(at(block.entry), at(block.prepared().a.nonzeros()));
}

// The block whose pivot is eliminated there: blocks stand in the order in the order of their numbers.
Chunk::Block& Chunk::block_of(Index position) {
  const auto after = std::upper_bound(blocks_.begin(), blocks_.end(), position,
                                      [](Index p, const auto& block) { return p < block->first; });
  return **std::prev(after);
}

// They move only when there are more columns than ever before.
void Chunk::take_vectors(Index columns) {
  if (columns <= columns_) return;
  columns_ = 0;
  const Offset count = Offset{n_} * columns;
  device::DeviceLinearSystem* const device = numeric_->device_system();
  for (Vectors* v : {&from_, &to_}) {
    v->reset();
    *v = device != nullptr ? device->host_memory(count) : std::make_shared<double[]>(at(count));
  }
  columns_ = columns;
}

// Systems with values or right-hand sides that are none are left.
void Chunk::take_systems(const ChunkJob& job) {
  take_vectors(job.columns);
  const auto count = static_cast<Index>(job.systems.size());
  for_blocks([&](Block& block, Index k) {
    block.begin(values_of(block));
    block.left = k >= count || !take_right_hand_sides(job, block, k) || !take_values(job, block, k);
    if (block.left)
      for (Index c = 0; c < job.columns; ++c) std::fill_n(column_of(from_, block, c), block.n(), 0.0);
  });
}

bool Chunk::take_right_hand_sides(const ChunkJob& job, const Block& block, Index k) {
  const Index n = block.n();
  for (Index c = 0; c < job.columns; ++c) {
    const double* b = job.systems[at(k)].b + Offset{c} * n;
    if (!std::all_of(b, b + n, [](double v) { return std::isfinite(v); })) return false;
    std::copy_n(b, n, column_of(from_, block, c));
  }
  return true;
}

bool Chunk::take_values(const ChunkJob& job, const Block& block, Index k) {
  const solver::PreparedMatrix& p = block.prepared();
  Worker& worker = *workers_[at(k) % workers_.size()];
  worker.values.resize(at(p.a.nonzeros()));
  worker.scaled.resize(worker.values.size());
  try {
    solver::copy_values(p, job.systems[at(k)].values, worker.values, worker.pool);
    (void)solver::scale_values(p, *block.scales, worker.values, worker.scaled.data(), worker.pool);
  } catch (const Error& e) {
    if (e.status().code != StatusCode::invalid_input) throw;
    return false;
  }
  std::copy(worker.values.begin(), worker.values.end(), values_of(block).begin());
  return true;
}

// Places of systems that are left get the values of another one of their pattern, or else easy ones, at worst zeros,
// whose pivots are replaced. @returns false: all are left
bool Chunk::fill_gaps() {
  const auto is_left = [](const auto& block) { return block->left; };
  if (std::none_of(blocks_.begin(), blocks_.end(), is_left)) return true;
  const auto good = std::find_if_not(blocks_.begin(), blocks_.end(), is_left);
  if (good == blocks_.end()) return false;
  for_blocks([&](Block& block, Index) {
    if (!block.left) return;
    const std::span<double> values = values_of(block), from = values_of(**good);
    if (one_ != nullptr)
      std::copy(from.begin(), from.end(), values.begin());
    else
      (void)take_easy_values(block.prepared(), values);
  });
  return true;
}

void Chunk::note_failures(const device::FactorOutcome& outcome) {
  for (const auto* list : {&outcome.replaced, &outcome.small, &outcome.failed})
    for (const Index position : *list) block_of(position).left = true;
  if (outcome.not_positive >= 0) block_of(outcome.not_positive).left = true;
}

// Until no pivot of any block fails. Of positive definite systems only the lowest failure is known each time; some
// rounds still take less time than all systems one by one.
// @returns whether there is a factor, with the inertia of each
bool Chunk::factorize() {
  const bool ldlt = all_->kind() == Kind::ldlt;
  const Index most_rounds = all_->kind() == Kind::llt ? std::max(4, systems() / 8) : 4;
  for (Index round = 0; round < most_rounds; ++round) {
    if (!fill_gaps()) return false;
    context_.pool.check();
    if (device::DeviceLinearSystem* device = numeric_->device_system(); device != nullptr)
      device->send_values(0, static_cast<Offset>(values_.size()));
    const device::FactorOutcome outcome = numeric_->factorize();
    note_failures(outcome);
    if (outcome.not_positive >= 0) continue;
    if (!ldlt || take_inertia()) return true;
    const bool failed = !outcome.replaced.empty() || !outcome.small.empty() || !outcome.failed.empty();
    if (!failed) return proves_inertia(outcome.negative);
  }
  return false;
}

// By the signs of pivots, where the device tells them. Those of a block that is left mean nothing, and nobody asks.
bool Chunk::take_inertia() {
  const std::vector<char> negative = numeric_->negative_pivots();
  if (negative.empty()) return false;
  for (const auto& block : blocks_) {
    const auto first = negative.begin() + block->first;
    block->negative = static_cast<Index>(std::count(first, first + block->n(), 1));
  }
  return true;
}

// Elsewhere a device counts for all blocks. Where that is what each of them has at least, each has just that.
bool Chunk::proves_inertia(Index negative) {
  for_blocks([&](Block& block, Index) {
    MatrixView a = block.prepared().a;
    a.values = values_of(block);
    block.negative = least_negative(a);
  });
  Offset least = 0;
  for (const auto& block : blocks_) least += block->negative;
  return least == negative;
}

// What is not accurate, or looks singular by its solution, is left.
void Chunk::finish(const ChunkJob& job, bool refined, std::span<SystemResult> results) {
  constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();
  for_blocks([&](Block& block, Index k) {
    if (block.left) return;
    const Index n = block.n();
    const ChunkSystem& system = job.systems[at(k)];
    const std::span<const double> b(system.b, at(n)), x(column_of(to_, block, 0), at(n));
    if (refined) {
      const solver::Scales& scales = *block.scales;
      const double norm = (job.transpose ? scales.row : scales.col).empty() ? block.residual.norm(job.transpose) : 1;
      block.left = !(block.refined.error.normwise <= context_.options.required_backward_error) ||
                   solver::growth_of(b, x, 1, scales, norm, job.transpose).is_far(false);
      if (block.left) return;
    }
    SystemResult& r = results[at(k)];
    r = SystemResult{};
    r.rank = n;
    if (all_->kind() != Kind::lu) r.inertia = {n - block.negative, block.negative, 0};
    r.refinement_steps = block.refined.steps;
    r.backward_error = refined ? block.refined.error.normwise : kUnknown;
    r.componentwise_error = refined ? block.refined.error.componentwise : kUnknown;
    for (Index c = 0; c < job.columns; ++c) std::copy_n(column_of(to_, block, c), n, system.x + Offset{c} * n);
  });
}

std::vector<char> Chunk::solve(const ChunkJob& job, std::span<SystemResult> results) {
  const double start = base::now_seconds(), substitutions = seconds_.substitutions;
  take_systems(job);
  const double taken = base::now_seconds();
  seconds_.values += taken - start;
  const bool factorized = factorize();
  const double ready = base::now_seconds();
  seconds_.factorizations += ready - taken;
  if (!factorized) return {};
  const Options& o = context_.options;
  const bool refined = o.refinement_steps > 0 || std::isfinite(o.required_backward_error);
  refinement_.steps = o.refinement_steps;
  refinement_.target = o.refinement_target;
  refinement_.positive_definite = all_->kind() == Kind::llt;
  if (!solve_on_device(job, refined)) solve_on_host(job, refined);
  finish(job, refined, results);
  std::vector<char> left(job.systems.size());
  for (std::size_t k = 0; k < left.size(); ++k) left[k] = blocks_[k]->left ? 1 : 0;
  seconds_.residuals += base::now_seconds() - ready - (seconds_.substitutions - substitutions);
  return left;
}

}  // namespace espalier::batch
