#include "dynamics/elements/assembly.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "base/at.hpp"
#include "base/parallel.hpp"

namespace espalier::dynamics {
namespace {

using base::for_each_range;

/// Tangents of a batch take about so many bytes for each thread: a part of its cache.
constexpr std::int64_t kBatchBytes = 1 << 20;

constexpr Index kElementsOfTask = 64, kVerticesOfTask = 512;  // of a task of forces: some 20 microseconds

}  // namespace

ElementAssembly::ElementAssembly(Index vertices, std::vector<std::unique_ptr<ElementGroup>> groups,
                                 base::ThreadPool* pool) {
  for (auto& group : groups) add_kind(std::move(group), vertices);
  energies_.resize(at(elements_));
  build_pattern(vertices, pool);
  for (Kind& kind : kinds_) build_batches(kind, pool);
}

void ElementAssembly::add_kind(std::unique_ptr<ElementGroup> group, Index vertices) {
  const Index count = group->count();
  const int n = group->vertices_per_element(), lanes = group->width();
  if (std::int64_t{count} * n > std::numeric_limits<std::int32_t>::max())
    throw Error(StatusCode::invalid_input, fmt::format("a body of {} elements with {} nodes is too large", count, n));
  Kind kind{std::move(group), ResultLayout(n, lanes), {}, elements_, tasks_, force_numbers_, {}, {}};
  kind.vertex.reserve(at(count) * at(n));
  for (Index e = 0; e < count; ++e)
    for (const Index v : kind.group->vertices(e)) {
      if (v < 0 || v >= vertices)
        throw std::invalid_argument(
            fmt::format("element {} uses vertex {}, the body has {}", kind.group->label(e), v, vertices));
      kind.vertex.push_back(v);
    }
  kind.forces = make_force_list(kind.connectivity(), vertices);
  elements_ += count;
  tasks_ += (count + kElementsOfTask - 1) / kElementsOfTask;
  force_numbers_ += std::int64_t{count + lanes - 1} / lanes * lanes * kind.layout.forces();
  kinds_.push_back(std::move(kind));
}

void ElementAssembly::build_pattern(Index vertices, base::ThreadPool* pool) {
  constexpr Index kVertices = 2048;  // of a range
  pattern_ = {};
  std::vector<std::vector<Index>> parts(at((vertices + kVertices - 1) / kVertices));
  pattern_.ptr.assign(at(vertices) + 1, 0);
  for_each_range(pool, vertices, kVertices, [&](std::int64_t begin, std::int64_t end) {
    std::vector<Index>& part = parts[at(begin / kVertices)];
    std::vector<Index> rows;
    for (auto v = static_cast<Index>(begin); v < end; ++v) {
      rows.assign(1, v);
      for (const Kind& kind : kinds_) {
        const int n = kind.layout.vertices();
        for (std::int32_t k = kind.forces.ptr[at(v)]; k < kind.forces.ptr[at(v) + 1]; ++k) {
          const auto first = kind.vertex.begin() + kind.forces.from[at(k)] / n * n;
          rows.insert(rows.end(), first, first + n);
        }
      }
      std::sort(rows.begin(), rows.end());
      rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
      part.insert(part.end(), rows.begin(), rows.end());
      pattern_.ptr[at(v) + 1] = static_cast<Offset>(rows.size());
    }
  });
  for (std::size_t v = 0; v < at(vertices); ++v) pattern_.ptr[v + 1] += pattern_.ptr[v];
  pattern_.ind.reserve(at(pattern_.ptr.back()));
  for (const std::vector<Index>& part : parts) pattern_.ind.insert(pattern_.ind.end(), part.begin(), part.end());
  if (pattern_.ptr.back() > std::numeric_limits<std::int32_t>::max())
    throw Error(StatusCode::invalid_input, fmt::format("a body of {} nodes has too many pairs of them", vertices));
}

void ElementAssembly::build_batches(Kind& kind, base::ThreadPool* pool) const {
  const std::int64_t threads = std::clamp(pool == nullptr ? 1 : pool->size(), 2, 64);
  const std::int64_t most = threads * kBatchBytes / (8 * kind.layout.tangents()) / kMaxLanes * kMaxLanes;
  const auto size = static_cast<Index>(std::clamp<std::int64_t>(most, kMaxLanes, kMostElementsOfList));
  kind.batches.resize(at((kind.count() + size - 1) / size));
  for_each_range(pool, static_cast<std::int64_t>(kind.batches.size()), 1, [&](std::int64_t k, std::int64_t) {
    const auto first = static_cast<Index>(k) * size;
    kind.batches[at(k)] = make_pair_list(kind.connectivity(), pattern_, first, std::min(first + size, kind.count()),
                                         kind.part_of(failed_));
  });
}

void ElementAssembly::set_failed(std::vector<char> failed, base::ThreadPool* pool) {
  if (!failed.empty() && failed.size() != at(elements_))
    throw std::invalid_argument(fmt::format("{} marks of failed elements, the body has {}", failed.size(), elements_));
  failed_ = std::move(failed);
  for (Kind& kind : kinds_) kind.forces = make_force_list(kind.connectivity(), vertices(), kind.part_of(failed_));
  build_pattern(vertices(), pool);
  for (Kind& kind : kinds_) build_batches(kind, pool);
}

int ElementAssembly::batches() const {
  std::size_t sum = 0;
  for (const Kind& kind : kinds_) sum += kind.batches.size();
  return static_cast<int>(sum);
}

ElementAssembly::~ElementAssembly() = default;

std::int64_t ElementAssembly::label(std::int64_t element) const {
  if (element < 0) return -1;
  for (const Kind& kind : kinds_)
    if (element < kind.first_element + kind.count())
      return kind.group->label(static_cast<Index>(element - kind.first_element));
  return -1;
}

std::unordered_map<std::int64_t, Index> ElementAssembly::numbers_by_label() const {
  std::unordered_map<std::int64_t, Index> numbers;
  for (const Kind& kind : kinds_)
    for (Index e = 0; e < kind.count(); ++e)
      numbers.emplace(kind.group->label(e), static_cast<Index>(kind.first_element) + e);
  return numbers;
}

/// The state for all elements, and what they are found to be.
struct ElementAssembly::Evaluation {
  AssemblyState state;
  double position_weight, velocity_weight;
  double* energies;  // of all elements
  std::span<const char> failed;
  std::atomic<std::int64_t> first_bad{std::numeric_limits<std::int64_t>::max()};

