/// \file
/// `espalier mesh`: what a mesh file holds, a page of it, and a first model.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "base/output_file.hpp"
#include "command.hpp"
#include "common/checked_options.hpp"
#include "common/terminal.hpp"
#include "dynamics/mesh/names.hpp"
#include "dynamics/mesh/read.hpp"
#include "dynamics/mesh/read/formats.hpp"
#include "dynamics/mesh/survey.hpp"
#include "espalier/dynamics.hpp"
#include "models/mesh_model.hpp"
#include "solve/report.hpp"

namespace espalier::cli {

namespace {

using dynamics::Mesh;
using dynamics::MeshSurvey;
using MeshJson = nlohmann::ordered_json;

struct MeshCommand {
  std::string file, model, page;
  bool json = false, formats = false;
  int run() const;
  void write_model(const Mesh& mesh, const MeshSurvey& survey) const;
  void write_page(const Mesh& mesh, const MeshSurvey& survey) const;
};

/// The volume of the solids of an element set.
double volume_of_set(const Mesh& mesh, const std::string& set) {
  const auto found = mesh.element_sets.find(set);
  return found == mesh.element_sets.end() || found->second.empty()
             ? 0
             : dynamics::volume_integrals(mesh, found->second).volume;
}

double density_of(const Mesh& mesh, const std::string& material) {
  for (const auto& m : mesh.materials)
    if (m.name == material) return m.density;
  return 0;
}

MeshJson mesh_json(const Mesh& mesh, const MeshSurvey& s, const std::string& file) {
  MeshJson j;
  const dynamics::MeshFormat* format = dynamics::mesh_format_of(file);
  j["file"] = file;
  j["format"] = format->program;
  j["nodes"] = s.nodes;
  j["elements"] = s.elements;
  j["solids"] = {{"count", s.solids}, {"simulated", s.simulated}, {"volume", s.volume}, {"centre", s.centre}};
  j["surface"] = {{"faces", s.outer_faces}, {"area", s.surface}};
  j["extents"] = {{"least", s.least}, {"most", s.most}};
  j["edges"] = {{"shortest", s.shortest_edge}, {"longest", s.longest_edge}};
  j["shape"] = {{"least", s.least_shape}, {"median", s.median_shape}};
  if (s.worst_element >= 0) j["shape"]["worst_element"] = dynamics::element_name(mesh, s.worst_element);
  j["pieces"] = s.pieces.size();
  j["units"] = s.units;
  for (const auto& m : mesh.materials)
    j["materials"].push_back({{"name", m.name}, {"young", m.young}, {"poisson", m.poisson}, {"density", m.density}});
  for (const auto& [set, name] : mesh.section_material) {
    j["sections"][set] = name;
    j["masses"][set] = density_of(mesh, name) * volume_of_set(mesh, set);
  }
  const auto sizes = [&](const char* key, const auto& sets) {
    j["sets"][key] = MeshJson::object();
    for (const auto& [name, list] : sets) j["sets"][key][name] = list.size();
  };
  sizes("nodes", mesh.node_sets);
  sizes("elements", mesh.element_sets);
  sizes("faces", mesh.face_sets);
  j["defects"] = s.defects;
  j["notices"] = mesh.notices;
  return j;
}

/// "FIX (12), LOAD (3)", so many names at most.
template <class Sets>
std::string listed(const Sets& sets) {
  constexpr std::size_t kMost = 40;
  std::vector<std::string> list;
  for (const auto& [name, members] : sets) {
    if (list.size() == kMost) {
      list.push_back(fmt::format("and {} more (--json has all)", sets.size() - kMost));
      break;
    }
    list.push_back(fmt::format("{} ({})", name, members.size()));
  }
  return list.empty() ? "none" : fmt::format("{}", fmt::join(list, ", "));
}

void print_survey(const Mesh& mesh, const MeshSurvey& s, const std::string& file) {
  const auto row = [](const char* name, const std::string& text) { print_result("  {:<10} {}\n", name, text); };
  print_result("{} ({})\n", file, dynamics::mesh_format_of(file)->program);
  std::vector<std::string> kinds;
  for (const auto& [name, count] : s.elements) kinds.push_back(fmt::format("{} {}", count, name));
  row("elements",
      fmt::format("{} on {} nodes", kinds.empty() ? "none" : fmt::format("{}", fmt::join(kinds, ", ")), s.nodes));
  row("extents",
      fmt::format("{:g} x {:g} x {:g}, from ({:g}) to ({:g})", s.most[0] - s.least[0], s.most[1] - s.least[1],
                  s.most[2] - s.least[2], fmt::join(s.least, ", "), fmt::join(s.most, ", ")));
  row("units", s.units);
  if (s.solids > 0) {
    row("volume", fmt::format("{:.15g}, centre ({:.15g})", s.volume, fmt::join(s.centre, ", ")));
    row("edges", fmt::format("{:g} to {:g}", s.shortest_edge, s.longest_edge));
    row("shape", fmt::format("at least {:.3g} (element {}), median {:.3g}; 1: cube, 0.71: regular tetrahedron",
                             s.least_shape, dynamics::element_name(mesh, s.worst_element), s.median_shape));
  }
  row("surface", fmt::format("{:.9g} in {} faces of solids", s.surface, s.outer_faces));
  row("pieces", fmt::format("{}", s.pieces.size()));
  std::vector<std::string> materials;
  for (const auto& m : mesh.materials)
    materials.push_back(fmt::format("{} (Young's modulus {:g}, Poisson's ratio {:g}, density {:g})", m.name, m.young,
                                    m.poisson, m.density));
  row("materials", materials.empty() ? "none" : fmt::format("{}", fmt::join(materials, ", ")));
  for (const auto& [set, name] : mesh.section_material) {
    const double mass = density_of(mesh, name) * volume_of_set(mesh, set);
    row("section", fmt::format("{} is of {}{}", set, name, mass > 0 ? fmt::format(", mass {:.9g}", mass) : ""));
  }
  row("face sets", listed(mesh.face_sets));
  row("node sets", listed(mesh.node_sets));
  row("el. sets", listed(mesh.element_sets));
  for (const std::string& defect : s.defects) print_result("  {}: {}\n", toned(Tone::bad, "defect"), defect);
  for (const std::string& notice : mesh.notices) print_result("  notice: {}\n", notice);
}

void MeshCommand::write_model(const Mesh& mesh, const MeshSurvey& survey) const {
  if (std::filesystem::exists(model))
    throw Error(StatusCode::invalid_input, fmt::format("'{}' is there already; name another file", model));
  base::OutputFile out(model);
  out.write(first_model(mesh, survey, file, model));
  out.commit();
  if (!json) print_result("wrote {}; run it: espalier simulate {} --out results\n", model, model);
}

void MeshCommand::write_page(const Mesh& mesh, const MeshSurvey& survey) const {
  SimulationOptions options;
  options.out = page;
  Simulation simulation(options);
  const std::string beside = (std::filesystem::path(file).parent_path() / "first_model.toml").string();
  Status status = simulation.load_text(first_model(mesh, survey, file, ""), beside);
  if (status.ok()) status = simulation.run();
  if (!status.ok()) throw Error(status);
  if (!json) print_result("wrote {}/index.html, the first model under its load: espalier view {}\n", page, page);
}

int MeshCommand::run() const {
  if (formats) {
    print_result("{}", dynamics::mesh_formats_table());
    return kSolved;
  }
  if (file.empty()) throw Error(StatusCode::invalid_input, "name a mesh file, or ask for --formats");
  if (!std::filesystem::exists(file))
    throw Error(StatusCode::invalid_input, fmt::format("there is no file '{}'", file));
  const Mesh mesh = dynamics::read_mesh(file);
  const MeshSurvey survey = dynamics::survey_mesh(mesh);
  if (json)
    print_result("{}\n", to_text(mesh_json(mesh, survey, file)));
  else
    print_survey(mesh, survey, file);
  if (!model.empty()) write_model(mesh, survey);
  if (!page.empty()) write_page(mesh, survey);
  return kSolved;
}

}  // namespace

void add_mesh(CLI::App& app, Action& action) {
  auto command = std::make_shared<MeshCommand>();
  CLI::App* sub =
      app.add_subcommand("mesh", "What a mesh file holds, and a first model of it (docs/guide/your_files.md)");
  add_file(*sub, "file", command->file, "the mesh: .inp, .msh, .bdf, .cdb, .vtk, .vtu, .mesh, also .gz");
  add_file(*sub, "--model", command->model,
           "write a first model here, to edit: one face held, another pressed, or its weight");
  add_file(*sub, "--page", command->page, "write a page into this folder: the mesh under the load of the first model",
           "DIR");
  sub->add_flag("--json", command->json, "print as JSON");
  sub->add_flag("--formats", command->formats, "print the table of what is read from each kind of file");
  sub->callback([command, &action] { action = [command] { return command->run(); }; });
}

}  // namespace espalier::cli
