/// \file
/// Whole files in memory: mapped where possible, unpacked where compressed.
#pragma once

#include <string>
#include <string_view>

#include "espalier/types.hpp"

namespace espalier::matrix {

/// The bytes of a file. A regular file is mapped into memory (it must not shrink meanwhile), a pipe is read to its end.
class FileBytes {
 public:
  /// @throws Error(invalid_input) when the file cannot be opened or read, with the system's reason
  /// @throws Error(out_of_memory) when a pipe or device (which may never end, as /dev/random) brings more than `limit`
  /// @param begin  of the format: of a pipe or device that begins otherwise, or with thousands of zero bytes as no
  /// format does (/dev/zero), the beginning alone is read, for the caller to refuse
  explicit FileBytes(const std::string& path, std::string_view begin = {}, Offset limit = pipe_limit());
  ~FileBytes();
  FileBytes(const FileBytes&) = delete;
  FileBytes& operator=(const FileBytes&) = delete;
  [[nodiscard]] std::string_view bytes() const { return bytes_; }

 private:
  static Offset pipe_limit();
  void read_all(int descriptor, const std::string& path, std::string_view begin, Offset limit);

  std::string_view bytes_;
  void* mapping_ = nullptr;
  std::string buffer_;
};

/// True for the two magic bytes of gzip.
bool is_gzip(std::string_view bytes);

/// Unpacks all members of a gzip stream. @param name for messages
/// @throws Error(invalid_input) when the stream is broken or truncated
/// @throws Error(out_of_memory) when it unpacks to more than half of the machine's memory
std::string gunzip(std::string_view bytes, const std::string& name);

/// Bytes of physical memory of this machine.
Offset machine_memory();

}  // namespace espalier::matrix
