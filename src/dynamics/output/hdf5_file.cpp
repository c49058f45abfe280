#include "dynamics/output/hdf5_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <bit>
#include <cerrno>
#include <cstring>

#include "base/output_file.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics::hdf5 {
namespace {

constexpr std::uint64_t kChunkBytes = std::uint64_t{4} << 20, kFirstRows = 64;
constexpr int kDeflate = 4;

/// First bytes of all numbers, then their second ones ...: those alike stand side by side.
std::string shuffled(const char* from, std::size_t bytes, std::size_t each) {
  if (each == 1) return {from, bytes};
  std::string out(bytes, '\0');
  const std::size_t count = bytes / each;
  for (std::size_t b = 0; b < each; ++b)
    for (std::size_t i = 0; i < count; ++i) out[b * count + i] = from[i * each + b];
  return out;
}

std::string deflated(const std::string& bytes) {
  uLongf size = compressBound(bytes.size());
  std::string out(size, '\0');
  if (compress2(reinterpret_cast<Bytef*>(out.data()), &size, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size(),
                kDeflate) != Z_OK)
    throw std::bad_alloc();
  out.resize(size);
  return out;
}

std::uint64_t pieces_of(std::uint64_t rows, std::uint64_t row_bytes) {
  return std::max<std::uint64_t>(1, (rows * row_bytes + kChunkBytes - 1) / kChunkBytes);
}

}  // namespace

File::File(const std::string& path) : path_(base::followed(path).string()), written_(path_ + ".espalier.part") {}

File::~File() {
  if (descriptor_ >= 0) ::close(descriptor_);
  if (descriptor_ >= 0 && !published_) ::unlink(written_.c_str());
}

void File::fail(const char* what) const {
  throw Error(StatusCode::invalid_input,
              fmt::format("{}: {}: {}{}", path_, what, std::strerror(errno),
                          errno == ENOSPC || errno == EFBIG || errno == EDQUOT ? " (is the disk full?)" : ""));
}

File::Object& File::object(const std::string& path) {
  std::size_t at = 0;
  for (std::size_t from = 0; from < path.size();) {
    const std::size_t to = std::min(path.find('/', from), path.size());
    const std::string name = path.substr(from, to - from);
    const std::vector<std::size_t>& members = objects_[at].members;
    const auto found =
        std::find_if(members.begin(), members.end(), [&](std::size_t m) { return objects_[m].name == name; });
    if (found != members.end()) {
      at = *found;
    } else {
      objects_[at].members.push_back(objects_.size());
      at = objects_.size();
      objects_.push_back({name, Object::Kind::group, 0, {}, {}, 0});
    }
    from = to + 1;
  }
  return objects_[at];
}

void File::add_attribute(const std::string& path, Attribute attribute) {
  object(path).attributes.push_back(std::move(attribute));
}

void File::set_attribute(const std::string& path, const std::string& name, std::int64_t value) {
  for (Attribute& a : object(path).attributes)
    if (a.name == name) a.numbers = {value};
}

int File::add_series(const std::string& path, NumberType type) {
  Object& o = object(path);
  o.kind = Object::Kind::series;
  o.number = series_.size();
  series_.push_back({{type, 0, 0, 0}, kNowhere, 0, {}});
  return static_cast<int>(o.number);
}

void File::add_name(const std::string& path, int series) {
  const auto target = std::find_if(objects_.begin(), objects_.end(), [&](const Object& o) {
    return o.kind == Object::Kind::series && o.number == place(series);
  });
  const auto index = static_cast<std::size_t>(target - objects_.begin());
  Object& o = object(path);
  o.kind = Object::Kind::name;
  o.number = index;
}

void File::add_texts(const std::string& path, const std::vector<std::string>& texts) {
  std::size_t longest = 1;
  for (const std::string& t : texts) longest = std::max(longest, t.size());
  Series& s = series_[place(add_series(path, NumberType::uint8))];
  s.shape.rows = texts.size();
  s.shape.text = longest;
  for (const std::string& t : texts) s.fixed += t + std::string(longest - t.size(), '\0');
}

