#include "base/output_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <system_error>
#include <utility>

namespace espalier::base {

namespace {

namespace fs = std::filesystem;

constexpr std::string_view kEnding = ".espalier.part";

[[noreturn]] void refuse(const std::string& path, const char* what, const char* why) {
  throw Error(StatusCode::invalid_input, fmt::format("{}: {}: {}", path, what, why));
}

/// The number of this process's open descriptor that a name such as /proc/self/fd/1 stands for, or -1.
int descriptor_of(const fs::path& name) {
  bool own = false;
  std::error_code error;
  for (const char* folder : {"/proc/self/fd", "/proc/thread-self/fd"})
    own = own || name.parent_path() == fs::canonical(folder, error);
  const std::string digits = name.filename().string();
  int number = -1;
  const auto [end, bad] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  return own && bad == std::errc() && end == digits.data() + digits.size() ? number : -1;
}

bool same_inode(int descriptor, const std::string& path) {
  struct stat open {
  }, named{};
  return ::fstat(descriptor, &open) == 0 && ::lstat(path.c_str(), &named) == 0 && open.st_dev == named.st_dev &&
         open.st_ino == named.st_ino;
}

/// Removes a temporary file that nobody writes any more. @return false when it is in use, or not ours to remove
bool remove_if_abandoned(const std::string& path) {
  const int descriptor = ::open(path.c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
  if (descriptor < 0) return false;
  const bool removed =
      ::flock(descriptor, LOCK_EX | LOCK_NB) == 0 && same_inode(descriptor, path) && ::unlink(path.c_str()) == 0;
  ::close(descriptor);
  return removed;
}

/// The file that is replaced keeps its owner (where that is allowed) and its permissions.
void take_over_permissions(int descriptor, const std::string& target) {
  struct stat old {};
  if (::stat(target.c_str(), &old) != 0) return;
  [[maybe_unused]] const int owner = ::fchown(descriptor, old.st_uid, old.st_gid);
  [[maybe_unused]] const int mode = ::fchmod(descriptor, old.st_mode & 0777U);
}

}  // namespace

void check_path(std::string_view path) {
  const std::size_t zero = path.find('\0');
  if (zero == std::string_view::npos) return;
  throw Error(StatusCode::invalid_input,
              fmt::format("{}...: the path holds a zero byte after {} characters, where the system would end it; leave "
                          "it out",
                          path.substr(0, zero), zero));
}

fs::path followed(const std::string& path) {
  check_path(path);
  constexpr int kMostLinks = 40;  // as Linux has it
  std::error_code error;
  fs::path at = fs::absolute(path, error);
  for (int links = 0; links < kMostLinks; ++links) {
    const fs::path name = at.filename();
    if (name.empty() || name == "." || name == "..") refuse(path, "cannot be written", "it is the name of a folder");
    const fs::path folder = fs::canonical(at.parent_path(), error);
    if (error) refuse(path, "cannot be written", error.message().c_str());
    at = folder / name;
    const fs::path link = fs::read_symlink(at, error);
    if (error || descriptor_of(at) >= 0) return at;
    at = link.is_absolute() ? link : folder / link;
  }
  refuse(path, "cannot be written", std::strerror(ELOOP));
}

OutputFile::OutputFile(std::string path, Durability durability) : path_(std::move(path)), durability_(durability) {
  try {
    open();
  } catch (...) {
    if (!temporary_.empty()) std::remove(temporary_.c_str());
    if (lock_ >= 0) ::close(lock_);
    throw;
  }
}

void OutputFile::open() {
  const fs::path target = followed(path_);
  struct stat info {};
  const bool there = ::stat(target.c_str(), &info) == 0;
  int descriptor = descriptor_of(target);
  errno = 0;
  if (descriptor >= 0) {  // a second one: it shares the place in the file
    std::fflush(stdout);
    descriptor = ::fcntl(descriptor, F_DUPFD_CLOEXEC, 3);
  } else if (there && S_ISDIR(info.st_mode)) {
    errno = EISDIR;
  } else if (there && !S_ISREG(info.st_mode)) {
    descriptor = ::open(target.c_str(), O_WRONLY | O_CLOEXEC | O_NOCTTY);
  } else {
    descriptor = open_temporary(target);
  }
  if (descriptor < 0) fail("cannot be written");
  if (path_.size() > 3 && path_.ends_with(".gz")) {
    packed_ = gzdopen(descriptor, "wb6");
  } else {
    plain_ = ::fdopen(descriptor, "wb");
  }
  if (plain_ == nullptr && packed_ == nullptr) {
    ::close(descriptor);
    fail("cannot be written");
  }
}

int OutputFile::open_temporary(const fs::path& target) {
  target_ = target.string();
  const bool there = ::access(target_.c_str(), F_OK) == 0;
  if (there ? ::access(target_.c_str(), W_OK) != 0 : errno == ENAMETOOLONG) return -1;
  constexpr std::size_t kLongest = 200;  // of a name, so that the ending fits into the 255 bytes of most file systems
  const std::string stem = (target.parent_path() / target.filename().string().substr(0, kLongest)).string();
  temporary_ = fmt::format("{}{}", stem, kEnding);
  int descriptor = make_locked();
  constexpr int kMostWriters = 100;
  for (int k = 0; descriptor < 0 && errno == EEXIST && k < kMostWriters; ++k) {
    temporary_ = fmt::format("{}.{}-{}{}", stem, ::getpid(), k, kEnding);
    descriptor = ::open(temporary_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor >= 0) static_cast<void>(::flock(descriptor, LOCK_EX | LOCK_NB));
  }
  if (descriptor < 0) {
    temporary_.clear();
    return -1;
  }
  take_over_permissions(descriptor, target_);
  lock_ = ::fcntl(descriptor, F_DUPFD_CLOEXEC, 3);
  return descriptor;
}

int OutputFile::make_locked() {
  for (;;) {
    const int descriptor = ::open(temporary_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor < 0) {
      if (errno != EEXIST) return -1;
      if (remove_if_abandoned(temporary_)) continue;
      errno = EEXIST;
      return -1;
    }
    // File systems without locks are taken as they are: there nobody can tell that a file is abandoned.
    const bool taken = ::flock(descriptor, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK;
    if (!taken && same_inode(descriptor, temporary_)) return descriptor;
    ::close(descriptor);  // somebody held it for abandoned before it was locked
  }
}

OutputFile::~OutputFile() {
  const bool open = plain_ != nullptr || packed_ != nullptr;
  if (open && !temporary_.empty()) std::remove(temporary_.c_str());
  if (plain_ != nullptr) std::fclose(plain_);
  if (packed_ != nullptr) gzclose(static_cast<gzFile>(packed_));
  if (lock_ >= 0) ::close(lock_);
}

void OutputFile::fail(const char* what) const {
  refuse(path_, what, errno != 0 ? std::strerror(errno) : "unknown reason");
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
    if (gzwrite(static_cast<gzFile>(packed_), bytes.data(), static_cast<unsigned>(part)) <= 0) abandon_packed();
    bytes.remove_prefix(part);
  }
}

void OutputFile::abandon_packed() {
  const int reason = errno;
  gzclose(static_cast<gzFile>(std::exchange(packed_, nullptr)));
  if (!temporary_.empty()) std::remove(temporary_.c_str());
  errno = reason;
  fail("writing failed");
}

void OutputFile::commit() {
  errno = 0;
  bool good = plain_ != nullptr ? std::fclose(plain_) == 0 : gzclose(static_cast<gzFile>(packed_)) == Z_OK;
  plain_ = nullptr;
  packed_ = nullptr;
  if (temporary_.empty()) {
    if (!good) fail("writing failed");
    return;
  }
  if (good && durability_ == Durability::power_failure && lock_ >= 0) good = ::fsync(lock_) == 0;
  if (!good) {
    std::remove(temporary_.c_str());
    fail("writing failed");
  }
  if (std::rename(temporary_.c_str(), target_.c_str()) != 0) {
    const int reason = errno;
    const bool there = ::access(temporary_.c_str(), F_OK) == 0;  // not where the whole folder has gone
    errno = reason;
    fail(there ? fmt::format("cannot be given its name (its content is in '{}')", temporary_).c_str()
               : "cannot be given its name");
  }
}

bool same_file(const std::string& a, const std::string& b) {
  std::error_code error;
  if (fs::exists(a, error) && fs::exists(b, error)) return fs::is_regular_file(a, error) && fs::equivalent(a, b, error);
  try {
    return followed(a) == followed(b);
  } catch (const Error&) {
    return false;  // a folder that is not there; who writes into it will say so
  }
}

void check_writable(const std::string& path) {
  const fs::path target = followed(path);
  const int descriptor = descriptor_of(target);
  struct stat info {};
  const bool special = ::stat(target.c_str(), &info) == 0 && !S_ISREG(info.st_mode) && !S_ISDIR(info.st_mode);
  if (descriptor < 0 && !special) {
    const OutputFile trial(path);
    return;
  }
  // Opening a pipe has consequences.
  errno = 0;
  const int flags = descriptor < 0 ? O_WRONLY : ::fcntl(descriptor, F_GETFL);
  if (flags >= 0 && (flags & O_ACCMODE) == O_RDONLY) errno = EBADF;
  const bool writable = errno == 0 && (descriptor >= 0 || ::access(target.c_str(), W_OK) == 0);
  if (!writable) refuse(path, "cannot be written", std::strerror(errno));
}

void remove_abandoned(const std::string& folder) noexcept {
  try {
    std::error_code error;
    for (const auto& entry : fs::directory_iterator(folder, error))
      if (entry.path().string().ends_with(kEnding)) remove_if_abandoned(entry.path().string());
  } catch (const std::exception&) {  // what cannot be listed stays
  }
}

}  // namespace espalier::base
