#include "dynamics/model/robots/robot_writer.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "base/text_stream.hpp"
#include "dynamics/model/robots/shapes.hpp"
#include "dynamics/model/robots/toml_writer.hpp"

namespace espalier::dynamics::model::robots {
namespace {

bool one_coordinate(const RobotJoint& j) { return j.kind == JointKind::hinge || j.kind == JointKind::slide; }

/// Writes a robot as a model.
class RobotWriter {
 public:
  RobotWriter(Robot& robot, const RobotTree& tree, const std::string& path, const RobotOptions& options)
      : robot_(robot), tree_(tree), path_(path), options_(options) {}

  std::string run() {
    name_all();
    for (std::size_t k = 0; k < tree_.moving.size(); ++k) write_body(k);
    write_markers();
    for (std::size_t k = 0; k < tree_.moving.size(); ++k) write_joint(k);
    for (const Equality& q : robot_.equalities) write_equality(q);
    for (const Moving& m : tree_.moving)
      if (m.joint.mimic) write_coupling(m.joint.name, *m.joint.mimic, m.joint.name + "_mimic");
    for (std::size_t k = 0; k < tree_.moving.size(); ++k) write_joint_forces(k), write_lifts(k);
    for (const Actuator& a : robot_.actuators)
      if (!a.joint.empty()) write_joint_actuator(a);
    for (const Actuator& a : robot_.actuators)
      if (!a.site.empty()) write_site_actuator(a);
    for (const Tendon& t : robot_.tendons) write_tendon(t);
    if (options_.geometry)
      out_ << shapes_text(
          robot_, tree_, names_of_bodies_, [&](const std::string& wish) { return names_.take(wish, ""); }, path_,
          options_);
    if (const std::string renamed = input_names_.renamed(); !renamed.empty())
      robot_.notices.push_back(path_ + ": actuators and tendons whose inputs and sensors have other names: " + renamed);
    return head() + out_.str() + tail();
  }

 private:
  std::string head() const {
    base::TextWriter s;
    s << "# Made from '" << printable(std::filesystem::path(path_).filename().string()) << "' by espalier.\n";
    s << "title = " << in_quotes(robot_.name.empty() ? "robot" : robot_.name)
      << "\nunits = \"SI\"\ngravity = " << vector_text(robot_.gravity) << "\n\n[parameters]\n";
    constexpr double kSag = 1e-3;  // of the whole robot on one point of contact
    s << "contact_stiffness = " << number_text(std::max(tree_.mass, 1e-3) * 9.81 / kSag) << "\n";
    s << "contact_damping = 10            # of Hunt and Crossley, s/m\n";
    s << "stop_rate = 50                  # rad/s, of a joint in its stop: stiffness = inertia at the joint * rate^2\n";
    s << "slip = 1e-2                     # speed at which the friction of joints is 76 % developed\n";
    return s.str();
  }

  std::string tail() const {
    base::TextWriter s;
    if (!inputs_.empty()) s << "\n[inputs]\n" << inputs_;
    if (!sensors_.empty()) s << "\n[sensors]\n" << sensors_;
    s << "\n[integrator]\nend = 1\n\n[output]\nvtu_interval = 0.02\nquantities = [";
    bool first = true;
    for (const auto& [name, at] : tree_.joints) {
      s << (first ? "" : ", ")
        << in_quotes(joint_names_.at(name) + (kind_of(at) == JointKind::hinge ? ".angle" : ".displacement"));
      first = false;
    }
    s << "]\n";
    return s.str();
  }

  [[nodiscard]] JointKind kind_of(int body) const { return tree_.moving[static_cast<std::size_t>(body)].joint.kind; }
  [[nodiscard]] const Moving& body(int k) const {
    return k < 0 ? tree_.ground : tree_.moving[static_cast<std::size_t>(k)];
  }
  [[nodiscard]] std::string body_name(int k) const {
    return k < 0 ? "ground" : names_of_bodies_[static_cast<std::size_t>(k)];
  }

  void name_all() {
    for (const Moving& m : tree_.moving) names_of_bodies_.push_back(names_.take(m.name, "_body"));
    for (const Moving& m : tree_.moving)
      if (m.joint.kind != JointKind::free) joint_names_[m.joint.name] = names_.take(m.joint.name, "_joint");
  }

