/// \file
/// Folders of tests for files without names, and disks that fail.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <string>

#include "base/scratch_file.hpp"
#include "espalier/types.hpp"

namespace espalier::test {

inline constexpr Offset kDiskBlock = base::ScratchFile::kAlignment;

// A folder of the test's own, which must be empty in the end.
class DiskFolder {
 public:
  DiskFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "espalier-disk-XXXXXX").string();
    EXPECT_NE(::mkdtemp(name.data()), nullptr);
    path_ = name;
  }
  ~DiskFolder() {
    EXPECT_TRUE(!std::filesystem::exists(path_) || std::filesystem::is_empty(path_)) << "a file was left behind";
    std::filesystem::remove_all(path_);
  }
  DiskFolder(const DiskFolder&) = delete;
  DiskFolder& operator=(const DiskFolder&) = delete;
  [[nodiscard]] std::string path() const { return path_; }
  // A second descriptor of the file without a name that is open there; -1: none is.
  [[nodiscard]] int open_file() const {
    for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
      std::error_code error;
      const std::string target = std::filesystem::read_symlink(entry.path(), error).string();
      if (target.starts_with(path_ + "/")) return ::open(entry.path().c_str(), O_RDWR);
    }
    return -1;
  }

 private:
  std::string path_;
};

// Refuses one system call.
class DiskFault {
 public:
  DiskFault(const char* call, int number, int error) {
    base::ScratchFile::fault = [this, wanted = std::string(call), number, error](const char* asked) {
      if (wanted != asked || ++count_ != number) return 0;
      return error;
    };
  }
  ~DiskFault() { base::ScratchFile::fault = nullptr; }
  DiskFault(const DiskFault&) = delete;
  DiskFault& operator=(const DiskFault&) = delete;
  [[nodiscard]] int calls() const { return count_; }

 private:
  std::atomic<int> count_{0};
};

template <class Use>
Status status_of(Use&& use) {
  try {
    use();
  } catch (const Error& e) {
    return e.status();
  }
  return {};
}

inline bool says(const Status& s, const std::string& what) { return s.message.find(what) != std::string::npos; }

}  // namespace espalier::test
