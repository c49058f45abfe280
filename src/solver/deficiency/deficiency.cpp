#include "solver/deficiency/deficiency.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "solver/deficiency/dense.hpp"
#include "solver/deficiency/description.hpp"
#include "solver/deficiency/null_space_iteration.hpp"

namespace espalier::solver {

namespace {

// For directions in the real space, how many they are of the caller's numbers.
Index whole(Index directions, Index parts) { return (directions + parts - 1) / parts; }

// The smallest directions of B, more of them while zeros may be among those that are missing.
Directions smallest_directions(const NullSpaceIteration& search) {
  const DeficiencyJob& job = search.job();
  const Index n = search.matrix().n(), suspects = search.matrix().parts() * job.suspects;
  constexpr double kMostWork = 1 << 24;  // of n * columns^2, for each of many steps
  const auto affordable = static_cast<Index>(std::sqrt(kMostWork / n));
  const Index most = std::min(n, std::clamp(affordable, kFirstColumns, kMostZerosSought));
  const Index for_all = std::min(most, std::max(kFirstColumns, (suspects + 2 + 7) / 8 * 8));
  // Small pivots may be many where none is a zero.
  Index columns = job.replaced ? for_all : std::min(most, kFirstColumns);
  Directions d = search.find(columns, false);
  while (d.found && columns < most && d.below(search.zero()) > 0 &&
         (columns < for_all || d.below(search.zero()) == columns)) {
    columns = columns < for_all ? for_all : std::min(most, 4 * columns);
    d = search.find(columns, false);
  }
  return d;
}

// Nothing can be said of a factor whose solutions overflow; zeros that it met are zeros.
Deficiency of_overflow(const DeficiencyJob& job) {
  Deficiency found;
  found.smallest = 0;
  found.complete = false;
  found.doubtful = true;
  found.worst = std::numeric_limits<double>::infinity();
  found.zeros = job.replaced ? job.suspects : 0;
  return found;
}

// Negative eigenvalues among the suspects that are no zeros.
Index negative_suspects(const DeficiencyJob& job, const Directions& d, Index zeros, Index parts) {
  const std::vector<double> ritz = ritz_values(job.pool, d.q, d.y);
  const Index end = std::min(d.q.columns, parts * job.suspects);
  Index negative = 0;
  for (Index k = parts * zeros; k < end; ++k) negative += ritz[at(k)] < 0 ? 1 : 0;
  return whole(negative, parts);
}

// The smallest directions of op(B) on the left, and what they say of the zeros found on the right.
Directions other_side(const NullSpaceIteration& search, Directions& d, Deficiency& found) {
  const Index parts = search.matrix().parts();
  Directions other = search.find(d.q.columns, true);
  if (other.found)
    search.agree(d, other);
  else
    found.doubtful = true;
  // One side proves what the factor's errors blur on the other.
  found.zeros = std::max(found.zeros, whole(std::max(d.below(search.zero()), other.below(search.zero())), parts));
  // Singular values are those of both sides; where estimates of the first that is none of zero differ, another zero
  // may hide between them.
  constexpr double kAlike = 1.5;
  const auto next = at(parts * found.zeros);
  const bool alike = !other.found || next >= d.values.size() ||
                     (d.values[next] < kAlike * other.values[next] && other.values[next] < kAlike * d.values[next]);
  found.doubtful = found.doubtful || !other.solved || !alike;
  return other;
}

}  // namespace

Deficiency find_deficiency(const DeficiencyJob& job) {
  Deficiency found;
  NullSpaceIteration search(job);
  if (!job.replaced && search.surely_regular()) return found;
  if (!job.replaced && job.surely_alone) {
    found.smallest = 0;
    return found;
  }
  search.prepare();
  const Index parts = search.matrix().parts();
  const bool two_sided = search.matrix().two_sided();
  Directions d = smallest_directions(search);
  if (!d.found) return of_overflow(job);
  found.doubtful = !d.solved;
  found.zeros = std::max(job.proven, whole(d.below(search.zero()), parts));
  found.smallest = d.values.front() / search.matrix().norm();
  if (job.kind == Kind::ldlt && !two_sided) found.negative = negative_suspects(job, d, found.zeros, parts);
  if (found.zeros == 0) return found;
  Directions other;
  if (two_sided) other = other_side(search, d, found);
  const Index columns = d.q.columns, taken = std::min(columns, parts * found.zeros);
  const auto last = at(taken - 1);
  constexpr double kBlurred = 16;
  found.worst = std::max(d.values[last], other.found ? other.values[last] : 0) / search.matrix().norm();
  found.doubtful = found.doubtful || found.worst > kBlurred * zero_singular_value(job.kind, job.prepared.n());
  const Block null = first_columns(d.q, taken);
  if (job.replaced && found.zeros < job.suspects && taken < columns && (!two_sided || other.found))
    found.doubtful = found.doubtful || search.hides_more(null, two_sided ? first_columns(other.q, taken) : null);
  const bool with_left = job.kind == Kind::lu && other.found;
  found.complete = with_left || job.kind != Kind::lu;  // else nothing tells the rows
  describe(search.matrix(), null, with_left ? first_columns(other.q, taken) : Block(0, 0), found);
  if (taken == columns && columns < search.matrix().n()) {
    found.complete = false;
    found.zeros = std::max(found.zeros, job.suspects);
    found.doubtful = true;  // nobody has counted them
  }
  return found;
}

bool surely_regular(const DeficiencyJob& job) { return NullSpaceIteration(job).surely_regular(); }

std::optional<Deficiency> zeros_of_pivots(const DeficiencyJob& job, Index zeros) {
  const Index parts = base::parts_of(job.prepared.numbers);
  if (zeros % parts != 0) return {};
  NullSpaceIteration search(job);
  if (!search.surely_regular()) return {};
  search.prepare();
  const double work = static_cast<double>(search.matrix().n()) * zeros * zeros;
  const bool all = zeros <= parts * kFirstColumns || work <= job.vector_work;
  constexpr Index kProof = 2;  // of one, a part that is none of a null vector might be small by chance
  const Index columns = all ? zeros : kProof;
  Block null = search.null_columns(columns, false, all);
  if (null.columns == 0) return {};
  if (!agrees_with_dense(search, zeros)) return {};
  Deficiency found;
  found.zeros = zeros / parts;
  found.smallest = 0;
  found.by_pivots = true;
  if (!all) return found;
  Block left(search.matrix().n(), 0);
  if (job.kind == Kind::lu) left = search.null_columns(columns, true, true);
  if (job.kind == Kind::lu && left.columns == 0) return {};
  describe_all(search, work, std::move(null), std::move(left), found);
  return found;
}

}  // namespace espalier::solver
