#include "dynamics/model/robots/shapes.hpp"

#include <algorithm>
#include <filesystem>
#include <set>
#include <system_error>

#include "base/at.hpp"
#include "base/text_stream.hpp"
#include "dynamics/contact/geometry/surface_file.hpp"
#include "dynamics/model/robots/files.hpp"
#include "dynamics/model/robots/toml_writer.hpp"
#include "espalier/types.hpp"

namespace espalier::dynamics::model::robots {
namespace {

class ShapeWriter {
 public:
  ShapeWriter(Robot& robot, const RobotTree& tree, const std::vector<std::string>& bodies,
              const std::function<std::string(const std::string&)>& take, const std::string& path,
              const RobotOptions& options)
      : robot_(robot), tree_(tree), bodies_(bodies), take_(take), path_(path), options_(options) {}

  std::string run() {
    std::vector<Shown> shown;
    Names names;
    for (int k = -1; k < static_cast<int>(tree_.moving.size()); ++k)
      for (const Geom& g : body(k).geoms) {
        if (!surface_is_usable(g)) continue;
        shown.push_back({names.take(g.name, "_geom"), &g, k});
        write_surface(shown.back());
      }
    if (robot_.contacts) write_contacts(shown);
    return out_.str();
  }

 private:
  [[nodiscard]] const Moving& body(int k) const { return k < 0 ? tree_.ground : tree_.moving[at(k)]; }
  [[nodiscard]] std::string body_name(int k) const { return k < 0 ? "ground" : bodies_[at(k)]; }

  struct Shown {
    std::string name;
    const Geom* geom;
    int body;
  };

  bool surface_is_usable(const Geom& g) {
    if (g.kind == GeomKind::ellipsoid && !(g.size.maxCoeff() - g.size.minCoeff() < 1e-9 * g.size.maxCoeff())) {
      robot_.pass_over("ellipsoids as shapes");
      return false;
    }
    if (g.kind != GeomKind::mesh) return true;
    const auto [it, fresh] = usable_.emplace(g.file, true);
    if (!fresh) return it->second;
    try {
      static_cast<void>(contact::read_surface(g.file, g.scale));
    } catch (const Error& error) {
      it->second = false;
      robot_.notices.push_back("no shape of " + std::string(error.what()));
    }
    return it->second;
  }

  void write_surface(const Shown& s) {
    const Geom& g = *s.geom;
    const bool round = g.kind == GeomKind::sphere || g.kind == GeomKind::ellipsoid;
    const Vec3 point = s.body < 0 ? g.pose.p : Vec3(g.pose.p - body(s.body).mass.centre);
    out_ << "\n[surfaces." << s.name << "]\nbody = " << in_quotes(body_name(s.body)) << "\nshape = \""
         << name_of(kGeomKinds, round ? GeomKind::sphere : g.kind) << "\"\npoint = " << vector_text(point) << "\n";
    if (!round) out_ << "rotation = " << rotation_text(g.pose.r) << "\n";
    if (round || g.kind == GeomKind::capsule || g.kind == GeomKind::cylinder)
      out_ << "radius = " << number_text(g.size[0]) << "\n";
    if (g.kind == GeomKind::capsule || g.kind == GeomKind::cylinder)
      out_ << "length = " << number_text(2 * g.size[1]) << "\n";
    if (g.kind == GeomKind::box) out_ << "size = " << vector_text(2 * g.size) << "\n";
    if (g.kind == GeomKind::mesh) {
      out_ << "file = " << in_quotes(mesh_path(g.file)) << "\n";
      if (!(g.scale - Vec3::Ones()).isZero(0)) out_ << "scale = " << vector_text(g.scale) << "\n";
    }
  }

  [[nodiscard]] std::string mesh_path(const std::string& file) const {
    std::error_code none;
    if (options_.absolute_paths) return std::filesystem::absolute(file, none).lexically_normal().string();
    const std::string folder = folder_of(path_);
    return !folder.empty() && file.starts_with(folder) ? file.substr(folder.size()) : file;
  }

  [[nodiscard]] bool may_touch(const Shown& a, const Shown& b) const {
    if (a.body == b.body) return false;
    if (a.geom->kind == GeomKind::plane && b.geom->kind == GeomKind::plane) return false;
    if ((a.geom->type & b.geom->affinity) == 0 && (b.geom->type & a.geom->affinity) == 0) return false;
    const int low = std::min(a.body, b.body), high = std::max(a.body, b.body);
    if (low >= 0 && !robot_.touch_parents && real_parent(high) == low) return false;
    return !excluded_.contains({low, high});
  }

  /// The body that it hangs on, past those that only carry it.
  [[nodiscard]] int real_parent(int k) const {
    int parent = body(k).parent;
    while (parent >= 0 && body(parent).links.empty()) parent = body(parent).parent;
    return parent;
  }

  void write_contacts(const std::vector<Shown>& shown) {
    for (const auto& [one, two] : robot_.excluded) {
      const int a = one.empty() ? -1 : tree_.homes.at(one).body, b = two.empty() ? -1 : tree_.homes.at(two).body;
      excluded_.insert({std::min(a, b), std::max(a, b)});
    }
    for (std::size_t i = 0; i < shown.size();) {
      std::size_t end = i;  // surfaces of one body
      while (end < shown.size() && shown[end].body == shown[i].body) ++end;
      for (; i < end; ++i) {
        std::map<double, std::vector<std::string>> against;  // by friction
        for (std::size_t j = end; j < shown.size(); ++j)
          if (may_touch(shown[i], shown[j])) {
            const bool rubs = std::max(shown[i].geom->dimensions, shown[j].geom->dimensions) > 1;
            against[rubs ? std::max(shown[i].geom->friction, shown[j].geom->friction) : 0].push_back(shown[j].name);
          }
        for (const auto& [friction, others] : against) write_contact(shown[i].name, others, friction);
      }
    }
  }

  void write_contact(const std::string& surface, const std::vector<std::string>& others, double friction) {
    out_ << "\n[contacts." << take_(surface + "_contact") << "]\nsurfaces = [" << in_quotes(surface)
         << "]\nagainst = [";
    for (std::size_t k = 0; k < others.size(); ++k) out_ << (k > 0 ? ", " : "") << in_quotes(others[k]);
    out_ << "]\nstiffness = \"contact_stiffness\"\ndamping = \"contact_damping\"\nfriction = " << number_text(friction)
         << "\n";
  }

  Robot& robot_;
  const RobotTree& tree_;
  const std::vector<std::string>& bodies_;
  const std::function<std::string(const std::string&)>& take_;
  const std::string& path_;
  const RobotOptions& options_;
  base::TextWriter out_;
  std::set<std::pair<int, int>> excluded_;
  std::map<std::string, bool> usable_;  // meshes by file
};

}  // namespace

std::string shapes_text(Robot& robot, const RobotTree& tree, const std::vector<std::string>& bodies,
                        const std::function<std::string(const std::string&)>& take, const std::string& path,
                        const RobotOptions& options) {
  return ShapeWriter(robot, tree, bodies, take, path, options).run();
}

}  // namespace espalier::dynamics::model::robots