  /// Evaluates the elements first .. last - 1 of a kind, at most as many as it has lanes, and at `force` and, if not
  /// null, `tangent` writes what they give side by side. Lanes left over repeat the last element.
  void run(const Kind& kind, Index first, Index last, double* force, double* tangent) {
    const int lanes = kind.layout.lanes();
    alignas(64) double reference[kNumbers], position[kNumbers], velocity[kNumbers];
    for (int lane = 0; lane < lanes; ++lane) {
      const Index e = std::min(first + lane, last - 1);
      const Index* vertex = kind.vertex.data() + at(e) * at(kind.layout.vertices());
      gather(vertex, kind.layout, lane, has_failed(kind, e), reference, position, velocity);
    }
    const double* rates = state.velocity == nullptr ? nullptr : velocity;
    double energy[kMaxLanes];
    unsigned whole = 0;
    if (lanes > 1) {
      whole = kind.group->evaluate_block({reference, position, rates, state.damping, position_weight, velocity_weight},
                                         {force, tangent, energy});
    } else {
      ElementOutput out{force, tangent, 0};
      whole = kind.group->evaluate(first, {reference, position, rates, state.damping, position_weight, velocity_weight},
                                   out)
                  ? 1
                  : 0;
      energy[0] = out.energy;
    }
    for (Index e = first; e < last; ++e) {
      const auto lane = static_cast<int>(e - first);
      energies[kind.first_element + e] = energy[lane];
      if (has_failed(kind, e))
        fill(kind, e, lane, force, tangent, 0.0);
      else if ((whole >> lane & 1) == 0)
        spoil(kind, e, lane, force, tangent);
    }
  }

 private:
  static constexpr int kNumbers = kMaxElementDofs * kMaxLanes;

  [[nodiscard]] bool has_failed(const Kind& kind, Index e) const {
    return !failed.empty() && failed[at(kind.first_element + e)] != 0;
  }

