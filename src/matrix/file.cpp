#include "matrix/file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "base/memory.hpp"
#include "base/output_file.hpp"

namespace espalier::matrix {

namespace {

constexpr std::size_t kChunk = std::size_t{1} << 20;  // bytes per read from a pipe and per step of zlib's output

[[noreturn]] void cannot_read(const std::string& path, const char* reason) {
  throw Error(StatusCode::invalid_input, fmt::format("{}: cannot be read: {}", path, reason));
}

struct Descriptor {
  int fd;
  ~Descriptor() { ::close(fd); }
};

// Owns zlib's state of one unpacking.
struct Inflater {
  z_stream stream{};
  Inflater() {
    constexpr int kGzipOnly = 16 + MAX_WBITS;
    if (inflateInit2(&stream, kGzipOnly) != Z_OK) throw Error(StatusCode::out_of_memory, "zlib: no memory to unpack");
  }
  ~Inflater() { inflateEnd(&stream); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
};

// zlib counts in 32 bits: hands over the next part of `rest` when the last one has been used up.
void feed(z_stream& stream, std::string_view& rest) {
  if (stream.avail_in > 0) return;
  const std::size_t part = std::min<std::size_t>(rest.size(), std::size_t{1} << 30);
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(rest.data()));
  stream.avail_in = static_cast<uInt>(part);
  rest.remove_prefix(part);
}

}  // namespace

FileBytes::FileBytes(const std::string& path, std::string_view begin, Offset limit) {
  base::check_path(path);
  const Descriptor file{::open(path.c_str(), O_RDONLY | O_CLOEXEC)};
  if (file.fd < 0) cannot_read(path, std::strerror(errno));
  struct stat info {};
  if (::fstat(file.fd, &info) != 0) cannot_read(path, std::strerror(errno));
  if (S_ISDIR(info.st_mode)) cannot_read(path, "it is a directory");
  if (S_ISREG(info.st_mode) && info.st_size > 0) {
    const auto size = at(info.st_size);
    void* p = ::mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.fd, 0);
    if (p != MAP_FAILED) {
      (void)::madvise(p, size, MADV_WILLNEED);
      mapping_ = p;
      bytes_ = {static_cast<const char*>(p), size};
      return;
    }
  }
  read_all(file.fd, path, begin, limit);
}

FileBytes::~FileBytes() {
  if (mapping_ != nullptr) ::munmap(mapping_, bytes_.size());
}

// While the buffer grows it stands in memory twice.
Offset FileBytes::pipe_limit() { return machine_memory() / 3; }

void FileBytes::read_all(int descriptor, const std::string& path, std::string_view begin, Offset limit) {
  constexpr std::size_t kNothing = 4096;  // zero bytes
  const auto foreign = [&] {
    const std::string_view head = std::string_view(buffer_).substr(0, kNothing);
    return !head.starts_with(begin.substr(0, head.size())) ||
           (head.size() == kNothing && head.find_first_not_of('\0') == std::string_view::npos);
  };
  for (;;) {
    const std::size_t old = buffer_.size();
    buffer_.resize(old + kChunk);
    const ssize_t got = ::read(descriptor, buffer_.data() + old, kChunk);
    if (got < 0 && errno != EINTR) cannot_read(path, std::strerror(errno));
    buffer_.resize(old + static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
    if (got == 0 || foreign()) break;
    if (static_cast<Offset>(buffer_.size()) > limit)
      throw Error(StatusCode::out_of_memory,
                  fmt::format("{}: brings more than {} without an end; give a file instead of a pipe or device", path,
                              base::format_bytes(limit)));
  }
  bytes_ = buffer_;
}

bool is_gzip(std::string_view bytes) { return bytes.size() >= 2 && bytes[0] == '\x1f' && bytes[1] == '\x8b'; }

Offset machine_memory() { return static_cast<Offset>(::sysconf(_SC_PHYS_PAGES)) * ::sysconf(_SC_PAGE_SIZE); }

std::string gunzip(std::string_view bytes, const std::string& name) {
  const auto limit = at(machine_memory() / 2);
  Inflater inflater;
  z_stream& stream = inflater.stream;
  std::string_view rest = bytes;
  std::string text;
  std::size_t used = 0;
  for (;;) {
    feed(stream, rest);
    if (text.size() == used) text.resize(std::max(kChunk, used + used / 2));
    const std::size_t room = std::min<std::size_t>(text.size() - used, std::size_t{1} << 30);
    stream.next_out = reinterpret_cast<Bytef*>(text.data() + used);
    stream.avail_out = static_cast<uInt>(room);
    const int result = inflate(&stream, Z_NO_FLUSH);
    used += room - stream.avail_out;
    if (used > limit)
      throw Error(StatusCode::out_of_memory, fmt::format("{}: unpacks to more than {}, half of this machine's memory",
                                                         name, base::format_bytes(static_cast<std::int64_t>(limit))));
    if (result == Z_STREAM_END) {
      feed(stream, rest);
      const bool another = stream.avail_in >= 2 && stream.next_in[0] == 0x1f && stream.next_in[1] == 0x8b;
      if (!another) break;  // what follows the last member is padding
      inflateReset(&stream);
    } else if (result == Z_BUF_ERROR ||
               (result == Z_OK && stream.avail_in == 0 && rest.empty() && stream.avail_out > 0)) {
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}: the gzip stream is truncated; fetch the file again", name));
    } else if (result != Z_OK) {
      throw Error(StatusCode::invalid_input, fmt::format("{}: the gzip stream is broken ({}); fetch the file again",
                                                         name, stream.msg != nullptr ? stream.msg : "no reason given"));
    }
  }
  text.resize(used);
  return text;
}

}  // namespace espalier::matrix
