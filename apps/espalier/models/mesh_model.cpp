#include "models/mesh_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>

#include "dynamics/mesh/deck/deck.hpp"
#include "dynamics/mesh/read/formats.hpp"
#include "dynamics/mesh/sides.hpp"
#include "models/deck_model.hpp"

namespace espalier::cli {

namespace {

using dynamics::Mesh;

struct Faces {
  std::string held, pressed;
};

/// Two face sets that are parts of the surface and share no node.
Faces choose_faces(const Mesh& mesh, std::size_t surface) {
  std::vector<std::string> names;  // the smallest first
  for (const auto& [name, faces] : mesh.face_sets)
    if (!faces.empty() && faces.size() < surface && name.find('"') == std::string::npos) names.push_back(name);
  std::stable_sort(names.begin(), names.end(), [&](const std::string& a, const std::string& b) {
    return mesh.face_sets.at(a).size() < mesh.face_sets.at(b).size();
  });
  for (const std::string& held : names) {
    const std::vector<Index> nodes = mesh.nodes_of_faces(mesh.face_sets.at(held));
    for (const std::string& pressed : names) {
      std::vector<Index> both;
      const std::vector<Index> others = mesh.nodes_of_faces(mesh.face_sets.at(pressed));
      std::set_intersection(nodes.begin(), nodes.end(), others.begin(), others.end(), std::back_inserter(both));
      if (both.empty()) return {held, pressed};
    }
  }
  return {names.empty() ? "" : names.front(), ""};
}

/// The ends of the longest direction.
Faces ends_of(const dynamics::MeshSurvey& survey) {
  std::size_t longest = 0;
  for (std::size_t d = 1; d < 3; ++d)
    if (survey.most[d] - survey.least[d] > survey.most[longest] - survey.least[longest]) longest = d;
  const char axis = static_cast<char>('x' + longest);
  return {std::string(1, axis) + "0", std::string(1, axis) + "1"};
}

/// A text of TOML.
std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') result += '\\';
    result += c;
  }
  return result + '"';
}

/// Supports of the pieces of a mesh that share no node with the held face: three corners of an element of each.
std::string held_pieces(const Mesh& mesh, const std::vector<Index>& held) {
  if (mesh.pieces({}).size() < 2) return "";
  constexpr int kMost = 20;
  std::vector<char> reached(mesh.nodes.size(), 0);  // nodes of pieces that are held
  for (const Index n : held) reached[static_cast<std::size_t>(n)] = 1;
  const auto spread = [&] {
    const auto through = [&](Index e) {
      const auto nodes = mesh.element(e);
      const auto is_reached = [&](Index n) { return reached[static_cast<std::size_t>(n)] != 0; };
      if (std::all_of(nodes.begin(), nodes.end(), is_reached) || std::none_of(nodes.begin(), nodes.end(), is_reached))
        return false;
      for (const Index n : nodes) reached[static_cast<std::size_t>(n)] = 1;
      return true;
    };
    for (bool changed = true; changed;) {
      changed = false;
      for (Index e = 0; e < mesh.element_count(); ++e) changed |= through(e);
      for (Index e = mesh.element_count() - 1; e >= 0; --e) changed |= through(e);
    }
  };
  spread();
  std::string text =
      "# The mesh falls into pieces that share no node. Three nodes of each other piece are held, so that the model\n"
      "# runs; make a body of each piece (element_set) and join them where they belong together.\n";
  int count = 1;
  for (Index e = 0; e < mesh.element_count(); ++e) {
    const auto nodes = mesh.element(e);
    if (dynamics::shape_of(mesh.type(e)).dimension < 3 || reached[static_cast<std::size_t>(nodes.front())] != 0)
      continue;
    if (++count > kMost)
      throw Error(StatusCode::invalid_input,
                  fmt::format("no model: the mesh falls into {} pieces that share no node", mesh.pieces({}).size()));
    text += fmt::format("piece_{} = {{ body = \"part\", nodes = [{}, {}, {}], hold = \"all\" }}\n", count,
                        mesh.node_label(nodes[0]), mesh.node_label(nodes[1]), mesh.node_label(nodes[2]));
    for (const Index n : nodes) reached[static_cast<std::size_t>(n)] = 1;
    spread();
  }
  return count == 1 ? "" : text;
}

bool only_solids(const Mesh& mesh) {
  for (Index e = 0; e < mesh.element_count(); ++e)
    if (dynamics::shape_of(mesh.type(e)).dimension < 3) return false;
  return true;
}

/// The model's text of a deck whose supports hold the part; empty for others.
std::string text_of_deck(const dynamics::Deck& deck, const std::string& mesh_file, const std::string& path,
                         const std::string& steel) {
  const DeckModel model = model_of_deck(deck, steel);
  if (!model.holds) return "";
  return fmt::format(
      "# A model of {}, written by 'espalier mesh': the deck's supports, loads and step are taken over. What they\n"
      "# become has names like part_hold_1; add to it what you like.\n{}"
      "# Run it: espalier simulate MODEL.toml --out results; then: espalier view results\n\n"
      "[bodies.part]\n{}mesh = {{ file = {}, take = {} }}\n{}{}{}",
      std::filesystem::path(mesh_file).filename().string(), model.left,
      only_solids(deck.mesh) ? "type = \"solid\"\n" : "", quoted(path), model.take, model.material, model.supports,
      model.run);
}

