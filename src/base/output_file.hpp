/// \file
/// Files that are written all or not at all.
#pragma once

#include <cstdio>
#include <string>
#include <string_view>

#include "espalier/types.hpp"

namespace espalier::base {

/// A file being written under a temporary name beside `path`; commit() gives it its name, the destructor of an
/// uncommitted one removes it. A path that ends in ".gz" is compressed.
class OutputFile {
 public:
  /// @throws Error(invalid_input) when the file cannot be made
  explicit OutputFile(std::string path);
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  /// @throws Error(invalid_input) when the medium is full or fails
  void write(std::string_view bytes);
  void commit();

 private:
  [[noreturn]] void fail(const char* what) const;

  std::string path_;
  std::string temporary_;
  std::FILE* plain_ = nullptr;
  void* packed_ = nullptr;  // gzFile
};

/// Tries whether `path` could be written, and leaves what is there as it is.
/// @throws Error(invalid_input) with the system's reason
void check_writable(const std::string& path);

}  // namespace espalier::base
