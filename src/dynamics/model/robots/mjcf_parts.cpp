// What acts between the bodies of MJCF.
#include <algorithm>
#include <map>
#include <set>

#include "dynamics/model/robots/mjcf.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics::model::robots {
namespace {

/// An actuator on its way through the classes of defaults: all kinds set the same fields, one after the other.
struct ActuatorFields {
  std::array<double, 3> gain{1, 0, 0}, bias{};
  double damping_ratio = 0, inherited = 0;
  std::string gain_type = "fixed", bias_type = "none", dynamics = "none";
  std::optional<bool> control_limited, force_limited;
  std::optional<std::array<double, 2>> control_range, force_range;
  std::array<double, 6> gear{1, 0, 0, 0, 0, 0};
  std::string not_taken;
};

class PartsReader {
 public:
  PartsReader(const MjcfText& text, Robot& robot) : text_(text), robot_(robot) {
    for (std::size_t k = 0; k < robot_.links.size(); ++k) {
      links_[robot_.links[k].name] = static_cast<int>(k);
      for (const RobotJoint& j : robot_.links[k].joints) joints_[j.name] = &j;
      for (const Site& s : robot_.links[k].sites) sites_[s.name] = {static_cast<int>(k), s.pose};
    }
    for (const Site& s : robot_.ground.sites) sites_[s.name] = {-1, s.pose};
  }

  void run() {
    for_all("tendon", [&](const Element& e) { add_tendon(e); });
    for_all("actuator", [&](const Element& e) { add_actuator(e); });
    for_all("equality", [&](const Element& e) { add_equality(e); });
    for_all("contact", [&](const Element& e) {
      if (e.tag() == "exclude")
        robot_.excluded.push_back({named_link(e, "body1"), named_link(e, "body2")});
      else
        robot_.pass_over("<" + std::string(e.tag()) + "> of contacts");
    });
  }

 private:
  /// Attributes that name something, with the tag of that.
  static constexpr std::pair<const char*, const char*> kReferences[] = {
      {"joint", "joint"}, {"jointinparent", "joint"}, {"joint1", "joint"}, {"joint2", "joint"}, {"site", "site"},
      {"site1", "site"},  {"site2", "site"},          {"body1", "body"},   {"body2", "body"},   {"tendon", "tendon"}};
  struct Placed {
    int link;
    Pose pose;
  };

  template <class Each>
  void for_all(const char* section, const Each& each) {
    for (const Element& s : text_.sections(section))
      for (const Element& e : text_.children(s))
        for (const std::string& suffix :
             suffixes_of(e)) {  // as MuJoCo: whoever names what was copied is copied with it
          suffix_ = suffix;
          each(e);
        }
  }

  /// What stands behind the names of copies of what an element names; {""}: nothing there was copied.
  std::vector<std::string> suffixes_of(const Element& e) const {
    for (const auto& [key, tag] : kReferences)
      if (e.has(key))
        if (const auto it = robot_.copied.find(std::string(tag) + " " + e.text(key)); it != robot_.copied.end())
          return it->second;
    for (const Element& inner : text_.children(e))
      if (auto list = suffixes_of(inner); list != std::vector<std::string>{""}) return list;
    return {""};
  }
  /// The copy that is meant of what is named there.
  std::string named(const Element& e, const char* key, const char* tag) const {
    const std::string name = e.text(key);
    return robot_.copied.contains(std::string(tag) + " " + name) ? name + suffix_ : name;
  }
  std::string needed(const Element& e, const char* key, const char* tag) const {
    static_cast<void>(e.need(key));
    return named(e, key, tag);
  }
  /// An element's own name; that of a copy, where it is one.
  std::string own_name(const Element& e) const { return e.has("name") ? e.text("name") + suffix_ : ""; }

  std::string named_link(const Element& e, const char* key) const {
    std::string name = needed(e, key, "body");
    if (name == "world") return "";
    if (!links_.contains(name)) e.fail("there is no body '" + name + "'");
    return name;
  }
  const Placed& named_site(const Element& e, const std::string& name) const {
    const auto it = sites_.find(name);
    if (it == sites_.end()) e.fail("there is no site '" + name + "'");
    return it->second;
  }
  const RobotJoint& named_joint(const Element& e, const std::string& name) const {
    const auto it = joints_.find(name);
    if (it == joints_.end()) e.fail("there is no joint '" + name + "'");
    return *it->second;
  }
  static bool has_coordinate(const RobotJoint& j) { return j.kind == JointKind::hinge || j.kind == JointKind::slide; }

  // Tendons ----------------------------------------------------------------------------------------------------------