  void write_body(std::size_t k) {
    const Moving& m = tree_.moving[k];
    const Vec3 arm = m.start.r * m.mass.centre;
    out_ << "\n[bodies." << names_of_bodies_[k] << "]\ntype = \"rigid\"\nmass = " << number_text(m.mass.mass)
         << "\ninertia = [";
    const Mat3& i = m.mass.inertia;
    for (int r = 0; r < 3; ++r) {
      const Vec3 row(0.5 * (i(r, 0) + i(0, r)), 0.5 * (i(r, 1) + i(1, r)), 0.5 * (i(r, 2) + i(2, r)));
      out_ << (r > 0 ? ", " : "") << vector_text(row);
    }
    out_ << "]\nposition = " << vector_text(m.start.p + arm) << "\nrotation = " << rotation_text(m.start.r) << "\n";
    if (!m.velocity.isZero(0) || !m.spin.isZero(0))
      out_ << "velocity = " << vector_text(m.velocity + m.spin.cross(arm))
           << "\nangular_velocity = " << vector_text(m.spin) << "\n";
    if (m.weightless != 0) out_ << "gravity = " << vector_text((1 - m.weightless) * robot_.gravity) << "\n";
  }

  /// Where links that are welded to each other feel gravity differently.
  void write_lifts(std::size_t k) {
    for (const auto& [mass, centre] : tree_.moving[k].lifts) {
      out_ << "\n[forces." << names_.take(names_of_bodies_[k] + "_lift", "")
           << "]\ntype = \"load\"\na = " << frame(static_cast<int>(k), {centre, Mat3::Identity()})
           << "\nforce = " << vector_text(-mass * robot_.gravity) << "\n";
    }
  }

  /// A frame on a body, given in the axes of its link.
  [[nodiscard]] std::string frame(int k, const Pose& pose) const {
    const Vec3 point = k < 0 ? pose.p : Vec3(pose.p - body(k).mass.centre);
    return "{ body = " + in_quotes(body_name(k)) + ", point = " + vector_text(point) +
           ", rotation = " + rotation_text(pose.r) + " }";
  }
  void write_frames(int a, const Pose& on_a, int b, const Pose& on_b) {
    out_ << "a = " << frame(a, on_a) << "\nb = " << frame(b, on_b) << "\n";
  }

  void write_markers() {
    const auto write = [&](int k) {
      for (const Site& s : body(k).places) {
        const std::string name = names_.take(s.name, "_site");
        const Vec3 point = k < 0 ? s.pose.p : Vec3(s.pose.p - body(k).mass.centre);
        out_ << "\n[markers." << name << "]\nbody = " << in_quotes(body_name(k)) << "\npoint = " << vector_text(point)
             << "\nrotation = " << rotation_text(s.pose.r) << "\n";
      }
    };
    write(-1);
    for (std::size_t k = 0; k < tree_.moving.size(); ++k) write(static_cast<int>(k));
  }

  struct Frames {
    Pose a, b;  ///< on the parent, and on the body; z is the axis, and the coordinate of b from a that of the joint
  };
  [[nodiscard]] Frames frames_of(const Moving& m) const {
    const RobotJoint& j = m.joint;
    const Mat3 axes = z_along(j.axis);
    Frames f{m.pose * Pose{j.point, axes}, {j.point, axes}};
    if (j.kind == JointKind::hinge) f.b.r = about(j.axis, j.ref) * axes;
    if (j.kind == JointKind::slide) f.a.p -= f.a.r * Vec3(0, 0, j.ref);
    if (!one_coordinate(j)) f = {m.pose * Pose{j.point, Mat3::Identity()}, {j.point, Mat3::Identity()}};
    return f;
  }
  void write_joint_frames(int k) {
    const Frames f = frames_of(body(k));
    write_frames(body(k).parent, f.a, k, f.b);
  }

  void write_joint(std::size_t k) {
    const Moving& m = tree_.moving[k];
    const RobotJoint& j = m.joint;
    if (j.kind == JointKind::free) return;
    const char* type = j.kind == JointKind::hinge ? "revolute" : j.kind == JointKind::slide ? "prismatic" : "spherical";
    out_ << "\n[joints." << joint_names_.at(j.name) << "]\ntype = \"" << type << "\"\n";
    write_joint_frames(static_cast<int>(k));
    if (j.armature > 0 && one_coordinate(j)) out_ << "armature = " << number_text(j.armature) << "\n";
    if ((!j.lower && !j.upper) || !(j.lower < j.upper) || !one_coordinate(j)) return;
    out_ << "limits = { lower = " << number_text(*j.lower) << ", upper = " << number_text(*j.upper)
         << ", stiffness = \"stop_rate^2*" << number_text(m.felt()) << "\", smoothing = 1e-3, damping = 5 }\n";
  }

