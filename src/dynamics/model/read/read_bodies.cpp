// The section [bodies] with meshes and materials.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <numbers>
#include <utility>

#include "dynamics/contact/geometry/surface_inertia.hpp"
#include "dynamics/model/build/body_demand.hpp"
#include "dynamics/model/description.hpp"
#include "dynamics/model/units/unit_system.hpp"

namespace espalier::dynamics::model {
namespace {

const std::vector<std::string> kTypes = {"rigid", "solid", "cable", "beam", "shell", "point", "substructure"};

constexpr const char* kNeedsMaterial =
    "needs 'material', a name of [materials] or a table { young = ..., poisson = ..., density = ... }";

/// The materials of the model by name, and where bodies find them.
class BodyReader {
 public:
  BodyReader(Section& root, Description& model) : model_(model) {
    root.named("materials",
               [&](const std::string& name, const Value& value) { materials_[name] = read_material(value); });
  }

  void read(const std::string& name, const Value& value) {
    Section s(value);
    BodySpec body;
    body.place = value.place;
    body.name = name;
    body.velocity_given = s.has("velocity");
    body.angular_velocity_given = s.has("angular_velocity");
    if (s.has("gravity")) body.gravity = s.vector("gravity");
    const int type = s.choice("type", kTypes);
    if (type == 0) {
      body.shape = read_rigid(s);
    } else if (type == 5) {
      body.shape = read_point(s);
    } else {
      read_motion(s, body);
      if (type == 1) body.shape = read_solid(s);
      if (type == 2) body.shape = read_cable(s);
      if (type == 3) body.shape = read_beam(s);
      if (type == 4) body.shape = read_shell(s);
      if (type == 6) body.shape = read_substructure(s);
    }
    s.finish();
    body.massless = std::exchange(massless_, false);
    demand_.add(body);
    model_.bodies.push_back(std::move(body));
  }

 private:
  Material read_material(const Value& value) const {
    Section s(value);
    Material m;
    check_material(s, value);
    m.law = static_cast<SolidLaw>(s.choice("law", {"st-venant-kirchhoff", "neo-hookean"}, 0));
    m.young = s.positive("young");
    m.poisson = s.number("poisson", 0);
    if (!(m.poisson > -1 && m.poisson < 0.5))
      fail(s.place("poisson"), fmt::format("must lie in (-1, 0.5), not {}", m.poisson));
    m.density = inertia(s, "density");
    s.finish();
    return m;
  }

  /// All that a material lacks in one message; what is misspelt is told where it is read.
  void check_material(const Section& s, const Value& value) const {
    const std::vector<std::string> known = {"law", "young", "poisson", "density"};
    for (const auto& entry : value.entries)
      if (std::find(known.begin(), known.end(), entry.first) == known.end()) return;
    std::string lacks;
    if (!s.has("young")) lacks = "'young' (Young's modulus)";
    if (!s.has("density") && !model_.statics)
      lacks += fmt::format(
          "{}'density' (mass over volume; only statics does without: [statics] instead of a motion, and "
          "no gravity)",
          lacks.empty() ? "" : " and ");
    if (!lacks.empty()) fail(s.place(), fmt::format("the material needs {}", lacks));
  }

  /// Density and the like: > 0; statics alone does without and takes 1, 0 stands for that here.
  double inertia(Section& s, const std::string& key) const {
    if (s.has(key)) return s.positive(key);
    if (!model_.statics)
      fail(s.place(),
           fmt::format("needs '{}', a number greater than 0 (only statics does without: [statics] instead of "
                       "a motion, and no gravity)",
                       key));
    return 0;
  }
  /// The same as a number that bodies can be made with.
  double noted(double density) const {
    massless_ = massless_ || density == 0;
    return density == 0 ? 1 : density;
  }