  void add_tendon(const Element& e) {
    const Attributes a = tendon_attributes(e);
    Tendon t;
    t.name = own_name(e);
    if (t.name.empty()) t.name = "tendon_" + std::to_string(robot_.tendons.size() + 1);
    if (!tendon_names_.insert(t.name).second) e.fail("there is a tendon of that name already");
    if (!suffix_.empty() && e.has("name")) robot_.copied["tendon " + e.text("name")].push_back(suffix_);
    bool whole = true;
    if (e.tag() == "fixed") {
      for (const Element& inner : text_.children(e)) {
        const RobotJoint& j = named_joint(inner, needed(inner, "joint", "joint"));
        if (!has_coordinate(j)) inner.fail("'" + j.name + "' is neither a hinge nor a slide");
        t.joints.emplace_back(j.name, inner.number("coef", 0));
      }
      whole = !t.joints.empty();
    } else if (e.tag() == "spatial") {
      whole = add_pieces(e, t);
    } else {
      return robot_.pass_over("<" + std::string(e.tag()) + "> of tendons");
    }
    if (!whole) {
      not_whole_.insert(t.name);
      return robot_.pass_over("tendons that wrap around geoms");
    }
    const auto stiffness = a.numbers("stiffness", 1, 8), damping = a.numbers("damping", 1, 8);
    t.stiffness = stiffness.empty() ? 0 : stiffness[0];
    t.damping = damping.empty() ? 0 : damping[0];
    t.friction = a.number("frictionloss", 0);
    if (const auto rest = a.numbers("springlength", 1, 2); !rest.empty() && (rest.front() != -1 || rest.back() != -1)) {
      t.rest = {rest.front(), rest.back()};
      if (rest.front() > rest.back()) e.fail("'springlength' must not fall");
    }
    if (const auto range = text_.limits(a, "limited", "range")) t.lower = (*range)[0], t.upper = (*range)[1];
    if (text_.limits(a, "actuatorfrclimited", "actuatorfrcrange")) robot_.pass_over("limits of the forces on tendons");
    if (a.number("armature", 0) != 0) robot_.pass_over("armature of tendons");
    robot_.tendons.push_back(std::move(t));
  }

  /// Defaults of both kinds stand in <tendon>.
  Attributes tendon_attributes(const Element& e) const {
    std::vector<Element> chain = text_.defaults_of(e, "", {"tendon"});
    chain.push_back(e);
    std::reverse(chain.begin(), chain.end());
    return Attributes(std::move(chain));
  }

  bool add_pieces(const Element& e, Tendon& t) {
    std::string last;
    double divisor = 1;
    for (const Element& inner : text_.children(e)) {
      if (inner.tag() == "pulley") {
        divisor = inner.number("divisor", 1);
        if (!(divisor > 0)) inner.fail("'divisor' must be greater than 0");
        last.clear();
      } else if (inner.tag() == "site") {
        const std::string site = needed(inner, "site", "site");
        static_cast<void>(named_site(inner, site));
        if (!last.empty()) t.pieces.push_back({last, site, divisor});
        last = site;
      } else {
        return false;
      }
    }
    if (t.pieces.empty()) e.fail("needs two sites");
    return true;
  }

  // Actuators --------------------------------------------------------------------------------------------------------

  static void apply(const Element& e, ActuatorFields& f) {
    const std::string_view tag = e.tag();
    const auto pair = [&](const char* key, auto& out) {
      if (!e.has(key)) return;
      const auto x = e.numbers(key, 2, 2);
      out = std::array{x[0], x[1]};
    };
    const auto limited = [&](const char* key, std::optional<bool>& out) {
      if (!e.has(key) || e.text(key) == "auto") return;
      out = e.text(key) == "true";
    };
    pair("ctrlrange", f.control_range);
    pair("forcerange", f.force_range);
    limited("ctrllimited", f.control_limited);
    limited("forcelimited", f.force_limited);
    if (e.has("gear")) {
      const auto gear = e.numbers("gear", 1, 6);
      std::copy(gear.begin(), gear.end(), f.gear.begin());
    }
    f.not_taken.clear();
    if (tag == "motor") {
      f.gain = {1, 0, 0}, f.bias = {}, f.damping_ratio = 0;
      f.gain_type = "fixed", f.bias_type = "none", f.dynamics = "none";
    } else if (tag == "position") {
      const double kp = e.number("kp", f.gain[0]);
      f.gain = {kp, 0, 0};
      f.bias[0] = 0, f.bias[1] = -kp;
      if (e.has("kv")) f.bias[2] = -e.number("kv", 0), f.damping_ratio = 0;
      if (e.has("dampratio")) f.damping_ratio = e.number("dampratio", 0), f.bias[2] = 0;
      f.gain_type = "fixed", f.bias_type = "affine";
      if (e.number("timeconst", 0) > 0) f.dynamics = "filterexact";
      f.inherited = e.number("inheritrange", f.inherited);
    } else if (tag == "velocity") {
      const double kv = e.number("kv", f.gain[0]);
      f.gain = {kv, 0, 0}, f.bias = {0, 0, -kv}, f.damping_ratio = 0;
      f.gain_type = "fixed", f.bias_type = "affine";
    } else if (tag == "damper") {
      f.gain = {0, 0, -e.number("kv", 0)}, f.bias = {}, f.damping_ratio = 0;
      f.gain_type = "affine", f.bias_type = "none";
    } else if (tag == "general") {
      apply_general(e, f);
    } else {
      f.not_taken = tag;
    }
  }

