// Masses of the elements of a body.
#include <algorithm>
#include <numeric>

#include "base/at.hpp"
#include "base/parallel.hpp"
#include "dynamics/elements/assembly.hpp"

namespace espalier::dynamics {

using base::for_each_range;

ElementAssembly::ElementMass ElementAssembly::element_mass(Index element, const double* reference) const {
  const Kind& kind = *(std::upper_bound(kinds_.begin(), kinds_.end(), std::int64_t{element},
                                        [](std::int64_t e, const Kind& k) { return e < k.first_element; }) -
                       1);
  const auto local = static_cast<Index>(element - kind.first_element);
  const std::size_t n = at(kind.layout.vertices());
  ElementMass out{std::span(kind.vertex).subspan(at(local) * n, n), std::vector<double>(n * n), std::vector<double>(n)};
  double x[kMaxElementDofs];
  for (std::size_t k = 0; k < 3 * n; ++k) x[k] = reference[3 * at(out.vertices[k / 3]) + k % 3];
  kind.group->mass(local, x, out.consistent.data());
  for (std::size_t a = 0; a < n; ++a) out.lumped[a] = out.consistent[a * n + a];
  const double whole = std::accumulate(out.consistent.begin(), out.consistent.end(), 0.0);
  const double diagonal = std::accumulate(out.lumped.begin(), out.lumped.end(), 0.0);
  for (double& m : out.lumped) m *= whole / diagonal;
  return out;
}

std::vector<double> ElementAssembly::mass(const double* reference, base::ThreadPool* pool) const {
  std::vector<double> values(pattern_.ind.size(), 0.0), results;
  for (const Kind& kind : kinds_) {
    const int n = kind.layout.vertices();
    const std::size_t size = at(n) * at(n);
    for (const PairList& batch : kind.batches) {
      results.resize(at(batch.last - batch.first) * size);
      for_each_range(pool, batch.last - batch.first, 32, [&](std::int64_t begin, std::int64_t end) {
        for (std::int64_t e = begin; e < end; ++e) {
          double x[kMaxElementDofs];
          const Index* vertex = kind.vertex.data() + at(batch.first + e) * at(n);
          for (int k = 0; k < 3 * n; ++k) x[k] = reference[3 * vertex[k / 3] + k % 3];
          kind.group->mass(batch.first + static_cast<Index>(e), x, &results[at(e) * size]);
        }
      });
      for_each_range(pool, static_cast<std::int64_t>(batch.pair.size()), 2048,
                     [&](std::int64_t begin, std::int64_t end) {
                       for (auto p = at(begin); p < at(end); ++p) {
                         double sum = values[at(batch.pair[p].entry)];
                         for (std::int32_t k = batch.ptr[p]; k < batch.ptr[p + 1]; ++k) {
                           const BlockSource s(batch.from[at(k)]);
                           sum += results[at(s.element) * size + at(s.b) * at(n) + at(s.a)];
                         }
                         values[at(batch.pair[p].entry)] = values[at(batch.pair[p].mirror)] = sum;
                       }
                     });
    }
  }
  for (std::size_t e = 0; e < failed_.size(); ++e) {
    if (failed_[e] == 0) continue;
    const ElementMass own = element_mass(static_cast<Index>(e), reference);
    for (std::size_t a = 0; a < own.lumped.size(); ++a)
      values[at(pattern_.entry(own.vertices[a], own.vertices[a]))] += own.lumped[a];
  }
  return values;
}

}  // namespace espalier::dynamics
