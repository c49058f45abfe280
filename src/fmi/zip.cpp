#include "fmi/zip.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "espalier/types.hpp"

// The format: APPNOTE.TXT of PKWARE, sections 4.3.7 (local headers), 4.3.12 (central directory), 4.3.16 (its end).
namespace espalier::fmi {
namespace {

constexpr std::uint32_t kLocal = 0x04034b50, kCentral = 0x02014b50, kEnd = 0x06054b50;
constexpr std::size_t kLocalSize = 30, kCentralSize = 46, kEndSize = 22;
constexpr std::uint32_t kStored = 0, kDeflated = 8;

void append(std::string& out, std::uint64_t value, int bytes) {
  for (int k = 0; k < bytes; ++k) out += static_cast<char>(value >> (8 * k) & 0xff);
}

uInt checked_size(std::size_t bytes) {
  if (bytes > std::numeric_limits<std::int32_t>::max())
    throw Error(StatusCode::invalid_input, "a file of the archive is larger than 2 GB");
  return static_cast<uInt>(bytes);
}

std::uint32_t checksum_of(std::string_view bytes) {
  return static_cast<std::uint32_t>(
      ::crc32(0, reinterpret_cast<const Bytef*>(bytes.data()), checked_size(bytes.size())));
}

std::string deflated(std::string_view bytes) {
  z_stream stream = {};
  // The size of a library of 12 MB: 5.8 MB in 0.3 s; the best ratio would be 5.3 MB in 0.8 s.
  if (::deflateInit2(&stream, Z_BEST_SPEED, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY) != Z_OK)
    throw std::bad_alloc();
  std::string out(::deflateBound(&stream, static_cast<uLong>(bytes.size())), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = checked_size(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  const int status = ::deflate(&stream, Z_FINISH);
  out.resize(stream.total_out);
  ::deflateEnd(&stream);
  if (status != Z_STREAM_END) throw std::logic_error("deflateBound was too small");
  return out;
}

/// The common part of both headers, from "version needed" to the length of the name.
std::string header(const ZipMember& member, const std::string& packed, std::uint32_t method) {
  std::string out;
  append(out, 20, 2);       // needs version 2.0
  append(out, 1 << 11, 2);  // the name is UTF-8
  append(out, method, 2);
  append(out, 0, 2);       // at midnight
  append(out, 0x0021, 2);  // of 1 January 1980: the same archive at any time
  append(out, checksum_of(member.bytes), 4);
  append(out, packed.size(), 4);
  append(out, member.bytes.size(), 4);
  append(out, member.name.size(), 2);
  return out;
}

/// Inside the folder that the archive is unpacked into.
bool stays_inside(const std::string& name) {
  if (name.empty() || name.front() == '/' || name.find('\\') != std::string::npos ||
      name.find('\0') != std::string::npos || name.find(':') != std::string::npos)
    return false;
  for (std::size_t at = 0; at <= name.size();) {
    const std::size_t end = std::min(name.find('/', at), name.size());
    const std::string_view part = std::string_view(name).substr(at, end - at);
    if (part == ".." || part == ".") return false;
    at = end + 1;
  }
  return true;
}

}  // namespace

std::string make_zip(const std::vector<ZipMember>& members) {
  std::string out, directory;
  for (const ZipMember& member : members) {
    std::string packed = deflated(member.bytes);
    const bool smaller = packed.size() < member.bytes.size();
    if (!smaller) packed = member.bytes;
    const std::string common = header(member, packed, smaller ? kDeflated : kStored);
    append(directory, kCentral, 4);
    append(directory, 3 << 8 | 20, 2);  // made on Unix, version 2.0
    directory += common;
    append(directory, 0, 2);  // no extra field
    append(directory, 0, 2);  // no comment
    append(directory, 0, 2);  // first disk
    append(directory, 0, 2);  // binary
    const bool program = member.name.ends_with(".so");
    append(directory, static_cast<std::uint64_t>(program ? 0100755 : 0100644) << 16, 4);
    append(directory, out.size(), 4);
    directory += member.name;
    append(out, kLocal, 4);
    out += common;
    append(out, 0, 2);
    out += member.name;
    out += packed;
  }
  if (out.size() + directory.size() > std::numeric_limits<std::uint32_t>::max() || members.size() > 65535)
    throw Error(StatusCode::invalid_input, "the archive would be larger than 4 GB, or have more than 65535 files");
  const std::size_t begin = out.size();
  out += directory;
  append(out, kEnd, 4);
  append(out, 0, 4);  // disks
  append(out, members.size(), 2);
  append(out, members.size(), 2);
  append(out, directory.size(), 4);
  append(out, begin, 4);
  append(out, 0, 2);  // no comment
  return out;
}

ZipArchive::ZipArchive(std::string name, std::string bytes, std::uint64_t most)
    : name_(std::move(name)), bytes_(std::move(bytes)) {
  read_directory(most);
}

void ZipArchive::refuse(const std::string& what) const {
  throw Error(StatusCode::invalid_input, fmt::format("{}: {}", name_, what));
}

std::uint32_t ZipArchive::number(std::size_t at, int bytes) const {
  if (at > bytes_.size() || bytes_.size() - at < static_cast<std::size_t>(bytes)) refuse("the archive ends too early");
  std::uint32_t value = 0;
  for (int k = 0; k < bytes; ++k)
    value |= std::uint32_t{static_cast<unsigned char>(bytes_[at + static_cast<std::size_t>(k)])} << (8 * k);
  return value;
}

void ZipArchive::read_directory(std::uint64_t most) {
  if (bytes_.size() < kEndSize || (number(0, 4) != kLocal && number(0, 4) != kEnd))
    refuse("this is not an FMU: no ZIP archive");
  std::size_t end = std::string::npos;  // only a comment of at most 65535 bytes may follow
  for (std::size_t back = kEndSize; back <= std::min<std::size_t>(bytes_.size(), kEndSize + 65535); ++back)
    if (const std::size_t at = bytes_.size() - back; number(at, 4) == kEnd && number(at + 20, 2) + kEndSize == back) {
      end = at;
      break;
    }
  if (end == std::string::npos) refuse("the archive has no directory: it is cut off, or damaged");
  const std::uint32_t count = number(end + 10, 2);
  std::size_t at = number(end + 16, 4);
  std::uint64_t unpacked = 0, packed = 0;
  for (std::uint32_t k = 0; k < count; ++k) {
    if (number(at, 4) != kCentral) refuse("the archive's directory is damaged");
    Entry e;
    const std::uint32_t flags = number(at + 8, 2);
    e.method = number(at + 10, 2);
    e.checksum = number(at + 16, 4);
    e.packed = number(at + 20, 4);
    e.size = number(at + 24, 4);
    e.offset = number(at + 42, 4);
    const std::size_t length = number(at + 28, 2);
    const std::size_t next = at + kCentralSize + length + number(at + 30, 2) + number(at + 32, 2);
    if (next > end) refuse("the archive's directory is damaged");
    e.name = bytes_.substr(at + kCentralSize, length);
    at = next;
    if (!stays_inside(e.name)) refuse(fmt::format("'{}' would lie outside the FMU's folder", e.name));
    if ((flags & 1) != 0) refuse(fmt::format("'{}' is encrypted", e.name));
    if (e.name.ends_with('/')) continue;  // a folder
    if (find(e.name) != nullptr) refuse(fmt::format("'{}' is there twice", e.name));
    unpacked += e.size;
    packed += e.packed;
    entries_.push_back(std::move(e));
  }
  if (packed > bytes_.size()) refuse("the archive's files overlap: it is damaged, or made to fill memory");
  if (unpacked > most)
    refuse(fmt::format("it would unpack to {:.3g} MB; FMUs of at most {:.3g} MB are read",
                       static_cast<double>(unpacked) / 1e6, static_cast<double>(most) / 1e6));
}

std::vector<std::string> ZipArchive::names() const {
  std::vector<std::string> list;
  for (const Entry& e : entries_) list.push_back(e.name);
  return list;
}

const ZipArchive::Entry* ZipArchive::find(std::string_view member) const {
  const auto it = std::find_if(entries_.begin(), entries_.end(), [&](const Entry& e) { return e.name == member; });
  return it == entries_.end() ? nullptr : &*it;
}

std::string ZipArchive::read(std::string_view member) const {
  const Entry* e = find(member);
  if (e == nullptr) refuse(fmt::format("there is no '{}' in it", member));
  const auto damaged = [&] { refuse(fmt::format("'{}' in it is damaged", member)); };
  if (number(e->offset, 4) != kLocal) damaged();
  const std::size_t begin = e->offset + kLocalSize + number(e->offset + 26, 2) + number(e->offset + 28, 2);
  if (begin > bytes_.size() || bytes_.size() - begin < e->packed) damaged();
  const std::string_view packed = std::string_view(bytes_).substr(begin, e->packed);
  std::string out;
  if (e->method == kStored) {
    out = packed;
  } else if (e->method == kDeflated) {
    constexpr std::uint64_t kMostOfDeflate = 1032;  // bytes for each packed one, zlib's technical details
    if (e->size > kMostOfDeflate * e->packed + 64) damaged();
    out.resize(e->size);
    z_stream stream = {};
    if (::inflateInit2(&stream, -MAX_WBITS) != Z_OK) throw std::bad_alloc();
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
    stream.avail_in = checked_size(packed.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = checked_size(out.size());
    const int status = ::inflate(&stream, Z_FINISH);
    const bool whole = status == Z_STREAM_END && stream.total_out == out.size();
    ::inflateEnd(&stream);
    if (!whole) damaged();
  } else {
    refuse(fmt::format("'{}' in it is packed by method {}; FMUs are stored or deflated", member, e->method));
  }
  if (out.size() != e->size || checksum_of(out) != e->checksum) damaged();
  return out;
}

}  // namespace espalier::fmi
