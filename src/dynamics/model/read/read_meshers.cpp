// Meshes of bodies: files, and the parts of our meshers.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "dynamics/model/read/body_readers.hpp"
#include "dynamics/model/units/unit_system.hpp"

namespace espalier::dynamics::model {
namespace {

using MesherForm = decltype(MesherSpec::shape);

constexpr int kMostPieces = 100000;  // teeth or blades

/// Sizes with their defaults, which are metres but for those of angles and ratios.
void lengths(Section& s, const std::string& units, std::initializer_list<std::pair<const char*, double*>> list) {
  const std::vector<std::string> others = {"pressure_angle", "opening", "angle", "disc_position", "blade_fraction"};
  for (const auto& [key, value] : list) {
    const bool length = std::find(others.begin(), others.end(), key) == others.end();
    *value = s.positive(key, length ? in_units(units, *value, "m") : *value);
  }
}

/// `divisions`, where it stands: three numbers of elements.
void read_divisions(Section& s, int (&divisions)[3], double copies = 1) {
  if (!s.has("divisions")) return;
  const Vec3 n = s.vector("divisions");
  for (int i = 0; i < 3; ++i) {
    if (!(n[i] >= 1 && n[i] <= kMostElements) || n[i] != std::floor(n[i]))
      fail(s.place("divisions"), fmt::format("needs three whole numbers from 1 to {:g}", kMostElements));
    divisions[i] = static_cast<int>(n[i]);
  }
  if (const double all = copies * n.prod(); all > kMostElements)
    fail(s.place("divisions"), fmt::format("makes {:g} elements; at most {:g} can be", all, kMostElements));
}

MesherForm read_block(Section& s, const std::string& units) {
  BlockMesh b;
  lengths(s, units, {{"lx", &b.shape.lx}, {"ly", &b.shape.ly}, {"lz", &b.shape.lz}});
  read_divisions(s, b.divisions);
  return b;
}

MesherForm read_rod(Section& s, const std::string& units) {
  RodShape r;
  lengths(s, units,
          {{"length", &r.length},
           {"big_inner", &r.big_inner},
           {"big_outer", &r.big_outer},
           {"small_inner", &r.small_inner},
           {"small_outer", &r.small_outer},
           {"shank_big", &r.shank_big},
           {"shank_small", &r.shank_small},
           {"thickness", &r.thickness}});
  return r;
}

MesherForm read_link(Section& s, const std::string& units) {
  LinkShape l;
  lengths(s, units,
          {{"pitch", &l.pitch},
           {"inner", &l.inner},
           {"outer", &l.outer},
           {"waist", &l.waist},
           {"thickness", &l.thickness}});
  return l;
}

MesherForm read_crank(Section& s, const std::string& units) {
  CrankShape c;
  lengths(s, units,
          {{"throw_radius", &c.throw_radius},
           {"journal_radius", &c.journal_radius},
           {"pin_radius", &c.pin_radius},
           {"web_big", &c.web_big},
           {"web_small", &c.web_small},
           {"web_neck", &c.web_neck},
           {"journal_length", &c.journal_length},
           {"web_thickness", &c.web_thickness},
           {"pin_length", &c.pin_length}});
  return c;
}

MesherForm read_guide(Section& s, const std::string& units) {
  GuideShape g;
  lengths(s, units,
          {{"lead", &g.lead}, {"radius", &g.radius}, {"angle", &g.angle}, {"height", &g.height}, {"width", &g.width}});
  return g;
}

MesherForm read_rotor(Section& s, const std::string& units) {
  RotorShape r;
  r.blades = s.integer("blades", 2, r.blades, kMostPieces);
  lengths(s, units,
          {{"bore_radius", &r.bore_radius},
           {"shaft_radius", &r.shaft_radius},
           {"disc_radius", &r.disc_radius},
           {"tip_radius", &r.tip_radius},
           {"shaft_length", &r.shaft_length},
           {"disc_thickness", &r.disc_thickness},
           {"bearing_length", &r.bearing_length},
           {"disc_position", &r.disc_position},
           {"blade_fraction", &r.blade_fraction}});
  r.blade_taper = s.number("blade_taper", r.blade_taper);
  r.blade_twist = s.number("blade_twist", r.blade_twist);
  return r;
}

MesherForm read_gear(Section& s, const std::string& units) {
  GearMesh g;
  g.shape.teeth = s.integer("teeth", 6, g.shape.teeth, kMostPieces);
  lengths(s, units,
          {{"module", &g.shape.module},
           {"pressure_angle", &g.shape.pressure_angle},
           {"width", &g.shape.width},
           {"bore_radius", &g.shape.bore_radius}});
  g.shape.backlash = s.number("backlash", g.shape.backlash);
  g.shape.tip_relief = s.number("tip_relief", g.shape.tip_relief);
  read_divisions(s, g.divisions, g.shape.teeth);
  return g;
}

MesherForm read_tyre(Section& s, const std::string& units) {
  TyreMesh t;
  lengths(s, units,
          {{"radius", &t.shape.radius},
           {"section_radius", &t.shape.section_radius},
           {"thickness", &t.shape.thickness},
           {"opening", &t.shape.opening}});
  constexpr int kMostSectors = 1000;
  t.shape.sectors = s.integer("sectors", 3, t.shape.sectors, kMostSectors);
  read_divisions(s, t.divisions);
  return t;
}

/// What a part of our meshers is called, and what reads it.
struct MesherRow {
  const char* name;
  MesherForm (*read)(Section& s, const std::string& units);
};
constexpr MesherRow kMeshers[] = {{"block", read_block},    {"connecting-rod", read_rod}, {"chain-link", read_link},
                                  {"crank", read_crank},    {"guide", read_guide},        {"bladed-rotor", read_rotor},
                                  {"spur-gear", read_gear}, {"tyre", read_tyre}};

constexpr base::Named<ElementType> kMesherElements[] = {{"hex8", ElementType::hex8}, {"hex20", ElementType::hex20}};

void read_take(Section& mesh, MeshFile& file) {
  file.take = mesh.texts("take");
  if (file.take.empty()) return;
  file.step = mesh.integer("step", 1, 0);
  file.owner = mesh.text("of", "");
}

}  // namespace

Index read_elements(Section& s, const std::string& key, int otherwise) {
  return static_cast<Index>(s.integer(key, 1, otherwise, static_cast<int>(kMostElements)));
}

std::string beside_model(const Description& model, const std::string& given) {
  return given.empty() || given.front() == '/' || model.folder.empty() ? given : model.folder + "/" + given;
}

MeshFile read_mesh_file(Section& mesh, const Description& model, const std::string& whose) {
  if (!mesh.has("file")) fail(mesh.place(), whose + " is a file: mesh = { file = \"...\" }");
  MeshFile found;
  found.path = beside_model(model, mesh.text("file"));
  found.scale = mesh.positive("scale", 1);
  read_take(mesh, found);
  mesh.finish();
  return found;
}

std::variant<MeshFile, MesherSpec> read_mesh_source(Section s, const Description& model) {
  if (s.has("file")) {
    MeshFile file{beside_model(model, s.text("file")), s.positive("scale", 1), {}};
    read_take(s, file);
    s.finish();
    return file;
  }
  MesherSpec part;
  const MesherRow& mesher = s.row("part", kMeshers);
  part.size.unknowns = s.positive("unknowns", part.size.unknowns);
  part.size.type = s.one_of("element", kMesherElements, part.size.type);
  part.shape = mesher.read(s, model.units);
  s.finish();
  return part;
}

}  // namespace espalier::dynamics::model
