// Arbitrary bytes as a Rutherford-Boeing file and as a file of the binary format: an error with a place, or a valid
// matrix.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "matrix/binary.hpp"
#include "matrix/rutherford_boeing.hpp"
#include "matrix/validate.hpp"
#include "values.hpp"

namespace {

using namespace espalier;

template <class Read>
void expect_matrix_or_error(const Read& read) {
  try {
    const SparseMatrix a = read();
    // Sums of huge duplicates may overflow; everything else must hold.
    if (test::all_below(a.values, 1e308)) matrix::validate(a);
  } catch (const Error& error) {
    const StatusCode code = error.status().code;
    if (code != StatusCode::invalid_input || std::string_view(error.what()).find("fuzz") != 0) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  expect_matrix_or_error([&] { return matrix::parse_rutherford_boeing(bytes, "fuzz.rb"); });
  if (matrix::is_binary_matrix(bytes)) expect_matrix_or_error([&] { return matrix::parse_binary(bytes, "fuzz.esp"); });
  return 0;
}