  /// [forces.NAME] of a type between the frames of a joint.
  std::string begin_force(const std::string& wish, const std::string& suffix, const std::string& type, int k) {
    std::string name = names_.take(wish, suffix);
    out_ << "\n[forces." << name << "]\ntype = \"" << type << "\"\n";
    write_joint_frames(k);
    return name;
  }

  void write_joint_forces(std::size_t at) {
    const int k = static_cast<int>(at);
    const RobotJoint& j = body(k).joint;
    if (!one_coordinate(j)) {
      const bool free = j.kind == JointKind::free;
      if (j.armature != 0 && !free) robot_.pass_over("armature of ball joints");
      if (j.friction != 0) robot_.pass_over("friction loss of ball and free joints");
      if (j.stiffness == 0 && j.damping == 0) return;
      begin_force(j.name + "_spring", "", "bushing", k);
      if (free)
        out_ << "stiffness = " << vector_text(Vec3::Constant(j.stiffness))
             << "\ndamping = " << vector_text(Vec3::Constant(j.damping)) << "\n";
      out_ << "angular_stiffness = " << vector_text(Vec3::Constant(j.stiffness))
           << "\nangular_damping = " << vector_text(Vec3::Constant(j.damping)) << "\n";
      return;
    }
    const bool turns = j.kind == JointKind::hinge;
    if (j.stiffness != 0 || j.damping != 0) {
      begin_force(j.name + "_spring", "", turns ? "rotational-spring" : "axial-spring", k);
      out_ << "stiffness = " << number_text(j.stiffness) << "\ndamping = " << number_text(j.damping)
           << "\nrest = " << number_text(j.rest) << "\n";
    }
    if (j.friction > 0) {
      begin_force(j.name + "_friction", "", turns ? "torque-motor" : "force-motor", k);
      write_drive(k, "-" + number_text(j.friction) + "*tanh(" + rate_of(k) + "/slip)");
    }
  }

  void write_drive(int k, const std::string& expression) {
    out_ << (kind_of(k) == JointKind::hinge ? "torque" : "force") << " = " << in_quotes(expression) << "\n";
  }

  [[nodiscard]] std::string coordinate_of(int k) const {
    return in_expression(joint_names_.at(body(k).joint.name),
                         kind_of(k) == JointKind::hinge ? ".angle" : ".displacement");
  }
  [[nodiscard]] std::string rate_of(int k) const {
    return in_expression(joint_names_.at(body(k).joint.name),
                         kind_of(k) == JointKind::hinge ? ".angular_speed" : ".speed");
  }

  /// What an actuator exerts along `length`, before its gear.
  std::string force_text(const Actuator& a, const std::string& length, const std::string& rate, double felt) {
    const std::string name = input_names_.take(a.name, "_input");
    inputs_ += name + " = " + number_text(a.start) + "\n";
    const bool plain = in_expression(name, "") == name;
    const std::string u =
        clamped(plain ? "inputs." + name : "'inputs." + name + "'", a.least_control, a.largest_control);
    std::string text = a.gain[0] == 1 ? u : number_text(a.gain[0]) + "*" + u;
    if (a.gain[1] != 0 || a.gain[2] != 0)
      text = "(" + number_text(a.gain[0]) + " + " + number_text(a.gain[1]) + "*" + length + " + " +
             number_text(a.gain[2]) + "*" + rate + ")*" + u;
    double damping = a.bias[2];
    if (a.damping_ratio > 0) damping = -2 * a.damping_ratio * std::sqrt(std::max(0.0, a.gain[0] * felt));
    if (a.bias[0] != 0) text += " + " + number_text(a.bias[0]);
    if (a.bias[1] != 0) text += " + " + number_text(a.bias[1]) + "*" + length;
    if (damping != 0) text += " + " + number_text(damping) + "*" + rate;
    return clamped("(" + text + ")", a.least_force, a.largest_force);
  }

