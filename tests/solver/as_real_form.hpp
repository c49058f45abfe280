/// \file
/// Complex systems as real ones where nothing asks for it.
#pragma once

#include <cstdlib>

namespace espalier::test {

/// Real forms on the host, which has kernels for complex numbers, for as long as this lives.
class AsRealForm {
 public:
  AsRealForm() { ::setenv("ESPALIER_COMPLEX_FORM", "real", 1); }
  AsRealForm(const AsRealForm&) = delete;
  AsRealForm& operator=(const AsRealForm&) = delete;
  ~AsRealForm() { ::unsetenv("ESPALIER_COMPLEX_FORM"); }
};

}  // namespace espalier::test