  std::optional<Material> material(Section& s) const {
    std::optional<Material> found = plain_material(s);
    if (found) found->density = noted(found->density);
    return found;
  }
  std::optional<Material> plain_material(Section& s) const {
    const Value* value = s.value("material");
    return value == nullptr ? std::nullopt : std::optional(material_of(*value));
  }
  /// A name, or a table.
  Material material_of(const Value& value) const {
    if (value.type != Value::Type::text) return read_material(value);
    const auto it = materials_.find(value.text);
    if (it != materials_.end()) return it->second;
    std::vector<std::string> names;
    for (const auto& [name, m] : materials_) names.push_back(name);
    fail(value.place, fmt::format("unknown material '{}'{}", value.text, suggestion(value.text, names)));
  }
  Material needed_material(Section& s) const {
    const auto found = material(s);
    if (!found) fail(s.place(), kNeedsMaterial);
    return *found;
  }

  static PointSpec read_point(Section& s) {
    PointSpec p;
    p.data.mass = s.positive("mass");
    p.data.position = s.vector("position", Vec3::Zero());
    p.data.velocity = s.vector("velocity", Vec3::Zero());
    return p;
  }

  /// File and scale of a closed surface.
  std::pair<std::string, double> read_closed_surface(Section& mesh) const {
    std::pair<std::string, double> found = {beside_model(mesh.text("file")), mesh.positive("scale", 1)};
    mesh.finish();
    return found;
  }

  /// A uniform solid inside a closed surface of a file; its centre of mass stands where the file puts it.
  RigidSpec read_rigid_of_surface(Section& s) const {
    for (const char* other : {"inertia", "box"})
      if (s.has(other)) fail(s.place(other), "does not go with 'mesh', which gives the inertia and the shape");
    if (s.has("mass") == s.has("density")) fail(s.place(), "needs one of 'mass' and 'density' beside 'mesh'");
    auto mesh = s.table("mesh");
    const auto [file, scale] = read_closed_surface(*mesh);
    RigidSpec r;
    const contact::SurfaceSolid solid = contact::solid_inside(contact::read_surface(file, scale), file);
    r.data.mass = s.has("mass") ? s.positive("mass") : s.positive("density") * solid.volume;
    r.data.inertia = r.data.mass / solid.volume * solid.inertia;
    r.box = solid.extents;
    r.data.position = s.vector("position", solid.centre);
    read_rigid_motion(s, r);
    return r;
  }

  static void read_rigid_motion(Section& s, RigidSpec& r) {
    r.data.rotation = quaternion_of(s.rotation("rotation"));
    r.data.velocity = s.vector("velocity", Vec3::Zero());
    r.data.angular_velocity = s.vector("angular_velocity", Vec3::Zero());
  }

  RigidSpec read_rigid(Section& s) const {
    if (s.has("mesh")) return read_rigid_of_surface(s);
    RigidSpec r;
    r.data.mass = s.positive("mass");
    if (s.has("box")) {
      r.box = s.vector("box");
      if (!(r.box->minCoeff() > 0)) fail(s.place("box"), "needs three lengths greater than 0");
    }
    if (!s.has("inertia") && !r.box) fail(s.place(), "needs 'inertia', or 'box' = [x, y, z], from which it follows");
    if (s.has("inertia")) {
      r.data.inertia = s.matrix("inertia");
    } else {  // a uniform block
      const Vec3 square = r.box->cwiseAbs2();
      r.data.inertia = Vec3(square.sum() * Vec3::Ones() - square).asDiagonal();
      r.data.inertia *= r.data.mass / 12;
    }
    if (!(r.data.inertia.diagonal().minCoeff() > 0))
      fail(s.place("inertia"),
           "needs moments of inertia greater than 0; a body without extension still needs small ones");
    r.data.position = s.vector("position", Vec3::Zero());
    read_rigid_motion(s, r);
    return r;
  }

  static void read_motion(Section& s, BodySpec& body) {
    body.position = s.vector("position", Vec3::Zero());
    body.rotation = s.rotation("rotation");
    body.velocity = s.vector("velocity", Vec3::Zero());
    body.angular_velocity = s.vector("angular_velocity", Vec3::Zero());
    if (auto d = s.table("damping")) read_damping(*d, body);
    if (auto r = s.table("reduce")) body.reduction = read_reduction(*r, s.text("type") == "substructure");
    if (!body.reduction || body.reduction->damping == 0) return;
    if (body.modal_damping > 0)
      fail(s.place("reduce"), "'damping' here and 'ratio' in the body's damping are the same; give one of them");
    body.modal_damping = body.reduction->damping;
  }

