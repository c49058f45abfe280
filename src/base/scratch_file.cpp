#include "base/scratch_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <pthread.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <thread>
#include <vector>

#include "base/memory.hpp"
#include "base/output_file.hpp"
#include "base/stopwatch.hpp"
#include "base/timeline.hpp"
#include "espalier/types.hpp"

namespace espalier::base {

namespace {

[[noreturn]] void refuse(const std::string& folder, const char* what, int error) {
  throw Error(StatusCode::invalid_input,
              fmt::format("scratch folder {}: {}: {}; give one that is there and takes files (--scratch)", folder, what,
                          std::strerror(error)));
}

// Where the file system has no files without names, one that loses its name at once: nothing can come in between but
// a death, after which an empty file is left.
int open_nameless(const std::string& folder, int more) {
  const int descriptor = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC | more, 0600);
  if (descriptor >= 0 || (errno != EOPNOTSUPP && errno != EISDIR && errno != EINVAL && errno != ENOENT))
    return descriptor;
  std::string name = folder + "/espalier-scratch-XXXXXX";
  const int named = ::mkostemp(name.data(), O_CLOEXEC | more);
  if (named >= 0) (void)::unlink(name.c_str());
  return named;
}

// A write past the process's limit of file sizes is an error here, not the signal that ends the process.
class NoFileSizeSignal {
 public:
  NoFileSizeSignal() {
    sigemptyset(&signal_);
    sigaddset(&signal_, SIGXFSZ);
    pthread_sigmask(SIG_BLOCK, &signal_, &before_);
  }
  ~NoFileSizeSignal() {
    const timespec at_once{};
    if (sigismember(&before_, SIGXFSZ) == 0) (void)sigtimedwait(&signal_, nullptr, &at_once);
    pthread_sigmask(SIG_SETMASK, &before_, nullptr);
  }
  NoFileSizeSignal(const NoFileSizeSignal&) = delete;
  NoFileSizeSignal& operator=(const NoFileSizeSignal&) = delete;

 private:
  sigset_t signal_, before_;
};

bool is_full(int error) { return error == ENOSPC || error == EDQUOT || error == EFBIG; }

}  // namespace

std::function<int(const char* call)> ScratchFile::fault;

std::int64_t free_disk_bytes(const std::string& folder) {
  check_path(folder);
  struct statvfs info {};
  if (::statvfs(folder.c_str(), &info) != 0) refuse(folder, "it cannot be looked at", errno);
  struct stat kind {};
  if (::stat(folder.c_str(), &kind) == 0 && !S_ISDIR(kind.st_mode)) refuse(folder, "it cannot be used", ENOTDIR);
  return static_cast<std::int64_t>(info.f_bavail) * static_cast<std::int64_t>(info.f_frsize);
}

ScratchFile::ScratchFile(const std::string& folder, std::int64_t needed) : folder_(folder) {
  const std::int64_t free = free_disk_bytes(folder);
  if (needed > free)
    throw Error(
        StatusCode::out_of_memory,
        fmt::format("scratch folder {}: {} are needed, {} are free; make room, give another folder (--scratch), "
                    "or more memory (--host-memory)",
                    folder, format_bytes(needed), format_bytes(free)));
  descriptor_ = open_nameless(folder, O_DIRECT);
  direct_ = descriptor_ >= 0;
  if (!direct_) descriptor_ = open_nameless(folder, 0);
  if (descriptor_ < 0) refuse(folder, "no file can be made there", errno);
}

ScratchFile::~ScratchFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

void ScratchFile::fail(const char* what, std::int64_t at, std::int64_t bytes, int error) const {
  std::string space;
  struct statvfs info {};
  if (is_full(error) && ::fstatvfs(descriptor_, &info) == 0)
    space = fmt::format(" ({} are free there)", format_bytes(static_cast<std::int64_t>(info.f_bavail) *
                                                             static_cast<std::int64_t>(info.f_frsize)));
  throw Error(
      is_full(error) ? StatusCode::out_of_memory : StatusCode::device_error,
      fmt::format("scratch folder {}: {} {} at byte {} failed: {}{}; {}", folder_, what, format_bytes(bytes), at,
                  error == 0 ? "the file ends there" : std::strerror(error), space,
                  is_full(error) ? "make room, raise the limit of file sizes, give another folder (--scratch) or "
                                   "more memory (--host-memory)"
                                 : "the medium has failed: factorize again, with another folder (--scratch)"));
}

