#include "dynamics/mesh/line_cards.hpp"

#include <fmt/format.h>

#include <set>

#include "base/at.hpp"
#include "dynamics/mesh/nastran_cards.hpp"

namespace espalier::dynamics {
namespace {

constexpr const char* kCardInstead =
    "give the section in the model instead (radius, or height and width, or its constants)";

void fault(const NastranCard& card, const std::string& what, std::string& out) {
  if (out.empty())
    out = fmt::format("{}:{}: {}: {} is not read; {}", card.path, card.line, card.name, what, kCardInstead);
}

class LineCards {
 public:
  LineCards(const std::string& path, const Mesh& mesh) : mesh_(mesh) {
    NastranCards cards(read_whole_file(path), path);
    NastranCard card;
    while (cards.next(card)) take(card);
  }

  LineSections finish() {
    for (const NastranCard& card : elements_) orient(card);
    for (auto& [number, section] : sections_) {
      section.set = fmt::format("property-{}", number);
      out_.list.push_back(std::move(section));
    }
    return std::move(out_);
  }

 private:
  void take(const NastranCard& card) {
    if (card.name == "GRID" && !card.field(5).empty() && card.field(5) != "0")
      turned_.insert(card.integer(0, "number"));
    if (card.name == "CBAR" || card.name == "CBEAM") elements_.push_back(card);
    if (card.name == "BAROR" || card.name == "BEAMOR")
      card.fail(card.name + " is not read: write its values into the elements");
    if (card.name == "PBAR") pbar(card);
    if (card.name == "PBEAM") pbeam(card);
    if (card.name == "PBARL" || card.name == "PBEAML") by_shape(card);
    if (card.name == "PROD") prod(card);
  }

  LineSection& begin(const NastranCard& card) {
    LineSection& s = sections_[card.integer(0, "number")];
    s = {};
    s.place = fmt::format("{}:{}", card.path, card.line);
    s.material = fmt::format("MAT1-{}", card.integer(1, "material"));
    return s;
  }
  /// Axes as ours: I1 is that of bending in the plane of y, about z.
  static void constants(const NastranCard& card, LineSection& s, double j) {
    s.shape = LineShape::constants;
    s.size = {card.real(2, "A"), card.real(4, "I2", 0), card.real(3, "I1", 0), j, 0, 0};
  }
  /// PID MID A I1 I2 J NSM - C1 ... F2 - K1 K2 I12
  void pbar(const NastranCard& card) {
    LineSection& s = begin(card);
    constants(card, s, card.real(5, "J", 0));
    s.extra_mass = card.real(6, "NSM", 0);
    s.size[4] = card.real(16, "K1", 0);
    s.size[5] = card.real(17, "K2", 0);
    if (card.real(18, "I12", 0) != 0) fault(card, "a product of inertia (I12)", s.fault);
  }
  /// PID MID A I1 I2 I12 J NSM - C1 ... F2 - then other stations
  void pbeam(const NastranCard& card) {
    LineSection& s = begin(card);
    constants(card, s, card.real(6, "J", 0));
    s.extra_mass = card.real(7, "NSM", 0);
    if (card.real(5, "I12", 0) != 0) fault(card, "a product of inertia (I12)", s.fault);
    constexpr std::size_t kStation = 16;
    for (std::size_t k = kStation; k < card.fields.size(); ++k)
      if (!card.field(k).empty())
        fault(card, "what follows the stress points (sections that vary, shear factors)", s.fault);
  }
  void prod(const NastranCard& card) {
    LineSection& s = begin(card);
    s.shape = LineShape::bar;
    s.size[0] = card.real(2, "A");
    s.extra_mass = card.real(5, "NSM", 0);
  }
  /// PID MID GROUP TYPE - - - - DIM1 DIM2 ... NSM. Widths are along z, heights along y.
  void by_shape(const NastranCard& card) {
    LineSection& s = begin(card);
    const std::string type = upper(card.field(3));
    const auto dim = [&](std::size_t k) { return card.real(7 + k, "dimension"); };
    std::size_t dims = 0;
    if (type == "ROD") {
      s.shape = LineShape::circle;
      s.size[0] = dim(dims = 1);
    } else if (type == "TUBE") {  // outer and inner radius
      s.shape = LineShape::pipe;
      s.size = {dim(1), dim(1) - dim(2)};
      dims = 2;
    } else if (type == "TUBE2") {
      s.shape = LineShape::pipe;
      s.size = {dim(1), dim(2)};
      dims = 2;
    } else if (type == "BAR") {
      s.shape = LineShape::rectangle;
      s.size = {dim(2), dim(1)};
      dims = 2;
    } else if (type == "BOX") {
      s.shape = LineShape::box;
      s.size = {dim(2), dim(1), dim(3), dim(4)};
      dims = 4;
    } else if (type == "I") {
      s.shape = LineShape::i_beam;
      s.size = {dim(1), dim(2), dim(5), dim(4)};
      if (dim(2) != dim(3) || dim(5) != dim(6)) fault(card, "an I whose flanges differ", s.fault);
      dims = 6;
    } else {
      fault(card, fmt::format("a section of the type {}", type), s.fault);
      return;
    }
    s.extra_mass = card.real(8 + dims, "NSM", 0);
    for (std::size_t k = 9 + dims; k < card.fields.size(); ++k)
      if (!card.field(k).empty()) fault(card, "a section that varies", s.fault);
  }

