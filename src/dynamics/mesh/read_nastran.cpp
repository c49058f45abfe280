#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "dynamics/mesh/deck/nastran_deck.hpp"
#include "dynamics/mesh/file_elements.hpp"
#include "dynamics/mesh/nastran_cards.hpp"
#include "dynamics/mesh/read.hpp"
#include "dynamics/mesh/read/nastran_systems.hpp"
#include "dynamics/mesh/read/orientation.hpp"

namespace espalier::dynamics {
namespace {

/// Element cards: EID, PID, then grid points. Solids and surfaces of second order have all mid-side nodes or none.
struct CardShape {
  const char* name;
  ElementType linear, quadratic;
};
constexpr CardShape kCardShapes[] = {
    {"CTETRA", ElementType::tet4, ElementType::tet10},     {"CHEXA", ElementType::hex8, ElementType::hex20},
    {"CPENTA", ElementType::wedge6, ElementType::wedge15}, {"CPYRAM", ElementType::pyramid5, ElementType::pyramid5},
    {"CTRIA3", ElementType::tri3, ElementType::tri3},      {"CTRIAR", ElementType::tri3, ElementType::tri3},
    {"CQUAD4", ElementType::quad4, ElementType::quad4},    {"CQUADR", ElementType::quad4, ElementType::quad4},
    {"CTRIA6", ElementType::tri3, ElementType::tri6},      {"CQUAD8", ElementType::quad4, ElementType::quad8},
    {"CBAR", ElementType::line2, ElementType::line2},      {"CBEAM", ElementType::line2, ElementType::line2},
    {"CROD", ElementType::line2, ElementType::line2}};
/// Read where shells and beams are made of the mesh.
constexpr const char* kSections[] = {"PSHELL", "PCOMP", "PBAR", "PBARL", "PBEAM", "PBEAML", "PROD"};
// Position in the card of our node a: Nastran counts the upright edges before those of the top.
constexpr int kCardHex20[20] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 16, 17, 18, 19, 12, 13, 14, 15};
constexpr int kCardWedge15[15] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 13, 14, 9, 10, 11};

class NastranReader {
 public:
  NastranReader(std::string content, const std::string& name, bool deck = false)
      : cards_(std::move(content), name), is_deck_(deck) {
    mesh_.name = name;
  }
  /// The cards of a deck, when the mesh is read.
  [[nodiscard]] const std::vector<NastranCard>& deck_cards() const { return deck_cards_; }
  [[nodiscard]] NastranSystems& systems() { return systems_; }

  Mesh read() {
    NastranCard card;
    while (cards_.next(card)) take(card);
    if (mesh_.nodes.empty())
      throw Error(StatusCode::invalid_input, fmt::format("{}: the file has no GRID cards", mesh_.name));
    systems_.resolve(mesh_);
    for (const NastranCard& element : element_cards_) add_element(element);
    if (!places_.empty()) by_label_.insert(systems_.nodes().begin(), systems_.nodes().end());
    for (const NastranCard& places : places_) add_places(places);
    elements_.finish(mesh_, is_deck_);
    add_materials();
    add_notice();
    return std::move(mesh_);
  }

 private:
  void take(const NastranCard& card) {
    if (is_deck_ &&
        (card.name == "GRDSET" || (card.name == "GRID" && (!card.field(5).empty() || !card.field(6).empty()))))
      deck_cards_.push_back(card);
    if (systems_.take(card, mesh_)) return;
    if (shape_of_card(card) != nullptr) return element_cards_.push_back(card);
    if (card.name == "MAT1") return materials_.push_back(card);
    if (std::find(std::begin(kSections), std::end(kSections), card.name) != std::end(kSections)) return;
    if (card.name == "PSOLID") {
      solids_[card.integer(0, "property")] = card.integer(1, "material");
      return;
    }
    if (is_deck_) return deck_cards_.push_back(card);
    if (card.name == "SPC" || card.name == "SPC1" || card.name == "FORCE") return places_.push_back(card);
    ++passed_over_[card.name];
  }

  static const CardShape* shape_of_card(const NastranCard& card) {
    for (const CardShape& s : kCardShapes)
      if (card.name == s.name) return &s;
    return nullptr;
  }

  [[nodiscard]] Index grid(const NastranCard& card, std::int64_t label) const {
    const auto found = systems_.nodes().find(label);
    if (found == systems_.nodes().end()) card.fail(fmt::format("grid point {} is not defined", label));
    return found->second;
  }

