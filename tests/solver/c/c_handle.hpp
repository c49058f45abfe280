/// \file
/// A handle of the C interface that destroys itself, and its calls by the type of the matrix.
#pragma once

#include <gtest/gtest.h>

#include <memory>

#include "espalier/espalier.h"

namespace espalier::test {

struct Destroy {
  void operator()(espalier_solver* s) const { espalier_destroy(s); }
};
using Handle = std::unique_ptr<espalier_solver, Destroy>;

inline Handle make() {
  espalier_solver* solver = nullptr;
  EXPECT_EQ(espalier_create(&solver), ESPALIER_OK);
  return Handle(solver);
}

inline int analyze(espalier_solver* s, const espalier_matrix_i32& a, espalier_analysis_info* info = nullptr) {
  return espalier_analyze_i32(s, &a, info);
}
inline int analyze(espalier_solver* s, const espalier_matrix_i64& a, espalier_analysis_info* info = nullptr) {
  return espalier_analyze_i64(s, &a, info);
}
inline int factorize(espalier_solver* s, const espalier_matrix_i32& a, espalier_factor_info* info = nullptr) {
  return espalier_factorize_i32(s, &a, info);
}
inline int factorize(espalier_solver* s, const espalier_matrix_i64& a, espalier_factor_info* info = nullptr) {
  return espalier_factorize_i64(s, &a, info);
}

}  // namespace espalier::test
