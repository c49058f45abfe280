#include "dynamics/model/robots/mjcf_defaults.hpp"

#include <algorithm>
#include <filesystem>

#include "dynamics/mesh/text_file.hpp"
#include "dynamics/model/robots/files.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics::model::robots {

const Element* Attributes::with(const char* key) const {
  const auto it = std::find_if(chain_.begin(), chain_.end(), [&](const Element& e) { return e.has(key); });
  return it == chain_.end() ? nullptr : &*it;
}

std::string Attributes::text(const char* key, const std::string& otherwise) const {
  const Element* e = with(key);
  return e == nullptr ? otherwise : e->text(key);
}

double Attributes::number(const char* key, double otherwise) const {
  const Element* e = with(key);
  return e == nullptr ? otherwise : e->number(key, otherwise);
}

Vec3 Attributes::vector(const char* key, const Vec3& otherwise) const {
  const Element* e = with(key);
  return e == nullptr ? otherwise : e->vector(key, otherwise);
}

std::vector<double> Attributes::numbers(const char* key, std::size_t least, std::size_t most) const {
  const Element* e = with(key);
  return e == nullptr ? std::vector<double>{} : e->numbers(key, least, most);
}

std::vector<double> Attributes::merged(const char* key, std::size_t most) const {
  std::vector<double> list;
  for (auto it = chain_.rbegin(); it != chain_.rend(); ++it) {
    if (!it->has(key)) continue;
    const std::vector<double> given = it->numbers(key, 1, most);
    list.resize(std::max(list.size(), given.size()));
    std::copy(given.begin(), given.end(), list.begin());
  }
  return list;
}

bool Attributes::flag(const char* key, bool otherwise) const {
  const Element* e = with(key);
  if (e == nullptr) return otherwise;
  const std::string word = e->text(key);
  if (word == "true") return true;
  if (word == "false") return false;
  if (word == "auto") return otherwise;
  e->fail(std::string("'") + key + "' must be true or false, not '" + word + "'");
}

MjcfText::MjcfText(const XmlFile& file) : file_(file), folder_(folder_of(file.name())) {
  if (root().tag() != "mujoco") root().fail("is no MJCF, whose outermost element is <mujoco>");
  by_[&file_] = nullptr;
  for (const Element& e : sections("compiler")) read_compiler(e);
  for (const Element& e : sections("default")) read_class(e, -1);
}

void MjcfText::read_compiler(const Element& e) {
  MjcfCompiler& c = compiler_;
  const Attributes a({e});
  if (e.has("angle")) {
    const std::string unit = e.text("angle");
    if (unit != "degree" && unit != "radian") e.fail("'angle' must be degree or radian, not '" + unit + "'");
    c.angle = unit == "degree" ? MjcfCompiler{}.angle : 1;
  }
  if (e.text("coordinate") == "global")
    e.fail("coordinate=\"global\" is of MuJoCo before 2.3.4, which rewrites such files in local coordinates");
  c.euler = a.text("eulerseq", c.euler);
  if (c.euler.size() != 3 || lower(c.euler).find_first_not_of("xyz") != std::string::npos)
    e.fail("'eulerseq' must be three letters among xyzXYZ");
  c.mesh_folder = a.text("meshdir", a.text("assetdir", c.mesh_folder));
  c.strip_path = a.flag("strippath", c.strip_path);
  c.balance_inertia = a.flag("balanceinertia", c.balance_inertia);
  c.auto_limits = a.flag("autolimits", c.auto_limits);
  c.least_mass = a.number("boundmass", c.least_mass);
  c.least_inertia = a.number("boundinertia", c.least_inertia);
  c.total_mass = a.number("settotalmass", c.total_mass);
  if (e.has("inertiafromgeom")) {
    const std::string word = e.text("inertiafromgeom");
    using From = MjcfCompiler::FromGeoms;
    c.from_geoms = word == "true" ? From::always : word == "false" ? From::never : From::where_missing;
  }
  if (e.has("inertiagrouprange")) {
    const std::vector<double> range = e.numbers("inertiagrouprange", 2, 2);
    c.inertia_groups = {range[0], range[1]};
  }
}

void MjcfText::read_class(const Element& e, int outer) {
  const std::string name = e.has("class") ? e.text("class") : outer < 0 ? "main" : e.need("class");
  int at = static_cast<int>(classes_.size());
  if (const auto it = class_names_.find(name); it != class_names_.end()) {
    if (outer >= 0) e.fail("there is a class '" + name + "' already");
    at = it->second;  // several <default> at the top are one
  } else {
    class_names_[name] = at;
    classes_.push_back({outer, {}});
  }
  for (const Element& inner : children(e)) {
    if (inner.tag() == "default")
      read_class(inner, at);
    else
      classes_[static_cast<std::size_t>(at)].elements.push_back(inner);
  }
}

const XmlFile& MjcfText::included(const Element& include) const {
  constexpr std::size_t kMost = 1000, kMostBytes = 200'000'000;
  const auto [it, fresh] = included_.emplace(std::pair{include.file, include.node.offset_debug()}, nullptr);
  if (!fresh && it->second != nullptr) return *it->second;
  const std::string path = path_from(folder_, include.need("file"));
  const auto plain = [](const std::string& name) {
    std::error_code none;
    return std::filesystem::weakly_canonical(name, none);
  };
  for (const XmlFile* above = include.file; above != nullptr; above = by_.at(above))
    if (above->name() == path || plain(above->name()) == plain(path)) include.fail("'" + path + "' includes itself");
  if (more_.size() >= kMost) include.fail("more than 1000 files are included");
  try {
    std::string text = read_whole_file(path);
    included_bytes_ += text.size();
    if (included_bytes_ > kMostBytes) include.fail("the included files are larger than 200 MB");
    more_.emplace_back(path, std::move(text));
  } catch (const Error& error) {
    include.fail(error.what());
  }
  it->second = &more_.back();
  by_[&more_.back()] = include.file;
  return more_.back();
}

