#include "dynamics/dae/constraint_response.hpp"

#include <algorithm>
#include <new>
#include <utility>

#include "dynamics/dae/at.hpp"
#include "dynamics/dae/products.hpp"
#include "dynamics/dae/vectors.hpp"

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

void ConstraintResponse::apply(Span x, base::ThreadPool* pool) const {
  r_.resize(kept_.size());
  for (std::size_t c = 0; c < kept_.size(); ++c) r_[c] = x[at(n_) + at(kept_[c])];
  fill_zero(pool, x);
  add_columns(columns_.data(), r_, x, pool);
}

}  // namespace espalier::dynamics
