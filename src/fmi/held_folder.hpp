/// \file
/// A temporary folder that goes with its process, however that ends.
#pragma once

#include <string>

namespace espalier::fmi {

/// A new folder PREFIX-XXXXXX where the system keeps temporary files. Its file .lock stays locked (flock) as long as
/// the process lives; folders of this prefix and user whose lock nobody holds were left by processes that were killed,
/// and are removed here.
class HeldFolder {
 public:
  /// @throws Error(invalid_input) that begins with `title`
  HeldFolder(const std::string& prefix, const std::string& title);
  ~HeldFolder();
  HeldFolder(const HeldFolder&) = delete;
  HeldFolder& operator=(const HeldFolder&) = delete;
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  std::string path_;
  int lock_ = -1;
};

}  // namespace espalier::fmi