  static void read_damping(Section& d, BodySpec& body) {
    if (d.has("ratio") && d.has("frequencies")) {
      for (const char* other : {"mass", "stiffness"})
        if (d.has(other)) fail(d.place(other), "follows from 'ratio' and 'frequencies'; leave it out");
      body.damping = rayleigh_of_ratios(d);
    } else {
      if (d.has("frequencies"))
        fail(d.place("frequencies"), "needs 'ratio', that of both frequencies or a list of two");
      body.modal_damping = d.number("ratio", 0);
      if (!(body.modal_damping >= 0 && body.modal_damping < 1))
        fail(d.place("ratio"), "is a part of critical damping: it must be at least 0 and below 1 (2 %: 0.02)");
      body.damping.mass = d.number("mass", 0);
      body.damping.stiffness = d.number("stiffness", 0);
      if (body.damping.mass < 0) fail(d.place("mass"), "must not be negative");
      if (body.damping.stiffness < 0) fail(d.place("stiffness"), "must not be negative");
    }
    body.loss_factor = d.number("loss_factor", 0);
    if (!(body.loss_factor >= 0)) fail(d.place("loss_factor"), "must not be negative");
    if (d.has("frequency")) {
      if (!(body.loss_factor > 0)) fail(d.place("frequency"), "belongs to 'loss_factor', which is not given");
      body.loss_frequency = d.positive("frequency");
    }
    d.finish();
  }

  /// ratio = mass / (2 w) + stiffness w / 2 at two frequencies.
  static RayleighDamping rayleigh_of_ratios(Section& d) {
    const std::vector<double> f = d.numbers("frequencies");
    const bool list = d.value("ratio")->type == Value::Type::array;
    const std::vector<double> z = list ? d.numbers("ratio") : std::vector(2, d.number("ratio"));
    if (f.size() != 2) fail(d.place("frequencies"), fmt::format("needs two numbers, has {}", f.size()));
    if (z.size() != 2) fail(d.place("ratio"), fmt::format("needs one number or two, has {}", z.size()));
    if (!(f[0] > 0 && f[1] > f[0])) fail(d.place("frequencies"), "needs two frequencies above 0, the lower one first");
    const double a = 2 * std::numbers::pi * f[0], b = 2 * std::numbers::pi * f[1];
    const RayleighDamping out{2 * a * b * (z[0] * b - z[1] * a) / (b * b - a * a),
                              2 * (z[1] * b - z[0] * a) / (b * b - a * a)};
    if (!(out.mass >= 0 && out.stiffness >= 0))
      fail(
          d.place("ratio"),
          fmt::format("these ratios would need mass = {:g} and stiffness = {:g}, which must not be negative: the ratio "
                      "of the higher frequency lies between {:g} and {:g}",
                      out.mass, out.stiffness, z[0] * a / b, z[0] * b / a));
    return out;
  }

  /// @param reduced the body is so already: all of it may be kept
  static ReductionOptions read_reduction(Section& s, bool reduced) {
    ReductionOptions r;
    if (!s.has("modes") && !s.has("frequency") && !reduced)
      fail(s.place(), "needs 'modes', how many are kept beside those of the interfaces, or 'frequency', below which");
    if (s.has("modes")) r.modes = s.integer("modes", 0, 0);
    r.frequency = s.positive("frequency", r.frequency);
    r.damping = s.number("damping", 0);
    if (!(r.damping >= 0)) fail(s.place("damping"), "must not be negative");
    s.finish();
    return r;
  }

  SolidSpec read_solid(Section& s) const {
    SolidSpec solid;
    const auto mesh = s.table("mesh");
    if (!mesh) fail(s.place(), "needs 'mesh': { file = \"...\" } or { part = \"...\", unknowns = ... }");
    solid.mesh = read_mesh_source(*mesh);
    solid.material = material(s);
    read_set_materials(s, solid);
    if (!solid.material && !std::holds_alternative<MeshFile>(solid.mesh)) fail(s.place(), kNeedsMaterial);
    solid.element_set = s.text("element_set", "");
    solid.options.hex8 =
        static_cast<Hex8Formulation>(s.choice("hex8", {"full", "mean-dilatation", "enhanced", "shell"}, 2));
    solid.options.reduced_hex20 = s.flag("reduced_hex20", false);
    if (auto e = s.table("erosion")) solid.erosion = read_erosion(*e);
    return solid;
  }

