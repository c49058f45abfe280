#include "base/output_file.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <system_error>

namespace espalier::base {

namespace {

/// A pipe, a folder, /dev/stdout: something that has no place beside it for a temporary file.
bool is_special(const std::string& path) {
  struct stat info {};
  return ::stat(path.c_str(), &info) == 0 && !S_ISREG(info.st_mode);
}

}  // namespace

OutputFile::OutputFile(std::string path) : path_(std::move(path)) {
  temporary_ = is_special(path_) ? path_ : fmt::format("{}.{}.part", path_, ::getpid());
  const bool pack = path_.size() > 3 && path_.ends_with(".gz");
  errno = 0;
  if (pack) {
    packed_ = gzopen(temporary_.c_str(), "wb6");
  } else {
    plain_ = std::fopen(temporary_.c_str(), "wb");
  }
  if (plain_ == nullptr && packed_ == nullptr) fail("cannot be written");
}

OutputFile::~OutputFile() {
  const bool open = plain_ != nullptr || packed_ != nullptr;
  if (plain_ != nullptr) std::fclose(plain_);
  if (packed_ != nullptr) gzclose(static_cast<gzFile>(packed_));
  if (open && temporary_ != path_) std::remove(temporary_.c_str());
}

void OutputFile::fail(const char* what) const {
  throw Error(StatusCode::invalid_input,
              fmt::format("{}: {}: {}", path_, what, errno != 0 ? std::strerror(errno) : "unknown reason"));
}

void OutputFile::write(std::string_view bytes) {
  if (bytes.empty()) return;  // its pointer may be null
  errno = 0;
  if (plain_ != nullptr) {
    if (std::fwrite(bytes.data(), 1, bytes.size(), plain_) != bytes.size()) fail("writing failed");
    return;
  }
  while (!bytes.empty()) {
    const auto part = std::min<std::size_t>(bytes.size(), std::size_t{1} << 30);
    if (gzwrite(static_cast<gzFile>(packed_), bytes.data(), static_cast<unsigned>(part)) <= 0) fail("writing failed");
    bytes.remove_prefix(part);
  }
}

void OutputFile::commit() {
  errno = 0;
  const bool closed = plain_ != nullptr ? std::fclose(plain_) == 0 : gzclose(static_cast<gzFile>(packed_)) == Z_OK;
  plain_ = nullptr;
  packed_ = nullptr;
  if (!closed) {
    if (temporary_ != path_) std::remove(temporary_.c_str());
    fail("writing failed");
  }
  if (temporary_ != path_ && std::rename(temporary_.c_str(), path_.c_str()) != 0) fail("cannot be renamed");
}

void check_writable(const std::string& path) {
  std::error_code error;
  if (is_special(path) && !std::filesystem::is_directory(path, error)) return;  // opening a pipe has consequences
  const OutputFile trial(path);
}

}  // namespace espalier::base
