/// \file
/// The tags of an XML text, one after the other: what VTK's files need of XML.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace espalier::dynamics {

class XmlTags {
 public:
  struct Tag {
    std::string_view name;  ///< "/Points" where it ends
    std::vector<std::pair<std::string_view, std::string_view>> attributes;
    bool empty = false;  ///< ends itself: <DataArray ... />
    /// The value, or empty.
    [[nodiscard]] std::string_view get(std::string_view attribute) const;
  };

  XmlTags(std::string_view text, std::string path) : text_(text), path_(std::move(path)) {}

  /// The next tag; comments, declarations and text are passed over. @return false at the end
  bool next(Tag& tag);
  /// The text from here to the next tag.
  std::string_view content();
  /// All that is left.
  [[nodiscard]] std::string_view rest() const { return text_.substr(at_); }
  /// @throws Error(invalid_input) "path:line: message"
  [[noreturn]] void fail(const std::string& message) const;
  [[nodiscard]] std::size_t line() const;

 private:
  std::string_view text_;
  std::string path_;
  std::size_t at_ = 0;
};

}  // namespace espalier::dynamics
