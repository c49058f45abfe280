// Bodies of MJCF with what hangs on them.
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <system_error>

#include "dynamics/model/robots/files.hpp"
#include "dynamics/model/robots/geom_mass.hpp"
#include "dynamics/model/robots/mjcf.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics::model::robots {
namespace {

struct MeshAsset {
  std::string file, inertia;
  Vec3 scale = Vec3::Ones();
  Pose reference;
  Element element;
};

class BodyReader {
 public:
  BodyReader(const MjcfText& text, const RobotOptions& options, Robot& robot)
      : text_(text), options_(options), robot_(robot) {}

  void run() {
    for (const Element& section : text_.sections("asset"))
      for (const Element& e : text_.children(section))
        if (e.tag() == "mesh") add_mesh(e);
    for (const Element& section : text_.sections("contact"))
      for (const Element& e : text_.children(section))
        if (e.tag() == "pair")
          for (const char* key : {"geom1", "geom2"}) in_pairs_.insert(e.text(key));
    bool any = false;
    for (const Element& world : text_.sections("worldbody")) {
      any = true;
      read_children(world, {-1, {}, world.text("childclass"), {}});
    }
    if (!any) text_.root().fail("has no <worldbody>");
    scale_masses();
  }

 private:
  /// What is around an element: its link, the frames between, the class of defaults.
  struct Around {
    int link;
    Pose frame;
    std::string childclass, suffix = {};  ///< suffix: of names, in copies
  };
  /// Its name in this copy; "": it has none.
  std::string name_of(const Element& e, const Around& around) {
    std::string name = e.text("name");
    if (name.empty() || around.suffix.empty()) return name;
    robot_.copied[std::string(e.tag()) + " " + name].push_back(around.suffix);
    return name + around.suffix;
  }

  void add_mesh(const Element& e) {
    const Attributes a = text_.attributes(e);
    MeshAsset mesh;
    mesh.element = e;
    mesh.scale = a.vector("scale", Vec3::Ones());
    mesh.inertia = a.text("inertia", "legacy");
    const Vec3 at = a.vector("refpos", Vec3::Zero());
    Mat3 turn = Mat3::Identity();
    if (a.has("refquat")) {
      const std::vector<double> q = a.numbers("refquat", 4, 4);
      turn = of_quaternion(q[0], q[1], q[2], q[3]);
    }
    mesh.reference = Pose{at, turn}.inverse();
    std::string file = a.text("file");
    std::string name = e.text("name");
    if (name.empty()) name = std::filesystem::path(file).stem().string();
    if (!file.empty()) {
      if (text_.compiler().strip_path) file = std::filesystem::path(file).filename().string();
      mesh.file = path_from(path_from(text_.folder(), text_.compiler().mesh_folder), file);
    }
    meshes_[name] = mesh;
  }

  /// Place of an element with its link, which is that of the frames around it first.
  Pose pose_in(const Attributes& a, const Around& around) const { return around.frame * text_.pose(a); }

  void read_children(const Element& parent, const Around& around) {
    for (const Element& e : text_.children(parent)) {
      if (e.tag() == "body") {
        read_body(e, around);
      } else if (e.tag() == "frame") {
        Around inner = around;
        inner.frame = around.frame * text_.pose(Attributes({e}));
        if (e.has("childclass")) inner.childclass = e.text("childclass");
        read_children(e, inner);
      } else if (e.tag() == "joint" || e.tag() == "freejoint") {
        if (around.link < 0) e.fail("the world does not move");
        add_joint(e, around, link_of(around.link));
      } else if (e.tag() == "geom") {
        add_geom(e, around);
      } else if (e.tag() == "site") {
        const Attributes a = text_.attributes(e, around.childclass);
        link_of(around.link).sites.push_back({name_of(e, around), site_pose(a, around)});
      } else if (e.tag() == "replicate") {
        replicate(e, around);
      } else if (e.tag() != "inertial") {
        const std::string tag(e.tag());
        if (tag == "attach" || tag == "composite" || tag == "flexcomp")
          robot_.notices.push_back(e.where() + ": <" + tag + "> and the bodies that it would make are left out");
        robot_.pass_over("<" + tag + ">");
      }
    }
  }

