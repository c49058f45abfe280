#include "dynamics/elements/assembly.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <mutex>
#include <stdexcept>

namespace espalier::dynamics {

Offset VertexPattern::entry(Index row, Index column) const {
  const auto begin = ind.begin() + ptr[static_cast<std::size_t>(column)];
  const auto end = ind.begin() + ptr[static_cast<std::size_t>(column) + 1];
  const auto found = std::lower_bound(begin, end, row);
  if (found == end || *found != row)
    throw std::logic_error(fmt::format("vertices {} and {} share no element", row, column));
  return found - ind.begin();
}

ElementAssembly::ElementAssembly(Index vertices, std::vector<std::unique_ptr<ElementGroup>> groups)
    : groups_(std::move(groups)) {
  for (const auto& group : groups_) elements_ += group->count();
  build_pattern(vertices);
  build_pairs();
  build_chunks();
  colour_chunks();
}

void ElementAssembly::build_pattern(Index vertices) {
  // Elements at every vertex, as (group, element) pairs in compressed form.
  struct Reference {
    std::int32_t group;
    Index element;
  };
  std::vector<Offset> start(static_cast<std::size_t>(vertices) + 1, 0);
  for (const auto& group : groups_)
    for (Index e = 0; e < group->count(); ++e)
      for (const Index v : group->vertices(e)) {
        if (v < 0 || v >= vertices)
          throw std::invalid_argument(
              fmt::format("element {} uses vertex {}, the body has {}", group->label(e), v, vertices));
        ++start[static_cast<std::size_t>(v) + 1];
      }
  for (std::size_t v = 0; v < static_cast<std::size_t>(vertices); ++v) start[v + 1] += start[v];
  std::vector<Reference> at(static_cast<std::size_t>(start.back()));
  std::vector<Offset> next(start.begin(), start.end() - 1);
  for (std::size_t g = 0; g < groups_.size(); ++g)
    for (Index e = 0; e < groups_[g]->count(); ++e)
      for (const Index v : groups_[g]->vertices(e))
        at[static_cast<std::size_t>(next[static_cast<std::size_t>(v)]++)] = {static_cast<std::int32_t>(g), e};
  pattern_.ptr.assign(1, 0);
  std::vector<Index> rows;
  for (std::size_t v = 0; v < static_cast<std::size_t>(vertices); ++v) {
    rows.assign(1, static_cast<Index>(v));
    for (Offset k = start[v]; k < start[v + 1]; ++k) {
      const Reference& r = at[static_cast<std::size_t>(k)];
      const auto list = groups_[static_cast<std::size_t>(r.group)]->vertices(r.element);
      rows.insert(rows.end(), list.begin(), list.end());
    }
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    pattern_.ind.insert(pattern_.ind.end(), rows.begin(), rows.end());
    pattern_.ptr.push_back(static_cast<Offset>(pattern_.ind.size()));
  }
}

void ElementAssembly::build_pairs() {
  for (const auto& group : groups_)
    for (Index e = 0; e < group->count(); ++e) {
      const auto list = group->vertices(e);
      for (const Index column : list)
        for (const Index row : list)
          pairs_.push_back(
              static_cast<std::int32_t>(pattern_.entry(row, column) - pattern_.ptr[static_cast<std::size_t>(column)]));
    }
}

void ElementAssembly::build_chunks() {
  // Large enough that neighbouring elements are reused from cache, small enough that a colour has many chunks.
  constexpr Index kSmallest = 1, kLargest = 32, kWantedChunks = 512;
  const Index wanted = std::clamp(elements_ / kWantedChunks, kSmallest, kLargest);
  Offset element = 0, pair = 0;
  for (std::size_t g = 0; g < groups_.size(); ++g) {
    const Offset pairs = static_cast<Offset>(groups_[g]->vertices_per_element()) * groups_[g]->vertices_per_element();
    const Index width = groups_[g]->width();
    const Index size = (wanted + width - 1) / width * width;  // full lanes, in small bodies too
    for (Index begin = 0; begin < groups_[g]->count(); begin += size) {
      const Index end = std::min(begin + size, groups_[g]->count());
      chunks_.push_back({static_cast<std::int32_t>(g), begin, end, element, pair});
      element += end - begin;
      pair += pairs * (end - begin);
    }
  }
}

void ElementAssembly::colour_chunks() {
  // First fit in order of the chunks; a vertex remembers its colours in a bit set of growing width.
  const std::size_t n = chunks_.size();
  std::vector<int> colour(n, 0);
  int colours = 0;
  std::vector<std::vector<std::uint64_t>> used(static_cast<std::size_t>(vertices()));
  for (std::size_t c = 0; c < n; ++c) {
    std::vector<std::uint64_t> taken(static_cast<std::size_t>(colours) / 64 + 1, 0);
    const auto visit = [&](const auto& body) {
      const ElementGroup& group = *groups_[static_cast<std::size_t>(chunks_[c].group)];
      for (Index e = chunks_[c].begin; e < chunks_[c].end; ++e)
        for (const Index v : group.vertices(e)) body(used[static_cast<std::size_t>(v)]);
    };
    visit([&](const std::vector<std::uint64_t>& bits) {
      for (std::size_t w = 0; w < bits.size(); ++w) taken[w] |= bits[w];
    });
    int pick = 0;
    while (taken[static_cast<std::size_t>(pick) / 64] >> (pick % 64) & 1) ++pick;
    colour[c] = pick;
    colours = std::max(colours, pick + 1);
    visit([&](std::vector<std::uint64_t>& bits) {
      bits.resize(std::max(bits.size(), static_cast<std::size_t>(pick) / 64 + 1), 0);
      bits[static_cast<std::size_t>(pick) / 64] |= std::uint64_t{1} << (pick % 64);
    });
  }
  colour_ptr_.assign(static_cast<std::size_t>(colours) + 1, 0);
  for (const int k : colour) ++colour_ptr_[static_cast<std::size_t>(k) + 1];
  for (std::size_t k = 0; k < static_cast<std::size_t>(colours); ++k) colour_ptr_[k + 1] += colour_ptr_[k];
  std::vector<Chunk> sorted(n);
  std::vector<Index> next(colour_ptr_.begin(), colour_ptr_.end() - 1);
  for (std::size_t c = 0; c < n; ++c)
    sorted[static_cast<std::size_t>(next[static_cast<std::size_t>(colour[c])]++)] = chunks_[c];
  chunks_ = std::move(sorted);
}

template <class Body>
void ElementAssembly::for_each_chunk(base::ThreadPool* pool, const Body& body) const {
  for (int k = 0; k < colours(); ++k) {
    const Index begin = colour_ptr_[static_cast<std::size_t>(k)], end = colour_ptr_[static_cast<std::size_t>(k) + 1];
    if (pool == nullptr || pool->size() == 1 || end - begin == 1) {
      for (Index c = begin; c < end; ++c) body(chunks_[static_cast<std::size_t>(c)]);
    } else {
      pool->for_each(end - begin, [&](std::int64_t c) { body(chunks_[static_cast<std::size_t>(begin + c)]); });
    }
  }
}

namespace {

/// The state of one element, or of several side by side, and what they give.
class Evaluation {
 public:
  Evaluation(const ElementGroup& group, const AssemblyState& state, bool tangent, double position_weight,
             double velocity_weight)
      : group_(group),
        state_(state),
        width_(group.width()),
        tangent_(tangent),
        position_weight_(position_weight),
        velocity_weight_(velocity_weight) {
    static_assert(kMaxBlockDofs * kMaxLanes >= kMaxElementDofs);
    static_assert(kMaxBlockDofs * kMaxBlockDofs * kMaxLanes >= kMaxElementDofs * kMaxElementDofs);
  }