struct BodyMaterial {
  std::string text;  ///< of the body
  double young = 0;  ///< the least
  bool weighs = true;
};
BodyMaterial steel_in(const std::string& units) {
  const bool millimetres = units.starts_with("mm");
  const double young = millimetres ? 210e3 : 210e9;
  return {fmt::format("material = {{ young = {:g}, poisson = 0.3, density = {:g} }}  # of steel in {}; the file states "
                      "none that is taken\n",
                      young, millimetres ? 7.85e-9 : 7850.0, millimetres ? "mm, t, s" : "m, kg, s"),
          young};
}

/// That of the file, or `steel` where it has none.
BodyMaterial material_of(const Mesh& mesh, const BodyMaterial& steel, bool statics) {
  if (!states_materials(mesh, statics)) return steel;
  std::set<std::string> of_sections;
  for (const auto& [set, name] : mesh.section_material) of_sections.insert(name);
  BodyMaterial out{"", 0, states_materials(mesh, false)};
  std::size_t known = 0;
  for (const dynamics::MeshMaterial& m : mesh.materials)
    if (of_sections.contains(m.name) && m.young > 0) {
      out.young = known++ == 0 ? m.young : std::min(out.young, m.young);
      out.text += fmt::format("{}{} {:g}", out.text.empty() ? "" : ", ", m.name, m.young);
    }
  out.text = fmt::format("# {} of the file. Young's modulus: {}.\n",
                         known == 1 ? "The material is that" : "Materials are those", out.text);
  return out;
}

}  // namespace

std::string first_model(const Mesh& stated, const dynamics::MeshSurvey& survey, const std::string& mesh_file,
                        const std::string& model_file) {
  const auto refuse = [&](const std::string& what) {
    throw Error(StatusCode::invalid_input, fmt::format("no model of '{}': {}", mesh_file, what));
  };
  namespace fs = std::filesystem;
  std::error_code ignored;
  const fs::path from = model_file.empty() ? fs::path(mesh_file).parent_path() : fs::path(model_file).parent_path();
  fs::path path = fs::relative(mesh_file, from.empty() ? fs::path(".") : from, ignored);
  if (path.empty()) path = fs::absolute(mesh_file);
  const BodyMaterial steel = steel_in(survey.units);
  std::string why;
  int modes = 0;
  try {
    const dynamics::Deck deck = dynamics::is_deck(mesh_file) ? dynamics::read_deck(mesh_file) : dynamics::Deck();
    if (std::string text = deck.steps > 0 ? text_of_deck(deck, mesh_file, path.string(), steel.text) : "";
        !text.empty())
      return text;
    if (deck.steps > 0) why = "# What can be taken of the deck's own supports does not hold it.\n";
    if (deck.step.kind == dynamics::DeckStep::Kind::modes) modes = deck.step.modes;
  } catch (const Error& error) {  // a mesh all the same
    why = fmt::format("# The deck's own supports and loads cannot be taken: {}\n", error.what());
  }
  if (survey.solids == 0)
    refuse(
        "it has no solids; of triangles and quadrilaterals make a body of type \"shell\" "
        "(docs/guide/simulate.md#shells-of-mesh-files)");
  if (survey.simulated < survey.solids)
    refuse("it has solids that are not simulated (tetrahedra, hexahedra and wedges are)");
  Mesh mesh = stated;
  mesh.drop_unused_nodes();
  const bool sides = dynamics::add_side_sets(mesh);
  const Faces faces = sides ? ends_of(survey) : choose_faces(mesh, static_cast<std::size_t>(survey.outer_faces));
  if (faces.held.empty()) refuse("it names no part of its surface");
  const BodyMaterial material = material_of(mesh, steel, modes == 0);
  // Where no second face is free, the part's own weight loads it.
  const bool weight = faces.pressed.empty() && material.weighs;
  std::string sets;
  for (const auto& [name, list] : mesh.face_sets) sets += (sets.empty() ? "" : ", ") + name;
  if (sets.size() > 400) sets = sets.substr(0, 400) + " ...";
  std::string text = fmt::format(
      "# A first model of {}, written by 'espalier mesh'. One face of the part is held;\n"
      "# pressure on another one, or its weight, loads it.\n{}"
      "# Face sets: {}{}\n"
      "# Run it: espalier simulate MODEL.toml --out results; then: espalier view results\n"
      "gravity = [0, 0, {}]\n\n[bodies.part]\ntype = \"solid\"\nmesh = {{ file = {} }}\n{}\n"
      "[supports]\nclamp = {{ body = \"part\", face = \"{}\", hold = \"all\" }}\n{}\n",
      fs::path(mesh_file).filename().string(), why, sets, sides ? " (the ends of the part in each direction)" : "",
      weight ? (survey.units.starts_with("mm") ? "-9810" : "-9.81") : "0", quoted(path.string()), material.text,
      faces.held, held_pieces(mesh, mesh.nodes_of_faces(mesh.face_sets.at(faces.held))));
  if (!faces.pressed.empty())
    text +=
        fmt::format("[forces]\nload = {{ type = \"pressure\", body = \"part\", face = \"{}\", pressure = {:g} }}\n\n",
                    faces.pressed, material.young * 1e-6);
  if (modes > 0) text += fmt::format("[initial]\nmodes = {}\n\n", modes);
  return text +
         "[statics]\nlinear = true\n\n[output]\nquantities = [\"clamp.force.x\", \"clamp.force.y\", "
         "\"clamp.force.z\"]\n";
}

}  // namespace espalier::cli
