// Arbitrary bytes as a Matrix Market file: an error with a place, or a valid matrix that is written and read back the
// same. The first byte chooses between one thread and several.
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "matrix/matrix_market.hpp"
#include "matrix/transform.hpp"
#include "matrix/triplets.hpp"
#include "matrix/validate.hpp"
#include "values.hpp"

namespace {

using namespace espalier;

void read_as_matrix(std::string_view text, const matrix::ReadOptions& options) {
  try {
    const SparseMatrix a = matrix::parse_matrix_market(text, "fuzz.mtx", options);
    // Sums of huge duplicates may overflow; everything else must hold.
    if (test::all_below(a.values, 1e308)) matrix::validate(a);
    const SparseMatrix general = matrix::to_general(a);
    if (!matrix::is_sorted_unique(general)) std::abort();
  } catch (const Error& error) {
    const StatusCode code = error.status().code;
    if (code != StatusCode::invalid_input || std::string_view(error.what()).find("fuzz.mtx") != 0) std::abort();
  }
}

void read_as_vectors(std::string_view text) {
  try {
    const matrix::DenseVectors v = matrix::parse_matrix_market_vectors(text, "fuzz.mtx");
    if (v.values.size() != static_cast<std::size_t>(v.rows) * static_cast<std::size_t>(v.cols)) std::abort();
  } catch (const Error& error) {
    if (error.status().code != StatusCode::invalid_input) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  static base::ThreadPool pool(2);
  matrix::ReadOptions options;
  options.pool = (data[0] & 1) != 0 ? &pool : nullptr;
  options.keep_pattern = (data[0] & 2) != 0;
  const std::string_view text(reinterpret_cast<const char*>(data) + 1, size - 1);
  read_as_matrix(text, options);
  if ((data[0] & 4) != 0) read_as_vectors(text);
  return 0;
}
