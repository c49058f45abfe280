#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <functional>

#include "base/output_file.hpp"
#include "base/parallel.hpp"
#include "matrix/matrix_market.hpp"
#include "matrix/validate.hpp"

namespace espalier::matrix {

namespace {

constexpr Offset kEntriesPerBlock = 1 << 16;  // about 2 MB of text

// Appends numbers to a text without a detour over streams.
class Text {
 public:
  void reserve(std::size_t bytes) { text_.reserve(bytes); }
  template <class Number>
  void number(Number v, char behind) {
    constexpr std::size_t kLongest = 32;
    char digits[kLongest];
    const auto [stop, code] = std::to_chars(digits, digits + kLongest, v);
    (void)code;  // 32 characters hold every double and every 64-bit integer
    *stop = behind;
    text_.append(digits, at(stop - digits) + 1);
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string text_;
};

std::string banner(const char* kind, const std::string& comment) {
  std::string head = fmt::format("%%MatrixMarket matrix {}\n", kind);
  for (std::size_t begin = 0; begin < comment.size();) {
    const std::size_t end = std::min(comment.find('\n', begin), comment.size());
    head += fmt::format("% {}\n", comment.substr(begin, end - begin));
    begin = end + 1;
  }
  return head;
}

// Formats blocks [0, n) with as many threads as there are and writes them in order, a wave of a few per thread at a
// time.
void write_blocks(base::OutputFile& file, Offset n, base::ThreadPool* pool,
                  const std::function<void(Offset, Text&)>& format) {
  const Offset wave = 4 * base::threads_of(pool);
  for (Offset begin = 0; begin < n; begin += wave) {
    const Offset size = std::min(wave, n - begin);
    std::vector<Text> texts(at(size));
    base::for_each(pool, size, [&](std::int64_t i) { format(begin + i, texts[at(i)]); });
    for (const auto& text : texts) file.write(text.text());
  }
}

// The triangle or the whole: is the entry (i, j) written?
bool written(Storage storage, Index i, Index j) { return storage != Storage::symmetric_both || i >= j; }

Offset count_written(const MatrixView& a) {
  if (a.storage != Storage::symmetric_both) return a.nonzeros();
  Offset count = 0;
  for (Index j = 0; j < a.cols; ++j)
    for (Offset p = a.col_ptr[at(j)]; p < a.col_ptr[at(j) + 1]; ++p) count += a.row_ind[at(p)] >= j ? 1 : 0;
  return count;
}

void format_value(double v, Text& text) { text.number(v, '\n'); }
void format_value(std::complex<double> v, Text& text) {
  text.number(v.real(), ' ');
  text.number(v.imag(), '\n');
}
double mirrored(double v, bool /*hermitian*/) { return v; }
std::complex<double> mirrored(std::complex<double> v, bool hermitian) { return hermitian ? std::conj(v) : v; }

// Writes the entries at positions [begin, end) of the arrays, with these values.
template <class Value>
void format_entries(const MatrixView& a, std::span<const Value> values, bool hermitian, Offset begin, Offset end,
                    Text& text) {
  constexpr std::size_t kBytesPerEntry = 40;
  text.reserve(at(end - begin) * kBytesPerEntry);
  auto j = static_cast<Index>(std::upper_bound(a.col_ptr.begin(), a.col_ptr.end(), begin) - a.col_ptr.begin() - 1);
  for (Offset p = begin; p < end; ++p) {
    while (a.col_ptr[at(j) + 1] <= p) ++j;
    const Index i = a.row_ind[at(p)];
    if (!written(a.storage, i, j)) continue;
    const bool mirror = a.storage == Storage::symmetric_upper;
    text.number((mirror ? j : i) + 1, ' ');
    text.number((mirror ? i : j) + 1, values.empty() ? '\n' : ' ');
    if (values.empty()) continue;
    const Value v = values[at(p)];
    format_value(mirror ? mirrored(v, hermitian) : v, text);
  }
}

template <class Value>
void write_entries(const std::string& path, const MatrixView& a, std::span<const Value> values, const std::string& kind,
                   const std::string& comment, base::ThreadPool* pool) {
  const bool hermitian = kind.ends_with("hermitian");
  base::OutputFile file(path);
  file.write(banner(kind.c_str(), comment));
  file.write(fmt::format("{} {} {}\n", a.rows, a.cols, count_written(a)));
  const Offset blocks = (a.nonzeros() + kEntriesPerBlock - 1) / kEntriesPerBlock;
  write_blocks(file, blocks, pool, [&](Offset i, Text& text) {
    format_entries(a, values, hermitian, i * kEntriesPerBlock, std::min(a.nonzeros(), (i + 1) * kEntriesPerBlock),
                   text);
  });
  file.commit();
}

template <class Value>
void write_array(const std::string& path, Index rows, Index cols, std::span<const Value> values, const char* kind,
                 const std::string& comment, base::ThreadPool* pool) {
  const Offset count = static_cast<Offset>(rows) * cols;
  if (static_cast<Offset>(values.size()) != count)
    throw std::invalid_argument(
        fmt::format("write_matrix_market_vectors: {} values for {} x {}", values.size(), rows, cols));
  base::OutputFile file(path);
  file.write(banner(kind, comment));
  file.write(fmt::format("{} {}\n", rows, cols));
  write_blocks(file, (count + kEntriesPerBlock - 1) / kEntriesPerBlock, pool, [&](Offset i, Text& text) {
    const Offset end = std::min(count, (i + 1) * kEntriesPerBlock);
    for (Offset k = i * kEntriesPerBlock; k < end; ++k) format_value(values[at(k)], text);
  });
  file.commit();
}

}  // namespace

void write_matrix_market(const std::string& path, const MatrixView& a, const std::string& comment,
                         base::ThreadPool* pool) {
  const bool pattern = a.values.empty() && a.nonzeros() > 0;
  const std::string kind =
      fmt::format("coordinate {} {}", pattern ? "pattern" : "real", a.symmetric() ? "symmetric" : "general");
  write_entries(path, a, a.values, kind, comment, pool);
}

void write_matrix_market(const std::string& path, const ComplexMatrixView& a, const std::string& comment,
                         base::ThreadPool* pool) {
  const MatrixView pattern = pattern_of(a);
  const char* symmetry = a.hermitian() ? "hermitian" : pattern.symmetric() ? "symmetric" : "general";
  const bool bare = a.values.empty() && a.nonzeros() > 0;
  const std::string kind = bare ? fmt::format("coordinate pattern {}", pattern.symmetric() ? "symmetric" : "general")
                                : fmt::format("coordinate complex {}", symmetry);
  write_entries(path, pattern, a.values, kind, comment, pool);
}

void write_matrix_market_vectors(const std::string& path, Index rows, Index cols, std::span<const double> values,
                                 const std::string& comment, base::ThreadPool* pool) {
  write_array(path, rows, cols, values, "array real general", comment, pool);
}

void write_matrix_market_vectors(const std::string& path, Index rows, Index cols,
                                 std::span<const std::complex<double>> values, const std::string& comment,
                                 base::ThreadPool* pool) {
  write_array(path, rows, cols, values, "array complex general", comment, pool);
}

}  // namespace espalier::matrix