  static void apply_general(const Element& e, ActuatorFields& f) {
    if (e.has("gaintype")) f.gain_type = e.text("gaintype");
    if (e.has("biastype")) f.bias_type = e.text("biastype");
    if (e.has("dyntype")) f.dynamics = e.text("dyntype");
    const auto fill = [&](const char* key, std::array<double, 3>& out) {
      if (!e.has(key)) return;
      const auto x = e.numbers(key, 1, 10);
      for (std::size_t k = 0; k < std::min<std::size_t>(3, x.size()); ++k) out[k] = x[k];
    };
    fill("gainprm", f.gain);
    fill("biasprm", f.bias);
    f.damping_ratio = 0;
    if (f.bias[2] > 0 && f.gain[0] == -f.bias[1]) f.damping_ratio = f.bias[2], f.bias[2] = 0;
  }

  void add_actuator(const Element& e) {
    static const std::vector<std::string_view> kinds = {"general", "motor",  "position", "velocity", "intvelocity",
                                                        "damper",  "muscle", "cylinder", "adhesion", "plugin"};
    ActuatorFields f;
    for (const Element& by_default : text_.defaults_of(e, "", kinds)) apply(by_default, f);
    apply(e, f);
    Actuator a;
    a.name = own_name(e);
    a.joint = named(e, e.has("joint") ? "joint" : "jointinparent", "joint");
    a.tendon = named(e, "tendon", "tendon");
    a.site = named(e, "site", "site");
    if (a.name.empty()) a.name = (a.joint + a.tendon + a.site).empty() ? "actuator" : a.joint + a.tendon + a.site;
    const auto pass = [&](const std::string& what) {
      robot_.actuators.push_back({});  // keyframes count it
      robot_.pass_over(what);
    };
    if (!f.not_taken.empty()) return pass("<" + f.not_taken + "> actuators");
    if ((f.gain_type != "fixed" && f.gain_type != "affine") || (f.bias_type != "none" && f.bias_type != "affine"))
      return pass("actuators with muscles or gains of the user");
    if (f.dynamics == "integrator" || f.dynamics == "muscle" || f.dynamics == "user")
      return pass("actuators with dynamics of their own (" + f.dynamics + ")");
    if (f.dynamics != "none") robot_.pass_over("filters of actuators (they act at once)");
    if (a.joint.empty() && a.tendon.empty() && a.site.empty()) return pass("actuators on bodies or cranks");
    if (!a.joint.empty() && !has_coordinate(named_joint(e, a.joint))) return pass("actuators on ball and free joints");
    if (not_whole_.contains(a.tendon)) return pass("actuators of tendons that wrap around geoms");
    if (!a.tendon.empty() && !tendon_names_.contains(a.tendon)) e.fail("there is no tendon '" + a.tendon + "'");
    if (!a.site.empty()) static_cast<void>(named_site(e, a.site));
    if (!a.site.empty() && e.has("refsite")) return pass("actuators between two sites");
    if (!a.site.empty() && f.bias_type != "none") return pass("actuators of sites with feedback");
    a.gear = f.gear;
    a.gain = f.gain_type == "fixed" ? std::array{f.gain[0], 0.0, 0.0} : f.gain;
    if (f.bias_type == "affine") a.bias = f.bias;
    a.damping_ratio = f.bias_type == "affine" ? f.damping_ratio : 0;
    if (limits(f.control_range, f.control_limited))
      a.least_control = (*f.control_range)[0], a.largest_control = (*f.control_range)[1];
    if (limits(f.force_range, f.force_limited))
      a.least_force = (*f.force_range)[0], a.largest_force = (*f.force_range)[1];
    if (f.inherited > 0 && (!a.joint.empty() || !a.tendon.empty())) inherit_range(e, f.inherited, a);
    robot_.actuators.push_back(std::move(a));
  }

  /// A range that does not rise limits where the model says so alone.
  [[nodiscard]] bool limits(const std::optional<std::array<double, 2>>& range, const std::optional<bool>& said) const {
    return range && said.value_or(text_.compiler().auto_limits && (*range)[0] < (*range)[1]);
  }

