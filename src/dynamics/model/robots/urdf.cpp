#include "dynamics/model/robots/urdf.hpp"

#include <algorithm>
#include <map>

#include "dynamics/model/robots/files.hpp"
#include "dynamics/model/robots/geom_mass.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics::model::robots {
namespace {

/// `origin` of an element: xyz and rpy, turns about the fixed axes x, y, z.
Pose origin_of(const Element& element) {
  const Element origin = element.child("origin");
  if (origin.empty()) return {};
  const Vec3 rpy = origin.vector("rpy", Vec3::Zero());
  return {origin.vector("xyz", Vec3::Zero()),
          about(Vec3::UnitZ(), rpy[2]) * about(Vec3::UnitY(), rpy[1]) * about(Vec3::UnitX(), rpy[0])};
}

class UrdfReader {
 public:
  UrdfReader(const XmlFile& file, const RobotOptions& options)
      : file_(file), options_(options), folder_(folder_of(file.name())) {}

  Robot run() {
    const Element root{file_.root(), &file_};
    refuse_macros(root);
    robot_.name = root.text("name");
    for (const Element& e : root.children()) {
      if (e.tag() == "link")
        add_link(e);
      else if (e.tag() == "joint")
        add_joint(e);
      else if (e.tag() == "transmission")
        add_transmission(e);
      else if (e.tag() != "material" && e.tag() != "mujoco")
        robot_.pass_over("<" + std::string(e.tag()) + ">");
    }
    if (links_.empty()) root.fail("has no <link>");
    arrange(root);
    add_motors();
    robot_.contacts = false;
    return std::move(robot_);
  }

 private:
  struct Joint {
    Element element;
    std::string parent, child, type;
    RobotJoint joint;
    Pose origin;
  };

  void refuse_macros(const Element& root) const {
    const std::string ask =
        "; this is xacro, which writes URDF: xacro " + file_.name() + " > robot.urdf, then read robot.urdf";
    for (const Element& e : root.children())
      if (e.tag().starts_with("xacro:")) e.fail("is a macro" + ask);
    if (root.tag() != "robot") root.fail("is no URDF, whose outermost element is <robot>");
    for (pugi::xml_node node = root.node; !node.empty();) {
      for (const pugi::xml_attribute& a : node.attributes())
        if (std::string_view(a.value()).find("${") != std::string_view::npos ||
            std::string_view(a.value()).find("$(") != std::string_view::npos)
          Element{node, &file_}.fail("'" + std::string(a.name()) + "' has an expression" + ask);
      if (std::string_view(node.name()).starts_with("xacro:")) Element{node, &file_}.fail("is a macro" + ask);
      if (!node.first_child().empty()) {
        node = node.first_child();
        continue;
      }
      while (!node.empty() && node != root.node && node.next_sibling().empty()) node = node.parent();
      node = node.empty() || node == root.node ? pugi::xml_node() : node.next_sibling();
    }
  }

  void add_link(const Element& e) {
    Link link;
    link.name = e.need("name");
    link.where = e.where();
    if (!by_name_.emplace(link.name, links_.size()).second) e.fail("there is a link of that name already");
    if (const Element inertial = e.child("inertial"); !inertial.empty()) link.mass = mass_of(inertial);
    for (const Element& inner : e.children()) {
      if (inner.tag() == "collision" && options_.geometry) add_geom(inner, link);
      if (inner.tag() != "inertial" && inner.tag() != "collision" && inner.tag() != "visual")
        robot_.pass_over("<" + std::string(inner.tag()) + "> of links");
    }
    links_.push_back(std::move(link));
  }

  static Mass mass_of(const Element& e) {
    const Element mass = e.child("mass"), inertia = e.child("inertia");
    if (mass.empty()) e.fail("needs <mass value=\"...\"/>");
    const Pose origin = origin_of(e);
    Mass m;
    static_cast<void>(mass.need("value"));
    m.mass = mass.number("value", 0);
    if (m.mass < 0) mass.fail("a mass must not be negative");
    if (!inertia.empty()) {
      const auto at = [&](const char* key) { return inertia.number(key, 0); };
      m.inertia << at("ixx"), at("ixy"), at("ixz"), at("ixy"), at("iyy"), at("iyz"), at("ixz"), at("iyz"), at("izz");
    }
    return moved(m, origin);
  }

