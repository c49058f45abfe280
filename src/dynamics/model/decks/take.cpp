#include "dynamics/model/decks/take.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "dynamics/mesh/read/formats.hpp"
#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/decks/taken.hpp"
#include "dynamics/model/decks/values.hpp"
#include "dynamics/model/read/section.hpp"

namespace espalier::dynamics::model {
namespace {

using ScopePtr = std::shared_ptr<const Scope>;

const Value* deck_of(const Value& body) {
  const Value* mesh = body.is_table() ? body.find("mesh") : nullptr;
  return mesh != nullptr && mesh->is_table() && mesh->find("take") != nullptr ? mesh : nullptr;
}

void give_scope(Value& value, const ScopePtr& scope) {
  value.scope = scope;
  for (Value& item : value.items) give_scope(item, scope);
  for (auto& entry : value.entries) give_scope(entry.second, scope);
}

class DeckTaker {
 public:
  DeckTaker(Value& root, const std::string& folder) : root_(root), folder_(folder) {}

  void take(Value& body, const std::string& name) {
    const Value& mesh = *deck_of(body);
    Section s(mesh);
    const DeckChoice choice = read_choice(*mesh.find("take"));
    if (s.has("scale") && s.number("scale") != 1)
      fail(s.place("scale"),
           "does not go with 'take': loads and stiffnesses of the deck would stay as they are. Leave it "
           "out, and say at the top what the deck's units are: units = \"mm-t-s\"");
    if (body.find("element_set") != nullptr)
      fail(body.find("element_set")->place, "does not go with 'take', which takes all elements of the deck");
    const std::string file = s.text("file");
    const std::string path = file.starts_with('/') || folder_.empty() ? file : folder_ + "/" + file;
    Deck deck;
    try {
      deck = read_deck(path, s.integer("step", 1, 0));
    } catch (const Error& error) {
      if (error.status().code == StatusCode::invalid_input && !std::string(error.what()).starts_with(path))
        fail(s.place("file"), error.what());
      throw;
    }
    const bool has_run = std::any_of(root_.entries.begin(), root_.entries.end(), [](const KeyValue& e) {
      return e.first == "statics" || e.first == "integrator" || e.first == "harmonic";
    });
    if (!has_run && choice.takes(DeckKind::step) && deck.steps == 0)
      throw Error(StatusCode::invalid_input,
                  fmt::format("{}\nTo run the deck by itself it needs a step: statics, frequencies, or dynamics",
                              mesh_is_no_model(path)));
    TakenDeck taken = take_deck(deck, choice, name);
    const ScopePtr scope = body.scope;
    add_bodies(body, taken, scope);
    for (auto& entry : taken.entries) add_named(entry, scope);
    for (auto& [key, value] : taken.run)
      if (!has_run || key == "output") add(root_, key, std::move(value), scope);
  }

 private:
  /// What the elements are beside the body itself; it says what all of them have.
  void add_bodies(Value& body, TakenDeck& taken, const ScopePtr& scope) {
    if (taken.bodies.empty()) fail(body.place, fmt::format("{} has no elements that bodies are made of", "the deck"));
    const ValueMaker maker({body.place.file, body.place.line}, "bodies");
    const Value* stated = body.find("type");
    if (stated != nullptr && stated->text != taken.bodies.front().type)
      fail(stated->place, fmt::format("the first of the deck's bodies is a {}: leave 'type' out, which 'take' finds",
                                      taken.bodies.front().type));
    if (const Value* reduce = body.find("reduce"); reduce != nullptr && taken.bodies.size() > 1)
      fail(reduce->place, "does not go with a deck that is several bodies: solids, shells of one section, beams, bars");
    const Value common = body;
    for (TakenDeck::Body& part : taken.bodies) {
      const bool first = part.name == taken.bodies.front().name;
      Value fresh = maker.table({});
      Value& to = first ? body : fresh;
      for (const char* key : {"gravity", "damping", "material", "position", "rotation", "velocity", "angular_velocity"})
        if (const Value* value = common.find(key); value != nullptr && !first) to.entries.emplace_back(key, *value);
      add(to, "type", maker.text(part.type), scope);
      if (!part.element_set.empty()) add(to, "element_set", maker.text(part.element_set), scope);
      for (auto& [key, value] : part.keys) add(to, key, std::move(value), scope);
      if (first) continue;
      Value mesh = *common.find("mesh");
      mesh.entries.emplace_back("of", maker.text(taken.bodies.front().name));
      to.entries.emplace_back("mesh", std::move(mesh));
      TakenDeck::Entry entry{"bodies", part.name, std::move(fresh)};
      add_named(entry, scope);
    }
  }

  static void add(Value& table, const std::string& key, Value value, const ScopePtr& scope) {
    if (table.find(key) != nullptr) return;
    give_scope(value, scope);
    table.entries.emplace_back(key, std::move(value));
  }
  void add_named(TakenDeck::Entry& entry, const ScopePtr& scope) {
    Value* section = root_.find(entry.section);
    if (section == nullptr) {
      Value fresh;
      fresh.place = entry.value.place;
      fresh.place.path = entry.section;
      fresh.scope = scope;
      root_.entries.emplace_back(entry.section, std::move(fresh));
      section = &root_.entries.back().second;
    }
    if (!section->is_table()) fail(section->place, "must be a table");
    if (const Value* there = section->find(entry.name); there != nullptr)
      fail(there->place,
           fmt::format("the deck has an entry of this name ({}); choose another", entry.value.place.text()));
    give_scope(entry.value, scope);
    section->entries.emplace_back(entry.name, std::move(entry.value));
  }

  Value& root_;
  const std::string& folder_;
};

}  // namespace

bool takes_decks(const Value& root) {
  const Value* bodies = root.find("bodies");
  return bodies != nullptr && bodies->is_table() &&
         std::any_of(bodies->entries.begin(), bodies->entries.end(),
                     [](const KeyValue& body) { return deck_of(body.second) != nullptr; });
}

void take_decks(Value& root, const std::string& folder) {
  // Bodies that a deck adds have no decks of their own.
  std::vector<std::string> names;
  for (const auto& [name, body] : root.find("bodies")->entries)
    if (deck_of(body) != nullptr) names.push_back(name);
  DeckTaker taker(root, folder);
  for (const std::string& name : names) {
    Value body = *root.find("bodies")->find(name);
    taker.take(body, name);
    *root.find("bodies")->find(name) = std::move(body);
  }
}

std::string read_model_text(const std::string& path) {
  if (!is_deck(path)) return read_whole_file(path);
  std::string file;
  for (const char c : std::filesystem::path(path).filename().string()) {
    if (c == '"' || c == '\\') file += '\\';
    file += c;
  }
  return fmt::format("bodies.part = {{ mesh = {{ file = \"{}\", take = \"all\" }} }}\n", file);
}

}  // namespace espalier::dynamics::model
