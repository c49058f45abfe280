// Arbitrary bytes as a mesh file, see fuzz_mesh.hpp.
#include "fuzz/fuzz_mesh.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return espalier::dynamics::fuzz_mesh(espalier::dynamics::parse_dot_mesh, data, size);
}