  /// As in MuJoCo, copy k is turned by k times the angles, and stands an `offset` in the axes of copy k - 1 from that.
  void replicate(const Element& e, const Around& around) {
    const double count = e.numbers("count", 1, 1)[0];
    if (!(count >= 0) || count != std::floor(count)) e.fail("'count' must be a whole number");
    const Vec3 offset = e.vector("offset", Vec3::Zero()), angles = e.vector("euler", Vec3::Zero());
    const std::size_t digits = std::to_string(std::max<long long>(0, std::llround(std::min(count, 1e9)) - 1)).size();
    Around inner = around;
    if (e.has("childclass")) inner.childclass = e.text("childclass");
    Pose copy;
    for (long long k = 0; static_cast<double>(k) < count; ++k) {
      if (++copies_ > kMostCopies) e.fail("more than 100,000 copies are made by <replicate>");
      const std::string last = std::to_string(k), number = std::string(digits - last.size(), '0') + last;
      inner.suffix = e.text("sep") + number + around.suffix;
      copy.r = text_.of_euler(static_cast<double>(k) * angles);
      inner.frame = around.frame * copy;
      read_children(e, inner);
      copy.p = copy * offset;
    }
  }

  Link& link_of(int link) { return link < 0 ? robot_.ground : robot_.links[static_cast<std::size_t>(link)]; }

  void read_body(const Element& e, const Around& around) {
    Link link;
    link.name = name_of(e, around);
    if (link.name.empty()) link.name = "body_" + std::to_string(robot_.links.size() + 1);
    if (!names_.insert(link.name).second) e.fail("there is a body of that name already");
    link.where = e.where();
    link.parent = around.link;
    const Attributes own({e});
    link.pose = pose_in(own, around);
    link.weightless = own.number("gravcomp", 0);
    if (own.flag("mocap", false)) robot_.pass_over("mocap bodies (they rest)");
    const int at = static_cast<int>(robot_.links.size());
    robot_.links.push_back(link);
    geom_masses_.emplace_back();
    weighed_by_geoms_.push_back(by_geoms(e));
    const Around inside{at, {}, e.has("childclass") ? e.text("childclass") : around.childclass, around.suffix};
    // Its own joints, geoms and mass before the bodies inside, whose links follow.
    read_children(e, inside);
    link_of(at).mass = mass_of(e, at);
  }

  /// Whether a body takes its mass from its geoms.
  bool by_geoms(const Element& body) const {
    using From = MjcfCompiler::FromGeoms;
    if (const From from = text_.compiler().from_geoms; from != From::where_missing) return from == From::always;
    const auto all = text_.children(body);
    return std::none_of(all.begin(), all.end(), [](const Element& e) { return e.tag() == "inertial"; });
  }

  Mass mass_of(const Element& body, int link) {
    Mass m;
    if (weighed_by_geoms_[static_cast<std::size_t>(link)]) {
      m = sum_of(geom_masses_[static_cast<std::size_t>(link)]);
    } else {
      for (const Element& e : text_.children(body))
        if (e.tag() == "inertial") m = read_inertial(text_, e);
    }
    const MjcfCompiler& c = text_.compiler();
    return bounded(m, c.least_mass, c.least_inertia, c.balance_inertia);
  }

  void add_joint(const Element& e, const Around& around, Link& link) {
    const Attributes a = e.tag() == "freejoint" ? Attributes({e}) : text_.attributes(e, around.childclass);
    RobotJoint j;
    j.name = name_of(e, around);
    if (j.name.empty())
      j.name = link.name + "_joint" + (link.joints.empty() ? "" : std::to_string(link.joints.size() + 1));
    else if (!joint_names_.insert(j.name).second)
      e.fail("there is a joint of that name already");
    const std::string type = e.tag() == "freejoint" ? "free" : a.text("type", "hinge");
    if (type == "free") {
      if (around.link < 0 || link.parent >= 0 || !link.joints.empty())
        e.fail("free joints are alone in bodies of the world");
      j.kind = JointKind::free;
      read_coefficients(a, j);
      link.joints.push_back(j);
      return;
    }
    if (type != "hinge" && type != "slide" && type != "ball")
      e.fail("'type' must be hinge, slide, ball or free, not '" + type + "'");
    j.kind = type == "hinge" ? JointKind::hinge : type == "slide" ? JointKind::slide : JointKind::ball;
    const double unit = j.kind == JointKind::hinge ? text_.compiler().angle : 1;
    const Vec3 axis = around.frame.r * a.vector("axis", Vec3::UnitZ());
    if (!(axis.norm() > 0)) e.fail("'axis' must not be zero");
    j.axis = axis.normalized();
    j.point = around.frame * a.vector("pos", Vec3::Zero());
    if (j.kind != JointKind::ball) j.ref = unit * a.number("ref", 0);
    j.rest = unit * a.number("springref", 0);
    read_coefficients(a, j);
    if (const auto x = a.numbers("springdamper", 2, 2); !x.empty()) j.spring_damper = {x[0], x[1]};
    j.start = j.ref;
    const auto range = text_.limits(a, "limited", "range");
    if (range && j.kind == JointKind::ball) robot_.pass_over("limits of ball joints");
    if (range && j.kind != JointKind::ball) j.lower = unit * (*range)[0], j.upper = unit * (*range)[1];
    if (const auto forces = text_.limits(a, "actuatorfrclimited", "actuatorfrcrange"))
      j.least_force = (*forces)[0], j.largest_force = (*forces)[1];
    j.carries_weight = a.text("actuatorgravcomp") == "true";
    link.joints.push_back(j);
  }

