/// \file
/// Where the files that a model names come from: the disk, or what the caller has instead (an FMU holds its model's).
#pragma once

#include <string>

namespace espalier::dynamics {

class FileSource {
 public:
  FileSource() = default;
  virtual ~FileSource() = default;
  FileSource(const FileSource&) = delete;
  FileSource& operator=(const FileSource&) = delete;

  /// As read_whole_file(), of the path that a reader asks for. @throws Error(invalid_input) naming the file
  [[nodiscard]] virtual std::string read(const std::string& path) = 0;
  [[nodiscard]] virtual bool exists(const std::string& path) = 0;

  /// While it lives, this thread's readers ask `source`.
  class Scope {
   public:
    explicit Scope(FileSource& source);
    ~Scope();
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    FileSource* before_;
  };
};

/// Whole content of a file on the disk, unpacked where it is packed by gzip. @throws Error(invalid_input)
[[nodiscard]] std::string read_from_disk(const std::string& path);
/// Whether there is such a file, where this thread's readers look for it.
[[nodiscard]] bool file_exists(const std::string& path);

}  // namespace espalier::dynamics