// Some file systems take the flag and then refuse the calls.
void ScratchFile::allow_cache() {
  const int flags = ::fcntl(descriptor_, F_GETFL);
  if (flags >= 0) (void)::fcntl(descriptor_, F_SETFL, flags & ~O_DIRECT);
  direct_ = false;
}

void ScratchFile::write(std::int64_t at, const std::byte* from, std::int64_t bytes) {
  const NoFileSizeSignal quiet;
  for (std::int64_t done = 0; done < bytes;) {
    errno = fault ? fault("write") : 0;
    const ssize_t now =
        errno != 0 ? -1 : ::pwrite(descriptor_, from + done, static_cast<std::size_t>(bytes - done), at + done);
    if (now > 0) {
      done += now;
    } else if (now < 0 && errno == EINVAL && direct_) {
      allow_cache();
    } else if (now == 0 || errno != EINTR) {
      fail("writing", at, bytes, now == 0 ? ENOSPC : errno);
    }
  }
}

void ScratchFile::read(std::int64_t at, std::byte* to, std::int64_t bytes) const {
  for (std::int64_t done = 0; done < bytes;) {
    errno = fault ? fault("read") : 0;
    const ssize_t now =
        errno != 0 ? -1 : ::pread(descriptor_, to + done, static_cast<std::size_t>(bytes - done), at + done);
    if (now > 0)
      done += now;
    else if (now == 0 || errno != EINTR)
      fail("reading", at, bytes, now == 0 ? 0 : errno);
  }
}

DiskRates measure_disk(const std::string& folder, std::int64_t bytes) {
  constexpr std::int64_t kBlock = 4 << 20;
  constexpr int kThreads = 4;
  const std::int64_t blocks = std::max<std::int64_t>(kThreads, bytes / kBlock);
  ScratchFile file(folder, blocks * kBlock);
  std::vector<std::byte> memory(static_cast<std::size_t>(kBlock + ScratchFile::kAlignment));
  std::uint32_t word = 1;
  for (std::byte& b : memory) b = static_cast<std::byte>((word = word * 1664525U + 1013904223U) >> 24);
  const auto misfit =
      static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(memory.data()) % ScratchFile::kAlignment);
  std::byte* const from = memory.data() + (ScratchFile::kAlignment - misfit) % ScratchFile::kAlignment;
  std::vector<std::vector<std::byte>> to(kThreads, memory);
  const auto rate = [&](auto&& one) {
    const double start = now_seconds();
    std::atomic<std::int64_t> next{0};
    std::vector<std::exception_ptr> failed(kThreads);
    std::vector<std::thread> threads;
    for (int t = 0; t < kThreads; ++t)
      threads.emplace_back([&, t] {
        try {
          for (std::int64_t k = next++; k < blocks; k = next++) one(k * kBlock, t);
        } catch (...) {
          failed[static_cast<std::size_t>(t)] = std::current_exception();
        }
      });
    for (std::thread& t : threads) t.join();
    for (const auto& e : failed)
      if (e) std::rethrow_exception(e);
    return static_cast<double>(blocks * kBlock) / (now_seconds() - start);
  };
  DiskRates rates;
  rates.write = rate([&](std::int64_t at, int) { file.write(at, from, kBlock); });
  rates.read = rate([&](std::int64_t at, int t) {
    std::byte* p = to[static_cast<std::size_t>(t)].data();
    const auto off = static_cast<std::int64_t>(reinterpret_cast<std::uintptr_t>(p) % ScratchFile::kAlignment);
    file.read(at, p + (ScratchFile::kAlignment - off) % ScratchFile::kAlignment, kBlock);
  });
  return rates;
}

}  // namespace espalier::base
