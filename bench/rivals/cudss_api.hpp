/// \file
/// What this benchmark uses of the cuDSS 1.0 interface, declared here so that neither header nor library is needed to
/// build. cudss_check.cpp compares every number with NVIDIA's header where that is found.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>

#include "rivals/cuda_runtime.hpp"

namespace espalier::bench::cudss {

using Handle = struct cudssContext*;
using Matrix = struct cudssMatrix*;
using Data = struct cudssData*;
using Config = struct cudssConfig*;
using Stream = struct CUstream_st*;

enum Status : int {
  kSuccess = 0,
  kNotInitialized,
  kAllocFailed,
  kInvalidValue,
  kNotSupported,
  kExecutionFailed,
  kInternalError,
  kRefinementFailed
};
enum ConfigParam : int {
  kMatchingAlg = 3,
  kRefinementLimit = 5,
  kHybridMemoryMode = 11,
  kHybridDeviceMemoryLimit = 12,
  kHostThreads = 14,
  kUniformBatchSize = 18,
  kDeviceCount = 21,
  kDeviceIndices = 22,
  kDeterministicMode = 24,
};
enum DataParam : int {
  kInfo = 0,
  kFactorNonzeros = 1,
  kPivots = 2,
  kInertia = 3,
  kHybridDeviceMemoryMin = 10,
  kMemoryEstimates = 13,
  kRefinementSteps = 24,
  kFlops = 26,
};
enum Phase : int { kAnalysis = 3, kFactorization = 4, kRefactorization = 8, kSolve = 1008 };
enum MatrixType : int { kGeneral = 0, kSymmetric = 1, kHermitian = 2, kPositiveDefinite = 3, kHermitianDefinite = 4 };
enum MatrixPart : int { kFull = 0, kLower = 1, kUpper = 2 };
enum Matching : int { kNoMatching = 0, kMaxDiagProduct = 5, kMatchingAuto = 6 };
constexpr int kBaseZero = 0;
constexpr int kColumnMajor = 0;
constexpr int kReal64 = 1;      ///< cudaDataType: 64-bit floating point
constexpr int kComplex64 = 5;   ///< cudaDataType: two of them
constexpr int kInteger32 = 10;  ///< cudaDataType: 32-bit integer

/// cuDSS, loaded at run time together with the libraries that it needs.
struct Api {
  SharedLibrary blas_lt{{"libcublasLt.so.13", "libcublasLt.so.12"}, SharedLibrary::Scope::global};
  SharedLibrary blas{{"libcublas.so.13", "libcublas.so.12"}, SharedLibrary::Scope::global};
  SharedLibrary nvrtc{{"libnvrtc.so.13", "libnvrtc.so.12"}, SharedLibrary::Scope::global};
  SharedLibrary library{{"libcudss.so.1", "libcudss.so.0"}, SharedLibrary::Scope::global};
  int (*create)(Handle*) = library.function<int (*)(Handle*)>("cudssCreate");
  int (*create_mg)(Handle*, int, const int*) = library.function<int (*)(Handle*, int, const int*)>("cudssCreateMg");
  int (*destroy)(Handle) = library.function<int (*)(Handle)>("cudssDestroy");
  int (*set_threading_layer)(Handle,
                             const char*) = library.function<int (*)(Handle, const char*)>("cudssSetThreadingLayer");
  int (*config_create)(Config*) = library.function<int (*)(Config*)>("cudssConfigCreate");
  int (*config_destroy)(Config) = library.function<int (*)(Config)>("cudssConfigDestroy");
  int (*config_set)(Config, int, const void*,
                    std::size_t) = library.function<int (*)(Config, int, const void*, std::size_t)>("cudssConfigSet");
  int (*data_create)(Handle, Data*) = library.function<int (*)(Handle, Data*)>("cudssDataCreate");
  int (*data_destroy)(Handle, Data) = library.function<int (*)(Handle, Data)>("cudssDataDestroy");
  int (*data_get)(Handle, Data, int, void*, std::size_t, std::size_t*) =
      library.function<int (*)(Handle, Data, int, void*, std::size_t, std::size_t*)>("cudssDataGet");
  int (*execute)(Handle, int, Config, Data, Matrix, Matrix,
                 Matrix) = library.function<int (*)(Handle, int, Config, Data, Matrix, Matrix, Matrix)>("cudssExecute");
  int (*create_dense)(Matrix*, std::int64_t, std::int64_t, std::int64_t, const void*, int, int) =
      library.function<int (*)(Matrix*, std::int64_t, std::int64_t, std::int64_t, const void*, int, int)>(
          "cudssMatrixCreateDn");
  int (*create_csr)(Matrix*, std::int64_t, std::int64_t, std::int64_t, const void*, const void*, const void*,
                    const void*, int, int, int, int, int, int) =
      library.function<int (*)(Matrix*, std::int64_t, std::int64_t, std::int64_t, const void*, const void*, const void*,
                               const void*, int, int, int, int, int, int)>("cudssMatrixCreateCsr");
  int (*matrix_destroy)(Matrix) = library.function<int (*)(Matrix)>("cudssMatrixDestroy");
  int (*get_property)(int, int*) = library.function<int (*)(int, int*)>("cudssGetProperty");
};

/// A failed call as a failure that names it.
inline void check_cudss(int status, const char* call) {
  constexpr std::array<const char*, 8> kNames = {"success",        "not initialized",  "allocation failed",
                                                 "invalid value",  "not supported",    "execution failed",
                                                 "internal error", "refinement failed"};
  if (status == kSuccess) return;
  const bool known = status > 0 && status < static_cast<int>(kNames.size());
  throw Failure(status == kAllocFailed    ? Outcome::out_of_memory
                : status == kNotSupported ? Outcome::not_offered
                                          : Outcome::failed,
                std::string("cuDSS ") + call + ": " + (known ? kNames[static_cast<std::size_t>(status)] : "status ") +
                    (known ? "" : std::to_string(status)));
}

}  // namespace espalier::bench::cudss
