#include "dynamics/mesh/line_sections.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/strtod.hpp"
#include "dynamics/mesh/line_cards.hpp"
#include "dynamics/mesh/read/inp_walk.hpp"

namespace espalier::dynamics {
namespace {

constexpr const char* kLinesInstead =
    "give the section in the model instead (radius, or height and width, or its constants)";

/// What one keyword says.
class InpSection {
 public:
  InpSection(LineReader& reader, const InpKeyword& keyword) : reader_(reader), keyword_(keyword) {
    out_.set = keyword.need(reader, "ELSET");
    out_.material = keyword.get("MATERIAL");
    out_.place = fmt::format("{}:{}", reader.path(), reader.line());
  }

  LineSection beam() {
    for (const char* other : {"OFFSET1", "OFFSET2"})
      if (!keyword_.get(other).empty() && base::strtod(keyword_.get(other).c_str()) != 0)
        fault(fmt::format("{} is not read", other));
    read(8);
    const std::string shape = upper(keyword_.get("SECTION"));
    if (shape == "RECT") {
      take(LineShape::rectangle, 2);
    } else if (shape == "CIRC") {  // Abaqus: the radius; CalculiX: both diameters
      take(LineShape::circle, 1);
      if (given_ > 1) {
        if (x_[1] != x_[0]) fault("an ellipse is not read");
        out_.size[0] = 0.5 * x_[0];
      }
    } else if (shape == "PIPE") {
      take(LineShape::pipe, 2);
    } else if (shape == "BOX") {
      take(LineShape::box, 6);
      if (x_[2] != x_[4] || x_[3] != x_[5]) fault("a box whose opposite walls differ is not read");
      out_.size = {x_[0], x_[1], x_[2], x_[3], 0, 0};
    } else if (shape == "I") {
      take(LineShape::i_beam, 7);
      if (x_[2] != x_[3] || x_[4] != x_[5] || std::abs(x_[0] - 0.5 * x_[1]) > 1e-6 * x_[1])
        fault("an I whose flanges differ, or whose nodes are not at half its height, is not read");
      out_.size = {x_[1], x_[2], x_[4], x_[6], 0, 0};
      out_.across = true;  // its height is along the second direction
    } else {
      fault(fmt::format("SECTION={} is not read", shape));
    }
    direction();
    return std::move(out_);
  }

  LineSection general() {
    const std::string shape = upper(keyword_.get("SECTION"));
    if (!shape.empty() && shape != "GENERAL") fault(fmt::format("SECTION={} is not read", shape));
    read(5);
    take(LineShape::constants, 5);
    if (x_[2] != 0) fault("a product of inertia (I12) is not read");
    out_.size = {x_[0], x_[1], x_[3], x_[4], 0, 0};
    direction();
    read(2);
    out_.own.name = fmt::format("line {}", reader_.line());
    out_.own.young = x_[0];
    out_.own.poisson = x_[1] > 0 ? x_[0] / (2 * x_[1]) - 1 : 0;
    out_.own.density = base::strtod(keyword_.get("DENSITY").c_str());
    return std::move(out_);
  }

  LineSection bar() {
    read(1);
    take(LineShape::bar, 1);
    return std::move(out_);
  }

 private:
  void fault(const std::string& what) {
    if (out_.fault.empty())
      out_.fault = fmt::format("{}:{}: {}: {}; {}", reader_.path(), reader_.line(), keyword_.name, what, kLinesInstead);
  }
  /// The next data line as numbers, where there is one.
  void read(int count) {
    x_ = {};
    given_ = 0;
    std::string_view line;
    if (!next_inp_data(reader_, line)) return;
    Fields fields(reader_, line, ',');
    given_ = read_inp_reals(fields, x_.data(), count);
  }
  void take(LineShape shape, int needed) {
    out_.shape = shape;
    if (given_ < needed) fault(fmt::format("needs {} numbers, has {}", needed, given_));
    std::copy_n(x_.begin(), 6, out_.size.begin());
  }
  /// The first direction of the section; Abaqus and CalculiX take (0, 0, -1) where the line is missing.
  void direction() {
    read(3);
    out_.first = given_ == 0 ? Point{0, 0, -1} : Point{x_[0], x_[1], x_[2]};
  }

  LineReader& reader_;
  const InpKeyword& keyword_;
  LineSection out_;
  std::array<double, 8> x_{};
  int given_ = 0;
};

LineSections inp_line_sections(const std::string& path) {
  LineSections out;
  std::vector<std::string> parts;
  InpInstances instances;
  walk_inp(path, [&](LineReader& reader, const InpKeyword& keyword) {
    instances.take(keyword);
    if (keyword.name == "*BEAMSECTION")
      out.list.push_back(InpSection(reader, keyword).beam());
    else if (keyword.name == "*BEAMGENERALSECTION")
      out.list.push_back(InpSection(reader, keyword).general());
    else if (keyword.name == "*SOLIDSECTION" && keyword.has("ELSET"))
      out.list.push_back(InpSection(reader, keyword).bar());
    parts.resize(out.list.size(), instances.part());
  });
  for (std::size_t k = 0; k < parts.size(); ++k)
    for (const std::string& name : instances.names(parts[k], out.list[k].set)) {
      out.list.push_back(out.list[k]);
      out.list.back().set = name;
    }
  return out;
}

}  // namespace

LineSections read_line_sections(const std::string& path, const Mesh& mesh) {
  std::string name = lower(path);
  if (name.ends_with(".gz")) name.resize(name.size() - 3);
  if (name.ends_with(".inp")) return inp_line_sections(path);
  if (name.ends_with(".bdf") || name.ends_with(".nas") || name.ends_with(".dat")) return line_cards(path, mesh);
  return {};
}

}  // namespace espalier::dynamics
