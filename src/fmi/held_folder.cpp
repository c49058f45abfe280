#include "fmi/held_folder.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "espalier/types.hpp"

namespace espalier::fmi {
namespace {

namespace fs = std::filesystem;

struct Lock {
  int file = -1;  ///< -1: there is none
  bool held = false;
};

/// The lock of a folder, open; taken where nobody else has it, and the folder is still there.
Lock lock_of(const std::string& folder, int create) {
  Lock lock;
  lock.file = ::open((folder + "/.lock").c_str(), O_RDWR | O_CLOEXEC | O_NOFOLLOW | create, 0600);
  struct stat found = {};
  lock.held = lock.file >= 0 && ::flock(lock.file, LOCK_EX | LOCK_NB) == 0 && ::fstat(lock.file, &found) == 0 &&
              found.st_nlink > 0;
  return lock;
}

void remove_abandoned(const fs::path& home, const std::string& prefix) {
  std::error_code error;
  for (auto it = fs::directory_iterator(home, error); !error && it != fs::directory_iterator(); it.increment(error)) {
    if (!it->path().filename().string().starts_with(prefix + "-")) continue;
    const std::string folder = it->path().string();
    struct stat found = {};
    if (::lstat(folder.c_str(), &found) != 0 || !S_ISDIR(found.st_mode) || found.st_uid != ::geteuid()) continue;
    // Empty, without a lock: its process has just made it, and will make another one; or it was killed there.
    if (::rmdir(folder.c_str()) == 0) continue;
    const Lock lock = lock_of(folder, 0);
    std::error_code ignored;
    if (lock.held) fs::remove_all(folder, ignored);
    if (lock.file >= 0) ::close(lock.file);
  }
}

}  // namespace

HeldFolder::HeldFolder(const std::string& prefix, const std::string& title) {
  std::error_code error;
  const fs::path home = fs::temp_directory_path(error);
  const auto refuse = [&](const std::string& folder, int why) {
    throw Error(StatusCode::invalid_input, fmt::format("{}: no folder can be made to unpack it: {}: {}", title, folder,
                                                       error ? error.message() : std::strerror(why)));
  };
  if (error) refuse("TMPDIR", 0);
  remove_abandoned(home, prefix);
  constexpr int kMostTries = 100;  // each is lost only to a process that clears folders at this very moment
  for (int k = 0; k < kMostTries; ++k) {
    path_ = (home / (prefix + "-XXXXXX")).string();
    if (::mkdtemp(path_.data()) == nullptr) refuse(path_, errno);
    errno = 0;
    const Lock lock = lock_of(path_, O_CREAT);
    const int why = errno;
    // A file system without locks: nobody can clear the folder.
    if (lock.held || (lock.file >= 0 && why != EWOULDBLOCK && why != 0)) {
      lock_ = lock.file;
      return;
    }
    if (lock.file >= 0) ::close(lock.file);
    if (lock.file < 0 && why != ENOENT) {
      ::rmdir(path_.c_str());
      refuse(path_, why);
    }
  }
  refuse(path_, EAGAIN);
}

HeldFolder::~HeldFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
  ::close(lock_);
}

}  // namespace espalier::fmi
