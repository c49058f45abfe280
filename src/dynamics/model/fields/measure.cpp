#include "dynamics/model/fields/measure.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dense/dense.hpp"
#include "dynamics/model/assembly/line_elements.hpp"

namespace espalier::dynamics::model {
namespace {

Mat3 tensor_of(const SiteNumbers& n) {
  Mat3 t;
  t << n[0], n[3], n[5], n[3], n[1], n[4], n[5], n[4], n[2];
  return t;
}

/// Principal values, the largest first.
Vec3 principal(const SiteNumbers& n) {
  const Mat3 t = tensor_of(n);
  if (!t.allFinite()) return Vec3::Constant(n[0] + n[1] + n[2] + n[3] + n[4] + n[5]);
  return dense::principal_values(t).reverse();
}

double von_mises_of(const SiteNumbers& n) {
  const double a = n[0] - n[1], b = n[1] - n[2], c = n[2] - n[0];
  return std::sqrt(0.5 * (a * a + b * b + c * c) + 3 * (n[3] * n[3] + n[4] * n[4] + n[5] * n[5]));
}

Measure component(const std::string& name, std::size_t k) {
  return {name, [k](const SiteNumbers& n, const Site&) { return n[k]; }};
}

std::vector<Measure> components(std::initializer_list<const char*> names) {
  std::vector<Measure> out;
  for (const char* name : names) out.push_back(component(name, out.size()));
  return out;
}

/// Normal stress in a section: of N, and by the distances from the axis.
struct Normal {
  double axial = 0, by_y = 0, by_z = 0;
};

/// The largest normal stress of the outline; with `sign` -1 the negative of the least.
double extreme(const SectionOutline& o, const Normal& s, double sign) {
  const double bending = o.radius > 0 ? o.radius * std::hypot(s.by_y, s.by_z)
                                      : 0.5 * (o.height * std::abs(s.by_y) + o.width * std::abs(s.by_z));
  return sign * s.axial + bending;
}

Normal normal_stress(const BeamSection& s, double young, const SiteNumbers& n) {
  return {young * n[0] / s.axial, -young * n[5] / s.bending_z, young * n[4] / s.bending_y};
}

std::vector<Measure> fibres(const SectionOutline& o, const std::function<Normal(const SiteNumbers&)>& normal,
                            Statistic statistic, const std::function<double(const SiteNumbers&)>& shear) {
  Measure xx{"xx", {}};
  if (statistic == Statistic::none || statistic == Statistic::mean) {
    xx.value = [normal](const SiteNumbers& n, const Site& site) {
      const Normal s = normal(n);
      return s.axial + s.by_y * site.y + s.by_z * site.z;
    };
  } else {
    xx.linear = false;
    xx.value = [=](const SiteNumbers& n, const Site&) {
      const double most = extreme(o, normal(n), 1), least = -extreme(o, normal(n), -1);
      return statistic == Statistic::max ? most : statistic == Statistic::min ? least : std::max(most, -least);
    };
  }
  std::vector<Measure> out = {xx};
  if (shear)
    out.push_back({"von_mises",
                   [=](const SiteNumbers& n, const Site& site) {
                     const Normal s = normal(n);
                     double most = std::max(extreme(o, s, 1), extreme(o, s, -1)), t = shear(n);
                     if (site.fibre) {
                       most = s.axial + s.by_y * site.y + s.by_z * site.z;
                       t *= std::hypot(site.y, site.z) / o.radius;
                     }
                     return std::sqrt(most * most + 3 * t * t);
                   },
                   false});
  return out;
}

}  // namespace

std::vector<Measure> tensor_measures(bool stress) {
  std::vector<Measure> out = components({"xx", "yy", "zz", "xy", "yz", "xz"});
  if (stress) {
    out.push_back({"von_mises", [](const SiteNumbers& n, const Site&) { return von_mises_of(n); }, false, true});
    out.push_back({"tresca",
                   [](const SiteNumbers& n, const Site&) {
                     const Vec3 p = principal(n);
                     return p[0] - p[2];
                   },
                   false});
    out.push_back({"pressure", [](const SiteNumbers& n, const Site&) { return -(n[0] + n[1] + n[2]) / 3; }});
  }
  for (int k = 0; k < 3; ++k)
    out.push_back({fmt::format("principal_{}", k + 1),
                   [k](const SiteNumbers& n, const Site&) { return principal(n)[k]; }, false});
  for (int k = 0; k < 3; ++k)
    for (int i = 0; i < 3; ++i)
      out.push_back({fmt::format("direction_{}.{}", k + 1, "xyz"[i]),
                     [k, i](const SiteNumbers& n, const Site&) {
                       Vec3 d = dense::principal_axes(tensor_of(n)).axes.col(2 - k);
                       Eigen::Index most = 0;
                       d.cwiseAbs().maxCoeff(&most);
                       return d[most] < 0 ? -d[i] : d[i];
                     },
                     false});
  return out;
}

std::vector<Measure> section_measures(FieldBody kind) {
  if (kind == FieldBody::beam) return components({"N", "Qy", "Qz", "T", "My", "Mz"});
  if (kind == FieldBody::shell) return components({"nxx", "nyy", "nxy", "mxx", "myy", "mxy", "qx", "qy"});
  std::vector<Measure> out = components({"N"});
  out.push_back({"M", [](const SiteNumbers& n, const Site&) { return std::hypot(n[1], n[2], n[3]); }, false, true});
  return out;
}

std::vector<Measure> fibre_measures(const SampledBody& body, Statistic statistic) {
  const auto* beam = std::get_if<BeamSpec>(&body.body().spec.shape);
  const auto* cable = std::get_if<CableSpec>(&body.body().spec.shape);
  const std::vector<LineChain> chains = line_chains(body.body());
  if (std::any_of(chains.begin(), chains.end(), [&](const LineChain& c) { return c.section != chains[0].section; }))
    throw std::invalid_argument(fmt::format(
        "'{}' has several sections: .section.N, .My ... are known; for stresses make a body of each section "
        "by 'element_set'",
        body.body().spec.name));
  const std::optional<SectionOutline> outline =
      beam != nullptr ? section_of_chain(*beam, chains[0]).outline : cable->outline;
  if (!outline)
    throw std::invalid_argument(
        fmt::format("the section of '{}' is given by its constants: stresses need 'material' with 'radius', or with "
                    "'height' and 'width'; .section.N, .My ... are known",
                    body.body().spec.name));
  const SectionOutline o = *outline;
  if (beam != nullptr) {
    const BeamSection s = section_of_chain(*beam, chains[0]).section;
    std::function<double(const SiteNumbers&)> shear;
    // T r / J, J = 2 I of a circle; shear forces have no part where bending is largest.
    if (o.radius > 0) shear = [s, o](const SiteNumbers& n) { return n[3] * o.radius * o.young / (2 * s.bending_y); };
    return fibres(
        o, [s, o](const SiteNumbers& n) { return normal_stress(s, o.young, n); }, statistic, shear);
  }
  const CableSection s = section_of_chain(*cable, chains[0]);
  const auto normal = [s, o](const SiteNumbers& n) {
    return Normal{o.young * n[0] / s.axial, o.young * std::hypot(n[1], n[2], n[3]) / s.bending, 0};
  };
  return fibres(o, normal, statistic, [](const SiteNumbers&) { return 0.0; });
}

}  // namespace espalier::dynamics::model
