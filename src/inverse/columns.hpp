/// \file
/// Columns of an inverse by solves.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <span>
#include <type_traits>
#include <vector>

#include "base/lazy_vector.hpp"
#include "solver/session/session.hpp"

namespace espalier::inverse {

/// Refined until rounding is left; the corrections tell how far they are from the truth. All threads share what is done
/// beside solves and residuals, and the page faults of the vectors.
template <class Value>
class Columns {
 public:
  /// @param rows  of A, one for each column of A^-1
  Columns(solver::Session& session, std::span<const Index> rows)
      : session_(&session), n_(static_cast<std::size_t>(session.current().n())), count_(rows.size()) {
    x_.resize(n_ * count_);
    largest_.assign(count_, 0);
    error_.assign(count_, kUnknown);
    if (!on_device(rows)) on_host(rows);
  }
  [[nodiscard]] Value at(std::size_t column, Index unknown) const {
    return x_[column * n_ + static_cast<std::size_t>(unknown)];
  }
  [[nodiscard]] double largest(std::size_t column) const { return largest_[column]; }
  /// What is left, over the largest entry.
  [[nodiscard]] double error(std::size_t column) const { return error_[column]; }

 private:
  using Vectors = base::LazyVector<Value>;
  static constexpr double kUnknown = std::numeric_limits<double>::infinity();
  static constexpr std::int64_t kGrain = 1 << 14;  // rows that a thread takes at a time

  static constexpr int kMostSteps = 12;  // as many as a factor in FP32 of a hard matrix takes

  void on_host(std::span<const Index> rows) {
    Vectors b(n_ * count_), r(n_ * count_), d(n_ * count_);
    over_columns([&](std::size_t c, std::size_t begin, std::size_t end) {
      std::fill(b.begin() + place(c, begin), b.begin() + place(c, end), Value(0));
    });
    for (std::size_t c = 0; c < count_; ++c) b[c * n_ + static_cast<std::size_t>(rows[c])] = 1;
    solve(b, x_);
    std::vector<double> before(count_, kUnknown);
    for (int step = 0; step < kMostSteps; ++step) {
      std::vector<solve::ResidualColumn> list;
      for (std::size_t c = 0; c < count_; ++c) list.push_back({parts(b, c), parts(x_, c), parts(r, c), {}});
      session_->factor->residual().compute(list, false);
      solve(r, d);
      const std::vector<double> corrections = largest_of(d);
      over_columns([&](std::size_t c, std::size_t begin, std::size_t end) {
        if (!(corrections[c] < before[c])) return;
        for (std::size_t i = c * n_ + begin; i < c * n_ + end; ++i) x_[i] += d[i];
      });
      largest_ = largest_of(x_);
      if (!note(corrections, before)) break;
    }
  }

  // Where a device has the factor and the matrix; vectors stay there until they are refined.
  // @returns false where none does, or it lacks memory for them
  bool on_device(std::span<const Index> rows) {
    if constexpr (!std::is_same_v<Value, double>) {
      return false;
    } else {
      device::DeviceLinearSystem* const device = session_->factor->numeric().device_system();
      if (device == nullptr || session_->factor->substitutes()) return false;
      const auto columns = static_cast<Index>(count_);
      std::shared_ptr<double[]> memory;
      try {
        memory = device->memory(4 * columns);
      } catch (const Error& e) {
        if (e.status().code != StatusCode::out_of_memory) throw;
        return false;
      }
      const device::Settled settled(*device);
      double *const b = memory.get(), *const x = b + n_ * count_, *const r = x + n_ * count_,
                    *const d = r + n_ * count_;
      const std::vector<double> ones(count_, 1.0);
      std::vector<Offset> places;
      for (std::size_t c = 0; c < count_; ++c) places.push_back(place(c, static_cast<std::size_t>(rows[c])));
      device->scatter(places, ones, b, columns);
      device->substitute(b, x, columns, false);
      const auto largest_there = [&](const double* v) {
        std::vector<const double*> list;
        std::vector<double> found(count_);
        for (std::size_t c = 0; c < count_; ++c) list.push_back(v + c * n_);
        device->largest(list, found);
        for (double& most : found) most = std::isnan(most) ? kUnknown : most;
        return found;
      };
      std::vector<double> before(count_, kUnknown);
      for (int step = 0; step < kMostSteps; ++step) {
        session_->pool.check();
        std::vector<solve::ResidualColumn> list;
        for (std::size_t c = 0; c < count_; ++c) list.push_back({b + c * n_, x + c * n_, r + c * n_, {}});
        device->compute(list, false);
        device->substitute(r, d, columns, false);
        const std::vector<double> corrections = largest_there(d);
        for (std::size_t c = 0; c < count_; ++c)
          if (corrections[c] < before[c]) device->combine(1, d + c * n_, 1, x + c * n_);
        largest_ = largest_there(x);
        if (!note(corrections, before)) break;
      }
      device->fetch(x_.data(), x, static_cast<Offset>(n_ * count_));
      device->finish();
      return true;
    }
  }

