#include "matrix/read.hpp"

#include <fmt/format.h>

#include <new>
#include <optional>

#include "matrix/binary.hpp"
#include "matrix/file.hpp"
#include "matrix/rutherford_boeing.hpp"

namespace espalier::matrix {

namespace {

constexpr std::size_t kParallelBytes = std::size_t{8} << 20;  // 40 ms of one core: then threads are worth starting

// Calls parse(text, options) with the file's text and a pool.
template <class Parse>
auto with_text(const std::string& path, ReadOptions options, const Parse& parse) {
  try {
    const FileBytes file(path);
    std::string unpacked;
    std::string_view text = file.bytes();
    if (is_gzip(text)) {
      unpacked = gunzip(text, path);
      text = unpacked;
    }
    if (text.starts_with("\xef\xbb\xbf")) text.remove_prefix(3);  // the mark that some editors put before UTF-8
    if (text.starts_with("\xff\xfe%") || (text.starts_with("\xfe\xff") && text.substr(3).starts_with('%')))
      throw Error(StatusCode::invalid_input, fmt::format("{}: the text is UTF-16; save it as UTF-8 or ASCII", path));
    std::optional<base::ThreadPool> own;
    if (options.pool == nullptr && text.size() >= kParallelBytes) options.pool = &own.emplace(base::available_cores());
    return parse(text, options);
  } catch (const std::bad_alloc&) {
    throw Error(StatusCode::out_of_memory, fmt::format("{}: this machine's memory is too small for the matrix", path));
  }
}

SparseMatrix parse_real(std::string_view text, const std::string& path, const ReadOptions& options) {
  const Source source{path, text};
  if (text.empty()) fail(source, "the file is empty");
  if (is_matrix_market(text)) return parse_matrix_market(text, path, options);
  if (is_binary_matrix(text)) return parse_binary(text, path);
  if (is_rutherford_boeing(text)) return parse_rutherford_boeing(text, path, options);
  fail_at(source, text.data(),
          "neither Matrix Market ('%%MatrixMarket matrix ...'), nor Rutherford-Boeing, nor Espalier's binary format");
}

}  // namespace

SparseMatrix read_matrix(const std::string& path, const ReadOptions& options) {
  return with_text(path, options, [&](std::string_view text, const ReadOptions& with_pool) {
    return parse_real(text, path, with_pool);
  });
}

AnyMatrix read_any_matrix(const std::string& path, const ReadOptions& options) {
  return with_text(path, options, [&](std::string_view text, const ReadOptions& with_pool) -> AnyMatrix {
    if (is_matrix_market(text) && is_complex_matrix_market(text, path))
      return parse_complex_matrix_market(text, path, with_pool);
    return parse_real(text, path, with_pool);
  });
}

ComplexVectors read_complex_vectors(const std::string& path, const ReadOptions& options) {
  return with_text(path, options, [&](std::string_view text, const ReadOptions& with_pool) {
    const Source source{path, text};
    if (text.empty()) fail(source, "the file is empty");
    return parse_complex_matrix_market_vectors(text, path, with_pool);
  });
}

AnyVectors read_any_vectors(const std::string& path, const ReadOptions& options) {
  return with_text(path, options, [&](std::string_view text, const ReadOptions& with_pool) -> AnyVectors {
    const Source source{path, text};
    if (text.empty()) fail(source, "the file is empty");
    if (is_complex_matrix_market(text, path)) return parse_complex_matrix_market_vectors(text, path, with_pool);
    return parse_matrix_market_vectors(text, path, with_pool);
  });
}

}  // namespace espalier::matrix
