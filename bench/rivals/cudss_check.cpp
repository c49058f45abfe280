/// \file
/// Compiled only where NVIDIA's cudss.h is found: our numbers and signatures are those of the header.
#include <cudss.h>

#include <type_traits>

#include "rivals/cudss_api.hpp"

namespace espalier::bench::cudss {

static_assert(CUDSS_VERSION_MAJOR == 1, "cudss_api.hpp follows cuDSS 1.x");

static_assert(kSuccess == int{CUDSS_STATUS_SUCCESS} && kRefinementFailed == int{CUDSS_STATUS_IR_FAILED});
static_assert(kAllocFailed == int{CUDSS_STATUS_ALLOC_FAILED});
static_assert(kMatchingAlg == int{CUDSS_CONFIG_MATCHING_ALG});
static_assert(kHybridMemoryMode == int{CUDSS_CONFIG_HYBRID_MEMORY_MODE});
static_assert(kHybridDeviceMemoryLimit == int{CUDSS_CONFIG_HYBRID_DEVICE_MEMORY_LIMIT});
static_assert(kHostThreads == int{CUDSS_CONFIG_HOST_NTHREADS} && kUniformBatchSize == int{CUDSS_CONFIG_UBATCH_SIZE});
static_assert(kRefinementLimit == int{CUDSS_CONFIG_IR_N_STEPS});
static_assert(kDeviceCount == int{CUDSS_CONFIG_DEVICE_COUNT});
static_assert(kDeviceIndices == int{CUDSS_CONFIG_DEVICE_INDICES});
static_assert(kDeterministicMode == int{CUDSS_CONFIG_DETERMINISTIC_MODE});
static_assert(kInfo == int{CUDSS_DATA_INFO} && kFactorNonzeros == int{CUDSS_DATA_LU_NNZ});
static_assert(kPivots == int{CUDSS_DATA_NPIVOTS} && kInertia == int{CUDSS_DATA_INERTIA});
static_assert(kHybridDeviceMemoryMin == int{CUDSS_DATA_HYBRID_DEVICE_MEMORY_MIN});
static_assert(kMemoryEstimates == int{CUDSS_DATA_MEMORY_ESTIMATES});
static_assert(kRefinementSteps == int{CUDSS_DATA_IR_N_STEPS} && kFlops == int{CUDSS_DATA_FLOPS});
static_assert(kAnalysis == int{CUDSS_PHASE_ANALYSIS} && kFactorization == int{CUDSS_PHASE_FACTORIZATION});
static_assert(kRefactorization == int{CUDSS_PHASE_REFACTORIZATION} && kSolve == int{CUDSS_PHASE_SOLVE});
static_assert(kGeneral == int{CUDSS_MTYPE_GENERAL} && kSymmetric == int{CUDSS_MTYPE_SYMMETRIC});
static_assert(kPositiveDefinite == int{CUDSS_MTYPE_SPD} && kHermitianDefinite == int{CUDSS_MTYPE_HPD});
static_assert(kHermitian == int{CUDSS_MTYPE_HERMITIAN} && kComplex64 == int{CUDA_C_64F});
static_assert(kFull == int{CUDSS_MVIEW_FULL} && kLower == int{CUDSS_MVIEW_LOWER} && kUpper == int{CUDSS_MVIEW_UPPER});
static_assert(kNoMatching == int{CUDSS_MATCHING_ALG_NONE} && kMatchingAuto == int{CUDSS_MATCHING_ALG_AUTO});
static_assert(kMaxDiagProduct == int{CUDSS_MATCHING_ALG_MAX_DIAG_PRODUCT});
static_assert(kBaseZero == int{CUDSS_BASE_ZERO} && kColumnMajor == int{CUDSS_LAYOUT_COL_MAJOR});
static_assert(kReal64 == int{CUDA_R_64F} && kInteger32 == int{CUDA_R_32I});
static_assert(kMemcpyHostToDevice == int{cudaMemcpyHostToDevice} && kMemcpyDeviceToHost == int{cudaMemcpyDeviceToHost});

/// Same number of arguments, each of the same size, once enumerations are read as int.
template <typename Ours, typename Theirs>
struct SameShape : std::false_type {};
template <typename R, typename... A, typename S, typename... B>
struct SameShape<R (*)(A...), S (*)(B...)> {
  static constexpr bool same() {
    if constexpr (sizeof...(A) == sizeof...(B))
      return sizeof(R) == sizeof(S) && ((sizeof(A) == sizeof(B) && std::is_pointer_v<A> == std::is_pointer_v<B>)&&...);
    else
      return false;
  }
  static constexpr bool value = same();
};
#define ESPALIER_SAME(ours, theirs) static_assert(SameShape<decltype(Api::ours), decltype(&theirs)>::value)
ESPALIER_SAME(create, cudssCreate);
ESPALIER_SAME(create_mg, cudssCreateMg);
ESPALIER_SAME(destroy, cudssDestroy);
ESPALIER_SAME(set_threading_layer, cudssSetThreadingLayer);
ESPALIER_SAME(config_create, cudssConfigCreate);
ESPALIER_SAME(config_destroy, cudssConfigDestroy);
ESPALIER_SAME(config_set, cudssConfigSet);
ESPALIER_SAME(data_create, cudssDataCreate);
ESPALIER_SAME(data_destroy, cudssDataDestroy);
ESPALIER_SAME(data_get, cudssDataGet);
ESPALIER_SAME(execute, cudssExecute);
ESPALIER_SAME(create_dense, cudssMatrixCreateDn);
ESPALIER_SAME(create_csr, cudssMatrixCreateCsr);
ESPALIER_SAME(matrix_destroy, cudssMatrixDestroy);
ESPALIER_SAME(get_property, cudssGetProperty);
#undef ESPALIER_SAME

}  // namespace espalier::bench::cudss
