#include "solver/deficiency/null_space_iteration.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "base/mix.hpp"

namespace espalier::solver {

namespace {

constexpr int kInverseSteps = 3;

}  // namespace

double random_number(std::uint64_t k) {
  k = base::mix(k + 0x9e3779b97f4a7c15U);
  const double magnitude = 0.5 + static_cast<double>(k >> 12) * 0x1p-53;
  return (k & 1) != 0 ? magnitude : -magnitude;
}

Index Directions::below(double bound) const {
  return static_cast<Index>(std::upper_bound(values.begin(), values.end(), bound) - values.begin());
}

Block first_columns(const Block& q, Index columns) {
  Block part(q.rows, columns);
  std::copy_n(q.values.begin(), part.values.size(), part.values.begin());
  return part;
}

bool NullSpaceIteration::surely_regular() const {
  return surely_above((job_.rough ? kLeastForFp32 : share_) * b_.norm());
}

// Whether all singular values are surely above a bound. A random vector of unit length has a part of at least
// 1 / (kUnlucky sqrt(n)) in the direction of the smallest one, s, but for a few of a thousand; k solutions in turn
// let that part alone grow by s^-k. That is said of the factor. Where s is not far above the bound (a long plate has
// 2.5 bounds), it may be the error of a factor whose matrix is singular (seen at 3 bounds in lu), and the matrix has
// to bear it out.
bool NullSpaceIteration::surely_above(double bound) const {
  constexpr double kUnlucky = 256;
  constexpr int kMostSolutions = 16;
  constexpr double kFar = 1.0 / 256;
  Block x = start(1);
  double most = kUnlucky * std::sqrt(static_cast<double>(b_.n()));  // ... times what growth was, over s^-k
  double length = norm_two(job_.pool, x.column(0), b_.n());
  for (int k = 1; k <= kMostSolutions; ++k) {
    const bool transpose = b_.two_sided() && k % 2 == 0;
    divide(job_.pool, x.column(0), length, b_.n());
    x = b_.inverse(std::move(x), transpose);
    length = norm_two(job_.pool, x.column(0), b_.n());
    const double growth = length * bound;
    most *= growth;
    if (most < 1) return growth <= kFar || returns(std::move(x), transpose);
    if (!(most * std::pow(growth, kMostSolutions - k) < 1)) return false;  // it never gets less
  }
  return false;
}

// Whether op(B)^-1 op(B) x is about x: what the factor makes of a direction that the matrix takes to nothing is its
// own error, and does not lead back.
bool NullSpaceIteration::returns(Block x, bool transpose) const {
  constexpr double kAbout = 0.125;
  normalize(job_.pool, x);
  Block again = b_.inverse(b_.product(x, transpose), transpose);
  for (std::size_t k = 0; k < x.values.size(); ++k) again.values[k] -= x.values[k];
  return norm_two(job_.pool, again.column(0), b_.n()) <= kAbout * norm_two(job_.pool, x.column(0), b_.n());
}

void NullSpaceIteration::prepare() {
  b_.make_even();
  zero_ = share_ * b_.norm();
}

// What may be a null direction that the factor's errors have blurred.
double NullSpaceIteration::near() const { return b_.norm() * (job_.rough ? 1e-3 : 1e-8); }

Block NullSpaceIteration::start(Index columns) const {
  Block x(b_.n(), columns);
  for (std::size_t k = 0; k < x.values.size(); ++k) x.values[k] = random_number(k);
  return x;
}

bool NullSpaceIteration::iterate(Block& x, bool transpose) const {
  x = b_.inverse(std::move(x), transpose);
  return make_orthonormal(x);
}

bool NullSpaceIteration::make_orthonormal(Block& x) const {
  if (!normalize(job_.pool, x)) return false;
  orthonormalize(job_.pool, x);
  return true;
}

Directions NullSpaceIteration::find(Index columns, bool transpose) const {
  Directions d{start(columns), Block(0, 0), {}};
  for (int step = 0; step < kInverseSteps; ++step) {
    if (b_.two_sided() && !iterate(d.q, !transpose)) return d;
    const Block before = step + 1 == kInverseSteps ? d.q : Block(0, 0);
    d.q = b_.inverse(std::move(d.q), transpose);
    if (before.columns > 0) d.solved = solves(d.q, before, transpose);
    if (!make_orthonormal(d.q)) return d;
  }
  d.found = true;
  improve(d, transpose);
  return d;
}

// Whether op(B) x is about y. Two vanishing pivots, one after the other, make inverses of tiles with numbers of 1e30,
// whose rounding errors drown a solution of 1e15.
bool NullSpaceIteration::solves(const Block& x, const Block& y, bool transpose) const {
  const double about = (job_.rough ? 1e-2 : 1e-9) * b_.norm();
  Block r = b_.product(x, transpose);
  for (Index c = 0; c < x.columns; ++c) {
    double* of = r.column(c);
    const double* from = y.column(c);
    for (Index i = 0; i < x.rows; ++i) of[i] -= from[i];
    if (!(norm_two(job_.pool, of, x.rows) <= about * norm_two(job_.pool, x.column(c), x.rows))) return false;
  }
  return true;
}

void NullSpaceIteration::inspect(Directions& d, bool transpose) const {
  d.y = b_.product(d.q, transpose);
  d.values = rotate_apart(job_.pool, d.y, d.q);
}

// Directions that may be null ones are corrected.
void NullSpaceIteration::improve(Directions& d, bool transpose) const {
  inspect(d, transpose);
  const Index candidates = d.below(near());
  if (candidates == 0) return;
  correct(d, b_.two_sided() ? left_of(d.q.columns, candidates, transpose) : first_columns(d.q, candidates), transpose);
}

// The `keep` smallest directions on the other side, of a block of so many columns.
Block NullSpaceIteration::left_of(Index columns, Index keep, bool transpose) const {
  Directions left{start(columns), Block(0, 0), {}};
  for (int step = 0; step < kInverseSteps; ++step)
    if (!iterate(left.q, transpose) || !iterate(left.q, !transpose)) return {b_.n(), 0};
  inspect(left, !transpose);
  return first_columns(left.q, keep);
}

// Newton's steps for null directions, q -= (1 - Q Q^T) B^-1 (1 - U U^T) B q, as long as they help: the error of the
// factor, which inverse iteration leaves in q, shrinks in each of them by itself over the next singular value. U, as
// many null directions on the other side, keeps the inverse from making much of what belongs to the zeros; further
// ones would keep it from what it is to correct.
void NullSpaceIteration::correct(Directions& d, const Block& other, bool transpose) const {
  const int most = job_.rough ? 20 : 6;
  const Index candidates = other.columns;
  for (int step = 0; step < most; ++step) {
    Directions next = d;
    Block part = first_columns(d.y, candidates);
    project_out(job_.pool, other, part);
    part = b_.inverse(std::move(part), transpose);
    project_out(job_.pool, d.q, part);
    for (std::size_t k = 0; k < part.values.size(); ++k) next.q.values[k] -= part.values[k];
    orthonormalize(job_.pool, next.q);
    inspect(next, transpose);
    const auto logarithms = [&](const Directions& of) {
      return std::accumulate(of.values.begin(), of.values.begin() + candidates, 0.0,
                             [&](double sum, double v) { return sum + std::log(std::max(v, zero_ / 64)); });
    };
    if (!(logarithms(next) < logarithms(d) - 0.1)) return;
    d = std::move(next);
  }
}

void NullSpaceIteration::agree(Directions& right, Directions& left) const {
  constexpr int kTurns = 2;
  for (int turn = 0; turn < kTurns; ++turn) {
    const Index candidates = std::max(right.below(near()), left.below(near()));
    if (std::min(right.below(zero_), left.below(zero_)) == candidates) return;
    correct(left, first_columns(right.q, candidates), true);
    correct(right, first_columns(left.q, candidates), false);
  }
}

bool NullSpaceIteration::hides_more(const Block& right, const Block& left) const {
  Block x = start(std::min(kFirstColumns, b_.n() - right.columns));
  if (x.columns <= 0) return false;
  const auto go = [&](const Block& before, const Block& after, bool transpose) {
    project_out(job_.pool, before, x);
    x = b_.inverse(std::move(x), transpose);
    if (!normalize(job_.pool, x)) return false;
    project_out(job_.pool, after, x);
    return make_orthonormal(x);
  };
  for (int step = 0; step < kInverseSteps; ++step) {
    if (b_.two_sided() && !go(right, left, true)) return true;
    if (!go(left, right, false)) return true;
  }
  Directions d{std::move(x), Block(0, 0), {}};
  inspect(d, false);
  return !(d.values.front() > near());
}

// Whether each column of y is at most so long beside that of x.
bool NullSpaceIteration::below(const Block& y, const Block& x, double ratio) const {
  for (Index c = 0; c < x.columns; ++c)
    if (!(norm_two(job_.pool, y.column(c), x.rows) <= ratio * norm_two(job_.pool, x.column(c), x.rows))) return false;
  return true;
}

bool NullSpaceIteration::vanish(const Block& y, const Block& x) const {
  const auto largest = [&](const double* v) {
    double most = 0;
    for (Index i = 0; i < x.rows; ++i)
      if (!(std::abs(v[i]) <= most)) most = std::abs(v[i]);  // NaN stays
    return most;
  };
  if (!below(y, x, zero_)) return false;
  for (Index c = 0; c < x.columns; ++c)
    if (!(largest(y.column(c)) <= zero_ * largest(x.column(c)))) return false;
  return true;
}

Block NullSpaceIteration::null_columns(Index columns, bool transpose, bool polished) const {
  constexpr int kMostSteps = 4;
  Block x = start(columns);
  bool vanished = false;
  for (int step = 0; step < kMostSteps; ++step) {
    Block y = b_.product(x, transpose);
    // Further steps would take away what is none of the null space as well as what rounding has left.
    if (step == 1 && !below(y, x, near())) break;
    if (step > 0 && vanish(y, x)) {
      if (vanished || !polished) return x;
      vanished = true;
    }
    y = b_.inverse(std::move(y), transpose);
    for (std::size_t k = 0; k < y.values.size(); ++k) x.values[k] -= y.values[k];
  }
  return {b_.n(), 0};
}

void NullSpaceIteration::clean(Block& x, bool transpose) const {
  const Block y = b_.inverse(b_.product(x, transpose), transpose);
  for (std::size_t k = 0; k < y.values.size(); ++k) x.values[k] -= y.values[k];
}

}  // namespace espalier::solver
