/// \file
/// Plain dense matrices and the two layouts of the host kernels, written from their definitions, for tests.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <new>
#include <random>
#include <vector>

#include "device/host/kernels/kernels.hpp"

namespace espalier::device::host::testing {

/// Aligned array whose end is guarded: writes past the end are found by intact().
template <class T>
class Array {
 public:
  explicit Array(std::int64_t size, T value = std::numeric_limits<T>::quiet_NaN()) : size_(size) {
    data_.reset(
        static_cast<T*>(::operator new (static_cast<std::size_t>(size + kGuard) * sizeof(T), std::align_val_t{64})));
    for (std::int64_t i = 0; i < size; ++i) data_[i] = value;
    for (std::int64_t i = size; i < size + kGuard; ++i) data_[i] = T(12345);
  }
  T* data() { return data_.get(); }
  const T* data() const { return data_.get(); }
  T& operator[](std::int64_t i) { return data_[i]; }
  const T& operator[](std::int64_t i) const { return data_[i]; }
  [[nodiscard]] std::int64_t size() const { return size_; }
  [[nodiscard]] bool intact() const {
    for (std::int64_t i = size_; i < size_ + kGuard; ++i) {
      if (data_[i] != T(12345)) return false;
    }
    return true;
  }

 private:
  static constexpr std::int64_t kGuard = 64;
  struct Delete {
    void operator()(T* p) const { ::operator delete (p, std::align_val_t{64}); }
  };
  std::unique_ptr<T[], Delete> data_;
  std::int64_t size_;
};

/// rows x columns, column-major, in extended precision.
struct Dense {
  Dense(std::int64_t r, std::int64_t c) : rows(r), columns(c), values(static_cast<std::size_t>(r * c), 0.0L) {}
  long double& operator()(std::int64_t i, std::int64_t j) { return values[static_cast<std::size_t>(j * rows + i)]; }
  long double operator()(std::int64_t i, std::int64_t j) const {
    return values[static_cast<std::size_t>(j * rows + i)];
  }
  std::int64_t rows, columns;
  std::vector<long double> values;
};

/// Uniform in [-1, 1], rounded to T so that both sides of a comparison hold the same numbers.
template <class T>
Dense random_dense(std::int64_t rows, std::int64_t columns, unsigned seed) {
  Dense x(rows, columns);
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-1, 1);
  for (long double& v : x.values) v = static_cast<T>(uniform(generator));
  return x;
}

/// Column-major scratch of `ld` rows with padded(columns) columns; NaN where the contract says "undefined".
template <class T>
Array<T> to_scratch(const Dense& x, std::int64_t ld, bool lower = false) {
  Array<T> c(ld * padded<T>(x.columns));
  for (std::int64_t j = 0; j < x.columns; ++j) {
    for (std::int64_t i = lower ? j : 0; i < x.rows; ++i) c[j * ld + i] = static_cast<T>(x(i, j));
  }
  return c;
}

template <class T>
Dense from_scratch(const Array<T>& c, std::int64_t ld, std::int64_t rows, std::int64_t columns) {
  Dense x(rows, columns);
  for (std::int64_t j = 0; j < columns; ++j) {
    for (std::int64_t i = 0; i < rows; ++i) x(i, j) = c[j * ld + i];
  }
  return x;
}

template <class T>
std::int64_t panel_index(std::int64_t i, std::int64_t k, std::int64_t depth) {
  return i / kPanel<T> * kPanel<T> * depth + k * kPanel<T> + i % kPanel<T>;
}

template <class T>
Array<T> to_panels(const Dense& x) {
  Array<T> p(padded<T>(x.rows) * x.columns, T(0));
  for (std::int64_t j = 0; j < x.columns; ++j) {
    for (std::int64_t i = 0; i < x.rows; ++i) p[panel_index<T>(i, j, x.columns)] = static_cast<T>(x(i, j));
  }
  return p;
}

template <class T>
Dense from_panels(const Array<T>& p, std::int64_t rows, std::int64_t columns) {
  Dense x(rows, columns);
  for (std::int64_t j = 0; j < columns; ++j) {
    for (std::int64_t i = 0; i < rows; ++i) x(i, j) = p[panel_index<T>(i, j, columns)];
  }
  return x;
}

/// The rows that pad the last panel are zero.
template <class T>
bool padding_is_zero(const Array<T>& p, std::int64_t rows, std::int64_t columns) {
  for (std::int64_t i = rows; i < padded<T>(rows); ++i) {
    for (std::int64_t j = 0; j < columns; ++j) {
      if (p[panel_index<T>(i, j, columns)] != T(0)) return false;
    }
  }
  return true;
}

inline Dense transposed(const Dense& x) {
  Dense y(x.columns, x.rows);
  for (std::int64_t j = 0; j < x.columns; ++j) {
    for (std::int64_t i = 0; i < x.rows; ++i) y(j, i) = x(i, j);
  }
  return y;
}

inline Dense absolute(Dense x) {
  for (long double& v : x.values) v = std::abs(v);
  return x;
}

/// X Y.
inline Dense product(const Dense& x, const Dense& y) {
  Dense z(x.rows, y.columns);
  for (std::int64_t j = 0; j < y.columns; ++j) {
    for (std::int64_t k = 0; k < x.columns; ++k) {
      const long double f = y(k, j);
      if (f == 0) continue;
      for (std::int64_t i = 0; i < x.rows; ++i) z(i, j) += x(i, k) * f;
    }
  }
  return z;
}

/// x + scale * y.
inline Dense sum(Dense x, long double scale, const Dense& y) {
  for (std::size_t i = 0; i < x.values.size(); ++i) x.values[i] += scale * y.values[i];
  return x;
}

/// |x - expected| <= factor * eps(T) * magnitude, entry by entry (only i >= j when `lower`).
template <class T>
::testing::AssertionResult close(const Dense& x, const Dense& expected, const Dense& magnitude, long double factor,
                                 bool lower = false) {
  const long double eps = std::numeric_limits<T>::epsilon();
  for (std::int64_t j = 0; j < x.columns; ++j) {
    for (std::int64_t i = lower ? j : 0; i < x.rows; ++i) {
      const long double bound = factor * eps * magnitude(i, j) + std::numeric_limits<T>::min();
      if (!(std::abs(x(i, j) - expected(i, j)) <= bound))
        return ::testing::AssertionFailure()
               << "(" << i << ", " << j << "): " << static_cast<double>(x(i, j)) << " for "
               << static_cast<double>(expected(i, j)) << ", bound " << static_cast<double>(bound);
    }
  }
  return ::testing::AssertionSuccess();
}

}  // namespace espalier::device::host::testing
