// espalier/sundials.hpp in SUNDIALS' IDA and KINSOL. Truths: the closed form of heat in a bar that is cut into pieces,
// a known root.
#include "espalier/sundials.hpp"

#include <gtest/gtest.h>
#include <ida/ida.h>
#include <kinsol/kinsol.h>
#include <nvector/nvector_serial.h>

#include <cmath>

namespace espalier::test {
namespace {

class SundialsHeader : public ::testing::TestWithParam<int> {
 protected:
  SundialsHeader() { SUNContext_Create(nullptr, &context); }
  ~SundialsHeader() override { SUNContext_Free(&context); }
  SUNContext context = nullptr;
};

constexpr int kPieces = 60;

// u'_k = (u_{k-1} - 2 u_k + u_{k+1}) s, ends at zero, as F(u, u') = 0. The sine decays by lambda = -2 s (1 - cos(pi /
// (n + 1))).
constexpr double kSpeed = 400;

double decay() { return -2 * kSpeed * (1 - std::cos(M_PI / (kPieces + 1))); }

int heat(realtype, N_Vector u, N_Vector rate, N_Vector residual, void*) {
  const double* v = N_VGetArrayPointer(u);
  for (int k = 0; k < kPieces; ++k) {
    const double left = k > 0 ? v[k - 1] : 0, right = k + 1 < kPieces ? v[k + 1] : 0;
    N_VGetArrayPointer(residual)[k] = N_VGetArrayPointer(rate)[k] - kSpeed * (left - 2 * v[k] + right);
  }
  return 0;
}

// dF/du + c dF/du'; symmetric, so that rows and columns are the same arrays.
int heat_jacobian(realtype, realtype c, N_Vector, N_Vector, N_Vector, SUNMatrix j, void*, N_Vector, N_Vector,
                  N_Vector) {
  SUNMatZero(j);
  sunindextype at = 0;
  for (int k = 0; k < kPieces; ++k) {
    SM_INDEXPTRS_S(j)[k] = at;
    for (int other = std::max(k - 1, 0); other <= std::min(k + 1, kPieces - 1); ++other) {
      SM_INDEXVALS_S(j)[at] = other;
      SM_DATA_S(j)[at++] = other == k ? c + 2 * kSpeed : -kSpeed;
    }
  }
  SM_INDEXPTRS_S(j)[kPieces] = at;
  return 0;
}

TEST_P(SundialsHeader, HeatByIda) {
  N_Vector u = N_VNew_Serial(kPieces, context), rate = N_VNew_Serial(kPieces, context);
  for (int k = 0; k < kPieces; ++k) {
    N_VGetArrayPointer(u)[k] = std::sin(M_PI * (k + 1) / (kPieces + 1));
    N_VGetArrayPointer(rate)[k] = decay() * N_VGetArrayPointer(u)[k];
  }
  void* ida = IDACreate(context);
  SUNMatrix a = SUNSparseMatrix(kPieces, kPieces, 3 * kPieces, GetParam(), context);
  SUNLinearSolver solver = SUNLinSol_Espalier(u, a, context);
  ASSERT_NE(solver, nullptr);
  ASSERT_EQ(IDAInit(ida, heat, 0, u, rate), IDA_SUCCESS);
  ASSERT_EQ(IDASStolerances(ida, 1e-8, 1e-10), IDA_SUCCESS);
  ASSERT_EQ(IDASetLinearSolver(ida, solver, a), IDA_SUCCESS);
  ASSERT_EQ(IDASetJacFn(ida, heat_jacobian), IDA_SUCCESS);
  realtype reached = 0;
  const double end = 1.5;
  ASSERT_EQ(IDASolve(ida, end, &reached, u, rate, IDA_NORMAL), IDA_SUCCESS);
  for (int k = 0; k < kPieces; ++k) {
    const double truth = std::sin(M_PI * (k + 1) / (kPieces + 1)) * std::exp(decay() * end);
    EXPECT_NEAR(N_VGetArrayPointer(u)[k], truth, 1e-6);
  }
  long int setups = 0;
  IDAGetNumLinSolvSetups(ida, &setups);
  EXPECT_GT(setups, 3);
  EXPECT_EQ(SUNLinSolLastFlag(solver), 0);
  IDAFree(&ida);
  EXPECT_EQ(SUNLinSolFree(solver), SUNLS_SUCCESS);
  SUNMatDestroy(a);
  N_VDestroy(u);
  N_VDestroy(rate);
}

// x_k^3 + x_{k+1} = 2 around a ring: all ones.
constexpr int kRing = 12;

int ring(N_Vector x, N_Vector f, void*) {
  const double* v = N_VGetArrayPointer(x);
  for (int k = 0; k < kRing; ++k) N_VGetArrayPointer(f)[k] = v[k] * v[k] * v[k] + v[(k + 1) % kRing] - 2;
  return 0;
}

int ring_jacobian(N_Vector x, N_Vector, SUNMatrix j, void*, N_Vector, N_Vector) {
  const double* v = N_VGetArrayPointer(x);
  const bool by_rows = SM_SPARSETYPE_S(j) == CSR_MAT;
  for (int k = 0; k < kRing; ++k) {  // row k, or column k
    const int other = by_rows ? (k + 1) % kRing : (k + kRing - 1) % kRing;
    SM_INDEXPTRS_S(j)[k] = 2 * k;
    SM_INDEXVALS_S(j)[2 * k] = k;
    SM_DATA_S(j)[2 * k] = 3 * v[k] * v[k];
    SM_INDEXVALS_S(j)[2 * k + 1] = other;
    SM_DATA_S(j)[2 * k + 1] = 1;
  }
  SM_INDEXPTRS_S(j)[kRing] = 2 * kRing;
  return 0;
}

TEST_P(SundialsHeader, RootByKinsol) {
  N_Vector x = N_VNew_Serial(kRing, context), scale = N_VNew_Serial(kRing, context);
  N_VConst(1, scale);
  for (int k = 0; k < kRing; ++k) N_VGetArrayPointer(x)[k] = 1.3 + 0.02 * k;
  void* kinsol = KINCreate(context);
  ASSERT_EQ(KINInit(kinsol, ring, x), KIN_SUCCESS);
  SUNMatrix a = SUNSparseMatrix(kRing, kRing, 2 * kRing, GetParam(), context);
  SUNLinearSolver solver = SUNLinSol_Espalier(x, a, context);
  ASSERT_EQ(KINSetLinearSolver(kinsol, solver, a), KIN_SUCCESS);
  ASSERT_EQ(KINSetJacFn(kinsol, ring_jacobian), KIN_SUCCESS);
  ASSERT_GE(KINSol(kinsol, x, KIN_LINESEARCH, scale, scale), 0);
  for (int k = 0; k < kRing; ++k) EXPECT_NEAR(N_VGetArrayPointer(x)[k], 1, 1e-6);
  KINFree(&kinsol);
  SUNLinSolFree(solver);
  SUNMatDestroy(a);
  N_VDestroy(x);
  N_VDestroy(scale);
}

TEST_P(SundialsHeader, PatternsMayChangeAndMatricesBeSingular) {
  N_Vector b = N_VNew_Serial(2, context), x = N_VNew_Serial(2, context);
  SUNMatrix a = SUNSparseMatrix(2, 2, 4, GetParam(), context);
  SUNLinearSolver solver = SUNLinSol_Espalier(b, a, context);
  ASSERT_EQ(SUNLinSolInitialize(solver), SUNLS_SUCCESS);
  N_VConst(6, b);
  EXPECT_EQ(SUNLinSolSolve(solver, a, x, b, 0), SUNLS_MEM_NULL) << "there is no factor";
  const auto fill = [&](std::initializer_list<double> values, std::initializer_list<int> indices, int first) {
    std::copy(values.begin(), values.end(), SM_DATA_S(a));
    std::copy(indices.begin(), indices.end(), SM_INDEXVALS_S(a));
    const sunindextype pointers[] = {0, first, static_cast<sunindextype>(values.size())};
    std::copy(pointers, pointers + 3, SM_INDEXPTRS_S(a));
  };
  fill({2, 3}, {0, 1}, 1);
  ASSERT_EQ(SUNLinSolSetup(solver, a), SUNLS_SUCCESS);
  ASSERT_EQ(SUNLinSolSolve(solver, a, x, b, 0), SUNLS_SUCCESS);
  EXPECT_NEAR(N_VGetArrayPointer(x)[0], 3, 1e-15);
  fill({2, 1, 1, 2}, {0, 1, 0, 1}, 2);
  ASSERT_EQ(SUNLinSolSetup(solver, a), SUNLS_SUCCESS) << "another pattern";
  ASSERT_EQ(SUNLinSolSolve(solver, a, x, b, 0), SUNLS_SUCCESS);
  EXPECT_NEAR(N_VGetArrayPointer(x)[1], 2, 1e-15);
  fill({1, 1, 1, 1}, {0, 1, 0, 1}, 2);
  EXPECT_EQ(SUNLinSolSetup(solver, a), SUNLS_LUFACT_FAIL);
  EXPECT_EQ(SUNLinSolLastFlag(solver), ESPALIER_SINGULAR);
  EXPECT_NE(SUNLinSolSolve(solver, a, x, b, 0), SUNLS_SUCCESS);
  fill({2, 1, 1, 2}, {0, 1, 0, 1}, 2);
  ASSERT_EQ(SUNLinSolSetup(solver, a), SUNLS_SUCCESS);
  SUNLinSolFree(solver);
  N_Vector longer = N_VNew_Serial(3, context);
  EXPECT_EQ(SUNLinSol_Espalier(longer, a, context), nullptr);
  EXPECT_EQ(SUNLinSol_Espalier(b, nullptr, context), nullptr);
  for (N_Vector v : {b, x, longer}) N_VDestroy(v);
  SUNMatDestroy(a);
}

INSTANTIATE_TEST_SUITE_P(Layouts, SundialsHeader, ::testing::Values(CSC_MAT, CSR_MAT));

}  // namespace
}  // namespace espalier::test
