/// \file
/// Checked access to the XML of a robot.
#pragma once

#include <memory>
#include <optional>
#include <pugixml.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "dynamics/model/robots/pose.hpp"

namespace espalier::dynamics::model::robots {

/// A file of XML. Entities of a DOCTYPE are not expanded, so nothing grows beyond what the file has.
class XmlFile {
 public:
  /// @throws Error(invalid_input) that names the file, and the line where it is no XML or nested too deeply
  XmlFile(std::string name, std::string text);
  [[nodiscard]] pugi::xml_node root() const { return document_->document_element(); }
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] int line_of(const pugi::xml_node& node) const;

 private:
  std::string name_, text_;
  std::unique_ptr<pugi::xml_document> document_;
  std::vector<std::size_t> lines_;  // where each begins
};

/// An element with the file that it stands in.
struct Element {
  pugi::xml_node node;
  const XmlFile* file = nullptr;

  [[nodiscard]] std::string_view tag() const { return node.name(); }
  [[nodiscard]] std::string where() const;
  /// @throws Error(invalid_input) "file:line: <tag name="...">: what"
  [[noreturn]] void fail(const std::string& what) const;
  [[nodiscard]] bool has(const char* key) const { return !node.attribute(key).empty(); }
  [[nodiscard]] std::string text(const char* key) const { return node.attribute(key).value(); }
  /// @throws where it is missing or empty
  [[nodiscard]] std::string need(const char* key) const;
  [[nodiscard]] Element child(const char* name) const { return {node.child(name), file}; }
  [[nodiscard]] bool empty() const { return node.empty(); }
  [[nodiscard]] std::vector<Element> children() const;

  /// Numbers of an attribute. @throws where one is none or not finite, or there are fewer or more than that
  [[nodiscard]] std::vector<double> numbers(const char* key, std::size_t least, std::size_t most) const;
  [[nodiscard]] double number(const char* key, double otherwise) const;
  [[nodiscard]] Vec3 vector(const char* key, const Vec3& otherwise) const;
};

/// Numbers in a text, blanks between them; nothing where something else stands there.
[[nodiscard]] std::optional<std::vector<double>> numbers_of(std::string_view text);

}  // namespace espalier::dynamics::model::robots