  void add_geom(const Element& e, Link& link) {
    const Element geometry = e.child("geometry");
    if (geometry.empty()) e.fail("needs <geometry>");
    const std::vector<Element> kinds = geometry.children();
    if (kinds.empty()) geometry.fail("needs <box>, <cylinder>, <sphere>, <capsule> or <mesh>");
    const Element& shape = kinds.front();
    Geom g;
    g.name = e.has("name") ? e.text("name") : link.name;
    g.pose = origin_of(e);
    const auto length = [&](const char* key) {
      static_cast<void>(shape.need(key));
      const double x = shape.number(key, 0);
      if (!(x > 0)) shape.fail(std::string("'") + key + "' must be greater than 0");
      return x;
    };
    if (shape.tag() == "box") {
      g.kind = GeomKind::box;
      static_cast<void>(shape.need("size"));
      g.size = 0.5 * shape.vector("size", Vec3::Zero());
      if (!(g.size.minCoeff() > 0)) shape.fail("'size' needs three lengths greater than 0");
    } else if (shape.tag() == "sphere") {
      g.kind = GeomKind::sphere;
      g.size[0] = length("radius");
    } else if (shape.tag() == "cylinder" || shape.tag() == "capsule") {
      g.kind = shape.tag() == "cylinder" ? GeomKind::cylinder : GeomKind::capsule;
      g.size = {length("radius"), 0.5 * length("length"), 0};
    } else if (shape.tag() == "mesh") {
      g.kind = GeomKind::mesh;
      g.scale = shape.vector("scale", Vec3::Ones());
      if (g.scale.prod() == 0) shape.fail("'scale' must not be 0");
      g.file = find_urdf_file(shape, shape.need("filename"), folder_, options_);
      if (!is_surface_file(g.file)) return robot_.pass_over("meshes other than STL and OBJ");
    } else {
      return robot_.pass_over("<" + std::string(shape.tag()) + "> as a shape");
    }
    link.geoms.push_back(std::move(g));
  }

  void add_joint(const Element& e) {
    Joint j{e, "", "", e.need("type"), {}, origin_of(e)};
    j.joint.name = e.need("name");
    for (const Joint& other : joints_)
      if (other.joint.name == j.joint.name) e.fail("there is a joint of that name already");
    const Element parent = e.child("parent"), child = e.child("child");
    if (parent.empty() || child.empty()) e.fail("needs <parent link=\"...\"/> and <child link=\"...\"/>");
    j.parent = parent.need("link");
    j.child = child.need("link");
    const auto& types = kTypes;
    if (std::find(types.begin(), types.end(), j.type) == types.end())
      e.fail("'" + j.type +
             "' is no type of joint; known are revolute, continuous, prismatic, fixed, floating, planar");
    if (const Element axis = e.child("axis"); !axis.empty()) {
      const Vec3 direction = axis.vector("xyz", Vec3::UnitX());
      const bool moves = j.type != "fixed" && j.type != "floating";
      if (!(direction.norm() > 0) && moves) axis.fail("must not be zero");
      if (moves) j.joint.axis = direction.normalized();
    } else {
      j.joint.axis = Vec3::UnitX();
    }
    if (j.type == "prismatic") j.joint.kind = JointKind::slide;
    if (j.type == "floating") j.joint.kind = JointKind::free;
    read_limits(e, j);
    if (const Element dynamics = e.child("dynamics"); !dynamics.empty()) {
      j.joint.damping = dynamics.number("damping", 0);
      j.joint.friction = dynamics.number("friction", 0);
      if (j.joint.damping < 0 || j.joint.friction < 0) dynamics.fail("damping and friction must not be negative");
    }
    if (const Element mimic = e.child("mimic"); !mimic.empty())
      j.joint.mimic = Mimic{mimic.need("joint"), mimic.number("multiplier", 1), mimic.number("offset", 0)};
    for (const char* other : {"safety_controller", "calibration"})
      if (!e.child(other).empty()) robot_.pass_over(std::string("<") + other + ">");
    joints_.push_back(std::move(j));
  }

  void read_limits(const Element& e, Joint& j) {
    const Element limit = e.child("limit");
    if (limit.empty()) {
      if (j.type == "revolute" || j.type == "prismatic")
        e.fail("needs <limit>; without limits a revolute joint has type=\"continuous\"");
      return;
    }
    if (j.type == "revolute" || j.type == "prismatic") {
      j.joint.lower = limit.number("lower", 0);
      j.joint.upper = limit.number("upper", 0);
      if (*j.joint.lower > *j.joint.upper) limit.fail("'lower' is above 'upper'");
    }
    if (limit.number("velocity", 0) > 0) robot_.pass_over("limits of velocity");
    if (const double effort = limit.number("effort", 0); effort > 0) {
      j.joint.largest_force = effort;
      j.joint.least_force = -effort;
    }
  }

