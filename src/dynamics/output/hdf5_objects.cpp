#include "dynamics/output/hdf5_objects.hpp"

#include <zlib.h>

#include <algorithm>
#include <bit>

namespace espalier::dynamics::hdf5 {
namespace {

const char kSignature[] = "\x89HDF\r\n\x1a\n";  // 8 bytes

enum Message : std::uint8_t {
  kDataspace = 1,
  kLinkInfo = 2,
  kDatatype = 3,
  kFillValue = 5,
  kLink = 6,
  kLayout = 8,
  kGroupInfo = 10,
  kFilters = 11,
  kAttribute = 12
};

/// IV.A.2.d
std::string datatype(NumberType type) {
  Bytes b;
  const int bytes = bytes_of(type);
  const bool real = type == NumberType::float32 || type == NumberType::float64;
  b.append(real ? 0x11 : 0x10, 1);
  b.append(real ? 0x20 : type == NumberType::int64 ? 0x08 : 0, 1);    // the leading bit is implied; signed
  b.append(real ? static_cast<std::uint64_t>(8 * bytes - 1) : 0, 1);  // where the sign is
  b.append(0, 1);
  b.append(static_cast<std::uint64_t>(bytes), 4);
  b.append(0, 2);
  b.append(static_cast<std::uint64_t>(8 * bytes), 2);
  if (!real) return b.text();
  const bool single = type == NumberType::float32;
  b.append(single ? 23 : 52, 1);
  b.append(single ? 8 : 11, 1);
  b.append(0, 1);
  b.append(single ? 23 : 52, 1);
  b.append(single ? 127 : 1023, 4);
  return b.text();
}

std::string text_datatype(std::uint64_t bytes, bool utf8) {
  Bytes b;
  b.append(0x13, 1);
  b.append(utf8 ? 0x11 : 0x01, 3);  // zeros behind the text
  b.append(bytes, 4);
  return b.text();
}

/// IV.A.2.b. @param open  whether the first dimension may grow
std::string dataspace(const std::vector<std::uint64_t>& extents, bool open) {
  Bytes b;
  b.append(2, 1);
  b.append(extents.size(), 1);
  b.append(open ? 1 : 0, 1);
  b.append(extents.empty() ? 0 : 1, 1);
  for (const std::uint64_t n : extents) b.append(n, 8);
  if (!open) return b.text();
  b.append(kNowhere, 8);
  for (std::size_t i = 1; i < extents.size(); ++i) b.append(extents[i], 8);
  return b.text();
}

void add_message(Bytes& messages, Message kind, const std::string& body) {
  messages.append(kind, 1);
  messages.append(body.size(), 2);
  messages.append(0, 1);
  messages.append(body);
}

std::string header(const Bytes& messages) {
  Bytes b;
  b.append("OHDR");
  b.append(2, 1);
  b.append(2, 1);  // the size of the messages has 4 bytes
  b.append(messages.size(), 4);
  b.append(messages.text());
  b.append(checksum(b.text()), 4);
  return b.text();
}

/// IV.A.2.m
std::string attribute_body(const Attribute& a) {
  const bool text = !a.text.empty();
  const std::string type = text ? text_datatype(a.text.size(), false) : datatype(NumberType::int64);
  const std::string space =
      text || a.single ? dataspace({}, false) : dataspace({static_cast<std::uint64_t>(a.numbers.size())}, false);
  Bytes b;
  b.append(3, 1);
  b.append(0, 1);
  b.append(a.name.size() + 1, 2);
  b.append(type.size(), 2);
  b.append(space.size(), 2);
  b.append(0, 1);
  b.append(a.name);
  b.append(0, 1);
  b.append(type);
  b.append(space);
  b.append(a.text);
  for (const std::int64_t n : a.numbers) b.append(static_cast<std::uint64_t>(n), 8);
  return b.text();
}

std::vector<std::uint64_t> extents_of(const ArrayExtents& shape) {
  return shape.columns == 0 ? std::vector{shape.rows} : std::vector{shape.rows, shape.columns};
}

std::string array_header(const ArrayExtents& shape, bool chunked, const std::string& layout,
                         const std::string& filters) {
  Bytes m, fill;
  add_message(m, kDataspace, dataspace(extents_of(shape), chunked));
  add_message(m, kDatatype, shape.text > 0 ? text_datatype(shape.text, true) : datatype(shape.type));
  fill.append(3, 1);
  fill.append(chunked ? 0x0B : 0x0A, 1);  // room as it is needed; the usual value
  add_message(m, kFillValue, fill.text());
  add_message(m, kLayout, layout);
  if (!filters.empty()) add_message(m, kFilters, filters);
  return header(m);
}

std::uint32_t rotated(std::uint32_t x, int by) { return std::rotl(x, by); }

}  // namespace

int bytes_of(NumberType type) { return type == NumberType::uint8 ? 1 : type == NumberType::float32 ? 4 : 8; }

std::uint32_t crc(const std::string& bytes) {
  return static_cast<std::uint32_t>(crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

void Bytes::append(std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) text_ += static_cast<char>(i < 8 ? value >> 8 * i & 0xFFU : 0);
}

std::uint64_t number_at(const char* from, int bytes) {
  std::uint64_t value = 0;
  for (int i = 0; i < bytes; ++i) value |= std::uint64_t{static_cast<unsigned char>(from[i])} << 8 * i;
  return value;
}

std::uint32_t checksum(const std::string& bytes) {
  std::uint32_t a = 0xDEADBEEFU + static_cast<std::uint32_t>(bytes.size()), b = a, c = a;
  const char* k = bytes.data();
  std::size_t left = bytes.size();
  const auto word = [&](std::size_t from) {
    return from >= left ? 0U
                        : static_cast<std::uint32_t>(
                              number_at(k + from, static_cast<int>(std::min<std::size_t>(4, left - from))));
  };
  for (; left > 12; left -= 12, k += 12) {
    a += word(0), b += word(4), c += word(8);
    a -= c, a ^= rotated(c, 4), c += b;
    b -= a, b ^= rotated(a, 6), a += c;
    c -= b, c ^= rotated(b, 8), b += a;
    a -= c, a ^= rotated(c, 16), c += b;
    b -= a, b ^= rotated(a, 19), a += c;
    c -= b, c ^= rotated(b, 4), b += a;
  }
  if (left == 0) return c;
  a += word(0), b += word(4), c += word(8);
  c ^= b, c -= rotated(b, 14);
  a ^= c, a -= rotated(c, 11);
  b ^= a, b -= rotated(a, 25);
  c ^= b, c -= rotated(b, 16);
  a ^= c, a -= rotated(c, 4);
  b ^= a, b -= rotated(a, 14);
  c ^= b, c -= rotated(b, 24);
  return c;
}

std::string superblock(std::uint64_t end, std::uint64_t root) {
  Bytes b;
  b.append(std::string(kSignature, 8));
  b.append(2, 1);
  b.append(8, 1);  // bytes of addresses and lengths
  b.append(8, 1);
  b.append(0, 1);  // nobody has it open for writing
  b.append(0, 8);
  b.append(kNowhere, 8);
  b.append(end, 8);
  b.append(root, 8);
  b.append(checksum(b.text()), 4);
  return b.text();
}

std::uint64_t root_of(const std::string& bytes) {
  if (bytes.size() != kSuperblock) return kNowhere;
  const std::uint64_t end = number_at(bytes.data() + 28, 8), root = number_at(bytes.data() + 36, 8);
  return bytes == superblock(end, root) ? root : kNowhere;
}

std::string group_header(const std::vector<Attribute>& attributes, const std::vector<GroupMember>& links) {
  Bytes m, info;
  info.append(0, 2);
  info.append(kNowhere, 8);
  info.append(kNowhere, 8);
  add_message(m, kLinkInfo, info.text());
  add_message(m, kGroupInfo, std::string(2, '\0'));
  for (const Attribute& a : attributes) add_message(m, kAttribute, attribute_body(a));
  for (const GroupMember& link : links) {
    Bytes b;
    b.append(1, 1);
    b.append(0x11, 1);  // the length of the name has 2 bytes; UTF-8
    b.append(1, 1);
    b.append(link.name.size(), 2);
    b.append(link.name);
    b.append(link.address, 8);
    add_message(m, kLink, b.text());
  }
  return header(m);
}

std::uint64_t ArrayExtents::row_bytes() const {
  return (text > 0 ? text : static_cast<std::uint64_t>(bytes_of(type))) * std::max<std::uint64_t>(1, columns);
}

std::string contiguous_header(const ArrayExtents& shape, std::uint64_t address) {
  Bytes layout;
  layout.append(3, 1);
  layout.append(1, 1);
  layout.append(address, 8);
  layout.append(shape.rows * shape.row_bytes(), 8);
  return array_header(shape, false, layout.text(), "");
}

std::string chunked_header(const ArrayExtents& shape, std::uint64_t chunk_rows, std::uint64_t index) {
  const auto bytes = static_cast<std::uint64_t>(bytes_of(shape.type));
  Bytes layout, filters;
  layout.append(3, 1);
  layout.append(2, 1);
  layout.append(shape.columns == 0 ? 2 : 3, 1);
  layout.append(index, 8);
  layout.append(chunk_rows, 4);
  if (shape.columns > 0) layout.append(shape.columns, 4);
  layout.append(bytes, 4);
  filters.append(2, 1);
  filters.append(2, 1);
  for (const auto& [filter, value] : {std::pair{2, bytes}, std::pair{1, std::uint64_t{4}}}) {  // shuffle, deflate
    filters.append(static_cast<std::uint64_t>(filter), 2);
    filters.append(0, 2);
    filters.append(1, 2);
    filters.append(value, 4);
  }
  return array_header(shape, true, layout.text(), filters.text());
}

std::size_t key_bytes(const ArrayExtents& shape) { return shape.columns == 0 ? 24 : 32; }

std::size_t node_bytes(const ArrayExtents& shape) {
  return 24 + (kChunkChildren + 1) * key_bytes(shape) + kChunkChildren * 8;
}

std::string chunk_key(const ArrayExtents& shape, std::uint64_t first_row, std::uint64_t packed) {
  Bytes b;
  b.append(packed, 4);
  b.append(0, 4);
  b.append(first_row, 8);
  b.pad(key_bytes(shape));
  return b.text();
}

std::string empty_node(const ArrayExtents& shape, int level, std::uint64_t left) {
  Bytes b;
  b.append("TREE");
  b.append(1, 1);
  b.append(static_cast<std::uint64_t>(level), 1);
  b.append(0, 2);
  b.append(left, 8);
  b.append(kNowhere, 8);
  b.pad(node_bytes(shape));
  return b.text();
}

}  // namespace espalier::dynamics::hdf5
