#include "dynamics/dae/constraint_response.hpp"

#include <algorithm>
#include <new>
#include <utility>

#include "base/parallel.hpp"
#include "dynamics/dae/at.hpp"

namespace espalier::dynamics {

namespace {

// So many right-hand sides at a time take as long as one alone (engine of 6,200 unknowns, 18 of them, one core; a GPU
// gains more).
constexpr Index kColumnsPerSolve = 5;
// A product must read this much less than a solve: its columns are read once, but come from memory that nobody else
// uses.
constexpr Offset kCheaper = 2;

}  // namespace

void ConstraintResponse::start(Index n, Index m, const std::vector<char>& dropped, Offset entries) {
  n_ = n;
  m_ = m;
  entries_ = entries;
  before_ = std::exchange(solved_, 0);
  made_ = false;
  kept_.clear();
  for (Index i = 0; i < m; ++i)
    if (dropped[at(i)] == 0) kept_.push_back(i);
}

bool ConstraintResponse::ready(Index columns, const std::function<void(Span, Index)>& solve) {
  const auto width = static_cast<Index>(kept_.size());
  const bool enough = before_ * kColumnsPerSolve >= width + width / 4 || solved_ * kColumnsPerSolve >= 2 * width;
  solved_ += columns;
  if (made_) return true;
  if (!enough || kCheaper * width * (Offset{n_} + m_) > entries_) return false;
  try {
    make(solve);
  } catch (const std::bad_alloc&) {
    entries_ = 0;
    columns_ = {};
  }
  return made_;
}

void ConstraintResponse::make(const std::function<void(Span, Index)>& solve) {
  const std::size_t size = at(Offset{n_} + m_);
  columns_.assign(size * kept_.size(), 0.0);
  for (std::size_t c = 0; c < kept_.size(); ++c) columns_[c * size + at(n_) + at(kept_[c])] = 1;
  solve(columns_, static_cast<Index>(kept_.size()));
  made_ = true;
}

void ConstraintResponse::take(std::vector<double> columns) {
  columns_ = std::move(columns);
  made_ = true;
}

std::vector<double> ConstraintResponse::give() {
  if (!std::exchange(made_, false)) return {};
  return std::move(columns_);
}

// By rows that stay in cache while the columns pass by: sums do not depend on the threads.
void ConstraintResponse::apply(Span x, base::ThreadPool* pool) const {
  constexpr std::int64_t kRows = 1024;
  const std::size_t size = x.size();
  r_.resize(kept_.size());
  for (std::size_t c = 0; c < kept_.size(); ++c) r_[c] = x[at(n_) + at(kept_[c])];
  const auto rows = [&](std::int64_t begin, std::int64_t end) {
    std::fill(x.begin() + begin, x.begin() + end, 0.0);
    for (std::size_t c = 0; c < kept_.size(); ++c) {
      const double r = r_[c];
      const double* column = columns_.data() + c * size;
      for (std::int64_t i = begin; i < end; ++i) x[at(i)] += r * column[i];
    }
  };
  base::for_each_range(pool, static_cast<std::int64_t>(size), kRows, rows);
}

}  // namespace espalier::dynamics