  /// The materials of element sets.
  void read_set_materials(Section& s, SolidSpec& solid) const {
    const Value* table = s.value("materials");
    if (table == nullptr) return;
    if (!table->is_table() || table->entries.empty())
      fail(table->place, "must be a table: { SET = \"steel\", OTHER = { young = ..., poisson = ..., density = ... } }");
    for (const auto& [set, value] : table->entries) {
      solid.set_materials.emplace_back(set, material_of(value));
      Material& made = solid.set_materials.back().second;
      made.density = noted(made.density);
    }
  }

  /// Relative to the folder of the model.
  std::string beside_model(const std::string& given) const {
    return given.empty() || given.front() == '/' || model_.folder.empty() ? given : model_.folder + "/" + given;
  }

  SubstructureSpec::Matrix read_matrix(const Section& body, std::optional<Section> s) const {
    if (!s) fail(body.place(), "needs 'stiffness' and 'mass': { file = \"...\", name = \"...\" } each");
    SubstructureSpec::Matrix m{s->place(), beside_model(s->text("file")), s->text("name", "")};
    s->finish();
    return m;
  }

  SubstructureSpec read_substructure(Section& s) const {
    SubstructureSpec out;
    out.stiffness = read_matrix(s, s.table("stiffness"));
    out.mass = read_matrix(s, s.table("mass"));
    const Value* nodes = s.value("nodes");
    if (nodes == nullptr)
      fail(s.place(),
           "needs 'nodes': [{ label = 1, position = [x, y, z] }, ...] or { file = \"...\" } with GRID cards");
    if (nodes->type == Value::Type::table) {
      Section file(*nodes);
      out.nodes_path = beside_model(file.text("file"));
      file.finish();
    } else {
      if (nodes->type != Value::Type::array) fail(nodes->place, "must be a list of nodes or { file = \"...\" }");
      for (const Value& value : nodes->items) out.nodes.push_back(read_node(value));
    }
    if (s.has("lines")) read_lines(s, out);
    return out;
  }

  static SubstructureNode read_node(const Value& value) {
    Section s(value);
    SubstructureNode node;
    if (!s.has("label")) fail(s.place(), "needs 'label', a whole number");
    node.label = s.integer("label", 1, 1);
    node.position = s.vector("position");
    node.components = s.integer("components", 3, 0);
    if (node.components != 0 && node.components != 3 && node.components != 6)
      fail(s.place("components"), "must be 6 (displacement and rotation) or 3 (displacement alone)");
    s.finish();
    return node;
  }
  static void read_lines(Section& s, SubstructureSpec& out) {
    const std::vector<double> labels = s.numbers("lines");
    const auto whole = [](double x) { return std::abs(x) < 1e15 && x == std::floor(x); };
    if (labels.size() % 2 != 0 || !std::all_of(labels.begin(), labels.end(), whole))
      fail(s.place("lines"), "needs two labels of nodes for every line: [1, 2, 2, 3]");
    for (std::size_t k = 0; k < labels.size(); k += 2)
      out.lines.push_back({static_cast<std::int64_t>(labels[k]), static_cast<std::int64_t>(labels[k + 1])});
  }

  std::variant<MeshFile, MesherSpec> read_mesh_source(Section s) const {
    if (s.has("file")) {
      MeshFile file{beside_model(s.text("file")), s.positive("scale", 1), {}};
      read_take(s, file);
      s.finish();
      return file;
    }
    MesherSpec part;
    const int kind = s.choice(
        "part", {"block", "connecting-rod", "chain-link", "crank", "guide", "bladed-rotor", "spur-gear", "tyre"});
    part.size.unknowns = s.positive("unknowns", part.size.unknowns);
    part.size.type = s.choice("element", {"hex8", "hex20"}, 0) == 0 ? ElementType::hex8 : ElementType::hex20;
    if (kind == 0) part.shape = read_block(s);
    if (kind == 1) part.shape = read_rod(s);
    if (kind == 2) part.shape = read_link(s);
    if (kind == 3) part.shape = read_crank(s);
    if (kind == 4) part.shape = read_guide(s);
    if (kind == 5) part.shape = read_rotor(s);
    if (kind == 6) part.shape = read_gear(s);
    if (kind == 7) part.shape = read_tyre(s);
    s.finish();
    return part;
  }

