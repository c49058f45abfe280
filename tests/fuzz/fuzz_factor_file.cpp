// Arbitrary changes of a saved factor, with checksums that fit: an error that names the file, or a factor that solves
// within its bounds. Input: the sort of matrix, then changes of two bytes for the place and one for the value.
#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "base/checksum.hpp"
#include "espalier/factor_file.hpp"
#include "matrix/generators/generate.hpp"

namespace {

using namespace espalier;
using Bytes = std::vector<char>;

// A file in memory, with a name.
class File {
 public:
  File() : descriptor_(::memfd_create("factor", MFD_CLOEXEC)), path_("/proc/self/fd/" + std::to_string(descriptor_)) {}
  ~File() { ::close(descriptor_); }
  File(const File&) = delete;
  File& operator=(const File&) = delete;
  [[nodiscard]] const std::string& path() const { return path_; }
  void write(const Bytes& bytes) const {
    if (::ftruncate(descriptor_, 0) != 0) std::abort();
    if (::pwrite(descriptor_, bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) std::abort();
  }

 private:
  int descriptor_;
  std::string path_;
};

Options small() {
  Options o;
  o.device = "cpu";
  o.threads = 1;
  o.max_block_size = 8;  // several tiles in a front
  return o;
}

template <class AnySolver, class Matrix>
Bytes saved(const Matrix& a, Kind kind) {
  Options o = small();
  o.kind = kind;
  AnySolver s(o);
  std::string folder = "/tmp/espalier-fuzz-XXXXXX";
  if (::mkdtemp(folder.data()) == nullptr || !s.analyze(a).status.ok() || !s.factorize(a).status.ok()) std::abort();
  const std::string path = folder + "/factor";
  if (!save_factor(s, path).ok()) std::abort();
  Bytes bytes(1 << 22);
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  bytes.resize(static_cast<std::size_t>(::read(file, bytes.data(), bytes.size())));
  ::close(file);
  ::unlink(path.c_str());
  ::rmdir(folder.c_str());
  return bytes;
}

SparseMatrix real(const std::vector<std::string>& words) { return matrix::generate(matrix::parse_generator(words)); }

// With imaginary parts off the diagonal.
ComplexSparseMatrix complex(const std::vector<std::string>& words, Storage storage) {
  const SparseMatrix a = real(words);
  ComplexSparseMatrix c{a.rows, a.cols, a.col_ptr, a.row_ind, {}, storage};
  for (Index j = 0; j < a.cols; ++j)
    for (auto q = static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(j)]);
         q < static_cast<std::size_t>(a.col_ptr[static_cast<std::size_t>(j) + 1]); ++q)
      c.values.emplace_back(a.values[q], a.row_ind[q] == j ? 0 : 0.1 * a.values[q]);
  return c;
}

// As factor_file.hpp describes the parts, as far as their sizes fit into the file.
void mend_checksums(Bytes& file) {
  constexpr std::size_t kHead = 24, kPartHead = 16, kSum = 8;
  const auto write_checksum = [&](std::size_t at, std::size_t bytes) {
    const std::uint64_t sum = base::checksum(file.data() + at, bytes);
    std::memcpy(file.data() + at + bytes, &sum, kSum);
  };
  write_checksum(0, kHead);
  for (std::size_t at = kHead + kSum; at + kPartHead + kSum <= file.size();) {
    std::uint64_t size = 0;
    std::memcpy(&size, file.data() + at + 8, sizeof size);
    if (size > file.size() - at - kPartHead - kSum) return;
    write_checksum(at, kPartHead + static_cast<std::size_t>(size));
    at += kPartHead + static_cast<std::size_t>(size) + kSum;
  }
}

template <class Value>
void try_out(LoadedFactorOf<Value> loaded) {
  const Status& status = loaded.result.status;
  if (status.code == StatusCode::invalid_input && status.message.find("/proc/self/fd/") != 0) std::abort();
  if (!status.ok()) return;
  std::vector<Value> x(static_cast<std::size_t>(loaded.solver.rows().count), Value(1));
  (void)loaded.solver.solve(x, x);
  (void)loaded.solver.solve(x, x, 1, Transpose::yes);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::vector<Bytes> good{
      saved<Solver>(real({"plate", "4", "4"}), Kind::llt), saved<Solver>(real({"kkt", "4", "2", "2", "2"}), Kind::ldlt),
      saved<Solver>(real({"gyroscopic", "3"}), Kind::lu),
      saved<ComplexSolver>(complex({"plate", "4", "4"}, Storage::hermitian_lower), Kind::ldlt),
      saved<ComplexSolver>(complex({"gyroscopic", "3"}, Storage::general), Kind::lu)};
  static const File file;
  if (size == 0) return 0;
  Bytes bytes = good[data[0] % good.size()];
  for (std::size_t k = 1; k + 2 < size; k += 3)
    bytes[(data[k] + 256U * data[k + 1]) % bytes.size()] = static_cast<char>(data[k + 2]);
  mend_checksums(bytes);
  file.write(bytes);
  if (data[0] % good.size() < 3)
    try_out(load_factor(file.path(), small()));
  else
    try_out(load_complex_factor(file.path(), small()));
  return 0;
}
