#include "dynamics/contact/geometry/surface_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "base/text_stream.hpp"
#include "dynamics/mesh/read.hpp"
#include "dynamics/mesh/text_file.hpp"

namespace espalier::dynamics::contact {
namespace {

using Soup = Triangles;

[[noreturn]] void fail_file(const std::string& path, const std::string& what) {
  throw Error(StatusCode::invalid_input, fmt::format("{}: {}", path, what));
}

constexpr std::size_t kStlHeader = 84, kStlTriangle = 50;

bool is_binary_stl(const std::string& text) {
  if (text.size() < kStlHeader) return false;
  std::uint32_t count = 0;
  std::memcpy(&count, text.data() + 80, 4);
  return text.size() == kStlHeader + kStlTriangle * static_cast<std::size_t>(count);
}

void add_corner(Soup& soup, const Vec3& corner) {
  soup.points.push_back(corner);
  if (soup.points.size() % 3 != 0) return;
  const auto last = static_cast<Index>(soup.points.size());
  soup.triangles.push_back({last - 3, last - 2, last - 1});
}

Soup parse_binary_stl(const std::string& text) {
  Soup soup;
  for (std::size_t at = kStlHeader; at < text.size(); at += kStlTriangle)
    for (std::size_t corner = 1; corner <= 3; ++corner) {  // 0: the normal
      float x[3];
      std::memcpy(x, text.data() + at + 12 * corner, sizeof(x));
      add_corner(soup, {x[0], x[1], x[2]});
    }
  return soup;
}

Soup parse_text_stl(const std::string& text, const std::string& path) {
  Soup soup;
  base::TextReader in(text);
  std::string line, word;
  for (int number = 1; std::getline(in, line); ++number) {
    base::TextReader words(line);
    if (!(words >> word) || lower(word) != "vertex") continue;
    Vec3 x;
    if (!(words >> x[0] >> x[1] >> x[2])) fail_file(fmt::format("{}:{}", path, number), "needs three numbers");
    add_corner(soup, x);
  }
  if (soup.points.size() % 3 != 0) fail_file(path, "ends within a triangle");
  return soup;
}

Soup parse_obj(const std::string& text, const std::string& path) {
  Soup soup;
  base::TextReader in(text);
  std::string line, word;
  for (int number = 1; std::getline(in, line); ++number) {
    base::TextReader words(line);
    if (!(words >> word)) continue;
    if (word == "v") {
      Vec3 x;
      if (!(words >> x[0] >> x[1] >> x[2])) fail_file(fmt::format("{}:{}", path, number), "needs three numbers");
      soup.points.push_back(x);
    } else if (word == "f") {
      std::vector<Index> corners;
      while (words >> word) {
        Index i = 0;
        const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), i);
        const auto count = static_cast<Index>(soup.points.size());
        if (i < 0) i += count + 1;  // counted from the last
        if (error != std::errc{} || (end != word.data() + word.size() && *end != '/') || i < 1 || i > count)
          fail_file(fmt::format("{}:{}", path, number), fmt::format("'{}' is no corner among {}", word, count));
        corners.push_back(i - 1);
      }
      if (corners.size() < 3) fail_file(fmt::format("{}:{}", path, number), "a face needs three corners");
      for (std::size_t k = 2; k < corners.size(); ++k)
        soup.triangles.push_back({corners[0], corners[k - 1], corners[k]});
    }
  }
  return soup;
}

/// Outer faces of solids and surface elements, by their corners.
Soup outer_faces(const Mesh& mesh) {
  Soup soup;
  for (const Point& p : mesh.nodes) soup.points.emplace_back(p[0], p[1], p[2]);
  const auto add = [&](std::span<const Index> nodes, ElementType type) {
    soup.triangles.push_back({nodes[0], nodes[1], nodes[2]});
    if (shape_of(type).corners == 4) soup.triangles.push_back({nodes[0], nodes[2], nodes[3]});
  };
  for (const MeshFace& face : mesh.boundary_faces())
    add(mesh.face_nodes(face), shape_of(mesh.type(face.element)).faces[static_cast<std::size_t>(face.face)].type);
  for (Index e = 0; e < mesh.element_count(); ++e)
    if (shape_of(mesh.type(e)).dimension == 2) add(mesh.element(e), mesh.type(e));
  return soup;
}

}  // namespace

Triangles read_triangles(const std::string& path, const Vec3& scale) {
  const std::string name = lower(path);
  const auto ends = [&](const char* ending) {
    return name.ends_with(ending) || name.ends_with(std::string(ending) + ".gz");
  };
  Soup soup;
  if (ends(".stl")) {
    const std::string text = read_whole_file(path);
    const bool binary = is_binary_stl(text);
    if (!binary && !lower(trim(std::string_view(text).substr(0, 80))).starts_with("solid"))
      fail_file(path,
                "is no STL: it neither begins with 'solid' nor has 84 bytes and 50 for each triangle it announces");
    soup = binary ? parse_binary_stl(text) : parse_text_stl(text, path);
  } else if (ends(".obj")) {
    soup = parse_obj(read_whole_file(path), path);
  } else {
    soup = outer_faces(read_mesh(path));
  }
  for (Vec3& p : soup.points) p = p.cwiseProduct(scale);
  if (scale.prod() < 0)  // the mirror image: they would look inwards
    for (auto& t : soup.triangles) std::swap(t[1], t[2]);
  return soup;
}

TriangleSurface read_surface(const std::string& path, const Vec3& scale) {
  Triangles soup = read_triangles(path, scale);
  try {
    return {std::move(soup.points), soup.triangles};
  } catch (const std::invalid_argument& error) {
    fail_file(path, error.what());
  }
}

TriangleSurface read_surface(const std::string& path, double scale) {
  return read_surface(path, Vec3::Constant(scale));
}

}  // namespace espalier::dynamics::contact