std::vector<Element> MjcfText::children(const Element& parent) const {
  std::vector<Element> list;
  for (const Element& e : parent.children()) {
    if (e.tag() != "include") {
      list.push_back(e);
      continue;
    }
    const XmlFile& file = included(e);
    const std::vector<Element> more = children({file.root(), &file});
    list.insert(list.end(), more.begin(), more.end());
  }
  return list;
}

std::vector<Element> MjcfText::sections(std::string_view tag) const {
  std::vector<Element> list = children(root());
  std::erase_if(list, [&](const Element& e) { return e.tag() != tag; });
  return list;
}

int MjcfText::class_of(const Element& element, const std::string& childclass) const {
  const std::string name = element.has("class") ? element.text("class") : childclass;
  if (name.empty()) return classes_.empty() ? -1 : 0;
  const auto it = class_names_.find(name);
  if (it == class_names_.end()) element.fail("there is no class of defaults '" + name + "'");
  return it->second;
}

std::vector<Element> MjcfText::defaults_of(const Element& element, const std::string& childclass,
                                           const std::vector<std::string_view>& tags) const {
  std::vector<Element> list;
  for (int c = class_of(element, childclass); c >= 0; c = classes_[static_cast<std::size_t>(c)].outer) {
    const auto& all = classes_[static_cast<std::size_t>(c)].elements;
    for (auto it = all.rbegin(); it != all.rend(); ++it)
      if (std::find(tags.begin(), tags.end(), it->tag()) != tags.end()) list.push_back(*it);
  }
  std::reverse(list.begin(), list.end());
  return list;
}

Attributes MjcfText::attributes(const Element& element, const std::string& childclass) const {
  std::vector<Element> chain = defaults_of(element, childclass, {element.tag()});
  chain.push_back(element);
  std::reverse(chain.begin(), chain.end());
  return Attributes(std::move(chain));
}

Mat3 MjcfText::of_euler(const Vec3& angles) const {
  Mat3 r = Mat3::Identity();
  for (std::size_t k = 0; k < 3; ++k) {
    const char letter = compiler_.euler[k];
    const int axis = letter >= 'x' ? letter - 'x' : letter - 'X';
    const Mat3 turn = about(Vec3::Unit(axis), compiler_.angle * angles[static_cast<int>(k)]);
    r = letter >= 'x' ? Mat3(r * turn) : Mat3(turn * r);
  }
  return r;
}

std::optional<Mat3> MjcfText::rotation_of(const Element& e) const {
  if (e.has("quat")) {
    const std::vector<double> q = e.numbers("quat", 4, 4);
    if (q[0] == 0 && q[1] == 0 && q[2] == 0 && q[3] == 0) e.fail("'quat' must not be zero");
    return of_quaternion(q[0], q[1], q[2], q[3]);
  }
  if (e.has("axisangle")) {
    const std::vector<double> x = e.numbers("axisangle", 4, 4);
    const Vec3 axis(x[0], x[1], x[2]);
    if (!(axis.norm() > 0)) e.fail("the axis of 'axisangle' must not be zero");
    return about(axis.normalized(), x[3] * compiler_.angle);
  }
  if (e.has("euler")) return of_euler(e.vector("euler", Vec3::Zero()));
  if (e.has("xyaxes")) {
    const std::vector<double> v = e.numbers("xyaxes", 6, 6);
    const Vec3 x = Vec3(v[0], v[1], v[2]).normalized(), given(v[3], v[4], v[5]);
    const Vec3 y = given - given.dot(x) * x;
    if (!(x.norm() > 0) || !(y.norm() > 0)) e.fail("the axes of 'xyaxes' must not be zero or parallel");
    Mat3 r;
    r << x, y.normalized(), x.cross(y.normalized());
    return r;
  }
  if (e.has("zaxis")) {
    const Vec3 z = e.vector("zaxis", Vec3::UnitZ());
    if (!(z.norm() > 0)) e.fail("'zaxis' must not be zero");
    return z_along(z);
  }
  return std::nullopt;
}

Mat3 MjcfText::rotation(const Attributes& a) const {
  for (const Element& e : a.chain())
    if (const auto r = rotation_of(e)) return *r;
  return Mat3::Identity();
}

Pose MjcfText::pose(const Attributes& a) const { return {a.vector("pos", Vec3::Zero()), rotation(a)}; }

std::optional<std::array<double, 2>> MjcfText::limits(const Attributes& a, const char* limited,
                                                      const char* range) const {
  const bool given = a.has(range), automatic = a.text(limited, "auto") == "auto";
  if (!a.flag(limited, given && compiler_.auto_limits)) return std::nullopt;
  const std::vector<double> list = a.numbers(range, 2, 2);
  if (list.empty()) a.own().fail(std::string("is limited and needs '") + range + "'");
  if (list[0] < list[1]) return std::array{list[0], list[1]};
  if (automatic) return std::nullopt;
  a.own().fail(std::string("'") + range + "' must rise");
}

}  // namespace espalier::dynamics::model::robots
