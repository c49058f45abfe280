#include "matrix/binary.hpp"

#include <fmt/format.h>

#include <cstring>

#include "base/checksum.hpp"
#include "base/output_file.hpp"
#include "matrix/entries.hpp"
#include "matrix/text.hpp"
#include "matrix/validate.hpp"

namespace espalier::matrix {

namespace {

constexpr std::string_view kMagic = "ESPALMTX";
constexpr std::uint32_t kVersion = 1;
constexpr std::uint32_t kByteOrder = 0x01020304;
constexpr std::uint32_t kStorages = 4;

struct Header {
  char magic[8];
  std::uint32_t version;
  std::uint32_t byte_order;
  std::int32_t rows;
  std::int32_t cols;
  std::int64_t entries;
  std::uint32_t storage;
  std::uint32_t has_values;
  std::uint64_t data_checksum;
  std::uint64_t header_checksum;
};
static_assert(sizeof(Header) == 56);
constexpr std::size_t kData = sizeof(Header) - sizeof(std::uint64_t);  // data_checksum covers from here on
constexpr std::size_t kHeaderChecked = kData - sizeof(std::uint64_t);  // header_checksum covers up to here

Header read_header(const Source& source) {
  Header header{};
  if (source.text.size() < sizeof header) fail(source, "the binary matrix is truncated within its header");
  std::memcpy(&header, source.text.data(), sizeof header);
  if (header.byte_order == __builtin_bswap32(kByteOrder))
    fail(source, "written on a machine of the other byte order; convert it there to Matrix Market");
  if (header.version != kVersion)
    fail(source,
         fmt::format("version {} of the binary format; this program reads version {}", header.version, kVersion));
  if (header.byte_order != kByteOrder || header.header_checksum != base::checksum(&header, kHeaderChecked))
    fail(source, "the header of the binary matrix is damaged; write the file again");
  if (header.rows < 0 || header.cols < 0 || header.entries < 0 || header.storage >= kStorages || header.has_values > 1)
    fail(source, "the header of the binary matrix holds impossible sizes");
  return header;
}

// Bytes that a file with this header has; saturates instead of overflowing.
std::uint64_t expected_bytes(const Header& h) {
  const std::uint64_t per_entry = sizeof(Index) + (h.has_values != 0 ? sizeof(double) : 0);
  const auto entries = static_cast<std::uint64_t>(h.entries);
  if (entries > (std::uint64_t{1} << 59)) return ~std::uint64_t{0};
  return sizeof(Header) + (static_cast<std::uint64_t>(h.cols) + 1) * sizeof(Offset) + entries * per_entry;
}

template <class T>
std::vector<T> take(const char*& p, std::size_t count) {
  std::vector<T> v(count);
  if (count > 0) std::memcpy(v.data(), p, count * sizeof(T));
  p += count * sizeof(T);
  return v;
}

template <class T>
std::string_view bytes_of(std::span<const T> v) {
  return {reinterpret_cast<const char*>(v.data()), v.size() * sizeof(T)};
}

}  // namespace

bool is_binary_matrix(std::string_view bytes) { return bytes.substr(0, kMagic.size()) == kMagic; }

SparseMatrix parse_binary(std::string_view bytes, const std::string& name) {
  const Source source{name, bytes};
  const Header header = read_header(source);
  check_sizes(header.rows, header.cols, header.entries, source, bytes.data());
  if (expected_bytes(header) != bytes.size())
    fail(source, fmt::format("the binary matrix has {} bytes, its header promises {}; it is truncated or damaged",
                             bytes.size(), expected_bytes(header)));
  if (header.data_checksum != base::checksum(bytes.data() + kData, bytes.size() - kData))
    fail(source, "the checksum of the binary matrix is wrong: the file is damaged; write or fetch it again");
  const char* p = bytes.data() + sizeof header;
  const auto entries = at(header.entries);
  SparseMatrix a;
  a.rows = header.rows;
  a.cols = header.cols;
  a.storage = static_cast<Storage>(header.storage);
  a.col_ptr = take<Offset>(p, at(header.cols) + 1);
  a.values = take<double>(p, header.has_values != 0 ? entries : 0);
  a.row_ind = take<Index>(p, entries);
  try {
    validate(a);
  } catch (const Error& error) {
    fail(source, error.what());
  }
  return a;
}

void write_binary(const std::string& path, const MatrixView& a) {
  Header header{};
  std::memcpy(header.magic, kMagic.data(), kMagic.size());
  header.version = kVersion;
  header.byte_order = kByteOrder;
  header.rows = a.rows;
  header.cols = a.cols;
  header.entries = a.nonzeros();
  header.storage = static_cast<std::uint32_t>(a.storage);
  header.has_values = a.values.empty() ? 0 : 1;
  header.header_checksum = base::checksum(&header, kHeaderChecked);
  const std::string_view parts[] = {bytes_of(a.col_ptr), bytes_of(a.values), bytes_of(a.row_ind)};
  base::Checksum sum;
  sum.add(&header.header_checksum, sizeof header.header_checksum);
  for (const auto part : parts) sum.add(part.data(), part.size());
  header.data_checksum = sum.value();
  base::OutputFile file(path);
  file.write({reinterpret_cast<const char*>(&header), sizeof header});
  for (const auto part : parts) file.write(part);
  file.commit();
}

}  // namespace espalier::matrix
