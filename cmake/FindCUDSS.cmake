# NVIDIA's cuDSS header with the CUDA toolkit's, for bench/ only: checks our own declarations. The library is loaded at run time.
find_path(CUDSS_INCLUDE_DIR cudss.h HINTS ${ESPALIER_RIVALS_DIR}/include)
find_path(CUDSS_CUDA_INCLUDE_DIR cuda_runtime.h HINTS /usr/local/cuda/include)
include(FindPackageHandleStandardArgs)
find_package_handle_standard_args(CUDSS REQUIRED_VARS CUDSS_INCLUDE_DIR CUDSS_CUDA_INCLUDE_DIR
  REASON_FAILURE_MESSAGE "run scripts/get_rivals.sh")
set(CUDSS_INCLUDE_DIRS ${CUDSS_INCLUDE_DIR} ${CUDSS_CUDA_INCLUDE_DIR})
