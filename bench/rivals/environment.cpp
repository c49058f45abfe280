#include "rivals/environment.hpp"

#include <cstdlib>

namespace espalier::bench {
namespace {

/// The core type of OpenBLAS for this processor; empty where its own choice can be trusted.
std::string openblas_core_type() {
#if defined(__x86_64__)
  if (__builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
      __builtin_cpu_supports("avx512vl"))
    return "SkylakeX";
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"))
    return __builtin_cpu_is("amd") ? "Zen" : "Haswell";
#endif
  return "";
}

}  // namespace

std::vector<std::string> rival_environment(int threads) {
  std::vector<std::string> environment;
  for (const char* name : {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"})
    environment.push_back(std::string(name) + "=" + std::to_string(threads));
  environment.emplace_back("MKL_DYNAMIC=FALSE");
  const char* chosen = std::getenv("OPENBLAS_CORETYPE");
  const std::string core = chosen != nullptr ? chosen : openblas_core_type();
  if (!core.empty()) environment.push_back("OPENBLAS_CORETYPE=" + core);
  return environment;
}

}  // namespace espalier::bench
