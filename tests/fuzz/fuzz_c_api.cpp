// Arbitrary bytes as a sequence of calls of the C interface: nothing may crash, hang or read outside the arrays; what
// is solved must have a small backward error or say that it has not.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <vector>

#include "espalier/espalier.h"

namespace {

/// Takes numbers off the front of the input; zeros when it is used up.
class Bytes {
 public:
  Bytes(const std::uint8_t* data, std::size_t size) : data_(data), size_(size) {}
  std::uint8_t byte() { return at_ < size_ ? data_[at_++] : std::uint8_t{0}; }
  /// Mostly small numbers, now and then any bits at all.
  double number() {
    const std::uint8_t kind = byte();
    if (kind < 0xf0) return (static_cast<double>(kind) - 120.0) / 8.0;
    std::uint64_t bits = 0;
    for (int i = 0; i < 8; ++i) bits = bits << 8 | byte();
    double value = 0;
    std::memcpy(&value, &bits, sizeof value);
    return value;
  }

 private:
  const std::uint8_t* data_;
  std::size_t size_;
  std::size_t at_ = 0;
};

struct Matrix {
  std::vector<std::int64_t> pointers, indices;
  std::vector<double> values;
  espalier_matrix_i64 c{};
};

/// Sizes up to 24, arrays of the lengths that they announce, contents often wrong.
Matrix make_matrix(Bytes& in) {
  Matrix m;
  const int n = in.byte() % 25;
  const int entries = in.byte() % 120;
  m.c.size = sizeof m.c;
  m.c.rows = n;
  m.c.cols = in.byte() < 8 ? in.byte() % 25 : n;
  m.c.layout = in.byte() % 2;
  m.c.storage = in.byte() % 5;
  m.c.index_base = in.byte() % 2;
  const std::int64_t outer = m.c.layout == ESPALIER_CSR ? m.c.rows : m.c.cols;
  std::int64_t at = 0;
  for (std::int64_t i = 0; i < outer; ++i) {
    m.pointers.push_back(at + m.c.index_base);
    const std::uint8_t step = in.byte();
    at = step == 255 ? at - in.byte() : std::min<std::int64_t>(entries, at + step % 12);
  }
  m.pointers.push_back((in.byte() < 250 ? std::int64_t{entries} : std::int64_t{in.byte()}) + m.c.index_base);
  for (int k = 0; k < entries; ++k) {
    const std::uint8_t index = in.byte();
    m.indices.push_back(index == 255 || n == 0 ? std::int64_t{index} - 128 : index % n + m.c.index_base);
    m.values.push_back(in.number());
  }
  m.c.nonzeros = entries;
  m.c.pointers = m.pointers.data();
  m.c.indices = m.indices.data();
  m.c.values = m.values.data();
  return m;
}

/// @returns the largest backward error with which a solution may be called one
double set_options(espalier_solver* solver, Bytes& in) {
  static const char* const kinds[] = {"auto", "llt", "ldlt", "lu"};
  static const char* const precisions[] = {"fp64", "fp32", "mixed"};
  espalier_set_option(solver, "threads", "1");
  espalier_set_option(solver, "kind", kinds[in.byte() % 4]);
  const int precision = in.byte() % 3;
  espalier_set_option(solver, "precision", precisions[precision]);
  espalier_set_option(solver, "matching", in.byte() % 2 != 0 ? "on" : "off");
  return precision == 1 ? 1e-5 : 1e-10;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes in(data, size);
  espalier_solver* solver = nullptr;
  if (espalier_create(&solver) != ESPALIER_OK) std::abort();
  const double most_error = set_options(solver, in);
  Matrix a = make_matrix(in);
  if (espalier_analyze_i64(solver, &a.c, nullptr) == ESPALIER_OK &&
      espalier_factorize_i64(solver, &a.c, nullptr) == ESPALIER_OK) {
    const auto n = static_cast<std::size_t>(a.c.rows);
    std::vector<double> x(2 * n, 1.0);
    espalier_solve_info info{};
    info.size = sizeof info;
    const int code = espalier_solve(solver, x.data(), x.data(), 2, in.byte() % 2, &info);
    if (code == ESPALIER_OK && !(info.backward_error <= most_error)) std::abort();
    for (double& v : a.values) v = in.number();
    espalier_refactorize(solver, a.values.data(), a.c.nonzeros, nullptr);
  }
  if (espalier_last_error(solver) == nullptr) std::abort();
  espalier_destroy(solver);
  return 0;
}