  void inherit_range(const Element& e, double part, Actuator& a) const {
    std::optional<double> lower, upper;
    if (!a.joint.empty()) {
      const RobotJoint& j = named_joint(e, a.joint);
      lower = j.lower, upper = j.upper;
    } else {
      for (const Tendon& t : robot_.tendons)
        if (t.name == a.tendon) lower = t.lower, upper = t.upper;
    }
    if (!lower || !upper) e.fail("'inheritrange' needs a joint or tendon with a range");
    const double middle = 0.5 * (*lower + *upper), half = 0.5 * part * (*upper - *lower);
    a.least_control = middle - half, a.largest_control = middle + half;
  }

  // Equalities -------------------------------------------------------------------------------------------------------

  void add_equality(const Element& e) {
    const Attributes a({[&] {
      std::vector<Element> chain = text_.defaults_of(e, "", {"equality"});
      chain.push_back(e);
      std::reverse(chain.begin(), chain.end());
      return chain;
    }()});
    Equality q;
    q.name = own_name(e);
    if (q.name.empty()) q.name = std::string(e.tag()) + "_" + std::to_string(robot_.equalities.size() + 1);
    q.active = a.flag("active", true);
    if (e.tag() == "connect" || e.tag() == "weld") {
      q.kind = e.tag() == "connect" ? EqualityKind::connect : EqualityKind::weld;
      set_places(e, q);
    } else if (e.tag() == "joint") {
      q.kind = EqualityKind::joint;
      if (!set_coupling(e, q)) return robot_.pass_over("<joint> equalities whose polynomial is not linear");
    } else {
      return robot_.pass_over("<" + std::string(e.tag()) + "> equalities");
    }
    robot_.equalities.push_back(std::move(q));
  }

  void set_places(const Element& e, Equality& q) const {
    if (e.has("site1")) {
      const Placed &one = named_site(e, needed(e, "site1", "site")), &two = named_site(e, needed(e, "site2", "site"));
      const auto name = [&](int link) {
        return link < 0 ? std::string() : robot_.links[static_cast<std::size_t>(link)].name;
      };
      q.first = name(one.link), q.second = name(two.link);
      q.on_first = one.pose, q.on_second = two.pose;
      return;
    }
    q.first = named_link(e, "body1");
    q.second = e.has("body2") ? named_link(e, "body2") : "";
    const auto at = [&](const std::string& name) {
      return name.empty() ? Pose{} : pose_at_ref(robot_, links_.at(name));
    };
    const Pose one = at(q.first), two = at(q.second);
    const Vec3 anchor = e.vector("anchor", Vec3::Zero());
    if (q.kind == EqualityKind::connect) {
      q.on_first.p = anchor;
      q.on_second.p = two.inverse() * (one * anchor);
      return;
    }
    Pose relative = one.inverse() * two;
    if (e.has("relpose")) {
      const auto x = e.numbers("relpose", 7, 7);
      if (x[3] != 0 || x[4] != 0 || x[5] != 0 || x[6] != 0)
        relative = {{x[0], x[1], x[2]}, of_quaternion(x[3], x[4], x[5], x[6])};
    }
    q.on_second.p = anchor;
    q.on_first = relative * q.on_second;
  }

  bool set_coupling(const Element& e, Equality& q) const {
    std::vector<double> c = {0, 1, 0, 0, 0};
    if (e.has("polycoef")) {
      const auto given = e.numbers("polycoef", 1, 5);
      std::copy(given.begin(), given.end(), c.begin());
    }
    const RobotJoint& one = named_joint(e, needed(e, "joint1", "joint"));
    if (!has_coordinate(one)) e.fail("'" + one.name + "' is neither a hinge nor a slide");
    q.first = one.name;
    q.coupling = {"", 0, one.ref + c[0]};
    if (!e.has("joint2")) return true;
    if (c[2] != 0 || c[3] != 0 || c[4] != 0) return false;
    const RobotJoint& two = named_joint(e, named(e, "joint2", "joint"));
    if (!has_coordinate(two)) e.fail("'" + two.name + "' is neither a hinge nor a slide");
    q.second = two.name;
    q.coupling = {two.name, c[1], one.ref + c[0] - c[1] * two.ref};
    return true;
  }

  const MjcfText& text_;
  Robot& robot_;
  std::map<std::string, int> links_;
  std::map<std::string, const RobotJoint*> joints_;
  std::map<std::string, Placed> sites_;
  std::set<std::string> tendon_names_, not_whole_;
  std::string suffix_;  // of the copies that are named at present
};

}  // namespace

void read_mjcf_parts(const MjcfText& text, Robot& robot) { PartsReader(text, robot).run(); }

}  // namespace espalier::dynamics::model::robots
