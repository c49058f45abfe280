/// \file
/// Foreign libraries loaded at run time.
#pragma once

#include <string>
#include <vector>

namespace espalier::bench {

/// A library opened with dlopen and kept open until the process ends (MKL and CUDA do not survive being closed).
class SharedLibrary {
 public:
  enum class Scope { local, global };

  /// Tries `names` one after the other in $ESPALIER_RIVALS_DIR, the folder that scripts/get_rivals.sh fills, the CUDA
  /// toolkit, and the system's own search path. Throws Failure(Outcome::missing) with the loader's words.
  SharedLibrary(const std::vector<std::string>& names, Scope scope);

  /// The function called `name`. Throws Failure(Outcome::missing) where the library has none.
  template <typename Function>
  Function function(const char* name) const {
    return reinterpret_cast<Function>(address(name));
  }
  /// Like function(), but null where the library has none.
  template <typename Function>
  Function optional_function(const char* name) const {
    return reinterpret_cast<Function>(optional_address(name));
  }
  /// Path that was opened.
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  [[nodiscard]] void* address(const char* name) const;
  [[nodiscard]] void* optional_address(const char* name) const;

  void* handle_ = nullptr;
  std::string path_;
};

/// Name of the BLAS kernels in use by the OpenBLAS of this process ("OpenBLAS SkylakeX"), or "BLAS unknown".
std::string blas_in_use();

}  // namespace espalier::bench