  /// Sizes with their defaults, which are metres but for those of angles and ratios.
  void lengths(Section& s, std::initializer_list<std::pair<const char*, double*>> list) const {
    const std::vector<std::string> others = {"pressure_angle", "opening", "angle", "disc_position", "blade_fraction"};
    for (const auto& [key, value] : list) {
      const bool length = std::find(others.begin(), others.end(), key) == others.end();
      *value = s.positive(key, length ? in_units(model_.units, *value, "m") : *value);
    }
  }
  /// `divisions`, where it stands: three numbers of elements.
  static void read_divisions(Section& s, int (&divisions)[3], double copies = 1) {
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
  BlockMesh read_block(Section& s) const {
    BlockMesh b;
    lengths(s, {{"lx", &b.shape.lx}, {"ly", &b.shape.ly}, {"lz", &b.shape.lz}});
    read_divisions(s, b.divisions);
    return b;
  }
  RodShape read_rod(Section& s) const {
    RodShape r;
    lengths(s, {{"length", &r.length},
                {"big_inner", &r.big_inner},
                {"big_outer", &r.big_outer},
                {"small_inner", &r.small_inner},
                {"small_outer", &r.small_outer},
                {"shank_big", &r.shank_big},
                {"shank_small", &r.shank_small},
                {"thickness", &r.thickness}});
    return r;
  }
  LinkShape read_link(Section& s) const {
    LinkShape l;
    lengths(s, {{"pitch", &l.pitch},
                {"inner", &l.inner},
                {"outer", &l.outer},
                {"waist", &l.waist},
                {"thickness", &l.thickness}});
    return l;
  }
  CrankShape read_crank(Section& s) const {
    CrankShape c;
    lengths(s, {{"throw_radius", &c.throw_radius},
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
  GuideShape read_guide(Section& s) const {
    GuideShape g;
    lengths(
        s, {{"lead", &g.lead}, {"radius", &g.radius}, {"angle", &g.angle}, {"height", &g.height}, {"width", &g.width}});
    return g;
  }
  RotorShape read_rotor(Section& s) const {
    RotorShape r;
    r.blades = s.integer("blades", 2, r.blades, kMostTeeth);
    lengths(s, {{"bore_radius", &r.bore_radius},
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
  TyreMesh read_tyre(Section& s) const {
    TyreMesh t;
    lengths(s, {{"radius", &t.shape.radius},
                {"section_radius", &t.shape.section_radius},
                {"thickness", &t.shape.thickness},
                {"opening", &t.shape.opening}});
    constexpr int kMostSectors = 1000;
    t.shape.sectors = s.integer("sectors", 3, t.shape.sectors, kMostSectors);
    read_divisions(s, t.divisions);
    return t;
  }
  GearMesh read_gear(Section& s) const {
    GearMesh g;
    g.shape.teeth = s.integer("teeth", 6, g.shape.teeth, kMostTeeth);
    lengths(s, {{"module", &g.shape.module},
                {"pressure_angle", &g.shape.pressure_angle},
                {"width", &g.shape.width},
                {"bore_radius", &g.shape.bore_radius}});
    g.shape.backlash = s.number("backlash", g.shape.backlash);
    g.shape.tip_relief = s.number("tip_relief", g.shape.tip_relief);
    read_divisions(s, g.divisions, g.shape.teeth);
    return g;
  }

  /// The most elements of one body. More have unknowns that no machine holds, and 32-bit numbers do not reach.
  static constexpr double kMostElements = 1e8;
  static constexpr int kMostTeeth = 100000;

  static Index elements(Section& s, const std::string& key, int otherwise) {
    return static_cast<Index>(s.integer(key, 1, otherwise, static_cast<int>(kMostElements)));
  }

  /// Lines of a file, in the place of an axis.
  LineFile read_lines_of_file(Section& s, Section mesh) const {
    for (const char* other : {"start", "end", "direction", "length", "curvature", "points", "elements"})
      if (s.has(other)) fail(s.place(other), "does not go with 'mesh', which says where the line is");
    LineFile out;
    out.file = read_mesh_file(mesh, "of a beam or cable");
    out.element_set = s.text("element_set", "");
    out.section_given = s.has("radius") || s.has("height") || s.has("axial");
    if (!s.has("axial")) out.material = material(s);
    return out;
  }

  CableSpec read_cable(Section& s) const {
    CableSpec c;
    if (auto mesh = s.table("mesh")) {
      c.file = read_lines_of_file(s, *mesh);
      if (s.has("radius")) c.outline = SectionOutline{0, s.positive("radius")};
      if (s.has("radius") || !c.file->section_given) return c;
    } else {
      c = {s.vector("start"), s.vector("end"), elements(s, "elements", 10), {}};
    }
    if (s.has("radius")) {  // a round wire
      const double r = s.positive("radius"), area = std::numbers::pi * r * r;
      const Material m = needed_material(s);
      c.section = {m.young * area, m.young * area * r * r / 4, m.density * area};
      c.outline = SectionOutline{m.young, r};
    } else {
      c.section = {s.positive("axial"), s.number("bending"), noted(inertia(s, "mass_per_length"))};
      if (c.section.bending < 0) fail(s.place("bending"), "must not be negative");
    }
    return c;
  }

  /// `start` and `end`, or `start`, `direction`, `length` and `curvature`, or `points`.
  static AxisShape read_axis(Section& s) {
    if (s.has("points")) {
      for (const char* other : {"start", "end", "direction", "length", "curvature"})
        if (s.has(other)) fail(s.place(other), "does not go with 'points', which say all of the axis");
      return SplineAxis{s.vectors("points")};
    }
    if (!s.has("curvature")) return StraightAxis{s.vector("start"), s.vector("end")};
    if (s.has("end")) fail(s.place("end"), "does not go with 'curvature'; give 'direction' and 'length'");
    return ArcAxis{s.vector("start"), s.vector("direction"), s.positive("length"), s.vector("curvature")};
  }
  static Vec3 first_direction(const AxisShape& shape) {
    if (const auto* straight = std::get_if<StraightAxis>(&shape)) return (straight->end - straight->start).normalized();
    if (const auto* arc = std::get_if<ArcAxis>(&shape)) return arc->direction.normalized();
    const auto& points = std::get<SplineAxis>(shape).points;
    return points.size() < 2 ? Vec3::UnitX() : Vec3((points[1] - points[0]).normalized());
  }

  BeamSpec read_beam(Section& s) const {
    BeamSpec b;
    if (auto mesh = s.table("mesh")) {
      b.file = read_lines_of_file(s, *mesh);
      b.file->y_given = s.has("y");
      b.y = s.vector("y", Vec3::UnitY());
      if (s.has("radius")) b.outline = SectionOutline{0, s.positive("radius")};
      if (s.has("height")) b.outline = SectionOutline{0, 0, s.positive("height"), s.positive("width")};
      if (b.outline || !b.file->section_given) return b;
    } else {
      b = {std::make_shared<const AxisShape>(read_axis(s)), Vec3::Zero(), elements(s, "elements", 10), {}};
      const Vec3 along = first_direction(*b.axis);
      b.y = s.vector("y", std::abs(along.y()) < 0.9 ? Vec3::UnitY() : Vec3::UnitX());
    }
    if (s.has("radius")) {
      const Material m = needed_material(s);
      b.outline = SectionOutline{m.young, s.positive("radius")};
      b.section = circular_section(m, b.outline->radius);
    } else if (s.has("height")) {
      const Material m = needed_material(s);
      b.outline = SectionOutline{m.young, 0, s.positive("height"), s.positive("width")};
      b.section = rectangular_section(m, b.outline->height, b.outline->width);
    } else {
      for (const auto& [key, value] :
           std::initializer_list<std::pair<const char*, double*>>{{"axial", &b.section.axial},
                                                                  {"shear_y", &b.section.shear_y},
                                                                  {"shear_z", &b.section.shear_z},
                                                                  {"torsion", &b.section.torsion},
                                                                  {"bending_y", &b.section.bending_y},
                                                                  {"bending_z", &b.section.bending_z},
                                                                  {"section_normal", &b.section.section_normal},
                                                                  {"section_shear", &b.section.section_shear}})
        *value = s.positive(key);
      b.section.mass_per_length = noted(inertia(s, "mass_per_length"));
      b.section.inertia_y = noted(inertia(s, "inertia_y"));
      b.section.inertia_z = noted(inertia(s, "inertia_z"));
    }
    return b;
  }

  MeshFile read_mesh_file(Section& mesh, const std::string& whose) const {
    if (!mesh.has("file")) fail(mesh.place(), whose + " is a file: mesh = { file = \"...\" }");
    MeshFile found;
    found.path = beside_model(mesh.text("file"));
    found.scale = mesh.positive("scale", 1);
    read_take(mesh, found);
    mesh.finish();
    return found;
  }

  static void read_take(Section& mesh, MeshFile& file) {
    file.take = mesh.texts("take");
    if (file.take.empty()) return;
    file.step = mesh.integer("step", 1, 0);
    file.owner = mesh.text("of", "");
  }

  /// Surface elements of a file.
  ShellSpec read_shell_of_file(Section& s, Section mesh) const {
    for (const char* other : {"origin", "x", "y", "curvature", "nx", "ny"})
      if (s.has(other)) fail(s.place(other), "does not go with 'mesh', which says where the shell is");
    ShellSpec shell;
    shell.file = read_mesh_file(mesh, "of a shell");
    shell.element_set = s.text("element_set", "");
    const std::optional<Material> given = material(s);
    shell.material_of_file = !given;
    if (given) shell.material = *given;
    if (s.has("thickness")) shell.thickness = s.positive("thickness");
    shell.offset_given = s.has("offset");
    shell.offset = s.number("offset", 0);
    return shell;
  }

  /// One number, or those of the four corners.
  static void read_thickness(Section& s, ShellSpec& shell) {
    if (!s.has("thickness") || s.value("thickness")->type != Value::Type::array) {
      shell.thickness = s.positive("thickness");
      return;
    }
    shell.corners = s.numbers("thickness");
    if (shell.corners.size() != 4 || !(*std::min_element(shell.corners.begin(), shell.corners.end()) > 0))
      fail(s.place("thickness"),
           "needs a number above 0, or those of the four corners: at the origin, at x, at x + y, at y");
    shell.thickness = 0.25 * (shell.corners[0] + shell.corners[1] + shell.corners[2] + shell.corners[3]);
  }

  ShellSpec read_shell(Section& s) const {
    if (auto mesh = s.table("mesh")) return read_shell_of_file(s, *mesh);
    ShellSpec shell{s.vector("origin", Vec3::Zero()),
                    s.vector("x"),
                    s.vector("y"),
                    s.number("curvature", 0),
                    elements(s, "nx", 4),
                    elements(s, "ny", 4),
                    needed_material(s),
                    0};
    read_thickness(s, shell);
    shell.offset = s.number("offset", 0);
    if (!(shell.x.cross(shell.y).norm() > 0)) fail(s.place("y"), "x and y must not be parallel");
    if (shell.curvature != 0) {
      if (!(std::abs(shell.x.dot(shell.y)) <= 1e-9 * shell.x.norm() * shell.y.norm()))
        fail(s.place("curvature"), "needs x and y at a right angle: x is bent about y");
      if (!(std::abs(shell.curvature) * shell.x.norm() < 2 * std::numbers::pi))
        fail(s.place("curvature"), "times the length of x must be less than a full turn, 2 pi");
    }
    if (static_cast<double>(shell.nx) * shell.ny > kMostElements)
      fail(s.place("nx"), fmt::format("nx times ny must not be above {:g}", kMostElements));
    return shell;
  }

  Description& model_;
  std::map<std::string, Material> materials_;
  mutable bool massless_ = false;  // the body that is being read
  MemoryDemand demand_;
};

}  // namespace

void read_bodies(Section& root, Description& model) {
  BodyReader reader(root, model);
  root.named("bodies", [&](const std::string& name, const Value& value) { reader.read(name, value); });
}

}  // namespace espalier::dynamics::model