  void write_joint_actuator(const Actuator& a) {
    const int k = tree_.joints.at(a.joint);
    const RobotJoint& j = body(k).joint;
    begin_force(a.name, "_motor", j.kind == JointKind::hinge ? "torque-motor" : "force-motor", k);
    const std::string gear = number_text(a.gear[0]) + "*";
    const bool direct = a.gear[0] == 1;
    const std::string length = direct ? coordinate_of(k) : "(" + gear + coordinate_of(k) + ")";
    const std::string rate = direct ? rate_of(k) : "(" + gear + rate_of(k) + ")";
    const double felt = body(k).felt() / std::max(1e-300, a.gear[0] * a.gear[0]);
    const std::string force = force_text(a, length, rate, felt);
    write_drive(k, clamped(direct ? force : gear + force, j.least_force, j.largest_force));
  }

  void write_site_actuator(const Actuator& a) {
    const RobotTree::Home& home = tree_.sites.at(a.site);
    if (home.body < 0) return robot_.pass_over("actuators on the ground");
    const std::string name = names_.take(a.name, "_motor");
    out_ << "\n[forces." << name << "]\ntype = \"load\"\na = " << frame(home.body, home.pose)
         << "\nforce = " << vector_text({a.gear[0], a.gear[1], a.gear[2]})
         << "\nmoment = " << vector_text({a.gear[3], a.gear[4], a.gear[5]})
         << "\nfactor = " << in_quotes(force_text(a, "0", "0", 0)) << "\nfollower = true\n";
  }

  // Equalities and couplings -----------------------------------------------------------------------------------------

  void write_equality(const Equality& q) {
    if (q.kind == EqualityKind::joint) {
      if (!q.active) return robot_.pass_over("couplings of joints that are off");
      return write_coupling(q.first, q.coupling, q.name);
    }
    const auto home = [&](const std::string& link) { return link.empty() ? RobotTree::Home{} : tree_.homes.at(link); };
    const RobotTree::Home a = home(q.first), b = home(q.second);
    if (a.body == b.body) return robot_.pass_over("equalities within one body");
    const std::string name = names_.take(q.name, "_equality");
    out_ << "\n[joints." << name << "]\ntype = \"" << (q.kind == EqualityKind::weld ? "fixed" : "spherical") << "\"\n";
    write_frames(a.body, a.pose * q.on_first, b.body, b.pose * q.on_second);
    if (!q.active) out_ << "active = false\n";
  }

  void write_four(int a, int c) {
    const Frames f = frames_of(body(a)), g = frames_of(body(c));
    write_frames(body(a).parent, f.a, a, f.b);
    out_ << "c = " << frame(body(c).parent, g.a) << "\nd = " << frame(c, g.b) << "\n";
  }

  void write_coupling(const std::string& joint, const Mimic& mimic, const std::string& wish) {
    const auto it = tree_.joints.find(joint);
    if (it == tree_.joints.end()) return robot_.pass_over("couplings of fixed joints");
    const int one = it->second;
    const std::string name = names_.take(wish, "_coupling");
    out_ << "\n[joints." << name << "]\n";
    const bool turns = kind_of(one) == JointKind::hinge;
    if (mimic.of.empty() || mimic.factor == 0) {
      out_ << "type = \"" << (turns ? "rotation" : "translation") << "-motor\"\nmotion = " << number_text(mimic.offset)
           << "\n";
      return write_joint_frames(one);
    }
    const int two = tree_.joints.at(mimic.of);
    const bool other_turns = kind_of(two) == JointKind::hinge;
    if (turns == other_turns) {
      out_ << "type = \"" << (turns ? "gear" : "coupled-slides") << "\"\nratio = " << number_text(-mimic.factor)
           << "\n";
      write_four(two, one);
    } else {
      out_ << "type = \"rack-and-pinion\"\nradius = " << number_text(turns ? 1 / mimic.factor : mimic.factor) << "\n";
      write_four(turns ? one : two, turns ? two : one);
    }
  }

  // Tendons ----------------------------------------------------------------------------------------------------------

