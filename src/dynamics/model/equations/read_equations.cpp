// The sections [equations] and [ties]: linear equations between displacements of nodes, and nodes on faces.
#include <fmt/format.h>

#include <algorithm>

#include "dynamics/model/description.hpp"

namespace espalier::dynamics::model {
namespace {

EquationSpec::Term read_term(const Value& value, const std::string& body) {
  Section s(value);
  EquationSpec::Term out;
  out.where.place = s.place();
  out.where.body = s.text("body", body);
  if (out.where.body.empty()) fail(s.place(), "needs 'body', here or beside 'terms'");
  read_where(s, out.where);
  out.direction = s.choice("direction", {"x", "y", "z"});
  out.factor = s.number("factor", 1);
  s.finish();
  return out;
}

EquationSpec read_equation(const std::string& name, const Value& value) {
  Section s(value);
  EquationSpec out;
  out.place = value.place;
  out.name = name;
  const std::string body = s.text("body", "");
  const Value* terms = s.value("terms");
  if (terms == nullptr || terms->type != Value::Type::array || terms->items.empty())
    fail(s.place("terms"), "needs a list: terms = [{ node = 7, direction = \"x\", factor = 2 }, ...]");
  for (const Value& term : terms->items) out.terms.push_back(read_term(term, body));
  if (std::all_of(out.terms.begin(), out.terms.end(), [](const auto& t) { return t.factor == 0; }))
    fail(terms->place, "all factors are 0; one at least must be another number");
  out.value = s.number("value", 0);
  out.elastic = s.has("stiffness") || s.has("damping");
  out.stiffness = s.number("stiffness", 0);
  out.damping = s.number("damping", 0);
  s.finish();
  return out;
}

TieSpec read_tie(const std::string& name, const Value& value) {
  Section s(value);
  TieSpec out;
  out.place = out.where.place = value.place;
  out.name = name;
  out.where.body = s.text("body");
  read_where(s, out.where);
  auto to = s.table("to");
  if (!to)
    fail(s.place(),
         "needs 'to', what the nodes stay on: to = { body = \"part\", face = \"SET\" } of a solid, to = { body = "
         "\"part\" } "
         "of a shell, a beam or a cable");
  out.to_place = to->place();
  out.to_body = to->text("body");
  out.to_face = to->text("face", "");
  to->finish();
  out.tolerance = s.positive("tolerance", 0);
  s.finish();
  return out;
}

}  // namespace

void read_equations(Section& root, Description& model) {
  root.named("equations", [&](const std::string& name, const Value& value) {
    model.equations.push_back(read_equation(name, value));
  });
  root.named("ties", [&](const std::string& name, const Value& value) { model.ties.push_back(read_tie(name, value)); });
}

}  // namespace espalier::dynamics::model
