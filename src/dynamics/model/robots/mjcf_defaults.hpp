/// \file
/// What stands around the bodies of MJCF: included files, settings of the compiler, classes of defaults.
#pragma once

#include <array>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dynamics/model/robots/xml.hpp"

namespace espalier::dynamics::model::robots {

/// An element with the classes of defaults behind it: an attribute is the nearest one.
class Attributes {
 public:
  explicit Attributes(std::vector<Element> chain) : chain_(std::move(chain)) {}
  [[nodiscard]] const Element& own() const { return chain_.front(); }
  /// The element that says it; null: none.
  [[nodiscard]] const Element* with(const char* key) const;
  [[nodiscard]] bool has(const char* key) const { return with(key) != nullptr; }
  [[nodiscard]] std::string text(const char* key, const std::string& otherwise = "") const;
  [[nodiscard]] double number(const char* key, double otherwise) const;
  [[nodiscard]] Vec3 vector(const char* key, const Vec3& otherwise) const;
  [[nodiscard]] std::vector<double> numbers(const char* key, std::size_t least, std::size_t most) const;
  /// The same of a list that an element may give in part: the rest are those of the classes behind it.
  [[nodiscard]] std::vector<double> merged(const char* key, std::size_t most) const;
  /// "true" or "false". @throws for other words
  [[nodiscard]] bool flag(const char* key, bool otherwise) const;
  [[nodiscard]] const std::vector<Element>& chain() const { return chain_; }

 private:
  std::vector<Element> chain_;
};

struct MjcfCompiler {
  double angle = 0.017453292519943295;  ///< one unit of it in radians: degrees
  std::string euler = "xyz";            ///< axes of the turns; capital letters: fixed axes
  std::string mesh_folder;
  bool strip_path = false, balance_inertia = false, auto_limits = true;
  double least_mass = 0, least_inertia = 0, total_mass = -1;
  enum class FromGeoms { always, never, where_missing } from_geoms = FromGeoms::where_missing;
  std::array<double, 2> inertia_groups{0, 5};
};

/// The model file with those that it includes.
class MjcfText {
 public:
  /// @throws Error(invalid_input)
  explicit MjcfText(const XmlFile& file);

  [[nodiscard]] const MjcfCompiler& compiler() const { return compiler_; }
  /// The children of an element, and in the place of each <include> those of its file.
  [[nodiscard]] std::vector<Element> children(const Element& parent) const;
  [[nodiscard]] Element root() const { return {file_.root(), &file_}; }
  /// The sections of that name.
  [[nodiscard]] std::vector<Element> sections(std::string_view tag) const;
  /// @param childclass  of the bodies around it, or ""
  [[nodiscard]] Attributes attributes(const Element& element, const std::string& childclass = "") const;
  /// Elements of defaults that count for one, from the outermost class on, with tags among `tags`.
  [[nodiscard]] std::vector<Element> defaults_of(const Element& element, const std::string& childclass,
                                                 const std::vector<std::string_view>& tags) const;
  /// quat, axisangle, euler, xyaxes or zaxis; none: no turn.
  [[nodiscard]] Mat3 rotation(const Attributes& a) const;
  [[nodiscard]] Pose pose(const Attributes& a) const;
  /// The rotation of three angles in the compiler's unit, about the axes of `eulerseq`.
  [[nodiscard]] Mat3 of_euler(const Vec3& angles) const;
  /// A range that limits: `limited` says so, or it is left to `autolimits` and the range rises.
  [[nodiscard]] std::optional<std::array<double, 2>> limits(const Attributes& a, const char* limited,
                                                            const char* range) const;
  [[nodiscard]] const std::string& folder() const { return folder_; }

 private:
  struct Class {
    int outer = -1;
    std::vector<Element> elements;
  };
  void read_compiler(const Element& e);
  void read_class(const Element& e, int outer);
  [[nodiscard]] const XmlFile& included(const Element& include) const;
  [[nodiscard]] int class_of(const Element& element, const std::string& childclass) const;
  [[nodiscard]] std::optional<Mat3> rotation_of(const Element& e) const;

  const XmlFile& file_;
  std::string folder_;
  mutable std::deque<XmlFile> more_;
  mutable std::size_t included_bytes_ = 0;
  mutable std::map<std::pair<const XmlFile*, std::ptrdiff_t>, const XmlFile*> included_;  // by the place of the element
  mutable std::map<const XmlFile*, const XmlFile*> by_;                                   // which file names it
  MjcfCompiler compiler_;
  std::vector<Class> classes_;
  std::map<std::string, int> class_names_;
};

}  // namespace espalier::dynamics::model::robots
