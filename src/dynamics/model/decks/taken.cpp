#include "dynamics/model/decks/taken.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "dynamics/model/decks/taker.hpp"

namespace espalier::dynamics::model {
namespace {

std::vector<std::string> known_words() {
  std::vector<std::string> words = {"all"};
  for (const auto& row : kDeckWords) words.emplace_back(row.name);
  return words;
}

void add_word(DeckChoice& choice, const std::string& word, const Place& place) {
  if (word == "all") {
    choice.all = true;
    return;
  }
  const auto* found =
      std::find_if(std::begin(kDeckWords), std::end(kDeckWords), [&](const auto& row) { return row.name == word; });
  if (found == std::end(kDeckWords))
    fail(place, fmt::format("'{}' cannot be taken{}", word, suggestion(word, known_words())));
  choice.kinds.insert(found->value);
}

}  // namespace

TakenDeck Taker::run() {
  refuse_left();
  bodies_ = make_deck_bodies(deck_, choice_.all, body_);
  find_roles();
  if (choice_.takes(DeckKind::masses)) masses();
  if (choice_.takes(DeckKind::boundary)) holds();
  if (choice_.takes(DeckKind::couplings)) couplings();
  if (choice_.takes(DeckKind::cload)) forces();
  if (choice_.takes(DeckKind::dload)) pressures();
  if (choice_.takes(DeckKind::dload)) line_loads();
  body_loads();
  if (choice_.takes(DeckKind::springs)) springs(deck_.springs, "spring");
  if (choice_.takes(DeckKind::dashpots)) springs(deck_.dashpots, "dashpot");
  if (choice_.takes(DeckKind::equations)) equations();
  if (choice_.takes(DeckKind::ties)) ties();
  if (choice_.takes(DeckKind::connectors)) connectors();
  if (choice_.takes(DeckKind::step)) step();
  join_bodies();
  formulations();
  list_bodies();
  notices();
  return std::move(out_);
}

void Taker::refuse_left() const {
  std::string list;
  const DeckLeft* first = nullptr;
  for (const auto& [key, left] : deck_.left) {
    if (!choice_.takes(key.first)) continue;
    list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", key.second, left.count);
    if (first == nullptr) first = &left;
  }
  if (first == nullptr) return;
  std::string others;
  for (const auto& row : kDeckWords) {
    if (!choice_.takes(row.value)) continue;
    const bool whole =
        std::none_of(deck_.left.begin(), deck_.left.end(), [&](const auto& l) { return l.first.first == row.value; });
    if (whole) others += fmt::format("{}\"{}\"", others.empty() ? "" : ", ", row.name);
  }
  dynamics::fail(
      first->place,
      fmt::format("this deck cannot be taken as it is, for the answer would be another one without: {}. What "
                  "can be taken: mesh = {{ file = ..., take = [{}] }} in a model, which states the rest itself",
                  list, others));
}

void Taker::notices() {
  std::string list;
  for (const auto& [key, left] : deck_.left)
    if (!choice_.takes(key.first)) list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", key.second, left.count);
  const auto count = [&](DeckKind kind, std::size_t n, const char* what) {
    if (n > 0 && !choice_.takes(kind)) list += fmt::format("{}{} ({})", list.empty() ? "" : ", ", what, n);
  };
  count(DeckKind::boundary, deck_.holds.size(), "boundary");
  count(DeckKind::cload, deck_.forces.size(), "cload");
  count(DeckKind::dload, deck_.pressures.size() + deck_.line_loads.size(), "dload");
  const auto weights = static_cast<std::size_t>(std::count_if(deck_.body_loads.begin(), deck_.body_loads.end(),
                                                              [](const DeckBodyLoad& l) { return l.label == "GRAV"; }));
  count(DeckKind::gravity, weights, "gravity");
  count(DeckKind::dload, deck_.body_loads.size() - weights, "loads on volumes");
  count(DeckKind::springs, deck_.springs.size(), "springs");
  count(DeckKind::dashpots, deck_.dashpots.size(), "dashpots");
  count(DeckKind::masses, deck_.masses.size(), "masses");
  count(DeckKind::couplings, deck_.couplings.size(), "couplings");
  count(DeckKind::equations, deck_.equations.size(), "equations");
  count(DeckKind::ties, deck_.ties.size(), "ties");
  count(DeckKind::connectors, deck_.connectors.size(), "connectors");
  if (!list.empty()) out_.notices.push_back(fmt::format("{}: not taken: {}", deck_.mesh.name, list));
  if (choice_.takes(DeckKind::step))
    out_.notices.insert(out_.notices.end(), deck_.notices.begin(), deck_.notices.end());
  if (turned_ > 0)
    out_.notices.push_back(fmt::format(
        "{}: {} rotations of nodes of solids are held in the deck; such nodes do not turn", deck_.mesh.name, turned_));
  if (deck_.steps > 1)
    out_.notices.push_back(fmt::format("{}: of {} steps the one of line {} is taken; step = N beside 'take' chooses",
                                       deck_.mesh.name, deck_.steps, deck_.step.place.line));
}

void Taker::step() {
  const DeckStep& s = deck_.step;
  const ValueMaker m(s.place, "statics");
  if (s.kind == DeckStep::Kind::none) return;
  if (s.kind == DeckStep::Kind::motion) {
    Value run = m.table({{"end", m.number(s.period)}});
    if (s.fixed) {
      run.entries.emplace_back("method", m.text("generalized-alpha"));
      run.entries.emplace_back("step", m.number(s.increment));
      run.entries.emplace_back("hht_alpha", m.number(s.alpha));
    } else if (s.longest > 0) {
      run.entries.emplace_back("max_step", m.number(s.longest));
    }
    out_.run.emplace_back("integrator", std::move(run));
  } else {
    out_.run.emplace_back("statics", s.large ? m.table({}) : m.table({{"linear", m.flag(true)}}));
    if (s.kind == DeckStep::Kind::modes) out_.run.emplace_back("initial", m.table({{"modes", m.whole(s.modes)}}));
  }
  constexpr std::size_t kMost = 12;
  std::vector<Value> list;
  for (const std::string& quantity : outputs_)
    if (list.size() < kMost) list.push_back(m.text(quantity));
  out_.run.emplace_back("output", m.table({{"quantities", m.list(std::move(list))}}));
}

void Taker::formulations() {
  if (!choice_.all || bodies_.list.empty() || bodies_.list.front().type != "solid") return;
  if (!deck_.hex8.empty()) body_keys_[body_].emplace_back("hex8", maker_.text(deck_.hex8));
  if (deck_.reduced_hex20) body_keys_[body_].emplace_back("reduced_hex20", maker_.flag(true));
  if (!deck_.other_elements.empty())
    out_.notices.push_back(fmt::format(
        "{}: elements of types {} are not those of the deck's program: they are computed with hex8 = \"{}\" and "
        "reduced_hex20 = {}, where the body states no others; displacements differ as far as the mesh is coarse",
        deck_.mesh.name, deck_.other_elements, deck_.hex8.empty() ? "enhanced" : deck_.hex8, deck_.reduced_hex20));
}

void Taker::list_bodies() {
  for (const DeckBody& body : bodies_.list) {
    std::string set;
    if (bodies_.list.size() > 1 || body.type != "solid") {
      set = fmt::format("deck-elements-{}", body.name);
      out_.element_sets[set] = body.elements;
    }
    out_.bodies.push_back({body.name, body.type, std::move(set), body_keys_[body.name]});
  }
  if (bodies_.list.size() < 2) return;
  std::string list;
  for (const DeckBody& body : bodies_.list)
    list += fmt::format("{}{} ({}, {} elements)", list.empty() ? "" : ", ", body.name, body.type, body.elements.size());
  out_.notices.push_back(fmt::format("{}: the deck is {} bodies: {}", deck_.mesh.name, bodies_.list.size(), list));
}

DeckChoice read_choice(const Value& take) {
  DeckChoice choice;
  if (take.type == Value::Type::text) {
    add_word(choice, take.text, take.place);
  } else if (take.type == Value::Type::array) {
    for (const Value& word : take.items) {
      if (word.type != Value::Type::text) fail(word.place, "must be a text");
      add_word(choice, word.text, word.place);
    }
  } else {
    fail(take.place, "must be \"all\" or a list of what is taken: [\"boundary\", \"cload\", ...]");
  }
  return choice;
}

DeckChoice choice_of(const std::vector<std::string>& words) {
  DeckChoice choice;
  for (const std::string& word : words) add_word(choice, word, {});
  return choice;
}

TakenDeck take_deck(const Deck& deck, const DeckChoice& choice, const std::string& body) {
  return Taker(deck, choice, body).run();
}

}  // namespace espalier::dynamics::model
