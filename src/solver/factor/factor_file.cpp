#include "solver/factor/factor_file.hpp"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace espalier::solver {

namespace {

constexpr char kFactorMagic[8] = {'E', 'S', 'P', 'F', 'A', 'C', 'T', '\0'};
constexpr std::uint32_t kByteOrder = 0x01020304;

struct FactorHead {
  char magic[8];
  std::uint32_t version, byte_order;
  std::uint64_t file_bytes;
};
static_assert(sizeof(FactorHead) == 24);

struct PartHead {
  char name[8];
  std::uint64_t bytes;
};

PartHead part_head(const char* name, std::uint64_t bytes) {
  PartHead head{{}, bytes};
  std::memcpy(head.name, name, std::min(std::strlen(name), sizeof head.name));
  return head;
}

constexpr std::uint64_t kSumBytes = sizeof(std::uint64_t);

// A checksum takes words; what is left of one waits for the next bytes.
void add_bytes(base::Checksum& sum, std::vector<std::byte>& odd, std::span<const std::byte> bytes) {
  if (!odd.empty()) {
    const std::size_t more = std::min(kSumBytes - odd.size(), bytes.size());
    odd.insert(odd.end(), bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(more));
    bytes = bytes.subspan(more);
    if (odd.size() < kSumBytes) return;
    sum.add(odd.data(), kSumBytes);
    odd.clear();
  }
  const std::size_t whole = bytes.size() / kSumBytes * kSumBytes;
  sum.add(bytes.data(), whole);
  odd.assign(bytes.begin() + static_cast<std::ptrdiff_t>(whole), bytes.end());
}

std::uint64_t finished(base::Checksum& sum, std::vector<std::byte>& odd) {
  sum.add(odd.data(), odd.size());
  odd.clear();
  return sum.value();
}

}  // namespace

FactorWriter::FactorWriter(const std::string& path, const std::vector<std::uint64_t>& bytes)
    : out_(path, base::OutputFile::Durability::power_failure) {
  if (path.ends_with(".gz"))
    throw Error(StatusCode::invalid_input, path + ": a factor is not compressed; give a name without .gz");
  FactorHead head{{}, kFactorVersion, kByteOrder, sizeof(FactorHead) + kSumBytes};
  std::memcpy(head.magic, kFactorMagic, sizeof kFactorMagic);
  for (const std::uint64_t b : bytes) head.file_bytes += sizeof(PartHead) + b + kSumBytes;
  const std::uint64_t sum = base::checksum(&head, sizeof head);
  raw(&head, sizeof head);
  raw(&sum, sizeof sum);
}

void FactorWriter::raw(const void* data, std::size_t bytes) { out_.write({static_cast<const char*>(data), bytes}); }

void FactorWriter::begin_part(const char* name, std::uint64_t bytes) {
  const PartHead head = part_head(name, bytes);
  sum_ = {};
  sum_.add(&head, sizeof head);
  raw(&head, sizeof head);
}

void FactorWriter::bytes(std::span<const std::byte> bytes) {
  add_bytes(sum_, odd_, bytes);
  raw(bytes.data(), bytes.size());
}

void FactorWriter::end_part() {
  const std::uint64_t sum = finished(sum_, odd_);
  raw(&sum, sizeof sum);
}

FactorReader::FactorReader(const std::string& path) : path_(path) {
  base::check_path(path);
  file_.reset(std::fopen(path.c_str(), "rbe"));
  if (file_ == nullptr) fail(fmt::format("it cannot be opened: {}", std::strerror(errno)));
  struct stat info {};
  if (::fstat(::fileno(file_.get()), &info) != 0 || !S_ISREG(info.st_mode)) fail("it is no regular file");
  left_of_file_ = static_cast<std::uint64_t>(info.st_size);
  const std::uint64_t file_bytes = left_of_file_;
  FactorHead head{};
  std::uint64_t sum = 0;
  raw(&head, sizeof head);
  if (std::memcmp(head.magic, kFactorMagic, sizeof kFactorMagic) != 0) fail("it is not a saved factor");
  if (head.byte_order != kByteOrder) fail("it comes from a machine with another order of bytes");
  if (head.version > kFactorVersion)
    fail(fmt::format("it has version {}, made by a newer program; this one reads up to {}", head.version,
                     kFactorVersion));
  raw(&sum, sizeof sum);
  if (sum != base::checksum(&head, sizeof head) || head.version < 1) fail("its head is damaged");
  if (head.file_bytes != file_bytes)
    fail(fmt::format("it has {} bytes of {}: it was cut off, or something was added", file_bytes, head.file_bytes));
}

void FactorReader::fail(const std::string& why) const {
  throw Error(StatusCode::invalid_input, fmt::format("{}: {}; factorize the matrix and save it again", path_, why));
}

void FactorReader::raw(void* to, std::size_t bytes) {
  if (bytes > left_of_file_) fail("it ends too early");
  if (bytes > 0 && std::fread(to, 1, bytes, file_.get()) != bytes) fail("it cannot be read to its end");
  left_of_file_ -= bytes;
}

void FactorReader::begin_part(const char* name) {
  PartHead head{};
  raw(&head, sizeof head);
  if (std::memcmp(head.name, part_head(name, 0).name, sizeof head.name) != 0)
    fail(fmt::format("its part '{}' is not where it belongs: it is damaged", name));
  if (head.bytes > left_of_file_) fail(fmt::format("its part '{}' is longer than the file: it is damaged", name));
  sum_ = {};
  sum_.add(&head, sizeof head);
  left_ = head.bytes;
}

void FactorReader::bytes(std::span<std::byte> to) {
  if (to.size() > left_) fail("one of its parts is too short");
  raw(to.data(), to.size());
  left_ -= to.size();
  add_bytes(sum_, odd_, to);
}

void FactorReader::end_part() {
  if (left_ != 0) fail("one of its parts is too long");
  std::uint64_t sum = 0;
  raw(&sum, sizeof sum);
  if (sum != finished(sum_, odd_)) fail("a checksum does not match: it is damaged");
}

}  // namespace espalier::solver
