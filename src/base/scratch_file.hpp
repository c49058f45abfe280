/// \file
/// Files for what does not fit in memory.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>

namespace espalier::base {

/// A file without a name: it is gone when this object is, and when the process dies, however it dies. Reads and writes
/// go past the page cache where the file system allows that (O_DIRECT): pages there would be memory, too. Any thread
/// may read and write.
class ScratchFile {
 public:
  /// The alignment of addresses, places and sizes.
  static constexpr std::int64_t kAlignment = 4096;

  /// @param needed  bytes that will be written, about
  /// @throws Error(invalid_input) where the folder is none, or takes no files; Error(out_of_memory) where fewer bytes
  /// are free there
  ScratchFile(const std::string& folder, std::int64_t needed);
  ~ScratchFile();
  ScratchFile(const ScratchFile&) = delete;
  ScratchFile& operator=(const ScratchFile&) = delete;

  /// @pre all arguments are multiples of kAlignment
  /// @throws Error(out_of_memory) where the medium is full, or the process may not write as much;
  /// Error(device_error) where it fails, or the file ends too early
  void write(std::int64_t at, const std::byte* from, std::int64_t bytes);
  void read(std::int64_t at, std::byte* to, std::int64_t bytes) const;
  /// Whether the page cache is left out.
  [[nodiscard]] bool direct() const { return direct_; }

  /// For tests: asked before each system call, "write" or "read"; what is not 0 is the call's error (errno). Null:
  /// nothing is asked. From any thread.
  static std::function<int(const char* call)> fault;

 private:
  void allow_cache();
  [[noreturn]] void fail(const char* what, std::int64_t at, std::int64_t bytes, int error) const;

  std::string folder_;
  int descriptor_ = -1;
  bool direct_ = false;
};

/// Bytes that a process without rights may still write in a folder. @throws Error(invalid_input) as ScratchFile()
std::int64_t free_disk_bytes(const std::string& folder);

/// Bytes in a second that a folder's medium takes, and gives.
struct DiskRates {
  double write = 0, read = 0;
};
/// Writes some blocks as ScratchFile does, reads them, and leaves nothing. @param bytes  to write
/// @throws Error as ScratchFile
DiskRates measure_disk(const std::string& folder, std::int64_t bytes = std::int64_t{64} << 20);

}  // namespace espalier::base