  [[nodiscard]] Index width() const { return width_; }

  /// Evaluates the elements first .. last, at most width() of them; lanes left over repeat the last one.
  void run(Index first, Index last) {
    for (int lane = 0; lane < width_; ++lane) gather(std::min<Index>(first + lane, last), lane);
    const double* velocity = state_.velocity == nullptr ? nullptr : velocity_values_;
    double* tangent = tangent_ ? tangent_values_ : nullptr;
    if (width_ > 1) {
      whole_ =
          group_.evaluate_block({reference_, position_, velocity, state_.damping, position_weight_, velocity_weight_},
                                {force_, tangent, energy_});
      return;
    }
    ElementOutput out{force_, tangent, 0};
    whole_ = group_.evaluate(first,
                             {reference_, position_, velocity, state_.damping, position_weight_, velocity_weight_}, out)
                 ? 1
                 : 0;
    energy_[0] = out.energy;
  }

  [[nodiscard]] ElementResult result(Index lane) const {
    return {force_ + lane, tangent_ ? tangent_values_ + lane : nullptr, energy_[lane], width_,
            (whole_ >> lane & 1) != 0};
  }

 private:
  void gather(Index e, int lane) {
    std::size_t to = static_cast<std::size_t>(lane);
    for (const Index v : group_.vertices(e))
      for (std::size_t i = 0; i < 3; ++i, to += static_cast<std::size_t>(width_)) {
        const std::size_t from = 3 * static_cast<std::size_t>(v) + i;
        reference_[to] = state_.reference[from];
        position_[to] = state_.position[from];
        if (state_.velocity != nullptr) velocity_values_[to] = state_.velocity[from];
      }
  }