  void add_transmission(const Element& e) {
    for (const Element& inner : e.children())
      if (inner.tag() == "joint" && inner.has("name")) driven_.push_back(inner.text("name"));
  }

  /// Links in the order of the tree, with the joints that lead to them.
  void arrange(const Element& root) {
    std::map<std::string, std::size_t> above;  // joint by child
    for (std::size_t k = 0; k < joints_.size(); ++k) {
      const Joint& j = joints_[k];
      for (const std::string* name : {&j.parent, &j.child})
        if (!by_name_.contains(*name)) j.element.fail("there is no link '" + *name + "'");
      if (const auto [it, fresh] = above.emplace(j.child, k); !fresh)
        j.element.fail("the link '" + j.child + "' hangs on the joint '" + joints_[it->second].joint.name +
                       "' already: URDF knows trees alone; take one of the two out, and close the loop by a joint of "
                       "the model (espalier robot FILE --out model.toml) or in MJCF by <equality>");
    }
    std::string base;
    for (const Link& link : links_)
      if (!above.contains(link.name)) {
        if (!base.empty())
          root.fail("'" + base + "' and '" + link.name + "' both hang on no joint; one link is the root");
        base = link.name;
      }
    if (base.empty()) root.fail("its joints run in a circle: no link is the root");
    std::map<std::string, std::vector<std::size_t>> below;
    for (std::size_t k = 0; k < joints_.size(); ++k) below[joints_[k].parent].push_back(k);
    std::vector<std::pair<std::string, int>> open = {{base, -1}};  // with the joint that leads there
    std::map<std::string, int> place;
    while (!open.empty()) {
      const auto [name, by] = open.back();
      open.pop_back();
      Link link = std::move(links_[by_name_.at(name)]);
      if (by >= 0) hang(joints_[static_cast<std::size_t>(by)], place, link);
      if (by < 0 && options_.free_base) link.joints.push_back(free_joint(link.name));
      const int at = static_cast<int>(robot_.links.size());
      place[name] = at;
      robot_.links.push_back(std::move(link));
      const auto& children = below[name];
      for (auto it = children.rbegin(); it != children.rend(); ++it)
        open.emplace_back(joints_[*it].child, static_cast<int>(*it));
    }
    if (robot_.links.size() != links_.size())
      for (const Joint& j : joints_)
        if (!place.contains(j.child)) j.element.fail("its joints run in a circle that does not hang on '" + base + "'");
  }

  static RobotJoint free_joint(const std::string& link) {
    RobotJoint j;
    j.name = link + "_free";
    j.kind = JointKind::free;
    return j;
  }

  static void hang(const Joint& j, const std::map<std::string, int>& place, Link& link) {
    link.parent = place.at(j.parent);
    link.pose = j.origin;
    if (j.type == "fixed") return;
    if (j.type != "planar") {
      link.joints.push_back(j.joint);
      return;
    }
    const Mat3 axes = z_along(j.joint.axis);  // two slides in the plane and a turn about its normal
    for (int k = 0; k < 3; ++k) {
      RobotJoint part = j.joint;
      part.name += std::array{"_x", "_y", ""}[static_cast<std::size_t>(k)];
      part.kind = k < 2 ? JointKind::slide : JointKind::hinge;
      part.axis = axes.col(k);
      part.mimic.reset();
      link.joints.push_back(part);
    }
  }

  void add_motors() {
    for (const Link& link : robot_.links)
      for (const RobotJoint& j : link.joints) {
        if (std::find(driven_.begin(), driven_.end(), j.name) == driven_.end()) continue;
        Actuator a;
        a.name = j.name + "_motor";
        a.joint = j.name;
        robot_.actuators.push_back(a);
      }
  }

  static constexpr std::array<std::string_view, 6> kTypes = {"revolute", "continuous", "prismatic",
                                                             "fixed",    "floating",   "planar"};
  const XmlFile& file_;
  const RobotOptions& options_;
  std::string folder_;
  Robot robot_;
  std::vector<Link> links_;
  std::map<std::string, std::size_t> by_name_;
  std::vector<Joint> joints_;
  std::vector<std::string> driven_;  // joints of transmissions
};

}  // namespace

Robot read_urdf(const XmlFile& file, const RobotOptions& options) { return UrdfReader(file, options).run(); }

}  // namespace espalier::dynamics::model::robots