  void write_tendon(const Tendon& t) {
    const std::string name = input_names_.take(t.name, "_tendon");
    std::string length, rate;
    double at_rest = 0;
    std::vector<std::string> springs;
    const auto add = [](std::string& sum, const std::string& term) { sum += (sum.empty() ? "" : " + ") + term; };
    for (const auto& [joint, factor] : t.joints) {
      const int k = tree_.joints.at(joint);
      add(length, number_text(factor) + "*" + coordinate_of(k));
      add(rate, number_text(factor) + "*" + rate_of(k));
      at_rest += factor * body(k).joint.rest;
    }
    for (const Tendon::Piece& p : t.pieces) {
      const RobotTree::Home &a = tree_.sites.at(p.from), &b = tree_.sites.at(p.to);
      const double part = (body(a.body).at_rest * a.pose.p - body(b.body).at_rest * b.pose.p).norm();
      at_rest += part / p.divisor;
      springs.push_back(a.body == b.body ? "" : names_.take(t.name, "_tendon"));
      if (springs.back().empty()) {
        add(length, number_text(part / p.divisor));
        continue;
      }
      add(length, in_expression(springs.back(), ".coordinate") + "/" + number_text(p.divisor));
      add(rate, in_expression(springs.back(), ".rate") + "/" + number_text(p.divisor));
    }
    if (rate.empty()) rate = "0";
    sensors_ += in_quotes(name + "_length") + " = " + in_quotes(length) + "\n" + in_quotes(name + "_rate") + " = " +
                in_quotes(rate) + "\n";
    const std::string pull = pull_text(t, name, at_rest);
    if (pull.empty()) return;
    sensors_ += in_quotes(name + "_push") + " = " + in_quotes(pull) + "\n";
    const std::string push = sensor(name + "_push");
    for (const auto& [joint, factor] : t.joints) {
      const int k = tree_.joints.at(joint);
      begin_force(t.name + "_" + joint, "_tendon", kind_of(k) == JointKind::hinge ? "torque-motor" : "force-motor", k);
      write_drive(k, number_text(factor) + "*" + push);
    }
    for (std::size_t i = 0; i < t.pieces.size(); ++i) {
      if (springs[i].empty()) continue;
      const RobotTree::Home &a = tree_.sites.at(t.pieces[i].from), &b = tree_.sites.at(t.pieces[i].to);
      out_ << "\n[forces." << springs[i] << "]\ntype = \"spring\"\n";
      write_frames(a.body, a.pose, b.body, b.pose);
      out_ << "rest = 0\nactuator = " << in_quotes("-" + push + "/" + number_text(t.pieces[i].divisor)) << "\n";
    }
  }

  static std::string sensor(const std::string& name) {
    return in_expression(name, "") == name ? "sensors." + name : "'sensors." + name + "'";
  }

  /// The force along the length, positive where it makes that longer; "": none.
  std::string pull_text(const Tendon& t, const std::string& name, double at_rest) {
    const std::string length = sensor(name + "_length"), rate = sensor(name + "_rate");
    const std::array<double, 2> rest = t.rest.value_or(std::array{at_rest, at_rest});
    std::string sum;
    const auto add = [&](const std::string& term) { sum += (sum.empty() ? "" : " + ") + term; };
    const auto less = [&](double x) { return "(" + length + " - (" + number_text(x) + "))"; };
    if (t.stiffness != 0) {
      if (rest[0] == rest[1])
        add(number_text(-t.stiffness) + "*" + less(rest[0]));
      else
        add(number_text(-t.stiffness) + "*(max(" + less(rest[1]) + ", 0) + min(" + less(rest[0]) + ", 0))");
    }
    if (t.damping != 0) add(number_text(-t.damping) + "*" + rate);
    if (t.friction != 0) add(number_text(-t.friction) + "*tanh(" + rate + "/slip)");
    const std::string stiff = "stop_rate^2*" + number_text(tree_.mass);
    if (t.lower && t.upper) add("-" + stiff + "*(max(" + less(*t.upper) + ", 0) + min(" + less(*t.lower) + ", 0))");
    for (const Actuator& a : robot_.actuators) {
      if (a.tendon.empty() || a.tendon != t.name) continue;
      const std::string gear = number_text(a.gear[0]) + "*";
      const auto geared = [&gear](const std::string& of) {
        return std::string("(").append(gear).append(of).append(")");
      };
      add(gear + force_text(a, geared(length), geared(rate), tree_.mass));
    }
    return sum;
  }

  Robot& robot_;
  const RobotTree& tree_;
  const std::string& path_;
  const RobotOptions& options_;
  base::TextWriter out_;
  std::string inputs_, sensors_;
  Names names_, input_names_{false};
  std::vector<std::string> names_of_bodies_;
  std::map<std::string, std::string> joint_names_;
};

}  // namespace

std::string written_model(Robot& robot, const RobotTree& tree, const std::string& path, const RobotOptions& options) {
  return RobotWriter(robot, tree, path, options).run();
}

}  // namespace espalier::dynamics::model::robots
