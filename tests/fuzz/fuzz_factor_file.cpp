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

Bytes saved(const std::vector<std::string>& words, Kind kind) {
  const SparseMatrix a = matrix::generate(matrix::parse_generator(words));
  Options o = small();
  o.kind = kind;
  Solver s(o);
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

// As factor_file.hpp describes the parts, as far as their sizes fit into the file.
void mend_checksums(Bytes& file) {
  constexpr std::size_t kHead = 24, kPartHead = 16, kSum = 8;
  const auto put = [&](std::size_t at, std::size_t bytes) {
    const std::uint64_t sum = base::checksum(file.data() + at, bytes);
    std::memcpy(file.data() + at + bytes, &sum, kSum);
  };
  put(0, kHead);
  for (std::size_t at = kHead + kSum; at + kPartHead + kSum <= file.size();) {
    std::uint64_t size = 0;
    std::memcpy(&size, file.data() + at + 8, sizeof size);
    if (size > file.size() - at - kPartHead - kSum) return;
    put(at, kPartHead + static_cast<std::size_t>(size));
    at += kPartHead + static_cast<std::size_t>(size) + kSum;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const std::vector<Bytes> good{saved({"plate", "4", "4"}, Kind::llt),
                                       saved({"kkt", "4", "2", "2", "2"}, Kind::ldlt),
                                       saved({"gyroscopic", "3"}, Kind::lu)};
  static const File file;
  if (size == 0) return 0;
  Bytes bytes = good[data[0] % good.size()];
  for (std::size_t k = 1; k + 2 < size; k += 3)
    bytes[(data[k] + 256U * data[k + 1]) % bytes.size()] = static_cast<char>(data[k + 2]);
  mend_checksums(bytes);
  file.write(bytes);
  LoadedFactor loaded = load_factor(file.path(), small());
  const Status& status = loaded.result.status;
  if (status.code == StatusCode::invalid_input && status.message.find("/proc/self/fd/") != 0) std::abort();
  if (!status.ok()) return 0;
  const auto n = static_cast<std::size_t>(loaded.solver.rows().count);
  std::vector<double> x(n, 1);
  (void)loaded.solver.solve(x, x);
  (void)loaded.solver.solve(x, x, 1, Transpose::yes);
  return 0;
}