int File::add_chunked(const std::string& path, NumberType type, std::uint64_t columns, std::uint64_t rows, bool fixed) {
  Object& o = object(path);
  o.kind = Object::Kind::chunked;
  o.number = chunked_.size();
  Chunked c{{type, fixed ? rows : 0, columns, 0}, 1, 1, 0, fixed, {}};
  c.pieces = pieces_of(rows, c.shape.row_bytes());
  c.chunk_rows = std::max<std::uint64_t>(1, (rows + c.pieces - 1) / c.pieces);
  if (rows == 0) c.pieces = 0;
  chunked_.push_back(std::move(c));
  return static_cast<int>(o.number);
}

std::uint64_t File::rows_per_append(int chunked) const {
  const Chunked& c = chunked_[place(chunked)];
  return c.pieces * c.chunk_rows;
}

void File::begin() {
  descriptor_ = ::open(written_.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (descriptor_ < 0) fail("cannot be written");
  fingerprint_ = crc(headers(0));
  std::uint64_t offset = record_bytes();
  for (Object& o : objects_) {
    o.offset = offset;
    offset += header_of(o, 0).size();
  }
  slot_bytes_ = (offset + 7) / 8 * 8;
  end_ = kFirstSlot + 2 * slot_bytes_;
  for (Series& s : series_) {
    if (s.fixed.empty()) continue;
    s.address = take(s.fixed.size());
    write_at(s.address, s.fixed);
    fingerprint_ ^= crc(s.fixed);
  }
}

std::string File::header_of(const Object& o, std::uint64_t base) const {
  if (o.kind == Object::Kind::name) return "";
  if (o.kind == Object::Kind::series) return contiguous_header(series_[o.number].shape, series_[o.number].address);
  if (o.kind == Object::Kind::chunked) {
    const Chunked& c = chunked_[o.number];
    return chunked_header(c.shape, c.chunk_rows, c.last.empty() ? kNowhere : c.last.back().address);
  }
  std::vector<GroupMember> links;
  for (const std::size_t m : o.members) {
    const Object& member = objects_[m];
    links.push_back(
        {member.name, base + (member.kind == Object::Kind::name ? objects_[member.number] : member).offset});
  }
  return group_header(o.attributes, links);
}

std::string File::headers(std::uint64_t base) const {
  std::string all;
  for (const Object& o : objects_) all += header_of(o, base);
  return all;
}

/// What the next run needs to go on: where arrays are, and how long.
std::string File::record() const {
  Bytes b;
  b.append(std::string(kRecord, 8));
  b.append(fingerprint_, 8);
  b.append(commits_, 8);
  for (const Series& s : series_) {
    b.append(s.address, 8);
    b.append(s.shape.rows, 8);
  }
  for (const Chunked& c : chunked_) {
    b.append(c.last.empty() ? kNowhere : c.last.back().address, 8);
    b.append(c.chunks, 8);
  }
  b.append(crc(b.text()), 8);
  return b.text();
}

void File::write_at(std::uint64_t address, const std::string& bytes) {
  for (std::size_t done = 0; done < bytes.size();) {
    errno = 0;
    const ::ssize_t n =
        ::pwrite(descriptor_, bytes.data() + done, bytes.size() - done, static_cast<::off_t>(address + done));
    if (n < 0 && errno == EINTR) continue;
    if (n == 0) errno = ENOSPC;
    if (n <= 0) fail("writing failed");
    done += static_cast<std::size_t>(n);
  }
}

std::uint64_t File::take(std::uint64_t bytes) {
  const std::uint64_t address = end_;
  end_ += (bytes + 7) / 8 * 8;
  return address;
}

void File::append(int series, double value) { append(series, std::bit_cast<std::int64_t>(value)); }

void File::append(int series, std::int64_t value) {
  Bytes b;
  b.append(static_cast<std::uint64_t>(value), 8);
  append_bytes(series_[place(series)], b.text());
}

void File::append_bytes(Series& series, const std::string& row) {
  if (series.shape.rows == series.capacity) grow(series);
  write_at(series.address + series.shape.rows * row.size(), row);
  ++series.shape.rows;
}

// The old place stays as it is: the headers that count lead there.
void File::grow(Series& s) {
  const std::uint64_t each = s.shape.row_bytes(), old = s.shape.rows * each;
  std::string rows(old, '\0');
  if (old > 0 && ::pread(descriptor_, rows.data(), old, static_cast<::off_t>(s.address)) != static_cast<::ssize_t>(old))
    fail("reading failed");
  s.capacity = std::max(kFirstRows, 2 * s.capacity);
  s.address = take(s.capacity * each);
  write_at(s.address, rows);
}

void File::append_rows(int chunked, const std::string& bytes) {
  const Chunked& c = chunked_[place(chunked)];
  const std::size_t each = c.chunk_rows * c.shape.row_bytes();
  for (std::uint64_t k = 0; k < c.pieces; ++k) {
    const std::size_t from = std::min(k * each, bytes.size());
    std::string piece = bytes.substr(from, each);
    piece.resize(each, '\0');
    append_packed(chunked, deflated(shuffled(piece.data(), each, static_cast<std::size_t>(bytes_of(c.shape.type)))));
  }
}

void File::append_packed(int chunked, const std::string& packed) {
  Chunked& c = chunked_[place(chunked)];
  const std::uint64_t address = take(packed.size());
  write_at(address, packed);
  add_child(c, 0, address, c.chunks * c.chunk_rows, packed.size());
  ++c.chunks;
  if (!c.fixed) c.shape.rows = c.chunks * c.chunk_rows;
}

std::uint64_t File::new_node(Chunked& c, std::size_t level, std::uint64_t left) {
  const std::uint64_t address = take(node_bytes(c.shape));
  write_at(address, empty_node(c.shape, static_cast<int>(level), left));
  return address;
}

void File::add_child(Chunked& c, std::size_t level, std::uint64_t child, std::uint64_t first_row,
                     std::uint64_t packed) {
  const std::size_t key = key_bytes(c.shape), entry = key + 8;
  constexpr std::size_t kHead = 24;
  const auto append_to = [&](TreeNode& node) {
    // Behind the last child stands what is behind its chunks: in nodes above the leaves, a row that is never reached.
    const std::uint64_t behind = level == 0 ? first_row + c.chunk_rows : c.chunk_rows << 31U;
    Bytes b, count;
    b.append(chunk_key(c.shape, first_row, packed));
    b.append(child, 8);
    b.append(chunk_key(c.shape, behind, 0));
    write_at(node.address + kHead + static_cast<std::size_t>(node.children) * entry, b.text());
    count.append(static_cast<std::uint64_t>(++node.children), 2);
    write_at(node.address + 6, count.text());
  };
  if (level == c.last.size()) {  // a root, above the one that has been it
    TreeNode root{new_node(c, level, kNowhere), 0};
    if (level > 0) {
      const std::uint64_t row = first_row, size = packed, own = child;
      first_row = 0;
      child = c.last.back().address;
      append_to(root);
      first_row = row, packed = size, child = own;
    }
    append_to(root);
    c.last.push_back(root);
    return;
  }
  TreeNode& node = c.last[level];
  if (node.children < kChunkChildren) return append_to(node);
  const TreeNode full = node;
  node = {new_node(c, level, full.address), 0};
  append_to(node);
  Bytes right;
  right.append(node.address, 8);
  write_at(full.address + kHead + kChunkChildren * entry, chunk_key(c.shape, first_row, 0));
  write_at(full.address + 16, right.text());
  const std::uint64_t above = node.address;
  // The root that is replaced stands first in the new one.
  if (level + 1 == c.last.size()) {
    c.last[level] = full;
    const TreeNode fresh{above, 1};
    add_child(c, level + 1, above, first_row, packed);
    c.last[level] = fresh;
    return;
  }
  add_child(c, level + 1, above, first_row, packed);
}

void File::commit() {
  const std::uint64_t slot = kFirstSlot + commits_ % 2 * slot_bytes_;
  ++commits_;
  struct stat info {};
  if (::fstat(descriptor_, &info) != 0 ||
      (static_cast<std::uint64_t>(info.st_size) < end_ && ::ftruncate(descriptor_, static_cast<::off_t>(end_)) != 0))
    fail("writing failed");
  write_at(slot, record() + headers(slot));
  write_at(0, superblock(end_, slot + record_bytes()));
}

void File::publish() {
  if (published_) return;
  if (std::rename(written_.c_str(), path_.c_str()) != 0) fail("cannot be given its name");
  published_ = true;
}

}  // namespace espalier::dynamics::hdf5