  void read_coefficients(const Attributes& a, RobotJoint& j) {
    j.stiffness = first(a, "stiffness");
    j.damping = first(a, "damping");
    j.armature = a.number("armature", 0);
    j.friction = a.number("frictionloss", 0);
    for (const double x : {j.damping, j.armature, j.friction})
      if (x < 0) a.own().fail("damping, armature and frictionloss must not be negative");
  }

  /// The linear part of a coefficient that may be a polynomial.
  double first(const Attributes& a, const char* key) {
    const std::vector<double> list = a.numbers(key, 1, 8);
    if (std::any_of(list.begin() + (list.empty() ? 0 : 1), list.end(), [](double x) { return x != 0; }))
      robot_.pass_over(std::string("polynomials of ") + key);
    return list.empty() ? 0 : list[0];
  }

  /// Ends of `fromto` in the axes of the link.
  static std::optional<std::array<Vec3, 2>> ends_of(const Attributes& a, const Around& around) {
    if (!a.has("fromto")) return std::nullopt;
    const std::vector<double> x = a.numbers("fromto", 6, 6);
    return std::array{around.frame * Vec3(x[0], x[1], x[2]), around.frame * Vec3(x[3], x[4], x[5])};
  }

  Pose site_pose(const Attributes& a, const Around& around) const {
    if (const auto ends = ends_of(a, around); ends && (*ends)[0] != (*ends)[1])
      return {0.5 * ((*ends)[0] + (*ends)[1]), z_along((*ends)[0] - (*ends)[1])};
    return pose_in(a, around);
  }

  void add_geom(const Element& e, const Around& around) {
    const Attributes a = text_.attributes(e, around.childclass);
    const std::string type = a.text("type", "sphere");
    const auto* const row =
        std::find_if(std::begin(kGeomKinds), std::end(kGeomKinds), [&](const auto& r) { return r.name == type; });
    if (row == std::end(kGeomKinds)) {
      if (type != "hfield" && type != "sdf") e.fail("'" + type + "' is no type of geom");
      return robot_.pass_over("geoms of type " + type);
    }
    Geom g;
    Link& link = link_of(around.link);
    g.kind = row->value;
    g.name = name_of(e, around);
    if (g.name.empty())
      g.name = (link.name.empty() ? "world" : link.name) + "_geom";
    else if (!geom_names_.insert(g.name).second)
      e.fail("there is a geom of that name already");
    g.type = static_cast<unsigned>(a.number("contype", 1));
    g.affinity = static_cast<unsigned>(a.number("conaffinity", 1));
    g.dimensions = static_cast<int>(a.number("condim", 3));
    if (const auto friction = a.numbers("friction", 1, 3); !friction.empty()) g.friction = friction[0];
    if (a.number("priority", 0) != 0) robot_.pass_over("priority of geoms");
    const bool touches = g.type != 0 || g.affinity != 0 || in_pairs_.contains(e.text("name"));
    if (g.kind != GeomKind::mesh && a.has("mesh")) {
      robot_.pass_over(weighs(around.link, a) ? "primitives fitted to meshes (their mass is missing)"
                                              : "primitives fitted to meshes");
      return;
    }
    set_size(e, a, around, g);
    const bool counts = weighs(around.link, a);
    if (g.kind == GeomKind::mesh && !(counts || (touches && options_.geometry))) return;
    MeshInertia how = MeshInertia::legacy;
    if (g.kind == GeomKind::mesh && !set_mesh(e, a, g, how, counts)) return;
    if (counts) add_mass(e, a, g, how, around.link);
    if (touches && options_.geometry) link.geoms.push_back(g);
  }

