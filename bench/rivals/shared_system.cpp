#include "rivals/shared_system.hpp"

#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

namespace espalier::bench {
namespace {

[[noreturn]] void fail(const char* call) { throw std::system_error(errno, std::generic_category(), call); }

}  // namespace

SharedMemory::SharedMemory(std::size_t bytes) {
  descriptor_ = memfd_create("espalier-bench", MFD_CLOEXEC);
  if (descriptor_ < 0) fail("memfd_create");
  size_ = bytes;
  if (ftruncate(descriptor_, static_cast<off_t>(bytes)) != 0) fail("ftruncate");
  map();
}

SharedMemory SharedMemory::adopt(int descriptor) {
  SharedMemory memory;
  memory.descriptor_ = descriptor;
  struct stat status {};
  if (fstat(descriptor, &status) != 0) fail("fstat");
  memory.size_ = static_cast<std::size_t>(status.st_size);
  memory.map();
  return memory;
}

void SharedMemory::map() {
  void* address = mmap(nullptr, size_, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, descriptor_, 0);
  if (address == MAP_FAILED) fail("mmap");
  data_ = static_cast<std::byte*>(address);
}

SharedMemory::SharedMemory(SharedMemory&& other) noexcept
    : descriptor_(std::exchange(other.descriptor_, -1)),
      data_(std::exchange(other.data_, nullptr)),
      size_(std::exchange(other.size_, 0)) {}

SharedMemory& SharedMemory::operator=(SharedMemory&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  std::swap(data_, other.data_);
  std::swap(size_, other.size_);
  return *this;
}

SharedMemory::~SharedMemory() {
  if (data_ != nullptr) munmap(data_, size_);
  if (descriptor_ >= 0) close(descriptor_);
}

/// Stands at the start of the memory; col_ptr, values, right-hand sides and row_ind follow in this order.
struct SharedSystem::Header {
  Index rows, cols, columns;
  Storage storage;
  Numbers numbers;
  Offset nonzeros;
  [[nodiscard]] std::size_t parts() const { return static_cast<std::size_t>(base::parts_of(numbers)); }
};

SharedSystem::SharedSystem(const SystemView& a, Index columns)
    : memory_(sizeof(Header) + sizeof(Offset) * (static_cast<std::size_t>(a.cols) + 1) +
              sizeof(double) * static_cast<std::size_t>(a.parts()) *
                  (static_cast<std::size_t>(a.nonzeros()) +
                   static_cast<std::size_t>(a.rows) * static_cast<std::size_t>(columns)) +
              sizeof(Index) * static_cast<std::size_t>(a.nonzeros())) {
  header() = {a.rows, a.cols, columns, a.storage, a.numbers, a.nonzeros()};
  const SystemView copy = matrix();
  std::copy(a.col_ptr.begin(), a.col_ptr.end(), const_cast<Offset*>(copy.col_ptr.data()));
  std::copy(a.row_ind.begin(), a.row_ind.end(), const_cast<Index*>(copy.row_ind.data()));
  std::copy(a.values.begin(), a.values.end(), values().begin());
}

SharedSystem::Header& SharedSystem::header() const { return *reinterpret_cast<Header*>(memory_.bytes().data()); }

SystemView SharedSystem::matrix() const {
  const Header& h = header();
  const auto count = static_cast<std::size_t>(h.nonzeros);
  const auto* pointers = reinterpret_cast<const Offset*>(&h + 1);
  const auto* rows = reinterpret_cast<const Index*>(right_hand_sides().data() + right_hand_sides().size());
  const std::span<const Offset> columns{pointers, static_cast<std::size_t>(h.cols) + 1};
  return {MatrixView{h.rows, h.cols, columns, {rows, count}, values(), h.storage}, h.numbers};
}

std::span<double> SharedSystem::values() const {
  Header& h = header();
  auto* pointers = reinterpret_cast<Offset*>(&h + 1);
  return {reinterpret_cast<double*>(pointers + h.cols + 1), h.parts() * static_cast<std::size_t>(h.nonzeros)};
}

std::span<double> SharedSystem::right_hand_sides() const {
  const Header& h = header();
  return {values().data() + values().size(),
          h.parts() * static_cast<std::size_t>(h.rows) * static_cast<std::size_t>(h.columns)};
}

}  // namespace espalier::bench
