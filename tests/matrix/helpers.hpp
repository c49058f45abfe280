/// \file
/// Dense references, random matrices, and checks of errors for the tests of the matrix layer.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <Eigen/Dense>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "espalier/matrix.hpp"

namespace espalier::matrix {

/// A file that a test writes. Its name has the process in it: the sanitizers' runs deal a program's tests to several.
inline std::string temporary(const std::string& name) {
  return testing::TempDir() + "espalier_" + std::to_string(::getpid()) + "_" + name;
}

/// The full matrix of any storage, duplicates summed; the slow readable reference of this folder's tests.
inline Eigen::MatrixXd dense(const MatrixView& a) {
  Eigen::MatrixXd d = Eigen::MatrixXd::Zero(a.rows, a.cols);
  const bool half = a.storage == Storage::symmetric_lower || a.storage == Storage::symmetric_upper;
  for (Index j = 0; j < a.cols; ++j)
    for (Offset p = a.col_ptr[static_cast<std::size_t>(j)]; p < a.col_ptr[static_cast<std::size_t>(j) + 1]; ++p) {
      const Index i = a.row_ind[static_cast<std::size_t>(p)];
      const double v = a.values.empty() ? 1.0 : a.values[static_cast<std::size_t>(p)];
      d(i, j) += v;
      if (half && i != j) d(j, i) += v;
    }
  return d;
}

/// A random matrix of the given storage, rows in random order, about `per_column` entries a column, duplicates
/// included. Values are small integers, so that sums in any order are exact.
inline SparseMatrix random_matrix(Index rows, Index cols, int per_column, Storage storage, unsigned seed) {
  std::mt19937 rng(seed);
  SparseMatrix a{rows, cols, {0}, {}, {}, storage};
  for (Index j = 0; j < cols; ++j) {
    const Index top = storage == Storage::symmetric_lower ? j : 0;
    const Index bottom = storage == Storage::symmetric_upper ? j + 1 : rows;
    const int count = bottom > top ? static_cast<int>(rng() % static_cast<unsigned>(2 * per_column + 1)) : 0;
    for (int k = 0; k < count; ++k) {
      a.row_ind.push_back(top + static_cast<Index>(rng() % static_cast<unsigned>(bottom - top)));
      a.values.push_back(static_cast<double>(static_cast<int>(rng() % 19) - 9));
    }
    a.col_ptr.push_back(static_cast<Offset>(a.row_ind.size()));
  }
  return a;
}

/// Runs `action`, which must throw Error(code), and returns the message.
inline std::string message_of(const std::function<void()>& action, StatusCode code = StatusCode::invalid_input) {
  try {
    action();
  } catch (const Error& error) {
    EXPECT_EQ(error.status().code, code) << error.what();
    return error.what();
  }
  ADD_FAILURE() << "no error was thrown";
  return {};
}

/// The message of `action` must hold every one of `parts`.
inline void expect_error(const std::function<void()>& action, const std::vector<std::string>& parts) {
  const std::string message = message_of(action);
  for (const auto& part : parts)
    EXPECT_NE(message.find(part), std::string::npos) << "'" << part << "' not in: " << message;
}

}  // namespace espalier::matrix
