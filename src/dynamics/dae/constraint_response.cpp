#include "dynamics/dae/constraint_response.hpp"

#include <algorithm>
#include <new>
#include <utility>

#include "base/at.hpp"
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

void ConstraintResponse::start(Index n, Index m, const std::vector<char>& dropped, Offset entries,
                               DeviceVectors* device) {
  n_ = n;
  m_ = m;
  entries_ = entries;
  device_ = device;
  before_ = std::exchange(solved_, 0);
  made_ = on_device_ = false;
  kept_.clear();
  for (Index i = 0; i < m; ++i)
    if (dropped[at(i)] == 0) kept_.push_back(i);
}

void ConstraintResponse::leave_device() {
  if (std::exchange(on_device_, false)) made_ = false;
  device_ = nullptr;
}

bool ConstraintResponse::ready(Index columns, const Solve& solve, const DeviceVectors::Solve& solve_on_device,
                               base::ThreadPool* pool) {
  const auto width = static_cast<Index>(kept_.size());
  const bool enough = before_ * kColumnsPerSolve >= width + width / 4 || solved_ * kColumnsPerSolve >= 2 * width;
  solved_ += columns;
  if (made_) return true;
  if (!enough || kCheaper * width * (Offset{n_} + m_) > entries_) return false;
  try {
    make(solve, solve_on_device, pool);
  } catch (const std::bad_alloc&) {
    entries_ = 0;
    columns_ = {};
  } catch (const Error& error) {
    const StatusCode code = error.status().code;
    if (device_ == nullptr || (code != StatusCode::out_of_memory && code != StatusCode::device_error)) throw;
    entries_ = 0;
  }
  return made_;
}

void ConstraintResponse::make(const Solve& solve, const DeviceVectors::Solve& solve_on_device, base::ThreadPool* pool) {
  if (device_ != nullptr) {
    std::vector<Index> rows(kept_);
    for (Index& row : rows) row += n_;
    device_->make_columns(rows, solve_on_device);
    made_ = on_device_ = true;
    return;
  }
  const std::size_t size = at(Offset{n_} + m_);
  columns_.resize(size * kept_.size());
  fill_zero(pool, columns_);
  for (std::size_t c = 0; c < kept_.size(); ++c) columns_[c * size + at(n_) + at(kept_[c])] = 1;
  solve(columns_, static_cast<Index>(kept_.size()));
  made_ = true;
}

void ConstraintResponse::take(Columns columns) {
  columns_ = std::move(columns);
  made_ = true;
  on_device_ = false;
}

ConstraintResponse::Columns ConstraintResponse::give() {
  if (!std::exchange(made_, false)) return {};
  if (!std::exchange(on_device_, false)) return std::move(columns_);
  Columns columns(at(Offset{n_} + m_) * kept_.size());
  device_->fetch_columns(columns);
  return columns;
}

void ConstraintResponse::apply(Span x, base::ThreadPool* pool) const {
  r_.resize(kept_.size());
  for (std::size_t c = 0; c < kept_.size(); ++c) r_[c] = x[at(n_) + at(kept_[c])];
  if (on_device_) return device_->combine_columns(r_, x);
  fill_zero(pool, x);
  add_columns(columns_.data(), r_, x, pool);
}

void ConstraintResponse::apply_there(ConstSpan r, double* x) const {
  r_.resize(kept_.size());
  for (std::size_t c = 0; c < kept_.size(); ++c) r_[c] = r[at(kept_[c])];
  device_->combine_columns_there(r_, x);
}

}  // namespace espalier::dynamics