  static constexpr int kNumbers = kMaxBlockDofs * kMaxLanes;
  const ElementGroup& group_;
  const AssemblyState& state_;
  int width_;
  bool tangent_;
  double position_weight_, velocity_weight_;
  unsigned whole_ = 0;
  alignas(64) double reference_[kNumbers], position_[kNumbers], velocity_values_[kNumbers], force_[kNumbers];
  alignas(64) double tangent_values_[kNumbers * kMaxBlockDofs];
  double energy_[kMaxLanes];
};

}  // namespace

/// Evaluates every element, calls body(group, e, number, pairs, result) in the order of its chunk and reports the first
/// element (by number) that is not whole.
template <class Body>
std::int64_t ElementAssembly::evaluate_all(base::ThreadPool* pool, const AssemblyState& state, bool tangent,
                                           double position_weight, double velocity_weight, const Body& body) const {
  std::mutex mutex;
  Offset first_bad = std::numeric_limits<Offset>::max();
  std::int64_t label = -1;
  for_each_chunk(pool, [&](const Chunk& chunk) {
    const ElementGroup& group = *groups_[static_cast<std::size_t>(chunk.group)];
    const Offset n = group.vertices_per_element();
    Evaluation evaluation(group, state, tangent, position_weight, velocity_weight);
    for (Index begin = chunk.begin; begin < chunk.end; begin += evaluation.width()) {
      const Index end = std::min(begin + evaluation.width(), chunk.end);
      evaluation.run(begin, end - 1);
      for (Index e = begin; e < end; ++e) {
        const Offset in_chunk = e - chunk.begin, number = chunk.first_element + in_chunk;
        const ElementResult result = evaluation.result(e - begin);
        body(group, e, number, chunk.first_pair + in_chunk * n * n, result);
        if (result.whole) continue;
        const std::scoped_lock lock(mutex);
        if (number >= first_bad) continue;
        first_bad = number;
        label = group.label(e);
      }
    }
  });
  return label;
}

std::int64_t ElementAssembly::add_forces(base::ThreadPool* pool, const AssemblyState& state, double* f,
                                         double& energy) const {
  std::vector<double> energies(static_cast<std::size_t>(elements_));
  const auto add = [&](const ElementGroup& group, Index e, Offset number, Offset, const ElementResult& r) {
    constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
    const double* from = r.force;
    for (const Index v : group.vertices(e))
      for (std::size_t i = 0; i < 3; ++i, from += r.stride)
        f[3 * static_cast<std::size_t>(v) + i] += r.whole ? *from : kNan;
    energies[static_cast<std::size_t>(number)] = r.whole ? r.energy : kNan;
  };
  const std::int64_t bad = evaluate_all(pool, state, false, 1, 0, add);
  for (const double value : energies) energy += value;  // in order of the elements
  return bad;
}

std::int64_t ElementAssembly::add_tangent(base::ThreadPool* pool, const AssemblyState& state, double position_weight,
                                          double velocity_weight, const BlockTarget& target) const {
  const auto add = [&](const ElementGroup& group, Index e, Offset, Offset pairs, const ElementResult& r) {
    const auto list = group.vertices(e);
    const std::size_t n = list.size(), stride = static_cast<std::size_t>(r.stride);
    const double invalid = r.whole ? 0 : std::numeric_limits<double>::quiet_NaN();
    const std::int32_t* pair = pairs_.data() + pairs;
    for (std::size_t b = 0; b < n; ++b) {
      const std::size_t column = static_cast<std::size_t>(list[b]);
      for (std::size_t a = 0; a < n; ++a) {
        const std::size_t entry = static_cast<std::size_t>(pattern_.ptr[column]) + static_cast<std::size_t>(*pair++);
        for (std::size_t j = 0; j < 3; ++j) {
          double* to = target.values + target.column_start[3 * column + j] + target.shift[3 * entry + j];
          const double* from = r.tangent + ((3 * b + j) * 3 * n + 3 * a) * stride;
          to[0] += from[0] + invalid;
          to[1] += from[stride] + invalid;
          to[2] += from[2 * stride] + invalid;
        }
      }
    }
  };
  return evaluate_all(pool, state, true, position_weight, velocity_weight, add);
}

std::vector<double> ElementAssembly::mass(const double* reference) const {
  std::vector<double> values(pattern_.ind.size(), 0.0);
  for_each_chunk(nullptr, [&](const Chunk& chunk) {
    const ElementGroup& group = *groups_[static_cast<std::size_t>(chunk.group)];
    const std::int32_t* pair = pairs_.data() + chunk.first_pair;
    for (Index e = chunk.begin; e < chunk.end; ++e) {
      double x[kMaxElementDofs], m[kMaxVertices * kMaxVertices];
      const auto list = group.vertices(e);
      for (std::size_t k = 0; k < 3 * list.size(); ++k)
        x[k] = reference[3 * static_cast<std::size_t>(list[k / 3]) + k % 3];
      group.mass(e, x, m);
      for (std::size_t k = 0; k < list.size() * list.size(); ++k)
        values[static_cast<std::size_t>(pattern_.ptr[static_cast<std::size_t>(list[k / list.size()])] + *pair++)] +=
            m[k];
    }
  });
  return values;
}

}  // namespace espalier::dynamics