  /// One that has failed may be anywhere: it is evaluated at rest, and what it gives is not taken.
  void gather(const Index* vertex, const ResultLayout& layout, int lane, bool at_rest, double* reference,
              double* position, double* velocity) const {
    const std::size_t lanes = at(layout.lanes());
    std::size_t to = at(lane);
    const double* places = at_rest ? state.reference : state.position;
    for (int a = 0; a < layout.vertices(); ++a)
      for (std::size_t i = 0; i < 3; ++i, to += lanes) {
        const std::size_t from = 3 * at(vertex[a]) + i;
        reference[to] = state.reference[from];
        position[to] = places[from];
        if (state.velocity != nullptr) velocity[to] = at_rest ? 0 : state.velocity[from];
      }
  }

  void fill(const Kind& kind, Index e, int lane, double* force, double* tangent, double value) {
    const int lanes = kind.layout.lanes();
    for (int k = 0; k < kind.layout.forces(); ++k) force[k * lanes + lane] = value;
    for (int k = 0; k < kind.layout.tangents() && tangent != nullptr; ++k) tangent[k * lanes + lane] = value;
    energies[kind.first_element + e] = value;
  }

  /// What an element that is not whole gives: no numbers.
  void spoil(const Kind& kind, Index e, int lane, double* force, double* tangent) {
    fill(kind, e, lane, force, tangent, std::numeric_limits<double>::quiet_NaN());
    const std::int64_t number = kind.first_element + e;
    for (std::int64_t seen = first_bad.load(); number < seen && !first_bad.compare_exchange_weak(seen, number);) {
    }
  }
};

std::int64_t ElementAssembly::add_forces(base::ThreadPool* pool, const AssemblyState& state, double* f,
                                         double& energy) {
  begin_forces(state);
  base::for_each(pool, element_tasks(), [&](std::int64_t task) { run_element_task(task); });
  base::for_each(pool, vertex_tasks(), [&](std::int64_t task) { run_vertex_task(task, f); });
  return end_forces(&energy);
}

void ElementAssembly::begin_forces(const AssemblyState& state) {
  forces_.reset(new Evaluation{state, 1, 0, energies_.data(), failed_});
  if (buffer_[0].size() < at(force_numbers_)) buffer_[0].resize(at(force_numbers_));
}

std::int64_t ElementAssembly::element_tasks() const { return tasks_; }
std::int64_t ElementAssembly::vertex_tasks() const { return (vertices() + kVerticesOfTask - 1) / kVerticesOfTask; }

void ElementAssembly::run_element_task(std::int64_t task) {
  const Kind& kind = *(std::upper_bound(kinds_.begin(), kinds_.end(), task,
                                        [](std::int64_t t, const Kind& k) { return t < k.first_task; }) -
                       1);
  const Index lanes = kind.layout.lanes();
  double* forces = buffer_[0].data() + kind.first_force;
  const auto begin = static_cast<Index>(task - kind.first_task) * kElementsOfTask;
  const Index end = std::min(begin + kElementsOfTask, kind.count());
  for (Index e = begin; e < end; e += lanes)
    forces_->run(kind, e, std::min(e + lanes, end), forces + kind.layout.force(e, 0), nullptr);
}

ElementAssembly::VertexRange ElementAssembly::run_vertex_task(std::int64_t task, double* f) {
  const Index first = static_cast<Index>(task) * kVerticesOfTask, last = std::min(first + kVerticesOfTask, vertices());
  for (const Kind& kind : kinds_)
    for (Index v = first; v < last; ++v)
      sum_forces(kind.forces, kind.layout, buffer_[0].data() + kind.first_force, v, f + 3 * std::int64_t{v});
  return {first, last};
}

std::int64_t ElementAssembly::end_forces(double* energy) {
  if (energy != nullptr)
    for (const double value : energies_) *energy += value;  // in order of the elements
  return label(forces_->first_bad);
}

namespace {

/// One lane of tangents side by side, of symmetric ones the half that is there, as ResultLayout says.
void separate(const ResultLayout& layout, bool symmetric, const double* side_by_side, int lane, double* to) {
  const int rows = layout.forces(), lanes = layout.lanes();
  const double* from = side_by_side + lane;
  for (int column = 0; column < rows; ++column, from += std::int64_t{rows} * lanes, to += rows)
    for (int row = 0, end = symmetric ? column / 3 * 3 + 3 : rows; row < end; ++row) to[row] = from[row * lanes];
}

/// Adds the blocks of pair p to the matrix.
void add_pair(const PairList& list, const ResultLayout& layout, const double* tangents, bool symmetric, std::int32_t p,
              const BlockTarget& target) {
  constexpr std::size_t kColumn = 3 * sizeof(double);
  const VertexPair& pair = list.pair[at(p)];
  double block[3][3], transposed[3][3];
  double* to[3] = {target.place(pair.column, pair.entry, 0), target.place(pair.column, pair.entry, 1),
                   target.place(pair.column, pair.entry, 2)};
  double* mirror[3] = {target.place(pair.row, pair.mirror, 0), target.place(pair.row, pair.mirror, 1),
                       target.place(pair.row, pair.mirror, 2)};
  for (int j = 0; j < 3; ++j) {
    std::memcpy(block[j], to[j], kColumn);
    std::memcpy(transposed[j], mirror[j], kColumn);
  }
  sum_blocks(list, layout, tangents, symmetric, p, block, transposed);
  for (int j = 0; j < 3; ++j) {
    std::memcpy(mirror[j], transposed[j], kColumn);
    std::memcpy(to[j], block[j], kColumn);
  }
}

}  // namespace

/// Tangents of elements begin .. end - 1 of a batch whose first element is `first`.
void ElementAssembly::evaluate_tangents(const Kind& kind, Evaluation& evaluation, Index first, Index begin, Index end,
                                        double* tangents) {
  constexpr int kDofs = kMaxElementDofs;
  const Index lanes = kind.layout.lanes();
  alignas(64) double force[kDofs * kMaxLanes], side_by_side[kDofs * kDofs * kMaxLanes];
  for (Index e = begin; e < end; e += lanes) {
    const Index last = std::min(e + lanes, end);
    evaluation.run(kind, first + e, first + last, force,
                   lanes == 1 ? tangents + kind.layout.block(e, 0, 0) : side_by_side);
    for (Index l = e; l < last && lanes > 1; ++l)
      separate(kind.layout, evaluation.state.symmetric(), side_by_side, static_cast<int>(l - e),
               tangents + kind.layout.block(l, 0, 0));
  }
}

/// One parallel loop a batch: it adds up the batch before and evaluates this one.
void ElementAssembly::add_tangent_of(const Kind& kind, base::ThreadPool* pool, Evaluation& evaluation,
                                     const BlockTarget& target) {
  constexpr std::int64_t kPairs = 256;
  const Index lanes = kind.layout.lanes(), grain = std::max<Index>(lanes, 16);  // elements of a task
  const bool symmetric = evaluation.state.symmetric();
  const std::size_t batches = kind.batches.size();
  for (std::size_t k = 0; k <= batches; ++k) {
    const PairList* done = k > 0 ? &kind.batches[k - 1] : nullptr;
    const PairList* next = k < batches ? &kind.batches[k] : nullptr;
    const std::int64_t pairs = done == nullptr ? 0 : static_cast<std::int64_t>(done->pair.size());
    const std::int64_t sums = (pairs + kPairs - 1) / kPairs;
    const Index elements = next == nullptr ? 0 : next->last - next->first;
    const std::vector<double>& ready = buffer_[(k + 1) % 2];
    std::vector<double>& made = buffer_[k % 2];
    const std::size_t needed = at(elements) * at(kind.layout.tangents());
    if (made.size() < needed) made.resize(needed);
    for_each_range(pool, sums + (elements + grain - 1) / grain, 1, [&](std::int64_t task, std::int64_t) {
      if (task < sums) {
        for (std::int64_t p = task * kPairs; p < std::min((task + 1) * kPairs, pairs); ++p)
          add_pair(*done, kind.layout, ready.data(), symmetric, static_cast<std::int32_t>(p), target);
        return;
      }
      const auto begin = static_cast<Index>(task - sums) * grain, end = std::min(begin + grain, elements);
      evaluate_tangents(kind, evaluation, next->first, begin, end, made.data());
    });
  }
}

std::int64_t ElementAssembly::add_tangent(base::ThreadPool* pool, const AssemblyState& state, double position_weight,
                                          double velocity_weight, const BlockTarget& target) {
  Evaluation evaluation{state, position_weight, velocity_weight, energies_.data(), failed_};
  for (const Kind& kind : kinds_) add_tangent_of(kind, pool, evaluation, target);
  return label(evaluation.first_bad);
}

}  // namespace espalier::dynamics