  void add_element(const NastranCard& card) {
    const CardShape& shape = *shape_of_card(card);
    const std::int64_t label = card.integer(0, "number");
    std::size_t given = 0;
    const auto most = at(shape_of(shape.quadratic).nodes);
    for (std::size_t a = 0; a < most; ++a)
      if (!card.field(2 + a).empty() && card.field(2 + a) != "0") given = a + 1;
    const auto corners = at(shape_of(shape.linear).nodes);
    const ElementType type = given > corners ? shape.quadratic : shape.linear;
    const auto count = at(shape_of(type).nodes);
    std::array<Index, kMaxElementNodes> nodes{};
    for (std::size_t a = 0; a < count; ++a) {
      const std::size_t from = type == ElementType::hex20     ? at(kCardHex20[a])
                               : type == ElementType::wedge15 ? at(kCardWedge15[a])
                                                              : a;
      if (card.field(2 + from).empty() || card.field(2 + from) == "0")
        card.fail(fmt::format("element {} has {} grid points, but number {} is empty; give all mid-side points or none",
                              label, given, from + 1));
      nodes[a] = grid(card, card.integer(2 + from, "grid point"));
    }
    if (shape_of(type).dimension == 3 && corner_volume(type, mesh_.nodes, std::span(nodes).first(count)) < 0) {
      turn_round(type, std::span(nodes).first(count));
      ++turned_;
    }
    const std::size_t added = elements_.add(type, label, {nodes.data(), count});
    elements_.add_to_set(added, fmt::format("property-{}", card.integer(1, "property", label)));
  }

  /// Grid points that are held or loaded, as a set: SPC-<number>, FORCE-<number>.
  void add_places(const NastranCard& card) {
    const char* kind = card.name == "FORCE" ? "FORCE" : "SPC";
    auto& set = mesh_.node_sets[fmt::format("{}-{}", kind, card.integer(0, "set"))];
    if (card.name == "FORCE") {
      set.push_back(grid(card, card.integer(1, "grid point")));
    } else if (card.name == "SPC") {
      for (std::size_t k = 1; k < card.fields.size(); k += 3)
        if (!card.field(k).empty()) set.push_back(grid(card, card.integer(k, "grid point")));
    } else if (upper(card.field(3)) == "THRU") {
      const std::int64_t first = card.integer(2, "first grid point"), last = card.integer(4, "last grid point");
      for (auto it = by_label_.lower_bound(first); it != by_label_.end() && it->first <= last; ++it) {
        set.push_back(it->second);
        constexpr std::size_t kFree = 1000000, kEach = 100;
        if (++range_members_ > kFree + kEach * by_label_.size())
          card.fail(fmt::format("the ranges up to here name more than {} grid points", range_members_ - 1));
      }
    } else {
      for (std::size_t k = 2; k < card.fields.size(); ++k)
        if (!card.field(k).empty()) set.push_back(grid(card, card.integer(k, "grid point")));
    }
  }

  void add_materials() {
    for (const NastranCard& card : materials_) {
      MeshMaterial m;
      m.name = fmt::format("MAT1-{}", card.integer(0, "number"));
      const double shear = card.real(2, "shear modulus", 0);
      m.young = card.real(1, "Young's modulus", 0);
      m.poisson = card.real(3, "Poisson's ratio", shear > 0 && m.young > 0 ? m.young / (2 * shear) - 1 : 0);
      if (m.young == 0) m.young = 2 * shear * (1 + m.poisson);
      m.density = card.real(4, "density", 0);
      constexpr double kApart = 0.01;  // from where on Nastran warns
      if (const double own = m.young / (2 * (1 + m.poisson)); shear > 0 && std::abs(own / shear - 1) > kApart)
        mesh_.notices.push_back(
            fmt::format("{}:{}: MAT1 has G = {:g}, and E / (2 (1 + NU)) is {:g}: E and NU are taken", card.path,
                        card.line, shear, own));
      mesh_.materials.push_back(m);
    }
    for (const auto& [property, material] : solids_)
      if (const auto set = fmt::format("property-{}", property); mesh_.element_sets.contains(set))
        mesh_.section_material[set] = fmt::format("MAT1-{}", material);
  }

  void add_notice() {
    if (turned_ > 0)
      mesh_.notices.push_back(
          fmt::format("{}: {} solids are left-handed, as Nastran allows; their nodes are put into the other order",
                      mesh_.name, turned_));
    if (passed_over_.empty()) return;
    std::vector<std::string> list;
    for (const auto& [name, count] : passed_over_) list.push_back(fmt::format("{} ({})", name, count));
    mesh_.notices.push_back(fmt::format(
        "{}: cards that were passed over; take = \"all\" beside the file takes supports, loads and couplings "
        "over: {}",
        mesh_.name, fmt::join(list, ", ")));
  }

  NastranCards cards_;
  bool is_deck_ = false;
  std::vector<NastranCard> deck_cards_;
  Mesh mesh_;
  NastranSystems systems_;
  long turned_ = 0;                         // left-handed solids
  std::map<std::int64_t, Index> by_label_;  // the same in order, for ranges
  std::size_t range_members_ = 0;           // grid points named by ranges so far
  std::vector<NastranCard> element_cards_, places_, materials_;
  std::map<std::int64_t, std::int64_t> solids_;  // property -> material
  std::map<std::string, long> passed_over_;
  FileElements elements_;
};

}  // namespace

Mesh parse_nastran(std::string content, const std::string& name) {
  return NastranReader(std::move(content), name).read();
}

Deck parse_nastran_deck(std::string content, const std::string& name, int step) {
  const NastranControl control = read_nastran_control(content, name);
  NastranReader reader(std::move(content), name, true);
  Deck deck;
  deck.mesh = reader.read();
  read_nastran_deck(reader.deck_cards(), control, reader.systems(), step, deck);
  return deck;
}

Mesh read_nastran(const std::string& path) { return parse_nastran(read_whole_file(path), path); }

}  // namespace espalier::dynamics