  void set_size(const Element& e, const Attributes& a, const Around& around, Geom& g) const {
    if (g.kind == GeomKind::mesh) {
      g.pose = pose_in(a, around);
      return;
    }
    std::vector<double> size = a.merged("size", 3);
    const auto ends = ends_of(a, around);
    g.pose = site_pose(a, around);
    const std::size_t needed = g.kind == GeomKind::sphere                                    ? 1
                               : g.kind == GeomKind::capsule || g.kind == GeomKind::cylinder ? 2
                                                                                             : 3;
    if (ends && needed >= 2) {
      const double half = 0.5 * ((*ends)[0] - (*ends)[1]).norm();
      if (!(half > 0)) e.fail("the two points of 'fromto' are one");
      if (size.empty()) e.fail("needs 'size'");
      if (needed == 2) {
        size.resize(2);
        size[1] = half;
      } else {
        size = {size[0], size[0], half};  // as MuJoCo does, whatever the second number says
      }
    }
    if (g.kind == GeomKind::plane) return;
    if (size.size() < needed) e.fail("'size' needs " + std::to_string(needed) + " numbers");
    for (std::size_t k = 0; k < needed; ++k) {
      if (!(size[k] > 0)) e.fail("'size' must be greater than 0");
      g.size[static_cast<int>(k)] = size[k];
    }
  }

  /// Whether the body takes its mass from this geom.
  bool weighs(int link, const Attributes& a) const {
    if (link < 0 || !weighed_by_geoms_[static_cast<std::size_t>(link)]) return false;
    const double group = a.number("group", 0);
    if (group < text_.compiler().inertia_groups[0] || group > text_.compiler().inertia_groups[1]) return false;
    return a.has("mass") ? a.number("mass", 0) != 0 : a.number("density", 1000) != 0;
  }

  bool set_mesh(const Element& e, const Attributes& a, Geom& g, MeshInertia& how, bool counts) {
    const std::string name = a.text("mesh");
    if (name.empty()) e.fail("needs 'mesh', the name of an asset");
    const auto it = meshes_.find(name);
    if (it == meshes_.end()) e.fail("there is no mesh '" + name + "' among the assets");
    const MeshAsset& mesh = it->second;
    if (mesh.file.empty()) {
      robot_.pass_over(counts ? "meshes without a file (their mass is missing)" : "meshes without a file");
      return false;
    }
    if (std::error_code none; !std::filesystem::is_regular_file(mesh.file, none))
      mesh.element.fail("there is no file '" + mesh.file + "'" +
                        (counts ? ""
                                : "; without its shapes the robot is read by geometry = false (Python), --no-geometry "
                                  "(espalier robot)"));
    if (!is_surface_file(mesh.file)) {
      robot_.pass_over(counts ? "meshes other than STL and OBJ (their mass is missing)"
                              : "meshes other than STL and OBJ");
      return false;
    }
    g.file = mesh.file;
    g.scale = mesh.scale;
    g.pose = g.pose * mesh.reference;
    how = mesh.inertia == "shell" ? MeshInertia::shell : mesh.inertia == "exact" ? MeshInertia::exact : how;
    if (mesh.inertia == "convex" && counts) robot_.pass_over("inertia of convex hulls (that of the mesh is taken)");
    return true;
  }

  void add_mass(const Element& e, const Attributes& a, const Geom& g, MeshInertia how, int link) {
    Mass m = unit_mass(g, a.flag("shellinertia", false), how);
    if (!(m.mass > 0)) return;
    const double factor = a.has("mass") ? a.number("mass", 0) / m.mass : a.number("density", 1000);
    if (factor < 0) e.fail("mass and density must not be negative");
    m.mass *= factor;
    m.inertia *= factor;
    geom_masses_[static_cast<std::size_t>(link)].push_back(m);
  }

  void scale_masses() {
    if (!(text_.compiler().total_mass > 0)) return;
    double sum = 0;
    for (const Link& link : robot_.links) sum += link.mass.mass;
    if (!(sum > 0)) return;
    const double factor = text_.compiler().total_mass / sum;
    for (Link& link : robot_.links) {
      link.mass.mass *= factor;
      link.mass.inertia *= factor;
    }
  }

  const MjcfText& text_;
  const RobotOptions& options_;
  Robot& robot_;
  std::map<std::string, MeshAsset> meshes_;
  std::vector<std::vector<Mass>> geom_masses_;  // of links
  std::vector<char> weighed_by_geoms_;          // of links
  std::set<std::string> names_, joint_names_, geom_names_, in_pairs_;
  static constexpr int kMostCopies = 100'000;
  int copies_ = 0;
};

}  // namespace

void read_mjcf_bodies(const MjcfText& text, const RobotOptions& options, Robot& robot) {
  BodyReader(text, options, robot).run();
}

Pose pose_at_ref(const Robot& robot, int link) {
  Pose pose;
  for (; link >= 0; link = robot.links[static_cast<std::size_t>(link)].parent)
    pose = robot.links[static_cast<std::size_t>(link)].pose * pose;
  return pose;
}

}  // namespace espalier::dynamics::model::robots