  /// EID PID GA GB X1 X2 X3 OFFT - PA PB W1A W2A W3A W1B W2B W3B; G0 in the place of X1.
  void orient(const NastranCard& card) {
    const std::int64_t label = card.integer(0, "number");
    std::string& wrong = out_.faults[label];
    for (const std::size_t k : {8, 9})
      if (!card.field(k).empty() && card.field(k) != "0") fault(card, "an end that is released (PA, PB)", wrong);
    for (std::size_t k = 10; k < 16; ++k)
      if (card.real(k, "offset", 0) != 0) fault(card, "an offset (W1A ... W3B)", wrong);
    for (std::size_t k = 16; k < 18; ++k)
      if (!card.field(k).empty()) fault(card, "warping (SA, SB)", wrong);
    if (const std::string& offt = card.field(7); !offt.empty() && upper(offt) != "GGG")
      fault(card, fmt::format("OFFT or BIT {}", offt), wrong);
    if (wrong.empty()) out_.faults.erase(label);
    const std::int64_t from = card.integer(2, "grid point");
    if (card.field(5).empty() && card.field(6).empty() && card.field(4).find('.') == std::string::npos) {
      out_.directions[label] = difference(card, card.integer(4, "G0"), from);
      return;
    }
    if (turned_.contains(from)) fault(card, "a direction in axes of the grid point (CD)", out_.faults[label]);
    out_.directions[label] = {card.real(4, "X1", 0), card.real(5, "X2", 0), card.real(6, "X3", 0)};
  }
  [[nodiscard]] Point difference(const NastranCard& card, std::int64_t to, std::int64_t from) {
    if (places_.empty())
      for (Index k = 0; k < static_cast<Index>(mesh_.nodes.size()); ++k) places_[mesh_.node_label(k)] = k;
    Point out{};
    for (const auto& [label, sign] : {std::pair{to, 1.0}, std::pair{from, -1.0}}) {
      const auto found = places_.find(label);
      if (found == places_.end()) card.fail(fmt::format("grid point {} is not defined", label));
      for (std::size_t i = 0; i < 3; ++i) out[i] += sign * mesh_.nodes[at(found->second)][i];
    }
    return out;
  }

  const Mesh& mesh_;
  LineSections out_;
  std::map<std::int64_t, LineSection> sections_;
  std::vector<NastranCard> elements_;
  std::set<std::int64_t> turned_;  // grid points whose displacements have axes of their own
  std::map<std::int64_t, Index> places_;
};

}  // namespace

LineSections line_cards(const std::string& path, const Mesh& mesh) { return LineCards(path, mesh).finish(); }

}  // namespace espalier::dynamics