  [[nodiscard]] std::ptrdiff_t place(std::size_t column, std::size_t row) const {
    return static_cast<std::ptrdiff_t>(column * n_ + row);
  }
  double* parts(Vectors& v, std::size_t c) const { return reinterpret_cast<double*>(v.data() + c * n_); }
  void solve(Vectors& from, Vectors& to) const {
    session_->pool.check();
    session_->factor->solve(parts(from, 0), parts(to, 0), static_cast<Index>(count_), false);
  }

  // use(column, begin, end) for ranges of rows.
  template <class Use>
  void over_columns(Use&& use) const {
    const auto rows = static_cast<std::int64_t>(n_);
    const std::int64_t ranges = (rows + kGrain - 1) / kGrain;
    session_->pool.for_each_range(ranges * static_cast<std::int64_t>(count_), 1, [&](std::int64_t k, std::int64_t) {
      const std::int64_t begin = k % ranges * kGrain;
      use(static_cast<std::size_t>(k / ranges), static_cast<std::size_t>(begin),
          static_cast<std::size_t>(std::min(rows, begin + kGrain)));
    });
  }

  // The largest magnitude of each column; infinite where one is not a number.
  [[nodiscard]] std::vector<double> largest_of(const Vectors& v) const {
    const std::size_t ranges = (n_ + kGrain - 1) / kGrain;
    std::vector<double> of_ranges(ranges * count_, 0), all(count_, 0);
    over_columns([&](std::size_t c, std::size_t begin, std::size_t end) {
      double most = 0;
      for (std::size_t i = begin; i < end; ++i) {
        const double m = std::abs(v[c * n_ + i]);
        if (!(m <= most)) most = std::isnan(m) ? kUnknown : m;
      }
      of_ranges[c * ranges + begin / kGrain] = most;
    });
    for (std::size_t k = 0; k < of_ranges.size(); ++k) all[k / ranges] = std::max(all[k / ranges], of_ranges[k]);
    return all;
  }

  // Others than smaller ones are noise, or do not converge: the error is that which the last one has left.
  // @param before  sizes of the last corrections. @returns whether others may help
  bool note(const std::vector<double>& corrections, std::vector<double>& before) {
    bool goes_on = false;
    for (std::size_t c = 0; c < count_; ++c) {
      if (!(corrections[c] < before[c])) continue;
      error_[c] = error_after(corrections[c], before[c], largest_[c]);
      before[c] = corrections[c];
      goes_on = goes_on || error_[c] > kEps;
    }
    return goes_on;
  }

  // The first correction is as much of the solution as is lost in each step, but for luck.
  static double error_after(double correction, double before, double largest) {
    constexpr double kLuck = 10;
    if (!(largest > 0)) return 0;
    const double rate = std::isfinite(before) ? correction / before : std::min(1.0, kLuck * correction / largest);
    return std::max(kEps, correction / largest * rate);
  }
  static constexpr double kEps = std::numeric_limits<double>::epsilon();

  solver::Session* session_;
  std::size_t n_, count_;
  Vectors x_;  // column by column
  std::vector<double> largest_, error_;
};

}  // namespace espalier::inverse
