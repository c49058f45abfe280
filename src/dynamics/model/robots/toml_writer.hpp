/// \file
/// Pieces of a model text.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "dynamics/model/robots/pose.hpp"

namespace espalier::dynamics::model::robots {

/// The shortest text that is read as the same number.
[[nodiscard]] std::string number_text(double x);
/// "[x, y, z]"
[[nodiscard]] std::string vector_text(const Vec3& x);
/// "{ quaternion = [w, x, y, z] }"
[[nodiscard]] std::string rotation_text(const Mat3& r);
/// With blanks for what TOML does not take: control characters, and bytes that are no UTF-8.
[[nodiscard]] std::string printable(std::string text);
/// A text in quotes.
[[nodiscard]] std::string in_quotes(std::string_view text);

/// Names, which models have once: of parts letters, digits, - and _.
class Names {
 public:
  /// @param dashes  inputs and sensors have none
  explicit Names(bool dashes = true) : dashes_(dashes) {}
  /// The name itself where nobody has it, else with the suffix or a number behind it.
  [[nodiscard]] std::string take(const std::string& wish, const std::string& suffix);
  /// "wish (name), ...", where they differ.
  [[nodiscard]] std::string renamed() const;

 private:
  [[nodiscard]] std::string fresh(std::string name, const std::string& suffix);
  bool dashes_;
  std::vector<std::string> renamed_;
  std::map<std::string, int> taken_;
};

/// A name as expressions take it: in quotes where it is not letters, digits and _.
[[nodiscard]] std::string in_expression(const std::string& name, const std::string& quantity);

/// An expression within bounds; those that are not finite are none.
[[nodiscard]] std::string clamped(const std::string& x, double least, double largest);

}  // namespace espalier::dynamics::model::robots
